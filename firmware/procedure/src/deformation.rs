//! Converts a conversion to a deformation: baseline, inductance, curve, cross-talk.

use ldc161x::Reading;
use palpate_model::contact::{Detector, Observation, Touch, Watch, Zero};
use palpate_model::tank::{relative_frequency_change, relative_inductance_change};
use palpate_model::units::{Metre, OutOfRange, Second};
use palpate_wire::command::{Crosstalk, Settings};

use crate::configuration::{ChannelCalibration, Curve};

/// Deformation at one channel of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Deformation {
    /// Deformation relative to the untouched sensor.
    pub(crate) value: Metre,
    /// Standard uncertainty of the value from noise and quantisation.
    pub(crate) sigma: Metre,
    /// Variance of the zero, common to all readings of a touch, m^2.
    pub(crate) zero_variance_m2: f32,
    /// Mean age of the deformation.
    pub(crate) mean_age: Second,
    /// The value is beyond the calibrated curve.
    pub(crate) extrapolated: bool,
    /// State of touch.
    pub(crate) touch: Touch,
}

impl Deformation {
    /// Returns the variance of noise and zero together, m^2.
    pub(crate) fn variance_m2(&self) -> f32 {
        self.sigma.0 * self.sigma.0 + self.zero_variance_m2
    }

    /// Returns whether no contact is detected.
    pub(crate) const fn is_untouched(&self) -> bool {
        matches!(self.touch, Touch::Ended | Touch::Clear | Touch::Settling)
    }
}

/// Reading before the touch that differs from the calibration's rest by more than its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RestMoved {
    pub(crate) reading: Metre,
    pub(crate) limit: Metre,
}

/// Follows one channel: baseline and touch.
#[derive(Clone, Debug)]
pub(crate) struct Follower {
    detector: Detector,
    /// Frequency at which the inductance change is zero. During a touch: that of the untouched sensor,
    /// without its recovery from earlier presses. Otherwise: the calibration's rest frequency or,
    /// without one, that of the first reading.
    reference_hz: Option<f64>,
    /// Code of the converter at the reference frequency; `None` until a reading has given the scale of
    /// the codes.
    reference_code: Option<u32>,
    /// Largest change of an untouched sensor's reading per kelvin.
    per_kelvin: Metre,
}

/// Memory of the baseline: half a second, because the drift of an untouched sensor (warming, recovery
/// from a press) is much slower.
const MEMORY_S: f32 = 0.5;
/// Minimum memory of the baseline, as a number of readings: as many as a straight line needs.
const LEAST_MEMORY: f32 = 20.0;
/// Maximum memory of the baseline, as a number of readings: with more, the variance of the straight line
/// does not improve (`palpate_model::contact`: figures for 500).
const MOST_MEMORY: f32 = 500.0;

/// Largest relative change of an untouched sensor's inductance per kelvin: 30 ppm for the tank's
/// capacitor (class C0G, EIA-198), and as much for the coil.
const INDUCTANCE_PER_KELVIN: f32 = 60e-6;

impl Follower {
    /// Creates a channel with an unknown baseline.
    pub(crate) fn new(settings: &Settings) -> Result<Self, OutOfRange> {
        Ok(Self {
            detector: Detector::new(watch(settings))?,
            reference_hz: None,
            reference_code: None,
            per_kelvin: Metre(0.0),
        })
    }

    /// Continues after an interruption or with other settings: keeps a touch and learns the baseline
    /// again. Discards the reference code, since the converter's codes may have another scale.
    pub(crate) fn resume(&mut self, settings: &Settings) {
        self.detector.resume(Watch {
            rest: self.detector.rest(),
            per_kelvin: self.per_kelvin,
            ..watch(settings)
        });
        self.reference_code = None;
    }

    /// Learns the baseline again, and assumes an untouched sensor until readings show a touch.
    pub(crate) fn learn_anew(&mut self) {
        self.detector.learn_anew();
        self.forget_reference();
    }

    /// Returns the time since the touch began; `None` without a touch.
    pub(crate) fn touched_for(&self) -> Option<Second> {
        self.detector.zero().map(|zero| zero.elapsed())
    }

