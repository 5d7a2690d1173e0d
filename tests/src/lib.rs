//! Campaigns that the tests run in a short form and `cargo xtask evidence` runs in full.

pub mod coil;
pub mod faults;
pub mod fuzz;
pub mod hostile;
pub mod sigma;
