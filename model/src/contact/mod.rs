//! When something touches, and since when.
//!
//! An untouched sensor's reading drifts: it warms, it recovers from the last press. The
//! [`Baseline`] follows that; what a reading has above it is the deformation; a [`Cusum`] over the
//! deformation says when it is no longer noise. Until then every reading is taken into the
//! baseline, afterwards none: a touch is found within a few readings, and those few weigh
//! little in a memory of hundreds.
//!
//! # Figures
//!
//! Measured by `tests/integration/contact.rs` with white noise of one sigma, a memory of 500 readings:
//!
//! | | |
//! |---|---|
//! | readings between false alarms, k 1, threshold 4 / 6 | 15,000 / 840,000 (exact for a known baseline: 14,500 / 790,000) |
//! | the same, k 1, threshold 10, from the exact Markov chain | 2.3e9 |
//! | delay of a touch that deepens 0.1 / 1 / 10 sigma a reading, threshold 10 | 24 / 5.4 / 1.6 readings |
//! | its onset, dated back: mean error (early) | 0.7 / 0.9 / 0.5 readings |
//! | the same, root mean square | 7.9 / 1.8 / 0.9 readings |
//!
//! Noise must be white at the rate of the readings for these figures: vibration that is not counts
//! as deformation, so sigma has to include it.

mod baseline;
mod cusum;

pub use baseline::Baseline;
pub use cusum::Cusum;

use crate::units::{Metre, OutOfRange, Requirement, Second};

/// How to watch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Watch {
    /// Standard deviation of a reading of the untouched sensor, vibration included.
    pub sigma: Metre,
    /// Readings that the baseline remembers.
    pub memory: f32,
    /// Readings after a start or a release before touches are looked for.
    pub settling: u32,
    /// Test for touch and release.
    pub cusum: Cusum,
    /// Deformation below which the touch is over. A touch that has not been twice as deep yet is
    /// over below half of its deepest, so that a slow one does not end where it begins; in any
    /// case below two sigma.
    pub release: Metre,
}

impl Watch {
    /// Memory and settling of 500 readings, [`Cusum::WATCH`], release at 5 sigma.
    pub const fn new(sigma: Metre) -> Self {
        Self {
            sigma,
            memory: 500.0,
            settling: 500,
            cusum: Cusum::WATCH,
            release: Metre(5.0 * sigma.0),
        }
    }
}

/// What the detector knows after a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Touch {
    /// The baseline is still being learnt.
    Settling,
    /// Nothing touches.
    Clear,
    /// Something touches, found with this reading.
    Began {
        /// How long before this reading it began.
        ago: Second,
    },
    /// Something touches.
    Held,
    /// It was released, found with this reading; the baseline is learnt anew.
    Ended,
}

/// One reading, judged.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Observation {
    /// Reading less baseline.
    pub deformation: Metre,
    /// State of touch.
    pub touch: Touch,
}

/// Readings since the sum was last zero: what may be the beginning of a touch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Rising {
    sum: f32,
    age: f32,
    count: f32,
    times: f32,
    squares: f32,
    values: f32,
    products: f32,
}

impl Rising {
    fn add(&mut self, interval: f32, value: f32) {
        self.age += interval;
        self.count += 1.0;
        self.times += self.age;
        self.squares += self.age * self.age;
        self.values += value;
        self.products += self.age * value;
    }

    /// Time from the onset to now.
    ///
    /// The sum was last zero at age 0, where Page's test places the change. A touch deepens from
    /// nothing, though, and stays below the allowance for a while: the line through the readings
    /// since, carried back to zero, finds that part. It may reach back by the run's own length,
    /// and not past the run's first reading.
    fn ago(&self) -> f32 {
        let spread = self.count * self.squares - self.times * self.times;
        let covariance = self.count * self.products - self.times * self.values;
        if self.count < 3.0 || !(covariance > 0.0) {
            return self.age;
        }
        let zero = (self.times - self.values * (spread / covariance)) / self.count;
        self.age - zero.max(-self.age).min(self.age / self.count)
    }
}

