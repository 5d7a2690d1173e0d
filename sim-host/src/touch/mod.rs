//! Touch: an elastic layer over several sensing coils, pressed anywhere.

mod coil;
mod fft;
mod grid;
mod indenter;
pub mod layer;
mod quadrature;
mod round;

pub use grid::Demand;
pub use indenter::Indenter;
