//! Calibration: what is done on a bench, what is checked of it, and what is found.
//!
//! The mathematics, from what was written down to the commands that set the instrument, is the crate
//! `palpate_calibration`'s.

pub(crate) mod bench;
pub(crate) mod checks;
#[cfg(feature = "emulator")]
mod found;
#[cfg(feature = "emulator")]
mod report;
#[cfg(feature = "emulator")]
pub(crate) mod sensor;
#[cfg(feature = "emulator")]
pub(crate) mod verb;
#[cfg(feature = "emulator")]
pub(crate) mod written;
