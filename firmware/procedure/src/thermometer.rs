//! Thermometer of the coil: a thermistor to ground, and a resistor of the same value to the ADC's
//! supply, which is also its reference. The ADC reads the ratio R/(R + R25).

use palpate_model::units::Celsius;
use palpate_wire::code::{FaultCode, Location};

use crate::event::Failure;
use crate::time::{Duration, Instant, between};

/// Reference temperature of the thermistor, 25 degrees Celsius, in kelvin. At this temperature
/// thermistor and resistor have the common value of 10 kiloohm.
const REFERENCE_K: f32 = 298.15;
/// Beta of the thermistor between 25 and 85 degrees Celsius, K: that of the common 1 % parts (type
/// 3950). The beta law has an error below 1 K from 0 to 100 degrees Celsius.
const BETA_K: f32 = 3_950.0;
const ZERO_C_K: f32 = 273.15;
/// Reference voltage of the ADC, V.
const REFERENCE_V: f32 = 3.3;

/// ADC ratios at 150 and at -40 degrees Celsius, where R/R25 = exp(beta (1/T - 1/T25)) is 0.0200 and
/// 40.2. Only a reading between them gives a temperature.
const PLAUSIBLE: [f32; 2] = [0.0196, 0.9757];
/// Fault thresholds, halfway from the [`PLAUSIBLE`] ratios to the ends of the ADC's range, 40 and 50
/// counts of 4096 from these ends: a short reads below the first, an open circuit above the second. The
/// ADC errs by 8 counts. A reading between a threshold and the plausible range neither starts nor ends a
/// fault, so noise at a threshold does neither.
const FAILED: [f32; 2] = [0.0098, 0.9879];
/// Time for which readings must be beyond a threshold to be a fault. 12 A in half an ohm heat copper of
/// 0.8 J/K by 1.8 K in this time; a disturbance of the wire by a discharge or by the bridge's edges
/// lasts microseconds.
pub const PERSISTENCE: Duration = Duration::from_ticks(20_000);
/// The failed time decreases by the time of plausible readings divided by this number, so an
/// intermittent contact is a fault if it is open for more than a fifth of the time. A disturbance of one
/// reading in five, a millisecond apart, is no fault.
const RECOVERY: u64 = 4;
/// Weight of a new reading in the exponential smoothing of the ratio.
const SMOOTHING: f32 = 0.25;

/// Filter and fault detection of a thermistor's readings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Thermometer {
    /// Smoothed ratio; `None` while readings are not plausible.
    ratio: Option<f32>,
    /// The last reading is that of an open or shorted thermistor.
    is_failed: bool,
    /// Failed time, us, less a part of the plausible time since; at most twice [`PERSISTENCE`].
    failed_us: u64,
    /// Time of the last reading.
    read: Option<Instant>,
}

impl Thermometer {
    /// Takes a reading as a fraction of the ADC's range. Returns a fault, in every call, while the
    /// thermistor has been open or shorted for [`PERSISTENCE`], continuously or intermittently.
    pub fn push(&mut self, now: Instant, ratio: f32) -> Option<Failure> {
        self.pass(now);
        let [least, most] = PLAUSIBLE;
        if (least..=most).contains(&ratio) {
            let before = self.ratio.unwrap_or(ratio);
            self.ratio = Some(before + SMOOTHING * (ratio - before));
            self.is_failed = false;
            return None;
        }
        self.ratio = None;
        let [short, open] = FAILED;
        self.is_failed |= ratio < short || ratio > open || ratio.is_nan();
        let limit = if ratio < 0.5 { short } else { open };
        (self.is_failed && self.failed_us >= PERSISTENCE.as_ticks()).then_some(Failure {
            code: FaultCode::Thermometer,
            location: Location::Thermometer,
            value: Some(REFERENCE_V * ratio).filter(|volts| volts.is_finite()),
            limit: Some(REFERENCE_V * limit),
        })
    }

    /// Adds the time since the last reading to the failed time if that reading had failed; otherwise
    /// reduces the failed time.
    fn pass(&mut self, now: Instant) {
        let before = self.read.replace(now);
        let passed_us = before.map_or(0, |before| between(before, now).as_ticks());
        let failed_us = if self.is_failed {
            self.failed_us.saturating_add(passed_us)
        } else {
            self.failed_us.saturating_sub(passed_us / RECOVERY)
        };
        self.failed_us = failed_us.min(2 * PERSISTENCE.as_ticks());
    }