    /// Returns the reading before the touch and its limit, if no untouched sensor reads as much.
    pub(crate) fn rest_moved(&self) -> Option<RestMoved> {
        let reading = self.detector.doubtful_rest()?;
        let limit = self.detector.highest_untouched()?;
        Some(RestMoved { reading, limit })
    }

    /// Evaluates a good reading, `interval` after the previous one, with the mean square of the coil's
    /// current and the temperature difference from the calibration in kelvin.
    ///
    /// Returns `None` without a calibrated curve.
    pub(crate) fn push(
        &mut self,
        reading: &Reading,
        interval: Second,
        square_a2: Option<f32>,
        away_k: f32,
        calibration: &ChannelCalibration,
    ) -> Option<Deformation> {
        let curve = calibration.curve.as_ref()?;
        let code = reading.word.code().get();
        let reference = match self.reference_code {
            Some(code) => code,
            None => self.refer(reading, calibration, curve),
        };
        let change = relative_inductance_change(relative_frequency_change(reference, code));
        let point = curve.at(change);
        let apparent = Metre(point.value);
        let read = match &calibration.crosstalk {
            Some(crosstalk) => without_crosstalk(apparent, square_a2, crosstalk),
            None => apparent,
        };
        if calibration.tank.is_some() {
            self.detector.set_rest(Some(self.rest(away_k)));
        }
        let Observation { deformation, touch } = self.detector.push(interval, read);
        match touch {
            Touch::Began { .. } => self.count_from_zero(reading, reference, away_k, calibration),
            Touch::Ended => self.forget_reference(),
            Touch::Settling | Touch::Clear | Touch::Held => {}
        }
        // L ~ f^-2, so the relative sigma of L/L0 is twice that of the frequency.
        let relative = reading.sigma_hz / reading.frequency_hz as f32;
        let sigma = point.sigma(2.0 * (1.0 + change) * relative);
        Some(Deformation {
            value: deformation,
            sigma: Metre(sigma),
            zero_variance_m2: self.detector.zero().map_or(0.0, Zero::variance_m2),
            mean_age: self.detector.mean_age(deformation).unwrap_or_default(),
            extrapolated: point.extrapolated,
            touch,
        })
    }

    /// Returns the largest reading of an untouched sensor relative to the calibration: the effect of the
    /// temperature difference `away_k`, which is known to within a kelvin.
    fn rest(&self, away_k: f32) -> Metre {
        self.per_kelvin * (away_k + 1.0)
    }

    /// Determines the reference code from the first reading.
    fn refer(&mut self, reading: &Reading, calibration: &ChannelCalibration, curve: &Curve) -> u32 {
        let rest_hz = calibration.tank.as_ref().map(|tank| tank.rest_frequency_hz);
        let first_hz = rest_hz.unwrap_or(reading.frequency_hz);
        let reference_hz = *self.reference_hz.get_or_insert(first_hz);
        // Rounding to a whole code causes an error of a few nanometres at most.
        let code = f64::from(reading.word.code().get()) * reference_hz / reading.frequency_hz;
        let code = (code + 0.5) as u32;
        self.reference_code = Some(code);
        self.per_kelvin = Metre(curve.at(0.0).slope.abs() * INDUCTANCE_PER_KELVIN);
        self.detector.set_per_kelvin(self.per_kelvin);
        code
    }

    fn forget_reference(&mut self) {
        self.reference_hz = None;
        self.reference_code = None;
    }

    /// Shifts the reference so that the inductance change is zero for the untouched sensor.
    ///
    /// The reference was shifted by the temperature, and by the quantisation of the reading that
    /// set it. At rest the baseline removes this error. Under pressure, where the curve has another
    /// slope, an error would remain and be larger. A deformation from which the sensor still
    /// recovers is real and is not removed.
    fn count_from_zero(
        &mut self,
        reading: &Reading,
        reference_code: u32,
        away_k: f32,
        calibration: &ChannelCalibration,
    ) {
        let Some((zero, curve)) = self.detector.zero().zip(calibration.curve.as_ref()) else {
            return;
        };
        let untouched = match &calibration.tank {
            Some(_) => {
                let Metre(limit_m) = self.rest(away_k);
                Metre(zero.value().0.max(-limit_m).min(limit_m))
            }
            None => zero.value(),
        };
        // Finds the inductance change at which the curve gives this deformation, by Newton's method from
        // a start close to it.
        let mut change = 0.0;
        for _ in 0..2 {
            let point = curve.at(change);
            change += (untouched.0 - point.value) / point.slope;
        }
        // Change of the code for this inductance change, since L ~ f^-2, to second order: the term of
        // third order is less than a count.
        let counts = -0.5 * change * (1.0 - 0.75 * change) * reference_code as f32;
        if !counts.is_finite() {
            return;
        }
        let code = reference_code.saturating_add_signed(counts as i32);
        let hertz_per_count = reading.frequency_hz / f64::from(reading.word.code().get());
        self.reference_hz = Some(f64::from(code) * hertz_per_count);
        self.reference_code = Some(code);
        self.detector.shift(untouched);
    }
}

