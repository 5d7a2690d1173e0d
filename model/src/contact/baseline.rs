//! The reading of an untouched sensor, as it drifts.

use crate::units::{Metre, Second};

/// A straight line through the past, older readings fading (alpha-beta filter, critically damped:
/// discounted least squares of degree one, after Morrison, *Introduction to Sequential Smoothing
/// and Prediction*, 1969).
///
/// It follows a steady drift without lag. A drift whose rate changes by a (m/s^2) leaves an error
/// of a (`memory` x interval)^2. The variance of its prediction is 1.25/`memory` of a reading's.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Baseline {
    memory: f32,
    /// Gains of level and rate once the memory has grown.
    fading: (f32, f32),
    readings: u32,
    /// The first reading: the rest is kept as deviation from it, or slow corrections would be
    /// lost in rounding.
    origin: Metre,
    level: f32,
    /// Metres per second.
    rate: f32,
}

/// Readings over memory beyond which both gains of the growing memory, 4/n and 6/n^2, are below
/// those of the fading one.
const GROWN: f32 = 3.0;

impl Baseline {
    /// `memory` is the number of readings after which one weighs 1/e; at least 2.
    pub const fn new(memory: f32) -> Self {
        let memory = memory.max(2.0);
        let forgotten = 1.0 / memory;
        Self {
            memory,
            fading: (forgotten * (2.0 - forgotten), forgotten * forgotten),
            readings: 0,
            origin: Metre(0.0),
            level: 0.0,
            rate: 0.0,
        }
    }

    /// Readings taken.
    pub const fn readings(&self) -> u32 {
        self.readings
    }

    /// Rate of the drift, m/s.
    pub const fn rate(&self) -> f32 {
        self.rate
    }

    /// The line at the last reading; zero before the first.
    pub fn value(&self) -> Metre {
        self.origin + Metre(self.level)
    }

    /// Counts all readings from here on, and those taken, from `zero`.
    pub fn shift(&mut self, zero: Metre) {
        self.origin = self.origin - zero;
    }

    /// Goes on by `interval` along the line and returns `reading` as deviation from it.
    pub fn deviation(&mut self, interval: Second, reading: Metre) -> Metre {
        if self.readings == 0 {
            self.origin = reading;
        }
        self.level += self.rate * interval.0;
        Metre((reading - self.origin).0 - self.level)
    }

    /// Takes the deviation last returned into the line.
    pub fn learn(&mut self, interval: Second, deviation: Metre) {
        self.readings = self.readings.saturating_add(1);
        let (level_gain, rate_gain) = self.gains();
        self.level += level_gain * deviation.0;
        if self.readings > 1 && interval.0 > 0.0 {
            self.rate += rate_gain * deviation.0 / interval.0;
        }
    }

    fn gains(&self) -> (f32, f32) {
        let n = self.readings as f32;
        let (level, rate) = self.fading;
        if n > GROWN * self.memory {
            return (level, rate);
        }
        // Growing memory, which is the least-squares line through all readings, until it is as
        // long as the fading one.
        let pairs = n * (n + 1.0);
        (
            (2.0 * (2.0 * n - 1.0) / pairs).max(level),
            (6.0 / pairs).max(rate),
        )
    }
}
