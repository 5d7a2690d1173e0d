//! The converter at a rate: its limits and the noise of its conversions.

use ldc161x::{Acquisition, Channel, LimitError, Model, Rate, ReferenceClock, Request, Sensor};

/// Clock of the converter on the reference board with one channel, Hz: 200 MHz over 6 (docs/decisions/0064-200-megahertz.md).
const CLKIN_HZ: u32 = 33_333_333;
/// Resonators of the board, as in the firmware (firmware/node/src/acquisition/scheme.rs).
const SENSOR: Sensor = Sensor {
    highest_quality_factor: 50,
    lowest_rp_ohm: 3_000,
    highest_rp_ohm: 3_000,
    ..Sensor::new(2_000_000, 5_000_000)
};

/// Conversions at a rate.
#[derive(Clone, Copy, Debug)]
pub struct Conversions {
    /// RCOUNT register.
    pub rcount: u16,
    /// Relative standard deviation of the frequency of one conversion.
    pub relative_sigma: f64,
}

impl Conversions {
    /// Configures the converter for a rate in conversions per second. `white` is the sensor's
    /// relative white noise in 1 ms, without quantisation.
    ///
    /// # Errors
    /// The exceeded limit of the converter or of its bus.
    pub fn at(rate_hz: u32, white: f64) -> Result<Self, LimitError> {
        let clock = ReferenceClock::External { hz: CLKIN_HZ };
        let one = Acquisition::Single(Channel::Zero);
        let plan = Request::new(Model::Ldc1614, clock, one, SENSOR)
            .rate(Rate::PerSecond(rate_hz))
            .plan()?;
        let scale = plan.configuration.scale(Channel::Zero);
        let lasts_s = scale.conversion_s();
        // Reference periods are counted as a whole number at both ends (SNOA944).
        let quantisation = 1.0 / (12_f64.sqrt() * scale.reference_hz() * lasts_s);
        Ok(Self {
            rcount: plan.configuration.channel(Channel::Zero).rcount.get(),
            relative_sigma: quantisation.hypot(white * (1e-3 / lasts_s).sqrt()),
        })
    }
}
