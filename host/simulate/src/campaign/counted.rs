//! Statistics of many presses.

use serde::Serialize;

use super::coverage::Coverage;
use super::press::{Claim, Press};

/// An estimate is narrow and wrong if its error exceeds this number of its own standard errors,
/// and the size of ln(estimate/truth) exceeds [`BEYOND`].
const STANDARD_ERRORS: f64 = 4.0;
const BEYOND: f64 = 0.05;

/// Statistics of presses. Errors are ln(estimate/truth).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Counted {
    /// Presses with an estimate.
    pub accepted: usize,
    /// Presses without an estimate.
    pub refused: usize,
    /// Root of the mean square error.
    pub rms_ln: Option<f64>,
    /// Mean error.
    pub bias_ln: Option<f64>,
    /// Median of the true c_L/c_S, with the load in series with its support.
    pub true_ratio: Option<f64>,
    /// Part of the intervals that contain the truth.
    pub coverage95: Option<f64>,
    /// Root mean square of the errors of c_S/c_L, each over its own standard error. It is 1 if the
    /// standard errors are right.
    pub rms_over_standard_error: Option<f64>,
    /// Mean interval score, in ln: the interval's width plus forty times the distance of a truth
    /// outside the interval from it (Gneiting and Raftery, J. Am. Stat. Assoc. 102, 2007, eq. 43).
    /// Smaller is better.
    pub interval_score_ln: Option<f64>,
    /// Half of the intervals' median width, in ln.
    pub half_width_ln: Option<f64>,
    /// Part of the estimates with an error above four of their own standard errors and above 5 %.
    pub narrow_and_wrong_part: Option<f64>,
    /// Root mean square error of the two-state formula, which uses rest and peak only.
    pub plain_rms_ln: Option<f64>,
}

impl Counted {
    /// Computes the statistics of presses.
    pub fn of<'p>(presses: impl Iterator<Item = &'p Press>) -> Self {
        let (mut claims, mut refused): (Vec<(&Press, &Claim)>, usize) = (Vec::new(), 0);
        for press in presses {
            match &press.outcome {
                Ok(claim) => claims.push((press, claim)),
                Err(_) => refused += 1,
            }
        }
        let errors: Vec<f64> = claims
            .iter()
            .filter_map(|(press, claim)| press.error_ln(claim.estimate_n_per_m?))
            .collect();
        let plain: Vec<f64> = claims
            .iter()
            .filter_map(|(press, claim)| press.error_ln(claim.two_state_n_per_m?))
            .collect();
        let widths: Vec<f64> = claims
            .iter()
            .filter_map(|(_, claim)| claim.half_width_ln())
            .collect();
        let scores: Vec<f64> = claims
            .iter()
            .filter_map(|(press, claim)| claim.score_ln(press.true_n_per_m))
            .collect();
        let ratios: Vec<f64> = claims.iter().map(|(press, _)| press.true_ratio).collect();
        let standardised: Vec<f64> = claims
            .iter()
            .filter_map(|(press, claim)| standard_errors(press, claim))
            .collect();
        let half_width_ln = quantile(&widths, 0.5);
        let part = |is: &dyn Fn(&Press, &Claim) -> bool| {
            let count = claims.iter().filter(|(press, claim)| is(press, claim));
            (!claims.is_empty()).then(|| count.count() as f64 / claims.len() as f64)
        };
        Self {
            accepted: claims.len(),
            refused,
            rms_ln: root_mean_square(&errors),
            bias_ln: mean(&errors),
            true_ratio: quantile(&ratios, 0.5),
            coverage95: part(&|press, claim| claim.holds(press.true_n_per_m)),
            rms_over_standard_error: root_mean_square(&standardised),
            interval_score_ln: mean(&scores),
            half_width_ln,
            narrow_and_wrong_part: part(&|press, claim| is_narrow_and_wrong(press, claim)),
            plain_rms_ln: root_mean_square(&plain),
        }
    }

    /// Number of intervals that contain the truth.
    pub fn covered(&self) -> usize {
        self.of_accepted(self.coverage95)
    }

    /// Number of narrow and wrong estimates.
    pub fn narrow_and_wrong(&self) -> usize {
        self.of_accepted(self.narrow_and_wrong_part)
    }

    /// Coverage for one load, with its bounds; each sensor has one press.
    pub fn coverage(&self) -> Coverage {
        let covered = self.covered();
        Coverage::of((0..self.accepted).map(|index| (usize::from(index < covered), 1)))
    }

    fn of_accepted(&self, part: Option<f64>) -> usize {
        (part.unwrap_or(0.0) * self.accepted as f64).round() as usize
    }
}

