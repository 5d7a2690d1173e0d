//! Response of the current to a step and a ramp, from the board's records.

use palpate_cli::failure::Failure;
use palpate_wire::Record;
use palpate_wire::record::CoilTest;
use serde::Serialize;

use crate::board::link::Reported;

/// A recorded current.
#[derive(Clone, Debug)]
pub(super) struct Traced {
    pub(super) interval_s: f64,
    pub(super) currents_a: Vec<f64>,
}

impl Traced {
    /// Returns the record if all parts have arrived.
    pub(super) fn whole(records: &[Reported]) -> Option<Self> {
        let mut parts: Vec<_> = records
            .iter()
            .filter_map(|(_, record)| match record {
                Record::CurrentTrace(part) => Some(part),
                _ => None,
            })
            .collect();
        parts.sort_by_key(|part| part.first);
        let last = parts.last()?;
        let currents_a: Vec<f64> = parts
            .iter()
            .flat_map(|part| part.currents_a.iter().copied().map(f64::from))
            .collect();
        (currents_a.len() == usize::from(last.total)).then_some(Self {
            interval_s: last.interval_s.into(),
            currents_a,
        })
    }

    /// Pairs of time since the start of the record, s, and current, A.
    pub(super) fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let at = |index: usize| (index as f64 + 1.0) * self.interval_s;
        self.currents_a
            .iter()
            .enumerate()
            .map(move |(index, current_a)| (at(index), *current_a))
    }
}

/// Noise of the current read in one period, A, by the widest of the wide codes of the RP2040's
/// converter (erratum E11: eight codes, half of them to either side, 6.4 mA each).
const NOISE_A: f64 = 0.052;
/// Greatest duty of the bridge; its upper switches need the remaining part of the period.
const DUTY: f64 = 0.98;
/// Greatest relative deviation of the settled current from the setpoint. The current is the board's
/// own reading, which does not show the offset and the nonlinearity of an uncalibrated measurement.
const SETTLED: f64 = 0.01;
/// Limits of overshoot and nonlinearity that docs/firmware.md promises, relative.
const OVERSHOOT: f64 = 0.02;
pub(super) const NONLINEARITY: f64 = 0.005;
/// Part of a ramp that is evaluated: conversions at the ends of a ramp average over currents
/// outside of it.
const MIDDLE: [f64; 2] = [0.05, 0.95];
/// Smallest number of conversions in a ramp for an evaluation.
const LEAST: usize = 10;

/// A step from rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct StepResponse {
    pub(super) to_a: f64,
    /// Start of the step in the record's time, s.
    pub(super) begins_s: f64,
    /// Rise time from the start to 90 %, and the shortest rise time possible with this circuit, s.
    pub(super) rise_s: f64,
    pub(super) shortest_rise_s: f64,
    /// Overshoot, relative to the setpoint.
    pub(super) overshoot: f64,
    /// Mean of the second half of the record, A.
    pub(super) settled_a: f64,
    /// Final current without regulation, A, and time constant of the circuit, s.
    final_a: f64,
    time_constant_s: f64,
    interval_s: f64,
}

impl StepResponse {
    pub(super) fn of(traced: &Traced, to_a: f64, test: &CoilTest) -> Result<Self, Failure> {
        let sign = to_a.signum();
        let size_a = to_a.abs();
        let part = |current_a: f64| sign * current_a / size_a;
        let points: Vec<(f64, f64)> = traced.points().map(|(at_s, of)| (at_s, part(of))).collect();
        let risen = points.windows(2).find_map(|of| match of {
            &[(before_s, before), (at_s, at)] if at >= 0.9 && before < 0.9 => {
                Some(before_s + (at_s - before_s) * (0.9 - before) / (at - before))
            }
            _ => None,
        });
        // The step begins after the last point at rest.
        let begins = points
            .iter()
            .take_while(|(_, of)| *of * size_a < 3.0 * NOISE_A);
        let (Some(risen_s), Some((begins_s, _))) = (risen, begins.last()) else {
            return Err(Failure::Refused(format!(
                "the current did not step to {to_a} A within the record"
            )));
        };
        let highest = points.iter().map(|(_, of)| *of).fold(0.0, f64::max);
        let half = points.get(points.len() / 2..).unwrap_or_default();
        let settled = half.iter().map(|(_, of)| *of).sum::<f64>() / half.len().max(1) as f64;
        let ohm = f64::from(test.resistance_ohm);
        let final_a = DUTY * f64::from(test.supply_v) / ohm;
        let time_constant_s = f64::from(test.inductance_h) / ohm;
        Ok(Self {
            to_a,
            begins_s: *begins_s,
            rise_s: risen_s - begins_s,
            shortest_rise_s: -time_constant_s * (1.0 - 0.9 * size_a / final_a).ln(),
            overshoot: (highest - 1.0).max(0.0),
            settled_a: settled * to_a,
            final_a,
            time_constant_s,
            interval_s: traced.interval_s,
        })
    }

