//! Touch: an elastic layer over several sensing coils, pressed anywhere.
//!
//! A rigid indenter presses a bonded layer of finite thickness without friction. The contact follows
//! from the layer's compliance in the domain of wave numbers ([`Layer`]): for balls and flat pins from
//! an integral equation, for all other indenters by conjugate gradients on a grid. Each coil's
//! inductance follows from the displacements of the magnetic elastomer's boundaries, weighted by the
//! coil's own field there. Nothing here is shared with a model that estimates touches.

mod coil;
pub mod draw;
#[cfg(test)]
mod edge;
mod fft;
mod grid;
mod indenter;
mod layer;
mod layout;
mod network;
mod press;
mod quadrature;
#[cfg(test)]
mod references;
mod round;
mod sensor;
mod timeline;

pub use draw::{TouchCoil, TouchParameters};
pub use grid::Demand;
pub use indenter::Indenter;
pub use layer::Layer;
pub use layout::{Coil, Layout};
pub use sensor::{
    CoilReading, Press, Pressing, Scan, Sequence, Surroundings, TouchSensor, TouchTruth,
};
pub use timeline::Timeline;
