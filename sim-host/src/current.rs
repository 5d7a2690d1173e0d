//! Drive of the coil's current, and its measurement by the instrument.
//!
//! An ideal source drives the coil: its mean current follows the command at once, within the
//! hardware limit and within the current that the supply can drive through the coil. Closed forms
//! give the bridge's duty cycle and ripple. The square of the ripple adds to the square of the
//! mean. The measurement has its own errors.

use core::f64::consts::TAU;

use ldc161x_sim::Time;

use crate::random::Stream;
use crate::sensing_coil::interference::Bridge;

/// Hardware current limit, in units of the stack's peak current. A bridge must have such a limit;
/// its level is a guess.
pub const HARD_LIMIT: f64 = 1.5;

/// One step of the ADC, A: 12 bits over 3.3 V behind an amplifier of 0.125 V/A about 1.65 V (the
/// reference board).
pub const LSB_A: f64 = 3.3 / 4096.0 / 0.125;

/// Drive of the coil and measurement of its current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentParameters {
    /// Peak current of the stack, A, 0.01 to 100.
    pub peak_a: f64,
    /// Inductance of the coils, H, 10⁻⁷ to 1. The ideal source ignores it; the simulated bridge
    /// uses it.
    pub inductance_h: f64,
    /// Voltage of the supply without load, V, 0.5 to 100; infinite for an unlimited supply.
    pub supply_v: f64,
    /// Resistance of the supply, ohm, 0 to 10.
    pub supply_ohm: f64,
    /// Relative error of the measured current, ±0.5.
    pub gain_error: f64,
    /// Integral non-linearity of the ADC, LSB, 0 to 200: a sine of this amplitude over the range.
    /// The shape is a guess.
    pub nonlinearity_lsb: f64,
    /// Phase of the non-linearity's sine in mid-range, rad.
    pub nonlinearity_phase: f64,
    /// Noise of one sample of the ADC, LSB rms, 0 to 200; white.
    pub noise_lsb: f64,
    /// Ripple factor: 1, or 0 for a source without ripple.
    pub ripple: f64,
}

/// Period of the bridge, s (the reference board: 62.5 kHz; docs/decisions/0040).
pub const PWM_PERIOD_S: f64 = 16e-6;

/// Effective current, A: √(mean² + rms ripple²), with the sign of the mean. All effects that depend
/// on I² use it.
#[must_use]
pub fn effective_current_a(mean_a: f64, ripple_a: f64) -> f64 {
    libm::copysign(libm::hypot(mean_a, ripple_a), mean_a)
}

/// Supply voltage of the bridge if `supply_v` is infinite, V.
const UNLIMITED_V: f64 = 12.0;

impl CurrentParameters {
    /// Largest possible current in a coil of this resistance, A.
    #[must_use]
    pub fn limit_a(&self, coil_ohm: f64) -> f64 {
        (HARD_LIMIT * self.peak_a).min(self.supply_v / (coil_ohm + self.supply_ohm))
    }

    /// State of the bridge that drives `current_a` through a coil of this resistance.
    #[must_use]
    pub fn bridge(&self, current_a: f64, coil_ohm: f64) -> Bridge {
        let supply_v = if self.supply_v.is_finite() {
            self.supply_v
        } else {
            UNLIMITED_V
        };
        let ohm = coil_ohm + self.supply_ohm;
        Bridge {
            supply_v,
            duty: (current_a.abs() * ohm / supply_v).min(1.0),
            period_s: PWM_PERIOD_S,
        }
    }

    /// Root mean square of the current over a period, ripple included, A, with the sign of the mean
    /// (see [`effective_current_a`]).
    #[must_use]
    pub fn effective_a(&self, current_a: f64, coil_ohm: f64) -> f64 {
        effective_current_a(current_a, self.ripple_a(current_a, coil_ohm))
    }

    /// Root mean square of the ripple, A.
    ///
    /// With supply V, duty cycle d, period T and inductance L the ripple is a triangle of
    /// V d (1 − d) T/L peak to peak; its variance is a twelfth of the square of that. The coil's
    /// resistance R, left out here, changes the ripple by a relative amount below R T/L.
    #[must_use]
    pub fn ripple_a(&self, current_a: f64, coil_ohm: f64) -> f64 {
        let Bridge {
            supply_v,
            duty,
            period_s,
        } = self.bridge(current_a, coil_ohm);
        let peak_to_peak_a = supply_v * duty * (1.0 - duty) * period_s / self.inductance_h;
        self.ripple * peak_to_peak_a / libm::sqrt(12.0)
    }

