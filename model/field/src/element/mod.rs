//! Finite elements: triangles with Lagrange polynomials, and their quadrature.

pub mod basis;
pub mod quadrature;
pub mod shape;

pub use basis::Basis;
