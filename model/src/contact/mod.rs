//! Contact detection: whether an object touches the sensor, since when, and how deep.
//!
//! The reading of an untouched sensor drifts, because the sensor warms and recovers from the last
//! press. The [`Baseline`] follows this drift; a [`Cusum`] test of the rise of the readings above
//! the baseline detects a touch. Only readings before the detection are added to the baseline. The
//! detection takes a few readings, so the touch hardly affects the baseline. During a touch the
//! [`Zero`] extrapolates the baseline, within bounds that hold for any elastomer and any time.
//!
//! Readings may depart from the baseline without a touch, for example when an object is lifted that
//! was present from the start. The baseline then restarts instead of learning the departure as
//! drift. If the reading of the untouched sensor is known ([`Watch::rest`]), an object that is
//! present from the start is detected as a touch.
//!
//! # Figures
//!
//! Measured by `tests/integration/contact.rs` with white noise of one sigma, a memory of 500 readings:
//!
//! | | |
//! |---|---|
//! | readings between false alarms, k 1, threshold 4 | 10,300 (exact for a known baseline: 14,500) |
//! | readings between false alarms, k 1, threshold 10, by [`Cusum::WATCH`] | 2.3e9 |
//! | delay of a touch that deepens 0.1 / 1 / 10 sigma a reading, threshold 10 | 24 / 5.4 / 1.6 readings |
//! | its estimated onset: mean error (early) | 0.9 / 0.9 / 0.5 readings |
//! | its estimated onset: root mean square error | 8.2 / 1.8 / 0.9 readings |
//!
//! These figures require noise that is white at the rate of the readings. Vibration that is not
//! white counts as deformation, so sigma has to include it.

mod baseline;
mod cusum;
mod recovery;
mod watch;
mod zero;

pub use baseline::{Baseline, Deviation};
pub use cusum::Cusum;
pub use recovery::{MOST_CREEP, Recovery};
pub use watch::Watch;
pub use zero::Zero;

use crate::units::{Metre, OutOfRange, Requirement, Second};

/// Number of readings that only train the baseline, before the test for touches starts.
const LEAST_READINGS: u32 = 8;

/// State of contact after a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Touch {
    /// The baseline is still being learnt, or it is lower than an untouched sensor with the known
    /// rest can read.
    Settling,
    /// No contact.
    Clear,
    /// Contact, detected with this reading.
    Began {
        /// Time since the contact started; zero if it was present from the start.
        ago: Second,
    },
    /// Contact continues.
    Held,
    /// Contact ended, detected with this reading; the baseline is learnt again.
    Ended,
}

/// Result of one reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Reading minus baseline; during a touch, reading minus the zero of the touch.
    pub deformation: Metre,
    /// State of contact.
    pub touch: Touch,
}

/// Sums over the readings since the test's sum was last zero, possibly the start of a touch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

    /// Time from the estimated onset of the touch to now.
    ///
    /// Page's test places the onset where its sum was last zero. But a touch deepens from zero and
    /// at first stays below the test's allowance, so the line through the readings since then is
    /// extrapolated back to zero. The onset is at most one length of the run before the run, and at
    /// the latest at the run's first reading.
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

/// Follows the baseline and detects touch and release, reading by reading.
///
/// ```
/// use palpate_model::contact::{Detector, Touch, Watch};
/// use palpate_model::units::{Metre, Second};
/// let watch = Watch { per_kelvin: Metre(3e-6), ..Watch::new(Metre(10e-9)) };
/// let mut detector = Detector::new(watch)?;
/// let interval = Second(1e-3);
/// // A quiet sensor that warms, and so drifts by 50 nm/s; then a press of 100 um/s.
/// for i in 0..1000 {
///     detector.push(interval, Metre(i as f32 * 50e-12));
/// }
/// let found = (0..100).find_map(|i| {
///     let pressed = Metre(50e-9 + i as f32 * 100e-9);
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
pub struct Detector {
    watch: Watch,
    baseline: Baseline,
    /// The baseline as it was before `rising` started.
    before: Baseline,
    rising: Rising,
    /// Sum of the test for movements that are neither drift nor touch.
    moving: f32,
    /// The current touch.
    held: Option<OngoingTouch>,
    /// Upper bound of the sensor's remaining recovery.
    recovery: Recovery,
}

/// State of a touch.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OngoingTouch {
    zero: Zero,
    /// Reading before the touch; `None` if an untouched sensor can have this reading.
    doubtful: Option<Metre>,
    deepest: Metre,
    /// Integral of the deformation over the touch, m s.
    integral: f32,
    falling: f32,
}