    /// Measured value at zero current, without noise, A: the offset that the drive measures in its
    /// self-test and subtracts.
    #[must_use]
    pub fn zero_a(&self) -> f64 {
        LSB_A * self.nonlinearity_lsb * libm::sin(self.nonlinearity_phase)
    }

    /// Measured value of a true mean current, averaged over `samples` samples, A.
    ///
    /// Quantisation is not modelled: the noise dithers it.
    pub fn reported_a(&self, true_a: f64, samples: u32, noise: &mut Stream) -> f64 {
        let scatter = if self.noise_lsb > 0.0 {
            self.noise_lsb * noise.normal() / libm::sqrt(f64::from(samples.max(1)))
        } else {
            0.0
        };
        self.noiseless_a(true_a) + LSB_A * scatter
    }

    /// Measured value without noise, A.
    #[must_use]
    pub fn noiseless_a(&self, true_a: f64) -> f64 {
        let amplified = true_a * (1.0 + self.gain_error);
        let turns = amplified / (4096.0 * LSB_A);
        let bow = self.nonlinearity_lsb * libm::sin(TAU * turns + self.nonlinearity_phase);
        amplified + LSB_A * bow
    }
}

/// Commanded current as a function of time: piecewise linear between points, constant after the
/// last one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Command {
    points: Vec<(Time, f64)>,
    /// Ripple computed by an external circuit, A rms; `None` if this model computes it.
    pub(crate) ripple_a: Option<f64>,
}

impl Command {
    /// Command through these points, which are in order of time.
    pub(crate) const fn path(points: Vec<(Time, f64)>) -> Self {
        Self {
            points,
            ripple_a: None,
        }
    }

    pub(crate) fn constant(current_a: f64) -> Self {
        Self::path(vec![(Time::ZERO, current_a)])
    }

    pub(crate) fn rippling(mean_a: f64, ripple_a: f64) -> Self {
        Self {
            ripple_a: Some(ripple_a),
            ..Self::constant(mean_a)
        }
    }

    /// Commanded current, A.
    pub(crate) fn at(&self, time: Time) -> f64 {
        let passed = self.points.partition_point(|&(at, _)| at <= time);
        let before = passed.checked_sub(1).and_then(|at| self.points.get(at));
        match (before, self.points.get(passed)) {
            (Some(&(start, from_a)), Some(&(end, to_a))) => {
                let share = (time - start).as_secs_f64() / (end - start).as_secs_f64();
                from_a + share * (to_a - from_a)
            }
            (Some(&(_, current_a)), None) | (None, Some(&(_, current_a))) => current_a,
            (None, None) => 0.0,
        }
    }

    /// Time of the next point after `time`.
    pub(crate) fn next_knot(&self, time: Time) -> Option<Time> {
        let passed = self.points.partition_point(|&(at, _)| at <= time);
        self.points.get(passed).map(|&(at, _)| at)
    }

