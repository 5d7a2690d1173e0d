//! The converter at a rate: what it accepts, and how much its conversions scatter.

use ldc161x::{Acquisition, Channel, LimitError, Model, Rate, ReferenceClock, Request, Sensor};

/// Clock of the converter on the reference board with one channel, Hz: 200 MHz over 6 (docs/decisions/0064-200-megahertz.md).
const CLKIN_HZ: u32 = 33_333_333;
/// The resonators that the board is made for, as its firmware has them (firmware/node/src/acquisition/scheme.rs).
const SENSOR: Sensor = Sensor {
    highest_quality_factor: 50,
    lowest_rp_ohm: 3_000,
    highest_rp_ohm: 3_000,
    ..Sensor::new(2_000_000, 5_000_000)
};

/// Conversions at a rate.
#[derive(Clone, Copy, Debug)]
pub struct Conversions {
    /// RCOUNT.
    pub rcount: u16,
    /// Standard deviation of a frequency, relative.
    pub relative_sigma: f64,
}

impl Conversions {
    /// The converter at so many conversions a second; `white` is the sensor's noise beside quantisation, relative, in 1 ms.
    ///
    /// # Errors
    /// The limit of the converter or of its bus that stands in the way.
    pub fn at(rate_hz: u32, white: f64) -> Result<Self, LimitError> {
        let clock = ReferenceClock::External { hz: CLKIN_HZ };
        let one = Acquisition::Single(Channel::Zero);
        let plan = Request::new(Model::Ldc1614, clock, one, SENSOR)
            .rate(Rate::PerSecond(rate_hz))
            .plan()?;
        let scale = plan.configuration.scale(Channel::Zero);
        let lasts_s = scale.conversion_s();
        // A count of reference periods that is whole at both ends (SNOA944).
        let quantisation = 1.0 / (12_f64.sqrt() * scale.reference_hz() * lasts_s);
        Ok(Self {
            rcount: plan.configuration.channel(Channel::Zero).rcount.get(),
            relative_sigma: quantisation.hypot(white * (1e-3 / lasts_s).sqrt()),
        })
    }
}
