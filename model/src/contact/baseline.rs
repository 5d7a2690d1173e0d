//! The reading of the untouched sensor.

use crate::math;
use crate::units::{Metre, Second};

/// A straight line through the past readings, older ones fading (alpha-beta filter, critically
/// damped: discounted least squares of degree one, after Morrison, *Introduction to Sequential
/// Smoothing and Prediction*, 1969), with their mean over the same memory beside it.
///
/// The memory grows with the time that it has learnt for, up to a limit. An elastomer recovers from a press
/// on all scales of time, fast at first: a line through an eighth of the time since the release
/// follows it. A part of the recovery of size A leaves an error of at most 0.009 A, whatever its time constant.
///
/// A steady drift is followed without lag. Once the memory has grown, the variance of the prediction
/// is 1.25/`memory` of a reading's.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Baseline {
    memory: f32,
    readings: u32,
    /// Readings in the memory now, and the part of the past that each reading makes it forget.
    window: f32,
    forgotten: f32,
    /// The first reading: the rest is kept as deviation from it, or slow corrections would be
    /// lost in rounding.
    origin: Metre,
    level: f32,
    /// Metres per second.
    rate: f32,
    mean: f32,
}

/// The memory's part of the readings since the beginning: a recovery a exp(-t/tau) departs from a line over t/8 by at
/// most a (t/8 tau)^2 exp(-t/tau), 0.0085 a.
const OF_THE_PAST: f32 = 0.125;

/// Least memory, in readings: with less a line is no better than its last reading.
const LEAST_MEMORY: f32 = 2.0;

/// A reading against what was expected of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// From the line.
    pub from_line: Metre,
    /// From the mean, which does not learn a rise as the line does: an untouched sensor recovers downwards, and what
    /// warming makes of it in the memory's time is far below its noise. While the readings fall the mean stays above them, so
    /// that a fall that comes to an end is no rise.
    pub rise: Metre,
}

impl Baseline {
    /// `memory` is the number of readings after which one weighs 1/e, once it has grown; at least 2.
    pub const fn new(memory: f32) -> Self {
        Self {
            memory: memory.max(LEAST_MEMORY),
            readings: 0,
            window: LEAST_MEMORY,
            forgotten: 1.0 / LEAST_MEMORY,
            origin: Metre(0.0),
            level: 0.0,
            rate: 0.0,
            mean: 0.0,
        }
    }

    /// The same without any reading.
    pub const fn anew(&self) -> Self {
        Self::new(self.memory)
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

    /// Standard error of [`Self::value`] for white noise of `sigma` a reading.
    pub fn standard_error(&self, sigma: Metre) -> Metre {
        sigma * math::sqrt(1.25 / self.window)
    }

    /// Counts all readings from here on, and those taken, from `zero`.
    pub fn shift(&mut self, zero: Metre) {
        self.origin = self.origin - zero;
    }

    /// Advances by `interval` along the line and compares `reading` with it.
    pub fn deviation(&mut self, interval: Second, reading: Metre) -> Deviation {
        if self.readings == 0 {
            self.origin = reading;
        }
        self.level += self.rate * interval.0;
        let relative = (reading - self.origin).0;
        Deviation {
            from_line: Metre(relative - self.level),
            rise: Metre(relative - self.mean),
        }
    }

    /// Takes the reading that was last compared into the line.
    pub fn learn(&mut self, interval: Second, deviation: Deviation) {
        let Metre(from_line) = deviation.from_line;
        let from_mean = self.level + from_line - self.mean;
        self.readings = self.readings.saturating_add(1);
        if self.window < self.memory {
            // Not `clamp`, which panics where the memory is shorter than the least.
            let window = (OF_THE_PAST * self.readings as f32).max(LEAST_MEMORY);
            self.window = window.min(self.memory);
            self.forgotten = 1.0 / self.window;
        }
        let (level_gain, rate_gain, mean_gain) = self.gains();
        self.level += level_gain * from_line;
        if self.readings > 1 && interval.0 > 0.0 {
            self.rate += rate_gain * from_line / interval.0;
        }
        self.mean += mean_gain * from_mean;
    }

    /// By how much a recovery may depart from the line within its memory: half of what the line changes in that time, since
    /// the memory is an eighth of the time for which it has fallen, m.
    pub(super) fn bend(&self, interval: Second) -> f32 {
        0.5 * self.rate.abs() * self.window * interval.0
    }

    /// Gains of level, rate and mean.
    fn gains(&self) -> (f32, f32, f32) {
        let forgotten = self.forgotten;
        let (level, rate) = (forgotten * (2.0 - forgotten), forgotten * forgotten);
        if self.readings > 8 * LEAST_MEMORY as u32 {
            return (level, rate, forgotten);
        }
        let n = self.readings as f32;
        // The first readings: the least-squares line through all of them.
        let pairs = n * (n + 1.0);
        (
            (2.0 * (2.0 * n - 1.0) / pairs).max(level),
            (6.0 / pairs).max(rate),
            (1.0 / n).max(forgotten),
        )
    }
}