    /// Whether the command stays equal to the constant command `other` from `time` on.
    pub(crate) fn rests_as(&self, time: Time, other: &Self) -> bool {
        let rests = |command: &Self| (command.at(time), command.ripple_a);
        self.next_knot(time).is_none() && rests(self) == rests(other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAIN: CurrentParameters = CurrentParameters {
        peak_a: 10.0,
        inductance_h: 40e-6,
        supply_v: 6.0,
        supply_ohm: 0.2,
        gain_error: 0.0,
        nonlinearity_lsb: 0.0,
        nonlinearity_phase: 0.0,
        noise_lsb: 0.0,
        ripple: 1.0,
    };

    #[test]
    fn the_supply_limits_before_the_hardware_does() {
        assert!((CHAIN.limit_a(0.4) - 10.0).abs() < 1e-12);
        assert_eq!(CHAIN.limit_a(0.01), 15.0);
    }

    #[test]
    fn the_ripple_is_that_of_the_circuit() {
        use crate::electrical::{Circuit, CircuitParameters, Pins, edges};
        for (duty, inductance_h) in [(0.1, 40e-6), (0.4, 40e-6), (0.5, 20e-6), (0.9, 20e-6)] {
            let mut circuit = Circuit::new(CircuitParameters {
                bridge_ohm: 0.0,
                dead_s: 0.0,
                supply_ohm: 0.0,
                limit_a: f64::INFINITY,
                wake_s: 0.0,
                ..CircuitParameters::common(0.4, inductance_h, 6.0)
            });
            let level = (960.0 * (1.0 - duty)) as u16;
            let period = |circuit: &mut Circuit| {
                let mut moments = edges([960, level], 960).peekable();
                while let Some((from, inputs)) = moments.next() {
                    let until = moments.peek().map_or(1.0, |next| next.0);
                    let pins = Pins {
                        awake: true,
                        inputs,
                    };
                    circuit.advance(pins, (until - from) * 16e-6);
                }
            };
            (0..500).for_each(|_| period(&mut circuit));
            let before = circuit.totals();
            period(&mut circuit);
            let after = circuit.totals();
            let mean_a = (after.charge_a_s - before.charge_a_s) / 16e-6;
            let square = (after.square_a2_s - before.square_a2_s) / 16e-6;
            let chain = CurrentParameters {
                inductance_h,
                supply_ohm: 0.0,
                ..CHAIN
            };
            let found = chain.effective_a(mean_a, 0.4).powi(2) - mean_a * mean_a;
            let exact = square - mean_a * mean_a;
            assert!(
                (found / exact - 1.0).abs() < 0.05,
                "{duty}: {found} {exact}"
            );
        }
    }

    #[test]
    fn the_measured_current_is_off_by_the_gain_the_bow_and_the_noise() {
        let mut noise = Stream::named(1, "test");
        assert_eq!(CHAIN.reported_a(-7.0, 1, &mut noise), -7.0);
        let gain = CurrentParameters {
            gain_error: 0.02,
            ..CHAIN
        };
        assert!((gain.reported_a(5.0, 1, &mut noise) - 5.1).abs() < 1e-12);
        let bowed = CurrentParameters {
            nonlinearity_lsb: 8.0,
            ..CHAIN
        };
        let worst = (-100..=100)
            .map(|step| 0.13 * f64::from(step))
            .map(|current| (bowed.reported_a(current, 1, &mut noise) - current).abs())
            .fold(0.0, f64::max);
        assert!((worst / LSB_A - 8.0).abs() < 0.01, "{worst}");
        let turned = CurrentParameters {
            nonlinearity_phase: 1.0,
            ..bowed
        };
        assert_eq!(turned.reported_a(0.0, 1, &mut noise), turned.zero_a());
        let noisy = CurrentParameters {
            noise_lsb: 2.0,
            ..CHAIN
        };
        let square = |samples: u32, noise: &mut Stream| {
            (0..4000)
                .map(|_| noisy.reported_a(0.0, samples, noise).powi(2))
                .sum::<f64>()
                / 4000.0
        };
        let one = square(1, &mut noise).sqrt() / LSB_A;
        assert!((one - 2.0).abs() < 0.1, "{one}");
        let many = square(16, &mut noise).sqrt() / LSB_A;
        assert!((many - 0.5).abs() < 0.03, "{many}");
    }

    #[test]
    fn a_path_is_straight_between_its_points_and_then_stays() {
        let [start, middle, corner, end] = [10, 15, 20, 30].map(Time::from_ms);
        let path = Command::path(vec![(start, 8.0), (corner, 2.0), (end, 1.0)]);
        assert_eq!(path.at(Time::ZERO), 8.0);
        assert_eq!(path.at(start), 8.0);
        assert!((path.at(middle) - 5.0).abs() < 1e-12);
        assert_eq!(path.at(corner), 2.0);
        assert_eq!((path.at(end), path.at(Time::MAX)), (1.0, 1.0));
        assert_eq!(path.next_knot(middle), Some(corner));
        assert_eq!(path.next_knot(corner), Some(end));
        assert_eq!(path.next_knot(end), None);
        let rest = Command::constant(1.0);
        assert!(path.rests_as(end, &rest) && !path.rests_as(middle, &rest));
        assert!(!path.rests_as(end, &Command::rippling(1.0, 0.1)));
        // A path with a jump, and an empty path.
        let jump = Command::path(vec![(start, 8.0), (start, 2.0)]);
        assert_eq!(jump.at(start), 2.0);
        assert_eq!(Command::default().at(start), 0.0);
    }
}
