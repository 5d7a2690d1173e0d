//! Coverage of intervals of 95 %: how many contain the truth, and the judgement about them.

use palpate_cli::failure::Failure;
use serde::Serialize;

/// Number of intervals that contain the truth, with bounds. The statistical unit is the sensor: its
/// presses share one calibration, so their intervals tend to cover or to miss together.
///
/// The bounds are those of Clopper and Pearson (Biometrika 26, 1934, p. 404), exact for one press
/// of each sensor. For several presses they use the number of independent presses with the same
/// scatter (Korn and Graubard, Survey Methodology 24, 1998, p. 193).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// Intervals that contain the truth.
    pub covered: usize,
    /// All intervals.
    pub intervals: usize,
    /// Lower end of the 95 % confidence interval of the fraction that contains the truth.
    pub lower: f64,
    /// Upper end of that confidence interval.
    pub upper: f64,
}

/// Judgement about intervals of 95 %. Its rule is fixed before a campaign runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Judgement {
    /// The lower bound of the coverage is at least 92 %.
    Pass,
    /// The upper bound of the coverage is below 95 %.
    Fail,
    /// Neither, since the sensors are too few.
    Undecided,
}

/// Lower bound of the coverage from which intervals pass.
const PASSES_FROM: f64 = 0.92;
/// Stated coverage of the intervals.
const STATED: f64 = 0.95;
/// Probability beyond each end of the bounds.
const EACH_END: f64 = 0.025;

impl Coverage {
    /// Computes the coverage. Each sensor is given by its numbers of covered intervals and of all
    /// intervals.
    pub fn of(sensors: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let sensors = sensors.into_iter().filter(|(_, intervals)| *intervals > 0);
        let sensors: Vec<(usize, usize)> = sensors.collect();
        let sum = |of: fn(&(usize, usize)) -> usize| sensors.iter().map(of).sum::<usize>();
        let (covered, intervals) = (sum(|of| of.0), sum(|of| of.1));
        if intervals == 0 {
            return Self::default();
        }
        let part = covered as f64 / intervals as f64;
        let independent = independent(&sensors, part);
        let (holding, missing) = (part * independent, (1.0 - part) * independent);
        Self {
            covered,
            intervals,
            lower: if covered == 0 {
                0.0
            } else {
                beta_quantile(holding, missing + 1.0, EACH_END)
            },
            upper: if covered == intervals {
                1.0
            } else {
                beta_quantile(holding + 1.0, missing, 1.0 - EACH_END)
            },
        }
    }

    /// Judges the intervals.
    pub fn judgement(&self) -> Judgement {
        if self.intervals > 0 && self.upper < STATED {
            Judgement::Fail
        } else if self.lower >= PASSES_FROM {
            Judgement::Pass
        } else {
            Judgement::Undecided
        }
    }

    /// Fails if the intervals, named by `of`, fail.
    ///
    /// # Errors
    /// States the coverage with its bounds.
    pub fn required(&self, of: &str) -> Result<(), Failure> {
        if self.judgement() != Judgement::Fail {
            return Ok(());
        }
        Err(Failure::Refused(format!(
            "{of}: {} of {} intervals of 95 % contain the truth; with 95 % confidence these are {:.1} % to {:.1} % of all such intervals",
            self.covered,
            self.intervals,
            self.lower * 100.0,
            self.upper * 100.0
        )))
    }
}

impl Judgement {
    /// The judgement in a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::Undecided => "undecided",
        }
    }
}

/// Effective number of presses: as many independent presses would give the covered part the same
/// variance. At most the number of presses; without any variance the number of sensors.
fn independent(sensors: &[(usize, usize)], part: f64) -> f64 {
    let count = sensors.len() as f64;
    let intervals = sensors.iter().map(|of| of.1).sum::<usize>() as f64;
    let deviations = sensors.iter().map(|(covered, intervals)| {
        let deviation = *covered as f64 - part * *intervals as f64;
        deviation * deviation
    });
    let variance =
        deviations.sum::<f64>() / (intervals * intervals) * count / (count - 1.0).max(1.0);
    // For n independent presses the covered part p has the variance p (1 - p)/(n - 1).
    let alone = part * (1.0 - part) / (intervals - 1.0).max(1.0);
    if alone == 0.0 || variance == 0.0 {
        return count;
    }
    (intervals * alone / variance).min(intervals)
}