impl Detector {
    /// Creates a detector whose baseline is not known yet. Sigma, allowance and threshold must be
    /// above zero.
    pub fn new(watch: Watch) -> Result<Self, OutOfRange> {
        Metre::positive(watch.sigma.0)?;
        OutOfRange::check(watch.cusum.allowance, Requirement::Positive)?;
        OutOfRange::check(watch.cusum.threshold, Requirement::Positive)?;
        let baseline = Baseline::new(watch.memory);
        Ok(Self {
            watch,
            baseline,
            before: baseline,
            rising: Rising::default(),
            moving: 0.0,
            held: None,
            recovery: Recovery::default(),
        })
    }

    /// The current baseline.
    pub const fn baseline(&self) -> &Baseline {
        &self.baseline
    }

    /// The zero of the current touch; `None` without a touch.
    pub fn zero(&self) -> Option<&Zero> {
        self.held.as_ref().map(|held| &held.zero)
    }

    /// Mean age of the present `deformation`: the integral of the deformation over the touch,
    /// divided by `deformation`. This is the mean age of the deformation's increments, weighted by
    /// their size. `None` without a touch or without a positive deformation.
    ///
    /// Creep and the coil's current add small, young increments, which hardly change the mean age
    /// of a press of constant depth. The creep of a press that only deepens follows the mean
    /// logarithm of the increments' ages; the logarithm of the mean age is an upper bound of that
    /// mean (Jensen's inequality).
    pub fn mean_age(&self, deformation: Metre) -> Option<Second> {
        let held = self.held.as_ref().filter(|_| deformation.0 > 0.0)?;
        Some(Second(held.integral / deformation.0))
    }

    /// Reading before the touch; `None` if an untouched sensor can have this reading. `Some` makes
    /// the zero of the deformation doubtful: an object was present from the start, or the sensor's
    /// rest has changed.
    pub fn doubtful_rest(&self) -> Option<Metre> {
        self.held.as_ref().and_then(|held| held.doubtful)
    }

    /// Largest reading of the untouched and recovered sensor, in magnitude; `None` if unknown.
    pub const fn rest(&self) -> Option<Metre> {
        self.watch.rest
    }

    /// Sets the rest of the untouched sensor from now on; see [`Watch::rest`].
    pub const fn set_rest(&mut self, rest: Option<Metre>) {
        self.watch.rest = rest;
    }

    /// Sets the largest change of the untouched sensor's reading per kelvin from now on.
    pub const fn set_per_kelvin(&mut self, per_kelvin: Metre) {
        self.watch.per_kelvin = per_kelvin;
    }

    /// Highest reading of an untouched sensor: the sum of its rest, the deformation that may stay
    /// undetected, and the remaining recovery. `None` if the rest is unknown.
    pub fn highest_untouched(&self) -> Option<Metre> {
        self.lowest_untouched()
            .map(|lowest| self.recovery.most() - lowest)
    }

    /// Lowest reading of an untouched sensor, a negative number.
    fn lowest_untouched(&self) -> Option<Metre> {
        let rest = self.watch.rest?;
        Some(-(rest + self.watch.release))
    }

    /// Returns the reading if an untouched sensor cannot have it, otherwise `None`.
    fn doubtful(&self, reading: Metre) -> Option<Metre> {
        let is_low = self
            .lowest_untouched()
            .is_some_and(|lowest| reading < lowest);
        let is_high = self
            .highest_untouched()
            .is_some_and(|highest| reading > highest);
        (is_low || is_high).then_some(reading)
    }

    /// Shifts the origin of all readings, past and future: the reading `zero` becomes 0. Later
    /// readings that are lower by `zero` give the same deformation.
    pub fn shift(&mut self, zero: Metre) {
        self.baseline.shift(zero);
        if let Some(held) = &mut self.held {
            held.zero.shift(zero);
        }
    }

    /// Restarts the baseline, and assumes the sensor to be untouched until readings show otherwise.
    pub fn learn_anew(&mut self) {
        self.held = None;
        self.begin();
    }

    /// Continues after an interruption or with other settings. A touch continues; without a touch
    /// the baseline is learnt again.
    pub fn resume(&mut self, watch: Watch) {
        // The remaining recovery is at most the last value of the baseline.
        if self.held.is_none() && self.baseline.readings() >= self.watch.settling {
            self.recovery.no_more_than(self.baseline.value());
        }
        self.watch = watch;
        self.baseline = Baseline::new(watch.memory);
        self.begin();
    }

    fn begin(&mut self) {
        self.baseline = self.baseline.anew();
        self.rising = Rising::default();
        self.moving = 0.0;
    }

