//! From a conversion to a deformation: baseline, inductance, curve, cross-talk.

use ldc161x::Reading;
use palpate_model::contact::{Detector, Observation, Touch, Watch};
use palpate_model::tank::{relative_frequency_change, relative_inductance_change};
use palpate_model::units::{Metre, OutOfRange, Second};
use palpate_wire::command::{Crosstalk, Settings};

use crate::configuration::ChannelCalibration;

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
    /// The code that the inductance change counts from: the untouched sensor's, as it was when
    /// the baseline was begun.
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
        if touch == Touch::Ended {
            self.reference_code = None;
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
