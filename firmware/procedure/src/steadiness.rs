//! Detection of a steady press.

use palpate_model::units::{Metre, Second};

/// Time over which the deformation is averaged: two periods of the fastest tremor that is not averaged
/// out, and half a period of the slowest vibration on a stand (5 Hz, sim-host/stacks).
const BLOCK: Second = Second(0.1);

/// Compares the means of successive blocks of time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Steadiness {
    sum: Metre,
    count: f32,
    elapsed: Second,
    previous: Option<Metre>,
}

impl Steadiness {
    /// Returns the time from the start to the first rate, in seconds: two blocks of at least two
    /// conversions, and half a block until the first conversion.
    pub(crate) fn least_s(rate_hz: f32) -> f32 {
        2.5 * BLOCK.0.max(2.0 / rate_hz)
    }

    /// Returns the mean deformation of the last whole block.
    pub(crate) const fn mean(&self) -> Option<Metre> {
        self.previous
    }

    /// Takes a deformation, `interval` after the previous one. Returns its rate in m/s at the end of a
    /// block.
    pub(crate) fn push(&mut self, interval: Second, deformation: Metre) -> Option<f32> {
        self.sum = self.sum + deformation;
        self.count += 1.0;
        self.elapsed = self.elapsed + interval;
        if self.elapsed < BLOCK || self.count < 2.0 {
            return None;
        }
        let mean = self.sum / self.count;
        let rate = self
            .previous
            .map(|previous| (mean - previous).0 / self.elapsed.0);
        *self = Self {
            previous: Some(mean),
            ..Self::default()
        };
        rate
    }
}