    /// Processes a reading that comes `interval` after the previous one. A reading that is not
    /// finite is ignored.
    pub fn push(&mut self, interval: Second, reading: Metre) -> Observation {
        if !(reading.0.is_finite() && interval.0.is_finite()) {
            let touch = if self.held.is_some() {
                Touch::Held
            } else {
                self.untouched()
            };
            return Observation {
                deformation: Metre(0.0),
                touch,
            };
        }
        if let Some(held) = &mut self.held {
            held.zero.advance(interval);
            let deformation = reading - held.zero.value();
            held.integral += deformation.0 * interval.0;
            let touch = self.watch_release(deformation);
            return Observation { deformation, touch };
        }
        self.recovery.advance(interval);
        let deviation = self.baseline.deviation(interval, reading);
        let touch = self.watch_touch(interval, reading, deviation);
        let deformation = match &self.held {
            Some(held) => reading - held.zero.value(),
            None => deviation.from_line,
        };
        Observation { deformation, touch }
    }

    fn untouched(&self) -> Touch {
        let is_low = |lowest| self.baseline.value() < lowest;
        if self.baseline.readings() < self.watch.settling
            || self.lowest_untouched().is_some_and(is_low)
        {
            Touch::Settling
        } else {
            Touch::Clear
        }
    }

    fn watch_touch(&mut self, interval: Second, reading: Metre, deviation: Deviation) -> Touch {
        if let Some(ago) = self.rises(interval, deviation.rise) {
            let zero = Zero::learnt(&self.before, &self.watch, interval, self.rising.age);
            return self.touched(zero, ago);
        }
        let mut deviation = deviation;
        if self.moves(interval, deviation) {
            self.begin();
            deviation = self.baseline.deviation(interval, reading);
        }
        self.baseline.learn(interval, deviation);
        let settled = self.baseline.readings() >= self.watch.settling;
        let is_high = |highest| self.baseline.value() > highest;
        if settled && self.highest_untouched().is_some_and(is_high) {
            return self.touched(Zero::at_rest(&self.watch), Second(0.0));
        }
        self.untouched()
    }

    /// Tests for a rise above the baseline; returns the time since the rise started.
    fn rises(&mut self, interval: Second, rise: Metre) -> Option<Second> {
        if self.baseline.readings() < LEAST_READINGS {
            return None;
        }
        let sum = self
            .watch
            .cusum
            .after(self.rising.sum, rise / self.watch.sigma);
        // When the sum is zero, the run restarts without memory of the readings before.
        if sum > 0.0 {
            if self.rising.sum <= 0.0 {
                self.before = self.baseline;
            }
            self.rising.add(interval.0, rise.0);
            self.rising.sum = sum;
        } else {
            self.rising = Rising::default();
        }
        let alarms = self.watch.cusum.alarms(self.rising.sum);
        alarms.then(|| Second(self.rising.ago()))
    }

    /// Whether the readings depart from the baseline in a way that is not a touch.
    fn moves(&mut self, interval: Second, deviation: Deviation) -> bool {
        let apart = if deviation.rise.0 > 0.0 {
            0.0
        } else {
            deviation.from_line.0.abs() - self.baseline.bend(interval)
        };
        let z = apart / self.watch.sigma.0;
        self.moving = self.watch.cusum.after(self.moving, z);
        self.watch.cusum.alarms(self.moving)
    }

    fn touched(&mut self, zero: Zero, ago: Second) -> Touch {
        let before = if self.rising.sum > 0.0 {
            &self.before
        } else {
            &self.baseline
        };
        self.held = Some(OngoingTouch {
            zero,
            doubtful: self.doubtful(before.value()),
            deepest: Metre(0.0),
            integral: 0.0,
            falling: 0.0,
        });
        self.begin();
        Touch::Began { ago }
    }

    fn watch_release(&mut self, deformation: Metre) -> Touch {
        let Some(held) = &mut self.held else {
            return Touch::Ended;
        };
        if deformation > held.deepest {
            held.deepest = deformation;
        }
        let sigma = self.watch.sigma;
        let shallow = (held.deepest.0 / 2.0).max(2.0 * sigma.0);
        let unrecovered = MOST_CREEP * held.deepest.0 + held.zero.of_fall().0;
        let level = Metre(self.watch.release.0.min(shallow).max(unrecovered));
        let below = (level - deformation) / sigma;
        held.falling = self.watch.cusum.after(held.falling, below);
        if !self.watch.cusum.alarms(held.falling) {
            return Touch::Held;
        }
        let (deepest, left) = (held.deepest, held.zero.value());
        let touched = held.zero.elapsed();
        let counts = self.watch.rest.is_some_and(|rest| left > rest);
        self.recovery = self
            .recovery
            .after(deepest, touched, counts.then_some(left));
        self.learn_anew();
        Touch::Ended
    }
}
