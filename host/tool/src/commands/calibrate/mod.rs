//! Calibration: procedure on a bench, checks of its data, results.
//!
//! The crate `palpate_calibration` contains the mathematics, from the recorded data to the commands
//! that set the instrument.

mod found;
mod report;
pub(crate) mod sensor;
pub(crate) mod verb;
pub(crate) mod written;
