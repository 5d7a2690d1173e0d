//! Zero of a touched sensor: what it would read without the touch.

use super::{Baseline, Watch};
use crate::math::student::NORMAL_975;
use crate::units::{Metre, Second};

/// The zero of the deformation during a touch: the baseline at the start of the touch,
/// extrapolated.
///
/// While an elastomer recovers from an earlier press, its remaining deformation falls as a sum of
/// decaying exponentials. Such a sum never falls faster than at its initial rate r, is convex, and
/// ends at the rest. From `left` above the rest, it falls in the time t by at least zero and at
/// most `left` (1 - exp(-r t/`left`)). The zero is assumed to fall by `left` r t/(`left` + r t),
/// which lies between these bounds, so it stays between the baseline and the rest for ever.
///
/// The uncertainty has four components: the noise of the baseline; a zero as low as the rest, if
/// the supposed recovery was an object on the sensor; a fall smaller than assumed; and a change of
/// the sensor's temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Zero {
    start: Metre,
    /// Largest further fall of the zero, m.
    left: f32,
    /// Initial rate at which the zero falls, m/s; at least zero.
    rate: f32,
    /// Whether `left` is the distance from a known rest.
    rest_is_known: bool,
    /// Change of the untouched sensor's reading per kelvin.
    per_kelvin: Metre,
    /// Standard error of the baseline due to noise, m.
    noise: f32,
    /// Time since the start of the touch, s.
    elapsed: f32,
    /// Fall of the zero within that time, m.
    fall: f32,
}

/// Largest rate at which the temperature changes in a heated room and on the board of a coil in
/// operation, K/s.
const WARMING_K_PER_S: f32 = 2.0 / 60.0;
/// Largest change of that temperature, K.
const MOST_WARMING_K: f32 = 10.0;

/// Standard deviation of a uniform distribution between -1 and 1.
const UNIFORM: f32 = 0.577_35;

impl Zero {
    /// The zero of a touch that started with the last reading of `baseline`, the time `elapsed`
    /// ago.
    ///
    /// A known rest is the reading 0, so the zero may fall by the baseline's value. Otherwise the
    /// largest further fall is the rate of the line times the time for which the line has been
    /// learnt.
    pub(super) fn learnt(
        baseline: &Baseline,
        watch: &Watch,
        interval: Second,
        elapsed: f32,
    ) -> Self {
        let rate = (-baseline.rate()).max(0.0);
        let start = baseline.value();
        let left = if watch.rest.is_some() {
            start.0.max(0.0)
        } else {
            rate * interval.0 * baseline.readings() as f32
        };
        let mut zero = Self {
            start,
            left,
            rate,
            noise: baseline.standard_error(watch.sigma).0,
            ..Self::at_rest(watch)
        };
        zero.advance(Second(elapsed));
        zero
    }

    /// The zero of a touch that was present before there was a baseline: the rest.
    pub(super) fn at_rest(watch: &Watch) -> Self {
        Self {
            rest_is_known: watch.rest.is_some(),
            per_kelvin: watch.per_kelvin,
            ..Self::default()
        }
    }

    pub(super) fn advance(&mut self, interval: Second) {
        self.elapsed += interval.0;
        let way = self.rate * self.elapsed;
        self.fall = if self.left > 0.0 {
            self.left * way / (self.left + way)
        } else {
            0.0
        };
    }

    pub(super) fn shift(&mut self, zero: Metre) {
        self.start = self.start - zero;
    }

    /// Time since the touch began.
    pub const fn elapsed(&self) -> Second {
        Second(self.elapsed)
    }

    /// The current zero.
    pub fn value(&self) -> Metre {
        self.start - Metre(self.fall)
    }

    /// Standard uncertainty of the zero's fall since the start of the touch: half of the fall. A
    /// recovery whose time constants are decades apart may have all but stopped, so the whole fall
    /// counts as two standard uncertainties.
    pub(super) fn of_fall(&self) -> Metre {
        Metre(0.5 * self.fall)
    }

    /// Variance of the zero, m^2.
    pub fn variance_m2(&self) -> f32 {
        let to_the_rest = if self.rest_is_known {
            (self.left - self.fall) / NORMAL_975
        } else {
            0.0
        };
        let warming_k = (WARMING_K_PER_S * self.elapsed).min(MOST_WARMING_K);
        // The change due to temperature is uniform within its limits.
        let drift = UNIFORM * warming_k * self.per_kelvin.0;
        let Metre(of_fall) = self.of_fall();
        let parts = [self.noise, to_the_rest, of_fall, drift];
        parts.iter().map(|part| part * part).sum()
    }
}