/// Returns the memory of a baseline, as a number of readings.
pub(crate) fn memory(settings: &Settings) -> f32 {
    (settings.rate_hz * MEMORY_S).clamp(LEAST_MEMORY, MOST_MEMORY)
}

/// Returns the settings of touch detection.
fn watch(settings: &Settings) -> Watch {
    let memory = memory(settings);
    Watch {
        memory,
        settling: memory as u32,
        release: Metre(settings.release_m),
        ..Watch::new(Metre(settings.contact_noise_m))
    }
}

/// Removes the reading a I^2 (1 + g x) that the current I causes at deformation x; a, g: `crosstalk`.
fn without_crosstalk(apparent: Metre, square_a2: Option<f32>, crosstalk: &Crosstalk) -> Metre {
    // Without current there is nothing to remove, and a division takes 150 cycles.
    let Some(square_a2) = square_a2.filter(|square_a2| *square_a2 != 0.0) else {
        return apparent;
    };
    let untouched_m = crosstalk.apparent_m_per_a2 * square_a2;
    // x + a I^2 (1 + g x) = apparent, solved for x.
    let growth = 1.0 + untouched_m * crosstalk.growth_per_m;
    (apparent - Metre(untouched_m)) / growth
}

#[cfg(test)]
mod tests {
    use ldc161x::Word;

    use super::*;
    use crate::configuration::DEFAULT_SETTINGS;

    const UNTOUCHED: u32 = 24_637_172;
    /// Code of the converter at a deformation of 0.41 mm.
    const PRESSED: u32 = 23_385_000;

    /// Calibration whose curve's slope at the code `PRESSED` is half its slope at rest.
    fn calibration() -> ChannelCalibration {
        let knots = [-0.01, 0.0, 0.02, 0.06, 0.12, 0.2];
        let points = knots.map(|change: f32| (change, 4.9e-3 * change * (1.0 - 2.2 * change)));
        ChannelCalibration {
            curve: Some(Curve::new(&points).unwrap()),
            ..ChannelCalibration::none()
        }
    }

    /// Returns the deformation at the end of a press if the first reading has the code `first`.
    fn pressed(first: u32) -> Deformation {
        let mut follower = Follower::new(&DEFAULT_SETTINGS).unwrap();
        let untouched = core::iter::once(first).chain([UNTOUCHED; 3_000]);
        let codes = untouched.chain([PRESSED; 20]);
        let deformations = codes.map(|code| {
            let reading = Reading {
                word: Word::from_registers((code >> 16) as u16, code as u16),
                frequency_hz: 3e6,
                ..Reading::default()
            };
            follower
                .push(&reading, Second(1e-3), None, 0.0, &calibration())
                .unwrap()
        });
        deformations.last().unwrap()
    }

    /// The first reading is off by two counts of the converter at 1 kHz, or by the cross-talk of 4 A in
    /// the coil, which is not a deformation.
    #[test]
    fn a_deformation_does_not_depend_on_the_first_reading() {
        let usual = pressed(UNTOUCHED);
        assert_eq!(usual.touch, Touch::Held);
        assert!((usual.value.0 - 4.1e-4).abs() < 1e-5, "{usual:?}");
        for off in [-740, 740, 5_600] {
            let other = pressed(UNTOUCHED.saturating_add_signed(off));
            let apart_m = (other.value - usual.value).0;
            assert!(apart_m.abs() < 2e-9, "{off}: {apart_m:e} m");
        }
    }
}
