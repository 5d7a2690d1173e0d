//! Compliance of the actuated layer during a sample, by the calibration in force.

use palpate_sim::current::effective_current_a;
use palpate_wire::Record;
use palpate_wire::command::Settings;
#[cfg(test)]
use palpate_wire::command::{Attraction, Springs, StiffeningCurve, StiffeningKnot};
use palpate_wire::record::Sample;

/// Conversion from a current to the actuated layer's compliance, by the calibration in force.
#[derive(Clone, Debug)]
pub(super) struct Law {
    settings: Settings,
    sensing_n_per_m: f64,
    /// c_S/c_D0: stiffness of the sensing layer over that of the actuated layer without current.
    ratio: f64,
    attraction_n_per_a2: f64,
    /// Knots of the curve: current, A, and relative rise of the actuated spring.
    rise: Vec<(f64, f64)>,
}

impl Law {
    /// Creates the law from the board's records of settings and calibration; `None` if a part is
    /// missing.
    pub(super) fn of(records: &[Record]) -> Option<Self> {
        let springs = last(records, |record| match record {
            Record::Springs(of) => Some(of),
            _ => None,
        })?;
        let settings = last(records, |record| match record {
            Record::Settings(of) => Some(of),
            _ => None,
        })?;
        let attraction = last(records, |record| match record {
            Record::Attraction(of) => Some(of),
            _ => None,
        });
        let sensing_n_per_m = springs.sensing_n_per_m.into();
        let chunks = records.iter().filter_map(|record| match record {
            Record::StiffeningCurve(chunk) => Some(&chunk.knots),
            _ => None,
        });
        let rise: Vec<_> = chunks
            .flatten()
            .map(|knot| (f64::from(knot.current_a), f64::from(knot.rise)))
            .collect();
        (!rise.is_empty()).then_some(Self {
            settings: settings.clone(),
            sensing_n_per_m,
            ratio: sensing_n_per_m / f64::from(springs.actuated_n_per_m),
            attraction_n_per_a2: attraction.map_or(0.0, |of| of.attraction_n_per_a2.into()),
            rise,
        })
    }

    /// The settings in force.
    pub(super) const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Relative rise of the actuated spring at a current, A, interpolated between the knots. For a
    /// square law with 32 knots the error is at most 1/(4 * 31^2) = 0.03 % of the rise at the peak.
    fn rise(&self, current_a: f64) -> f64 {
        let current_a = current_a.abs();
        let later = self.rise.partition_point(|(at_a, _)| *at_a < current_a);
        let before = later.checked_sub(1).and_then(|index| self.rise.get(index));
        match (before, self.rise.get(later)) {
            (Some((from_a, from)), Some((to_a, to))) => {
                from + (current_a - from_a) / (to_a - from_a) * (to - from)
            }
            (Some((_, rise)), None) | (None, Some((_, rise))) => *rise,
            (None, None) => 0.0,
        }
    }

    /// Compliance of the actuated layer relative to the sensing layer: c_S/c_D(I) plus the effect
    /// of the attraction.
    pub(super) fn compliance(&self, reading: &Reading) -> f64 {
        let ratio = self.ratio / (1.0 + self.rise(reading.current_a));
        let pull_n = self.attraction_n_per_a2 * reading.current_a.powi(2);
        ratio + pull_n * ratio / self.sensing_n_per_m / reading.deformation_m
    }
}

/// Returns the last record of a kind.
fn last<'r, T>(records: &'r [Record], of: impl Fn(&'r Record) -> Option<&'r T>) -> Option<&'r T> {
    records.iter().rev().find_map(of)
}

/// The quantities of a sample that the law needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// Device time, s.
    pub(super) time_s: f64,
    /// Deformation, m.
    pub(super) deformation_m: f64,
    /// Effective current, A: root mean square of mean and ripple.
    pub(super) current_a: f64,
}

impl Reading {
    /// Converts a sample; `None` without a deformation or a current.
    pub(super) fn of(time_s: f64, sample: &Sample) -> Option<Self> {
        let deformation_m = sample.channels.first()?.deformation_m?.into();
        let ripple_a = sample.ripple_a.unwrap_or(0.0).into();
        Some(Self {
            time_s,
            deformation_m,
            current_a: effective_current_a(sample.current_a?.into(), ripple_a),
        })
    }
}

#[cfg(test)]
impl Law {
    /// Springs, curve and attraction with round numbers, and the settings of a board.
    pub(super) fn made_parts() -> Vec<Record> {
        let knot = |a: u8| StiffeningKnot {
            current_a: 0.5 * f32::from(a),
            rise: 1e-3 * (0.5 * f32::from(a)).powi(2),
        };
        let chunk = |first: u8| {
            Record::StiffeningCurve(StiffeningCurve {
                total: 32,
                first,
                rise_uncertainty: 0.0,
                knots: (first..first + 8).map(knot).collect(),
            })
        };
        let springs = Springs {
            sensing_n_per_m: 6e3,
            sensing_uncertainty: 0.0,
            actuated_n_per_m: 3e3,
            actuated_uncertainty: 0.0,
            force_scale_uncertainty: 0.0,
            zero_uncertainty_m: 0.0,
            bend: 0.0,
        };
        let attraction = Attraction {
            attraction_n_per_a2: 1e-4,
            uncertainty: 0.0,
        };
        let curve = [0, 8, 16, 24].map(chunk);
        let others = [
            Record::Settings(palpate_sim::native::default_settings()),
            Record::Springs(springs),
            Record::Attraction(attraction),
        ];
        curve.into_iter().chain(others).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rise_is_that_of_the_knots_and_straight_between_them() {
        let law = Law::of(&Law::made_parts()).unwrap();
        assert_eq!(law.rise(0.0), 0.0);
        assert!((law.rise(3.0) - 9e-3).abs() < 1e-9);
        assert!((law.rise(-3.25) - 10.625e-3).abs() < 1e-9);
        assert!((law.rise(99.0) - 0.240_25).abs() < 1e-6);
    }

    #[test]
    fn without_all_parts_of_a_calibration_there_is_no_law() {
        let parts = Law::made_parts();
        assert!(Law::of(&parts).is_some());
        // Leaves out the curve, then the settings, then the springs.
        for part in [&parts[..4], &parts[4..5], &parts[5..6]] {
            let others = parts.iter().filter(|of| !part.contains(of));
            let others: Vec<_> = others.cloned().collect();
            assert!(Law::of(&others).is_none(), "{part:?}");
        }
    }
}
