//! Result of `palpate plan`.

use super::expected::{ExpectedError, PlannedPress};
use super::search::ComparedTrain;
use super::sensor::PlannedSensor;

/// Plan for a sensor design.
pub(super) struct Plan {
    pub(super) stack: String,
    /// Whether the design differs from [`ASSUMED_FROM`](super::expected::ASSUMED_FROM).
    pub(super) is_assumed: bool,
    pub(super) sensor: PlannedSensor,
    pub(super) press: PlannedPress,
    pub(super) contact_s: f64,
    pub(super) errors: Vec<ExpectedError>,
    pub(super) trains: Vec<ComparedTrain>,
}