fn is_narrow_and_wrong(press: &Press, claim: &Claim) -> bool {
    let Some(standard_errors) = standard_errors(press, claim) else {
        return !claim.holds(press.true_n_per_m);
    };
    let error_ln = claim.estimate_n_per_m.and_then(|of| press.error_ln(of));
    standard_errors.abs() > STANDARD_ERRORS && error_ln.is_none_or(|error| error.abs() > BEYOND)
}

/// Error of c_S/c_L over its own standard error; `None` where there is only a lower bound.
fn standard_errors(press: &Press, claim: &Claim) -> Option<f64> {
    let of_true = claim.estimate_n_per_m? / press.true_n_per_m;
    Some(claim.load_ratio * (1.0 - of_true) / claim.load_ratio_standard_error)
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn root_mean_square(values: &[f64]) -> Option<f64> {
    let squares: Vec<f64> = values.iter().map(|value| value * value).collect();
    mean(&squares).map(f64::sqrt)
}

/// The quantile `part` of the values; `None` without values.
pub fn quantile(values: &[f64], part: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = part * sorted.len().saturating_sub(1) as f64;
    sorted.get(index.round() as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::world::World;

    /// A press onto a load of 1 kN/m, whose estimate has this relative error and a standard error
    /// of 1 %.
    fn press(error: f64) -> Press {
        let estimate_n_per_m = 1e3 * (1.0 + error);
        Press {
            world: World::Calibrated,
            ratio: 1.0,
            true_ratio: 0.9,
            true_n_per_m: 1e3,
            outcome: Ok(Claim {
                estimate_n_per_m: Some(estimate_n_per_m),
                lower_n_per_m: estimate_n_per_m / 1.02,
                upper_n_per_m: Some(estimate_n_per_m * 1.02),
                load_ratio: 6.0,
                load_ratio_standard_error: 0.06,
                reduced_chi_square: Some(1.0),
                two_state_n_per_m: Some(2e3),
            }),
        }
    }

    #[test]
    fn figures_are_those_of_known_errors() {
        let refused = Press {
            outcome: Err("misfit: 1; limit 0".to_owned()),
            ..press(0.0)
        };
        let presses = [press(0.01), press(-0.01), press(0.03), press(0.1), refused];
        let counted = Counted::of(presses.iter());
        assert_eq!((counted.accepted, counted.refused), (4, 1));
        assert_eq!(counted.coverage95, Some(0.5));
        // Only the error of 10 % counts: it exceeds four standard errors, which are 1 % each, and
        // 5 %.
        assert_eq!(counted.narrow_and_wrong_part, Some(0.25));
        let near = |value: Option<f64>, expected: f64| {
            assert!(
                (value.unwrap() / expected - 1.0).abs() < 1e-6,
                "{value:?} {expected}"
            );
        };
        near(counted.true_ratio, 0.9);
        near(counted.half_width_ln, 1.02_f64.ln());
        // The standard error is 1 %, so an error in per cent is also its number of standard errors.
        near(
            counted.rms_over_standard_error,
            ((1.0 + 1.0 + 9.0 + 100.0) / 4.0_f64).sqrt(),
        );
        // For the errors of 3 % and 10 % the truth lies below the lower end of the interval.
        let beyond = (1.03_f64 / 1.02).ln() + (1.1_f64 / 1.02).ln();
        near(
            counted.interval_score_ln,
            2.0 * 1.02_f64.ln() + 40.0 * beyond / 4.0,
        );
        near(counted.plain_rms_ln, 2_f64.ln());
        let errors = [1.01, 0.99, 1.03, 1.1].map(f64::ln);
        near(counted.bias_ln, errors.iter().sum::<f64>() / 4.0);
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        near(counted.rms_ln, (squares / 4.0).sqrt());
    }

    #[test]
    fn of_nothing_there_are_no_figures() {
        assert_eq!(Counted::of([].iter()), Counted::default());
    }
}