    /// Returns the temperature; `None` while readings are not plausible.
    ///
    /// With the ratio r: R/R25 = r/(1 - r) and 1/T = 1/T25 + ln(R/R25)/beta.
    pub fn temperature(&self) -> Option<Celsius> {
        let ratio = self.ratio?;
        let logarithm = palpate_model::math::ln(ratio / (1.0 - ratio));
        Some(Celsius(
            1.0 / (1.0 / REFERENCE_K + logarithm / BETA_K) - ZERO_C_K,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the ADC ratio at a temperature, computed from the beta law in `f64`.
    fn ratio(celsius: f64) -> f64 {
        let ratio = (3_950.0 * (1.0 / (celsius + 273.15) - 1.0 / 298.15)).exp();
        ratio / (1.0 + ratio)
    }

    fn at(ms: u64) -> Instant {
        Instant::from_ticks(1_000 * ms)
    }

    #[test]
    fn it_reads_temperatures_from_minus_39_to_149_degrees() {
        for celsius in (-39..150).step_by(4) {
            let mut thermometer = Thermometer::default();
            let truth = f64::from(celsius);
            assert_eq!(thermometer.push(at(0), ratio(truth) as f32), None);
            let Celsius(found) = thermometer.temperature().unwrap();
            // At both ends of the range, half a count of 4096 exceeds this limit.
            assert!((f64::from(found) - truth).abs() < 0.02, "{truth}: {found}");
        }
    }

    #[test]
    fn its_bounds_are_those_of_the_law() {
        let [least, most] = PLAUSIBLE.map(f64::from);
        assert!((least - ratio(150.0)).abs() < 1e-4, "{}", ratio(150.0));
        assert!((most - ratio(-40.0)).abs() < 1e-4, "{}", ratio(-40.0));
        let [short, open] = FAILED.map(f64::from);
        assert!((short - 0.5 * least).abs() < 1e-4);
        assert!((open - 0.5 * (1.0 + most)).abs() < 1e-4);
    }

    #[test]
    fn open_and_short_are_faults_after_20_ms_and_not_before() {
        for (broken, is_low) in [(0.0, true), (0.009, true), (0.99, false), (1.0, false)] {
            let mut thermometer = Thermometer::default();
            thermometer.push(at(0), 0.5);
            for ms in 1..21 {
                assert_eq!(thermometer.push(at(ms), broken), None, "{broken}: {ms} ms");
                assert_eq!(thermometer.temperature(), None);
            }
            let failure = thermometer.push(at(21), broken).unwrap();
            assert_eq!(failure.code, FaultCode::Thermometer);
            assert_eq!(failure.location, Location::Thermometer);
            assert_eq!(failure.value, Some(REFERENCE_V * broken));
            let limit_v = failure.limit.unwrap();
            assert_eq!(limit_v < 1.0, is_low, "{limit_v}");
            // The fault lasts as long as its cause.
            assert!(thermometer.push(at(500), broken).is_some());
            assert_eq!(thermometer.push(at(501), 0.5), None);
            assert!(thermometer.temperature().is_some());
        }
        let mut thermometer = Thermometer::default();
        assert_eq!(thermometer.push(at(0), f32::NAN), None);
        assert!(thermometer.push(at(20), f32::NAN).is_some());
    }

    /// Intermittent contact: the coil's temperature is unknown for half of the time.
    #[test]
    fn one_that_is_open_now_and_then_is_a_fault() {
        for open_ms in 1..=9 {
            for shut_ms in 1..=2 * open_ms {
                let mut thermometer = Thermometer::default();
                let failed_ms = (0..500).find(|ms| {
                    let is_open = ms % (open_ms + shut_ms) < open_ms;
                    let ratio = if is_open { 1.0 } else { 0.5 };
                    thermometer.push(at(*ms), ratio).is_some()
                });
                assert!(
                    failed_ms.is_some_and(|ms| (20..200).contains(&ms)),
                    "open for {open_ms} of {} ms: {failed_ms:?}",
                    open_ms + shut_ms
                );
            }
        }
        let mut thermometer = Thermometer::default();
        for ms in 0..19 {
            assert_eq!(thermometer.push(at(ms), 1.0), None, "{ms}");
        }
    }

    #[test]
    fn a_spike_is_none_and_the_band_between_begins_and_ends_nothing() {
        let mut thermometer = Thermometer::default();
        for ms in 0..2_000 {
            let spike = if ms % 5 == 0 { 1.0 } else { 0.5 };
            assert_eq!(thermometer.push(at(ms), spike), None, "{ms}");
        }
        // Between a plausible reading and an open circuit: neither a temperature nor a fault.
        let mut thermometer = Thermometer::default();
        for ms in 0..200 {
            assert_eq!(thermometer.push(at(ms), 0.98), None, "{ms}");
        }
        assert_eq!(thermometer.temperature(), None);
        // After an open circuit, such a reading does not end the fault.
        thermometer.push(at(200), 1.0);
        assert!(thermometer.push(at(220), 0.98).is_some());
    }
}