/// Quantile of the beta distribution at the probability `below`, by bisection. `a` and `b` must be
/// above zero.
fn beta_quantile(a: f64, b: f64, below: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    // Fifty halvings leave an error of 1e-15.
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if beta_probability(a, b, middle) < below {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Regularised incomplete beta function: the probability below `x`.
fn beta_probability(a: f64, b: f64, x: f64) -> f64 {
    // The fraction converges fast below the mean. Above, I_x(a, b) = 1 - I_(1-x)(b, a).
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta_probability(b, a, 1.0 - x);
    }
    let logarithm =
        libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * x.ln() + b * (-x).ln_1p();
    logarithm.exp() / (a * continued_fraction(a, b, x))
}

/// Continued fraction of the incomplete beta function (DLMF 8.17.22), evaluated from its last term
/// to its first.
fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    /// Number of terms that leave an error of less than 1e-12 for 100,000 presses.
    const TERMS: u32 = 1_000;
    (1..=TERMS).rev().fold(1.0, |fraction, term| {
        let m = f64::from(term / 2);
        let numerator = if term % 2 == 0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        1.0 + numerator / fraction
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn once(covered: usize, missed: usize) -> Coverage {
        Coverage::of(
            [(1, 1)]
                .repeat(covered)
                .into_iter()
                .chain([(0, 1)].repeat(missed)),
        )
    }

    /// Compares with the binomial sums by which Clopper and Pearson define the bounds.
    #[test]
    fn the_bounds_of_one_press_a_sensor_are_those_of_the_binomial_distribution() {
        let at_most = |k: usize, n: usize, p: f64| {
            let mut term = (1.0 - p).powi(i32::try_from(n).unwrap());
            let mut sum = term;
            for i in 0..k {
                term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
                sum += term;
            }
            sum
        };
        for (covered, all) in [(1, 10), (9, 10), (57, 60), (190, 200), (192, 200)] {
            let coverage = once(covered, all - covered);
            // Sums over the misses, since the terms over the covered intervals underflow.
            let missing = all - covered;
            let below = 1.0 - at_most(missing - 1, all, 1.0 - coverage.upper);
            let above = at_most(missing, all, 1.0 - coverage.lower);
            assert!((below - 0.025).abs() < 1e-9, "{covered} of {all}: {below}");
            assert!((above - 0.025).abs() < 1e-9, "{covered} of {all}: {above}");
        }
        // If all ten intervals cover, the lower bound is the tenth root of 0.025.
        let all_hold = once(10, 0);
        assert!((all_hold.lower - 0.025_f64.powf(0.1)).abs() < 1e-12 && all_hold.upper == 1.0);
        assert_eq!(once(0, 10).lower, 0.0);
    }

    #[test]
    fn presses_of_one_sensor_that_hold_or_miss_together_count_once() {
        let alone = once(19, 1);
        let ten_each = Coverage::of([(10, 10)].repeat(19).into_iter().chain([(0, 10)]));
        assert_eq!((ten_each.covered, ten_each.intervals), (190, 200));
        let near = |one: f64, other: f64| assert!((one - other).abs() < 0.01, "{one} {other}");
        near(ten_each.lower, alone.lower);
        near(ten_each.upper, alone.upper);
        // Again 190 of 200, but ten sensors miss once each: the presses are independent, so each counts.
        let apart = Coverage::of(
            [(9, 10)]
                .repeat(10)
                .into_iter()
                .chain([(10, 10)].repeat(10)),
        );
        assert!(apart.lower > ten_each.lower + 0.1, "{apart:?}");
    }

    #[test]
    fn many_sensors_decide_and_few_do_not() {
        assert_eq!(once(193, 7).judgement(), Judgement::Pass);
        assert_eq!(once(190, 10).judgement(), Judgement::Undecided);
        assert_eq!(once(180, 20).judgement(), Judgement::Fail);
        assert_eq!(once(12, 0).judgement(), Judgement::Undecided);
        assert_eq!(Coverage::default().judgement(), Judgement::Undecided);
        // A limit of three standard deviations below 95 % would let 25 of 30 sensors pass.
        assert_eq!(once(25, 5).judgement(), Judgement::Fail);
    }
}
