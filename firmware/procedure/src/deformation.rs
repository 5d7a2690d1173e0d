//! From a conversion to a deformation: baseline, inductance, curve, cross-talk.

use ldc161x::Reading;
use palpate_model::contact::{Detector, Observation, Touch, Watch};
use palpate_model::tank::{relative_frequency_change, relative_inductance_change};
use palpate_model::units::{Metre, OutOfRange, Second};
use palpate_wire::command::{Crosstalk, Settings};

use crate::configuration::{ChannelCalibration, Curve};

/// The deformation at one channel of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Deformation {
    /// Against the untouched sensor.
    pub(crate) value: Metre,
    /// Its standard uncertainty from noise and quantisation.
    pub(crate) sigma: Metre,
    /// Whether it lies beyond the calibrated curve.
    pub(crate) extrapolated: bool,
    /// State of touch.
    pub(crate) touch: Touch,
}

impl Deformation {
    /// Whether nothing touches, as far as is known.
    pub(crate) const fn is_untouched(&self) -> bool {
        matches!(self.touch, Touch::Ended | Touch::Clear | Touch::Settling)
    }
}

/// One channel's memory: what it reads untouched.
#[derive(Clone, Debug)]
pub(crate) struct Follower {
    detector: Detector,
    /// The code that the inductance change counts from: at first that of the first reading, from a
    /// touch on the untouched sensor's, as the baseline has it.
    reference_code: Option<u32>,
}

/// Readings that the baseline remembers: half a second, because the drift of an untouched sensor
/// (warming, recovery from a press) is slow against that, but as many as a straight line needs and
/// no more than its variance gains from (`palpate_model::contact`: figures for 500).
const MEMORY_S: f32 = 0.5;
const LEAST_MEMORY: f32 = 20.0;
const MOST_MEMORY: f32 = 500.0;

impl Follower {
    /// A channel with an unknown baseline.
    pub(crate) fn new(settings: &Settings) -> Result<Self, OutOfRange> {
        let memory = (settings.rate_hz * MEMORY_S).clamp(LEAST_MEMORY, MOST_MEMORY);
        let watch = Watch {
            memory,
            settling: memory as u32,
            release: Metre(settings.release_m),
            ..Watch::new(Metre(settings.contact_noise_m))
        };
        Ok(Self {
            detector: Detector::new(watch)?,
            reference_code: None,
        })
    }

    /// Evaluates a reading that nothing speaks against, `interval` after the one before, with that
    /// mean square of the coil's current.
    ///
    /// `None` without a calibrated curve.
    pub(crate) fn push(
        &mut self,
        reading: &Reading,
        interval: Second,
        square_a2: Option<f32>,
        calibration: &ChannelCalibration,
    ) -> Option<Deformation> {
        let curve = calibration.curve.as_ref()?;
        let code = reading.word.code().get();
        let reference = *self.reference_code.get_or_insert(code);
        let change = relative_inductance_change(relative_frequency_change(reference, code));
        let point = curve.at(change);
        let apparent = Metre(point.value);
        let read = match &calibration.crosstalk {
            Some(crosstalk) => without_crosstalk(apparent, square_a2, crosstalk),
            None => apparent,
        };
        let Observation { deformation, touch } = self.detector.push(interval, read);
        match touch {
            Touch::Began { .. } => self.count_from_baseline(reference, curve),
            Touch::Ended => self.reference_code = None,
            Touch::Settling | Touch::Clear | Touch::Held => {}
        }
        // L ~ f^-2, so that the relative sigma of L/L0 is twice the frequency's.
        let relative = reading.sigma_hz / reading.frequency_hz as f32;
        let sigma = point.sigma(2.0 * (1.0 + change) * relative);
        Some(Deformation {
            value: deformation,
            sigma: Metre(sigma),
            extrapolated: point.extrapolated,
            touch,
        })
    }

    /// Lets the inductance change count from the untouched sensor.
    ///
    /// A single reading is off by its quantisation, and by the current of the coil's test if that was
    /// under way. Taken off the deformation as the baseline, this is no error of the deformation at
    /// rest; but the curve is not straight, so that it would remain one, and a larger one, of the pressed
    /// sensor.
    fn count_from_baseline(&mut self, reference_code: u32, curve: &Curve) {
        let untouched = self.detector.baseline().value();
        // Newton's method, from where it is near.
        let mut change = 0.0;
        for _ in 0..2 {
            let point = curve.at(change);
            change += (untouched.0 - point.value) / point.slope;
        }
        // L ~ f^-2, to second order: the cube of such a change is below a count.
        let counts = -0.5 * change * (1.0 - 0.75 * change) * reference_code as f32;
        if !counts.is_finite() {
            return;
        }
        self.reference_code = Some(reference_code.saturating_add_signed(counts as i32));
        self.detector.shift(untouched);
    }
}

/// Takes out what the coil's current adds to the reading: a I^2 (1 + g x).
fn without_crosstalk(apparent: Metre, square_a2: Option<f32>, crosstalk: &Crosstalk) -> Metre {
    let Some(square_a2) = square_a2 else {
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
    /// Of 0.41 mm.
    const PRESSED: u32 = 23_385_000;

    /// The curve's slope there is half of that at rest.
    fn calibration() -> ChannelCalibration {
        let knots = [-0.01, 0.0, 0.02, 0.06, 0.12, 0.2];
        let points = knots.map(|change: f32| (change, 4.9e-3 * change * (1.0 - 2.2 * change)));
        let mut calibration = ChannelCalibration::default();
        calibration.curve = Some(Curve::new(&points).unwrap());
        calibration
    }

    /// The deformation at the end of a press, with this code first of all.
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
                .push(&reading, Second(1e-3), None, &calibration())
                .unwrap()
        });
        deformations.last().unwrap()
    }

    /// Two counts of the converter at 1 kHz, and what 4 A in the coil add to a reading, which is of no
    /// deformation.
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
