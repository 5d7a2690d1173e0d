//! Finite elements: triangles with Lagrange polynomials, and how they are integrated over.

pub mod basis;
pub mod quadrature;
pub mod shape;

pub use basis::Basis;
