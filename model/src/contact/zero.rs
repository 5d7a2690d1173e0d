//! What a touched sensor would read without the touch.

use super::{Baseline, Watch};
use crate::math::student::NORMAL_975;
use crate::units::{Metre, Second};

/// The zero of the deformation during a touch: the baseline as it was when the touch began, carried on.
///
/// While an elastomer recovers from an earlier press, what is left of it falls as a sum of decaying exponentials. Such a
/// sum never falls faster than its rate at the beginning, is convex, and ends at the rest: of what is left, `left`, a rate r
/// takes in the time t at most `left` (1 - exp(-r t/`left`)) and at least nothing. The zero falls by
/// `left` r t/(`left` + r t), which lies between, so that it stays between the baseline and the rest for ever.
///
/// The uncertainty has four parts: the baseline's noise; the zero may lie as low as the rest, if what was taken for recovery
/// was something that lay on the sensor; it may have fallen less; and the sensor may have become warmer or colder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Zero {
    start: Metre,
    /// How far it can still fall, m.
    left: f32,
    /// How fast it falls at the beginning, m/s; at least zero.
    rate: f32,
    /// Whether `left` is the distance from a rest that is known.
    rest_is_known: bool,
    /// What a kelvin does to the rest.
    per_kelvin: Metre,
    /// Standard error of the baseline by noise, m.
    noise: f32,
    /// Since the touch began, s.
    elapsed: f32,
}

/// How fast temperature may move the rest, K/s, and how far, K: a room that is heated, and a coil's board at work.
const WARMING_K_PER_S: f32 = 2.0 / 60.0;
const MOST_WARMING_K: f32 = 10.0;

/// Standard deviation of a uniform distribution between -1 and 1.
const UNIFORM: f32 = 0.577_35;

impl Zero {
    /// The zero of a touch that began `elapsed` after the baseline's last reading.
    ///
    /// Where the rest is known it reads 0. Elsewhere all that the line can fall is what it would have fallen by at its rate
    /// in the time that it has learnt for.
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
        Self {
            start,
            left,
            rate,
            noise: baseline.standard_error(watch.sigma).0,
            elapsed,
            ..Self::at_rest(watch)
        }
    }

    /// The rest, for a touch that was there before any baseline.
    pub(super) fn at_rest(watch: &Watch) -> Self {
        Self {
            rest_is_known: watch.rest.is_some(),
            per_kelvin: watch.per_kelvin,
            ..Self::default()
        }
    }

    pub(super) fn advance(&mut self, interval: Second) {
        self.elapsed += interval.0;
    }

    pub(super) fn shift(&mut self, zero: Metre) {
        self.start = self.start - zero;
    }

    /// Time since the touch began.
    pub const fn elapsed(&self) -> Second {
        Second(self.elapsed)
    }

    /// The zero now.
    pub fn value(&self) -> Metre {
        self.start - Metre(self.fall())
    }

    fn fall(&self) -> f32 {
        let way = self.rate * self.elapsed;
        if self.left > 0.0 {
            self.left * way / (self.left + way)
        } else {
            0.0
        }
    }

    /// Standard uncertainty of its fall since the touch began: sums of modes that are decades apart may have all but stopped
    /// falling, so that the whole fall is two of them.
    pub(super) fn of_fall(&self) -> Metre {
        Metre(0.5 * self.fall())
    }

    /// Its variance, m^2.
    pub fn variance_m2(&self) -> f32 {
        let to_the_rest = if self.rest_is_known {
            (self.left - self.fall()) / NORMAL_975
        } else {
            0.0
        };
        let warming_k = (WARMING_K_PER_S * self.elapsed).min(MOST_WARMING_K);
        // Uniform within its limits.
        let drift = UNIFORM * warming_k * self.per_kelvin.0;
        let Metre(of_fall) = self.of_fall();
        let parts = [self.noise, to_the_rest, of_fall, drift];
        parts.iter().map(|part| part * part).sum()
    }
}