    /// Longest allowed rise time; includes one period by which a record may miss the start.
    pub(super) fn longest_rise_s(&self) -> f64 {
        self.shortest_rise_s + 3.0 * self.interval_s
    }

    pub(super) fn overshoot_at_most(&self) -> f64 {
        OVERSHOOT + NOISE_A / self.to_a.abs()
    }

    pub(super) fn tolerance_a(&self) -> f64 {
        SETTLED * self.to_a.abs()
    }

    pub(super) fn is_as_it_should_be(&self) -> bool {
        self.rise_s <= self.longest_rise_s()
            && self.overshoot <= self.overshoot_at_most()
            && (self.settled_a - self.to_a).abs() <= self.tolerance_a()
    }

    /// Rise with the bridge fully on until the setpoint, in µs and A.
    pub(super) fn fastest_rise(&self, to_s: f64) -> Vec<(f64, f64)> {
        const STEPS: u32 = 400;
        let at = |step: u32| to_s * f64::from(step) / f64::from(STEPS);
        let rise = (0..=STEPS).map(|step| {
            let risen_a = self.final_a * (1.0 - (-at(step) / self.time_constant_s).exp());
            (
                1e6 * at(step),
                self.to_a.signum() * risen_a.min(self.to_a.abs()),
            )
        });
        rise.collect()
    }
}

/// A linear fall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Ramp {
    pub(super) from_a: f64,
    pub(super) to_a: f64,
    /// Greatest deviation from the fitted line, relative to `from_a`.
    pub(super) nonlinearity: f64,
    /// Standard deviation of the current about the fitted line, A.
    pub(super) scatter_a: f64,
    /// Evaluated span since the ramp's start, s.
    pub(super) span_s: [f64; 2],
    /// Fitted line: current at the middle of the span, A, and slope, A/s.
    middle_a: f64,
    slope_a_per_s: f64,
}

impl Ramp {
    /// Evaluates the reported currents, as pairs of time, s, and current, A.
    pub(super) fn of(currents: &[(f64, f64)], [from_a, to_a]: [f64; 2]) -> Result<Self, Failure> {
        let [early, late] = MIDDLE.map(|part| from_a + part * (to_a - from_a));
        let (low_a, high_a) = (early.min(late), early.max(late));
        let points: Vec<(f64, f64)> = currents
            .iter()
            .copied()
            .filter(|(_, current_a)| (low_a..=high_a).contains(current_a))
            .collect();
        let (Some((first_s, _)), Some((last_s, _)), LEAST..) =
            (points.first(), points.last(), points.len())
        else {
            return Err(Failure::Refused(format!(
                "the board reported {} conversions of the ramp from {from_a} to {to_a} A: set its \
                 stream to samples and its rate to 1 kHz, and check that the probe loses no records",
                points.len()
            )));
        };
        let middle_s = 0.5 * (first_s + last_s);
        let count = points.len() as f64;
        let mean_s = points.iter().map(|(at_s, _)| at_s).sum::<f64>() / count;
        let mean_a = points.iter().map(|(_, of)| of).sum::<f64>() / count;
        let (mut product, mut square) = (0.0, 0.0);
        for (at_s, current_a) in &points {
            product += (at_s - mean_s) * (current_a - mean_a);
            square += (at_s - mean_s).powi(2);
        }
        let slope_a_per_s = product / square;
        let off = |(at_s, of): &(f64, f64)| of - mean_a - slope_a_per_s * (at_s - mean_s);
        let worst_a = points
            .iter()
            .map(|point| off(point).abs())
            .fold(0.0, f64::max);
        let squares = points.iter().map(|point| off(point).powi(2)).sum::<f64>();
        Ok(Self {
            from_a,
            to_a,
            nonlinearity: worst_a / from_a.abs(),
            scatter_a: (squares / count).sqrt(),
            span_s: [*first_s, *last_s],
            middle_a: mean_a + slope_a_per_s * (middle_s - mean_s),
            slope_a_per_s,
        })
    }

