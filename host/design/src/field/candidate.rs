//! Candidates of an optimisation: a design's figures at its current, and their limits.

use clap::{Args, ValueEnum};
use palpate_cli::failure::Failure;
use palpate_field::design::Design;
use palpate_field::layer::{Elastomer, Layer, pad_spring_n_per_m};
use palpate_field::solve::Solved;

use super::stack::{SensingLayer, expected_error_ln};
use super::tables::BeyondTable;

/// Goal of the optimisation.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum Goal {
    /// eps w_D w_L at the design's current: the part of the stiffness' error that noise makes falls as
    /// this rises. It is not the expected error: temperature, creep and calibration are not in it
    Merit,
    /// Relative rise of the actuated spring at the design's current, per watt
    RisePerWatt,
    /// Least std/mean of |B| in the core at the design's current
    Homogeneity,
    /// Least expected error of a press on a load as stiff as the sensing layer, as by `palpate plan`
    StiffnessError,
}

/// Stiffening by the elastomer between the boards.
#[derive(Clone, Copy, Debug)]
struct Stiffening {
    /// Relative rise of the actuated spring's stiffness.
    rise: f64,
    /// Share of the actuated layer in the whole compliance.
    layer_share: f64,
    /// Share in the whole compliance of a load as stiff as the sensing layer.
    load_share: f64,
}

impl Stiffening {
    fn of(layer: &Layer, elastomer: &Elastomer) -> Self {
        let [radius_m, height_m] = SensingLayer::REFERENCE.pad_m;
        let sensing = 1.0 / pad_spring_n_per_m(elastomer, radius_m, height_m);
        let actuated = 1.0 / layer.spring_n_per_m;
        let whole = actuated + 2.0 * sensing;
        Self {
            rise: layer.stiffening,
            layer_share: actuated / whole,
            load_share: sensing / whole,
        }
    }

    fn merit(&self) -> f64 {
        self.rise * self.layer_share * self.load_share
    }
}

/// A design's figures at a current, in SI units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    stiffening: Option<Stiffening>,
    homogeneity: f64,
    /// Expected standard error of ln(c_L) for a press onto c_S; `None` without a plan.
    stiffness_error_ln: Option<f64>,
    current_a: f64,
    power_w: f64,
    height_m: f64,
    diameter_m: f64,
    force_n: f64,
    plate_max_t: f64,
    /// Greatest excess of the field over the end of a material's table, T; 0 within all tables.
    beyond_table_t: f64,
}

impl Candidate {
    /// Computes the figures of a design solved at a current, A.
    pub(super) fn of(
        design: &Design,
        current_a: f64,
        elastomer: &Elastomer,
        solved: &Solved,
        goal: Goal,
    ) -> Result<Self, Failure> {
        let planned = expected_error_ln(design, elastomer, current_a, solved);
        let stiffness_error_ln = match goal {
            Goal::StiffnessError => Some(planned.map_err(unplanned)?),
            Goal::Merit | Goal::RisePerWatt | Goal::Homogeneity => planned.ok(),
        };
        let layer = Layer::of(design, solved, elastomer);
        let [low, high] = design.height_m();
        Ok(Self {
            stiffening: layer.map(|layer| Stiffening::of(&layer, elastomer)),
            homogeneity: solved.figures.cv[0],
            stiffness_error_ln,
            current_a,
            power_w: current_a.powi(2) * design.resistance_ohm(),
            height_m: high - low,
            diameter_m: 2.0 * design.radius_m(),
            force_n: solved.figures.force_n.abs(),
            plate_max_t: solved.figures.plate_max_t,
            beyond_table_t: (BeyondTable::all(design, solved).iter())
                .map(BeyondTable::excess_t)
                .fold(0.0, f64::max),
        })
    }

    /// Figure for the goal; `None` if the design has none.
    fn figure(&self, goal: Goal) -> Option<f64> {
        match goal {
            Goal::Merit => self.stiffening.map(|s| s.merit()),
            Goal::RisePerWatt => self.stiffening.map(|s| s.rise / self.power_w),
            Goal::Homogeneity => Some(self.homogeneity),
            Goal::StiffnessError => self.stiffness_error_ln,
        }
    }

