//! The reading of the untouched sensor.

use crate::math;
use crate::units::{Metre, Second};

/// A straight line through the past readings, whose weights fade with age (alpha-beta filter,
/// critically damped: discounted least squares of degree one, after Morrison, *Introduction to
/// Sequential Smoothing and Prediction*, 1969), and the readings' mean with the same memory.
///
/// The memory grows with the time for which the baseline learns, up to a limit. An elastomer
/// recovers from a press on all time scales, fast at first: a line through the last eighth of the
/// time since the release follows the recovery. A component of the recovery of size A causes an
/// error of at most 0.009 A, whatever its time constant.
///
/// The line follows a steady drift without lag. Once the memory has grown, the variance of its
/// prediction is 1.25/`memory` of the variance of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Baseline {
    memory: f32,
    readings: u32,
    /// Current size of the memory, in readings. `forgotten` is its reciprocal: the fraction of the
    /// past that each reading displaces.
    window: f32,
    forgotten: f32,
    /// The first reading. All other values are stored as deviations from it, since slow corrections
    /// would otherwise be lost in rounding.
    origin: Metre,
    level: f32,
    /// Rate of the line, m/s.
    rate: f32,
    mean: f32,
}

/// Memory as a fraction of the number of readings since the start. Over the time t/8, a recovery a
/// exp(-t/tau) departs from a straight line by at most a (t/8 tau)^2 exp(-t/tau): 0.0085 a.
const OF_THE_PAST: f32 = 0.125;

/// Smallest memory, in readings: with less, a line is no better than the last reading.
const LEAST_MEMORY: f32 = 2.0;

/// Deviation of a reading from its prediction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Deviation from the line.
    pub from_line: Metre,
    /// Deviation from the mean, by which a touch is detected. Unlike the line, the mean hardly
    /// follows a rise. An untouched sensor stays near or below the mean: it recovers downwards, and
    /// within the memory, warming changes its reading by far less than the noise. While the
    /// readings fall, the mean is above them, so the end of a fall does not count as a rise.
    pub rise: Metre,
}

impl Baseline {
    /// Creates an empty baseline. Once the memory has grown, the weight of a reading falls to 1/e
    /// within `memory` readings, at least 2.
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

    /// A baseline with the same memory and without readings.
    pub const fn anew(&self) -> Self {
        Self::new(self.memory)
    }

    /// Number of readings taken.
    pub const fn readings(&self) -> u32 {
        self.readings
    }

    /// Rate of the drift: slope of the line, m/s.
    pub const fn rate(&self) -> f32 {
        self.rate
    }

    /// Value of the line at the last reading; zero before the first.
    pub fn value(&self) -> Metre {
        self.origin + Metre(self.level)
    }

    /// Standard error of [`Self::value`] for readings with white noise of `sigma`.
    pub fn standard_error(&self, sigma: Metre) -> Metre {
        sigma * math::sqrt(1.25 / self.window)
    }

    /// Shifts the origin of all readings, past and future: `zero` becomes 0.
    pub fn shift(&mut self, zero: Metre) {
        self.origin = self.origin - zero;
    }

    /// Advances the line by `interval` and returns the deviations of `reading` from line and mean.
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

    /// Adds the last reading to line and mean, given the deviation that [`Self::deviation`]
    /// returned for this reading.
    pub fn learn(&mut self, interval: Second, deviation: Deviation) {
        let Metre(from_line) = deviation.from_line;
        let from_mean = self.level + from_line - self.mean;
        self.readings = self.readings.saturating_add(1);
        if self.window < self.memory {
            // `clamp` would panic if `memory` is less than the smallest memory.
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

    /// Largest departure of a recovery from the line within the memory, m: half of the line's
    /// change over the memory, since the memory is an eighth of the time for which the readings
    /// have fallen.
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
        // The first readings have larger gains, which make the line the least-squares line through
        // all of them.
        let pairs = n * (n + 1.0);
        (
            (2.0 * (2.0 * n - 1.0) / pairs).max(level),
            (6.0 / pairs).max(rate),
            (1.0 / n).max(forgotten),
        )
    }
}
