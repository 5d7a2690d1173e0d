//! Plan of the converter, and the time of each of its scans.

mod grid;
mod parts;
mod scheme;
mod setpoint;

pub use grid::{Fetch, Finding, Grid, Sampled};
pub use parts::{MOST_PARTS, Parts};
pub use scheme::{rates_hz, stronger, with_room};
pub use setpoint::{Scheme, Setpoint};