    /// Power at the design's current, W.
    pub(super) const fn power_w(&self) -> f64 {
        self.power_w
    }

    pub(super) const fn current_a(&self) -> f64 {
        self.current_a
    }

    /// Score for the goal and the limits.
    pub(super) fn score(&self, goal: Goal, limits: &Limits) -> Result<Score, Failure> {
        let figure = self.figure(goal).ok_or_else(|| {
            let reason = "no elastomer lies between the boards, so there is no actuated spring: add a \
                          [[body]] there, or take --goal homogeneity";
            Failure::Refused(reason.to_owned())
        })?;
        let sign = match goal {
            Goal::Homogeneity | Goal::StiffnessError => -1.0,
            Goal::Merit | Goal::RisePerWatt => 1.0,
        };
        Ok(Score {
            excess: limits.of(self).iter().map(Limited::excess).sum(),
            value: sign * figure,
        })
    }

    /// Lists every figure with its limit, one per line.
    pub(super) fn explain(&self, limits: &Limits) -> String {
        let mut text = String::new();
        if let Some(s) = &self.stiffening {
            text.push_str(&format!(
                "  merit eps w_D w_L   {:.5} = {:.4} x {:.4} x {:.4}\n  rise per watt       {:.5}\n",
                s.merit(),
                s.rise,
                s.layer_share,
                s.load_share,
                s.rise / self.power_w
            ));
        }
        text.push_str(&format!("  std/mean of |B|     {:.5}\n", self.homogeneity));
        let error = self.stiffness_error_ln;
        let error = error.map_or_else(
            || "no plan: a calibration would be refused".to_owned(),
            |error_ln| format!("{error_ln:.5} expected at c_S, as by `palpate plan`"),
        );
        text.push_str(&format!("  error of stiffness  {error}\n"));
        for limited in limits.of(self) {
            text.push_str(&limited.explain());
        }
        if self.beyond_table_t > 0.0 {
            text.push_str(&format!(
                "  beyond a table      {:.4} T, where B rises as in vacuum\n",
                self.beyond_table_t
            ));
        }
        text
    }
}

/// Adds a remedy to the error of a design without a plan.
fn unplanned(cause: Failure) -> Failure {
    match cause {
        Failure::Refused(reason) => Failure::Refused(format!(
            "{reason}. Begin with --goal merit, which needs no plan"
        )),
        other => other,
    }
}

/// Rank of a candidate: first by the excess over its limits, then by its goal.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct Score {
    /// Sum of the relative excesses over all limits; 0 within them.
    excess: f64,
    /// Value of the goal; greater is better.
    value: f64,
}

impl Score {
    /// Whether this score is better than another.
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        self.excess < other.excess || (self.excess == other.excess && self.value > other.value)
    }

    /// The goal's figure.
    pub(super) fn figure(&self) -> f64 {
        self.value.abs()
    }

    /// Whether the candidate keeps all limits.
    pub(super) fn is_allowed(&self) -> bool {
        self.excess == 0.0
    }
}

/// Limits that every design has to keep.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Most power at the design's current, W
    #[arg(long, value_name = "W", value_parser = limit)]
    most_power: Option<f64>,
    /// Greatest height of the whole design along the axis, mm
    #[arg(long, value_name = "MM", value_parser = limit)]
    most_height: Option<f64>,
    /// Greatest diameter, mm
    #[arg(long, value_name = "MM", value_parser = limit)]
    most_diameter: Option<f64>,
    /// Greatest attraction of the halves, N
    #[arg(long, value_name = "N", value_parser = limit)]
    most_force: Option<f64>,
    /// Greatest flux density in the plates, T
    #[arg(long, value_name = "T", value_parser = limit)]
    most_plate_field: Option<f64>,
}

fn limit(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("allowed: a number above 0".into()),
    }
}

