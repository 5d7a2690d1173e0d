//! Calibration: what is done on a bench, what is checked of it, and what is found.
//!
//! The mathematics, from what was written down to the commands that set the instrument, is the crate
//! `palpate_calibration`'s.

mod found;
mod report;
pub(crate) mod sensor;
pub(crate) mod verb;
pub(crate) mod written;
