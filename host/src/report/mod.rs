//! The report: one HTML page with everything in it.

use crate::demo::Measured;
use crate::instrument::Instrument;

/// The page of a row of presses.
pub(crate) fn page(_instrument: &Instrument, _row: &[Measured], heading: &str) -> String {
    format!("<!doctype html><meta charset=\"utf-8\"><title>palpate</title><h1>{heading}</h1>")
}
