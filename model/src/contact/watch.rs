//! Parameters of the contact detection.

use super::Cusum;
use crate::units::Metre;

/// Settings of the contact detection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch {
    /// Standard deviation of a reading of the untouched sensor, vibration included.
    pub sigma: Metre,
    /// Memory of the baseline, as a number of readings.
    pub memory: f32,
    /// Number of readings after a start or a release until the baseline counts as learnt.
    pub settling: u32,
    /// Parameters of the tests for touches and movements.
    pub cusum: Cusum,
    /// Deformation below which a touch ends. For a touch less than twice as deep as this, the limit
    /// is half of its greatest depth, but at least two sigma, so that a slow touch does not end
    /// where it starts. The limit is never below the largest remaining recovery of the elastomer
    /// ([`MOST_CREEP`](super::MOST_CREEP) of the greatest depth).
    pub release: Metre,
    /// Largest reading of the untouched and recovered sensor, in magnitude; `None` if unknown.
    pub rest: Option<Metre>,
    /// Largest change of the untouched sensor's reading per kelvin.
    pub per_kelvin: Metre,
}

impl Watch {
    /// Default settings: memory and settling of 500 readings, [`Cusum::WATCH`], release at 5 sigma,
    /// unknown rest, and no effect of temperature on the reading.
    pub const fn new(sigma: Metre) -> Self {
        Self {
            sigma,
            memory: 500.0,
            settling: 500,
            cusum: Cusum::WATCH,
            release: Metre(5.0 * sigma.0),
            rest: None,
            per_kelvin: Metre(0.0),
        }
    }
}