    pub(super) fn at(&self, at_s: f64) -> f64 {
        let [first_s, last_s] = self.span_s;
        self.middle_a + self.slope_a_per_s * (at_s - 0.5 * (first_s + last_s))
    }

    pub(super) fn is_as_it_should_be(&self) -> bool {
        self.nonlinearity <= NONLINEARITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn test() -> CoilTest {
        CoilTest {
            resistance_ohm: 0.5,
            inductance_h: 40e-6,
            lost: 0.0,
            zero_v: 1.65,
            supply_v: 12.0,
            limited_to_a: None,
        }
    }

    fn traced(interval_s: f64, of: impl Fn(f64) -> f64) -> Traced {
        let at = |index: u32| of((f64::from(index) + 1.0) * interval_s);
        Traced {
            interval_s,
            currents_a: (0..128).map(at).collect(),
        }
    }

    /// Current, A, that rises to `to_a` along an exponential towards 98 % of 24 A, with a time
    /// constant of 80 us, from 160 us on.
    fn rising(at_s: f64, to_a: f64) -> f64 {
        let since_s = (at_s - 160e-6).max(0.0);
        (0.98 * 24.0 * (1.0 - (-since_s / 80e-6).exp())).min(to_a)
    }

    #[test]
    fn an_ideal_step_is_as_it_should_be_and_others_are_not() {
        let step =
            StepResponse::of(&traced(16e-6, |at_s| rising(at_s, 8.0)), 8.0, &test()).unwrap();
        assert!(step.is_as_it_should_be(), "{step:?}");
        // The rise to 0.9 * 8 A towards 23.52 A takes 80 us times ln(23.52/16.32).
        assert!((step.shortest_rise_s - 29.2e-6).abs() < 0.2e-6, "{step:?}");
        assert!(
            (step.rise_s - step.shortest_rise_s).abs() < 16e-6,
            "{step:?}"
        );
        assert!(step.overshoot < 1e-9 && (step.settled_a - 8.0).abs() < 1e-6);
        let falling =
            StepResponse::of(&traced(16e-6, |at_s| -rising(at_s, 8.0)), -8.0, &test()).unwrap();
        assert!(falling.is_as_it_should_be(), "{falling:?}");
        let bad: [(&str, &dyn Fn(f64) -> f64); 3] = [
            ("late", &|at_s| rising(0.3 * at_s, 8.0)),
            ("over", &|at_s| {
                let peak = if (200e-6..240e-6).contains(&at_s) {
                    0.4
                } else {
                    0.0
                };
                rising(at_s, 8.0) + peak
            }),
            ("off", &|at_s| rising(at_s, 7.9)),
        ];
        for (what, of) in bad {
            let step = StepResponse::of(&traced(16e-6, of), 8.0, &test()).unwrap();
            assert!(!step.is_as_it_should_be(), "{what}: {step:?}");
        }
        assert!(StepResponse::of(&traced(16e-6, |_| 0.0), 8.0, &test()).is_err());
    }

    #[test]
    fn a_straight_ramp_is_straight_and_a_bent_one_is_not() {
        let reported = |of: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
            let times = (0..100).map(|number| 1e-3 * (f64::from(number) + 0.3));
            times.map(|at_s| (at_s, of(at_s))).collect()
        };
        let fall = |at_s: f64| 8.0 - 6.4 * (at_s / 0.06).min(1.0);
        let ramp = Ramp::of(&reported(&fall), [8.0, 1.6]).unwrap();
        assert!(
            ramp.is_as_it_should_be() && ramp.nonlinearity < 1e-9,
            "{ramp:?}"
        );
        assert!((ramp.at(0.03) - 4.8).abs() < 1e-9);
        let bent = |at_s: f64| fall(at_s) + 0.2 * (at_s / 0.06 * 3.0).sin();
        let ramp = Ramp::of(&reported(&bent), [8.0, 1.6]).unwrap();
        assert!(!ramp.is_as_it_should_be(), "{ramp:?}");
        assert!(Ramp::of(&reported(&|_| 0.0), [8.0, 1.6]).is_err());
        let up = |at_s: f64| -fall(at_s);
        assert!(
            Ramp::of(&reported(&up), [-8.0, -1.6])
                .unwrap()
                .is_as_it_should_be()
        );
    }
}