/// Follows the baseline and finds touch and release, reading by reading.
///
/// ```
/// use palpate_model::contact::{Detector, Touch, Watch};
/// use palpate_model::units::{Metre, Second};
/// let mut detector = Detector::new(Watch::new(Metre(10e-9)))?;
/// let interval = Second(1e-3);
/// // A quiet sensor that drifts by 1 um/s, then a press of 100 um/s.
/// for i in 0..1000 {
///     detector.push(interval, Metre(i as f32 * 1e-9));
/// }
/// let found = (0..).find_map(|i| {
///     let pressed = Metre(1e-6 + i as f32 * 101e-9);
///     match detector.push(interval, pressed).touch {
///         Touch::Began { ago } => Some((i, ago)),
///         _ => None,
///     }
/// });
/// let (readings, ago) = found.unwrap();
/// assert!(readings <= 2 && ago.0 <= 3e-3);
/// # Ok::<(), palpate_model::units::OutOfRange>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detector {
    watch: Watch,
    baseline: Baseline,
    touching: bool,
    /// Deepest deformation of the touch.
    deepest: Metre,
    rising: Rising,
    falling: f32,
}

impl Detector {
    /// Begins with an unknown baseline. Sigma, allowance and threshold must be above zero.
    pub fn new(watch: Watch) -> Result<Self, OutOfRange> {
        Metre::positive(watch.sigma.0)?;
        OutOfRange::check(watch.cusum.allowance, Requirement::Positive)?;
        OutOfRange::check(watch.cusum.threshold, Requirement::Positive)?;
        Ok(Self {
            watch,
            baseline: Baseline::new(watch.memory),
            touching: false,
            deepest: Metre(0.0),
            rising: Rising::default(),
            falling: 0.0,
        })
    }

    /// The baseline as it stands.
    pub const fn baseline(&self) -> &Baseline {
        &self.baseline
    }

    /// Counts all readings from here on, and those taken, from `zero`: of a reading less by as much the
    /// deformation is the same.
    pub fn shift(&mut self, zero: Metre) {
        self.baseline.shift(zero);
    }

    /// Judges a reading that comes `interval` after the one before. One that is not finite is
    /// passed over: it neither touches nor teaches.
    pub fn push(&mut self, interval: Second, reading: Metre) -> Observation {
        if !(reading.0.is_finite() && interval.0.is_finite()) {
            let touch = if self.touching {
                Touch::Held
            } else {
                self.untouched()
            };
            return Observation {
                deformation: Metre(0.0),
                touch,
            };
        }
        let deformation = self.baseline.deviation(interval, reading);
        let touch = if self.touching {
            self.watch_release(deformation)
        } else {
            self.watch_touch(interval, deformation)
        };
        Observation { deformation, touch }
    }

    fn untouched(&self) -> Touch {
        if self.baseline.readings() < self.watch.settling {
            Touch::Settling
        } else {
            Touch::Clear
        }
    }

    fn watch_touch(&mut self, interval: Second, deformation: Metre) -> Touch {
        let state = self.untouched();
        if state == Touch::Clear {
            let z = deformation / self.watch.sigma;
            let sum = self.watch.cusum.after(self.rising.sum, z);
            // A sum of zero begins anew, and remembers nothing.
            if sum > 0.0 {
                self.rising.add(interval.0, deformation.0);
                self.rising.sum = sum;
            } else {
                self.rising = Rising::default();
            }
            if self.watch.cusum.alarms(self.rising.sum) {
                let ago = Second(self.rising.ago());
                self.touching = true;
                self.deepest = deformation;
                self.rising = Rising::default();
                self.falling = 0.0;
                return Touch::Began { ago };
            }
        }
        self.baseline.learn(interval, deformation);
        state
    }

    fn watch_release(&mut self, deformation: Metre) -> Touch {
        if deformation > self.deepest {
            self.deepest = deformation;
        }
        let sigma = self.watch.sigma;
        let shallow = (self.deepest.0 / 2.0).max(2.0 * sigma.0);
        let level = Metre(self.watch.release.0.min(shallow));
        let below = (level - deformation) / sigma;
        self.falling = self.watch.cusum.after(self.falling, below);
        if !self.watch.cusum.alarms(self.falling) {
            return Touch::Held;
        }
        self.touching = false;
        self.baseline = Baseline::new(self.watch.memory);
        Touch::Ended
    }
}