/// A figure with its limit, in the limit's unit.
struct Limited {
    name: &'static str,
    unit: &'static str,
    value: f64,
    most: Option<f64>,
}

impl Limits {
    /// Whether the greatest field in the plates has a limit.
    pub(super) const fn has_plates(&self) -> bool {
        self.most_plate_field.is_some()
    }

    fn of(&self, candidate: &Candidate) -> [Limited; 5] {
        let limited = |name, unit, value, most| Limited {
            name,
            unit,
            value,
            most,
        };
        [
            limited("power", "W", candidate.power_w, self.most_power),
            limited("height", "mm", 1e3 * candidate.height_m, self.most_height),
            limited(
                "diameter",
                "mm",
                1e3 * candidate.diameter_m,
                self.most_diameter,
            ),
            limited("attraction", "N", candidate.force_n, self.most_force),
            limited(
                "field in plates",
                "T",
                candidate.plate_max_t,
                self.most_plate_field,
            ),
        ]
    }
}

impl Limited {
    /// Relative excess over the limit.
    fn excess(&self) -> f64 {
        self.most
            .map_or(0.0, |most| (self.value / most - 1.0).max(0.0))
    }

    fn explain(&self) -> String {
        // A figure without a limit is not computed, if that takes time.
        if self.value.is_nan() {
            return String::new();
        }
        let Self {
            name,
            unit,
            value,
            most,
        } = self;
        let limit = match most {
            None => String::new(),
            Some(most) if self.excess() > 0.0 => format!(", above the limit of {most}"),
            // Within 1 % the value is at the limit, since the search's finest step is a hundredth.
            Some(most) if *value > 0.99 * most => format!(", at the limit of {most}"),
            Some(most) => format!(", limit {most}"),
        };
        format!("  {name:<19} {value:.4} {unit}{limit}\n")
    }
}

#[cfg(test)]
mod tests {
    use palpate_field::design::builtin;
    use palpate_field::solve::{Accuracy, Excitation, solve};

    use super::*;

    /// docs/field.md states 0.022 for eps w_D w_L of the closed circuit with soft elastomer at 5 A.
    #[test]
    fn the_merit_is_that_of_the_docs() {
        let design = builtin("closed").unwrap();
        let excitation = Excitation::saturating(&design, 5.0);
        let solved = solve(&design, &excitation, &Accuracy::default()).unwrap();
        let layer = Layer::of(&design, &solved, &Elastomer::SOFT).unwrap();
        let merit = Stiffening::of(&layer, &Elastomer::SOFT).merit();
        assert!((merit / 0.0217 - 1.0).abs() < 0.01, "{merit}");
    }

    /// `palpate field stack closed --mse soft --out closed.toml` and `palpate plan closed.toml`
    /// give 7.67 % at c_S; a smaller current stiffens less.
    #[test]
    fn the_error_is_that_of_palpate_plan() {
        let design = builtin("closed").unwrap();
        let error_at = |current_a: f64| {
            let excitation = Excitation::saturating(&design, current_a);
            let solved = solve(&design, &excitation, &Accuracy::default()).unwrap();
            let goal = Goal::StiffnessError;
            let candidate = Candidate::of(&design, current_a, &Elastomer::SOFT, &solved, goal)?;
            Ok::<_, Failure>(candidate.stiffness_error_ln.unwrap())
        };
        let error_ln = error_at(5.0).unwrap();
        assert!((error_ln / 0.0767 - 1.0).abs() < 1e-3, "{error_ln}");
        assert!(error_at(4.0).unwrap() > error_ln);
    }

    #[test]
    fn limits_come_before_the_goal() {
        let score = |excess: f64, value: f64| Score { excess, value };
        assert!(score(0.0, 1.0).is_better_than(&score(0.1, 2.0)));
        assert!(score(0.1, 0.0).is_better_than(&score(0.2, 2.0)));
        assert!(score(0.0, 2.0).is_better_than(&score(0.0, 1.0)));
        assert!(!score(0.0, 1.0).is_better_than(&score(0.0, 1.0)));
    }
}
