//! Touch: an elastic layer over several sensing coils, pressed anywhere.

pub mod layer;
mod quadrature;
