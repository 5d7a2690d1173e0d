//! Designs with varied numbers, and a compass search among them.

use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_field::design::vary;
use palpate_field::layer::Elastomer;
use palpate_field::solve::{Excitation, Figure, Wanted};
use rayon::prelude::*;

use super::candidate::{Candidate, Goal, Limits, Score};
use super::drive::{Drive, field_for, reached};
use super::input::{DesignSource, Effort, parse, say_files, text_of};
use super::mse::elastomer;
use super::sweep::range;

/// Path of a varied number, and its bounds.
type Varied = (String, f64, f64);

/// What is searched, and for what.
#[derive(Args)]
pub(super) struct SearchArguments {
    #[command(flatten)]
    source: DesignSource,
    /// Goal of the optimisation
    #[arg(long, value_enum, default_value = "stiffness-error")]
    pub(super) goal: Goal,
    /// A number of the design and its bounds
    #[arg(long, required = true, value_name = "PATH=FROM..TO", value_parser = range)]
    pub(super) vary: Vec<Varied>,
    #[command(flatten)]
    pub(super) limits: Limits,
    /// The elastomer, for the stiffness: soft, ultrasoft or a file
    #[arg(long, default_value = "soft", value_name = "NAME|FILE")]
    mse: String,
}

impl SearchArguments {
    /// Reads the design and the elastomer.
    pub(super) fn open(&self) -> Result<Search<'_>, Failure> {
        let (name, text) = text_of(&self.source.design)?;
        say_files(&parse(&name, &text, &[])?);
        Ok(Search {
            arguments: self,
            name: name.into(),
            text,
            elastomer: elastomer(&self.mse)?,
            effort: self.source.effort.clone(),
            power_w: None,
            linear: false,
        })
    }
}

/// Figures on which goals depend.
pub(super) const JUDGED: [Figure; 4] = [
    Figure::CoreMean,
    Figure::CvWhole,
    Figure::Linkage,
    Figure::Force,
];
/// [`JUDGED`] and the greatest field in the plates, for its limit.
const JUDGED_WITH_PLATES: [Figure; 5] = [
    Figure::CoreMean,
    Figure::CvWhole,
    Figure::Linkage,
    Figure::Force,
    Figure::PlateMax,
];
/// First step of a search from any point, as a share of the range between the bounds of a number.
pub(super) const FAR: f64 = 0.25;
/// First step of a search that starts near the optimum, as a share of the range between the bounds
/// of a number.
pub(super) const NEAR: f64 = 0.0625;
/// Smallest step, as a share of the range between the bounds of a number.
const FINEST: f64 = 0.01;
/// Two values of a number count as equal if they differ by less than this share of the range
/// between its bounds: adding and subtracting one step leaves a rounding error.
const SAME: f64 = 1e-9;

/// Search space: all designs that the varied numbers can give.
#[derive(Clone)]
pub(super) struct Search<'s> {
    arguments: &'s SearchArguments,
    name: PathBuf,
    text: String,
    elastomer: Elastomer,
    effort: Effort,
    /// Power of each design, W; `None` where each has its own current.
    power_w: Option<f64>,
    /// Whether designs are solved without saturation.
    linear: bool,
}

/// A point within the bounds, from 0 to 1 along each number, with its result.
#[derive(Clone)]
pub(super) struct Tried {
    pub(super) place: Vec<f64>,
    pub(super) candidate: Candidate,
    pub(super) score: Score,
}

impl Search<'_> {
    /// Returns this search with each design at the current that gives this power, W.
    pub(super) fn at_power(&self, power_w: f64) -> Self {
        Self {
            power_w: Some(power_w),
            ..self.clone()
        }
    }

    /// Returns this search without saturation.
    pub(super) fn linear(&self) -> Self {
        Self {
            linear: true,
            ..self.clone()
        }
    }

    /// Returns this search with the accuracy `relative`, or with its own if that is coarser.
    pub(super) fn at_most_accurate(&self, relative: f64) -> Self {
        Self {
            effort: self.effort.at_most_accurate(relative),
            ..self.clone()
        }
    }

    /// Returns the user's own design as a point within the bounds.
    pub(super) fn start(&self) -> Result<Vec<f64>, Failure> {
        let settings = &self.effort.settings;
        let text = vary::set(&self.text, settings).map_err(Failure::Argument)?;
        let share = |(path, low, high): &Varied| {
            let value = vary::get(&text, path).map_err(Failure::Argument)?;
            if low < high && (*low..=*high).contains(&value) {
                return Ok((value - low) / (high - low));
            }
            Err(Failure::Argument(format!(
                "--vary {path}={low}..{high}: the design has {value}, where the search begins: choose growing bounds around it, or --set another"
            )))
        };
        self.arguments.vary.iter().map(share).collect()
    }

    /// Returns the settings of `--set`, followed by the settings of a point.
    pub(super) fn settings(&self, place: &[f64]) -> Vec<(String, f64)> {
        let mut settings = self.effort.settings.clone();
        let places = self.arguments.vary.iter().zip(place);
        settings
            .extend(places.map(|((path, low, high), s)| (path.clone(), low + s * (high - low))));
        settings
    }

    /// Returns the text of the design at a point.
    pub(super) fn text_at(&self, place: &[f64]) -> Result<String, Failure> {
        vary::set(&self.text, &self.settings(place)).map_err(Failure::Refused)
    }

    /// Solves the design at a point.
    pub(super) fn attempt(&self, place: Vec<f64>) -> Result<Tried, Failure> {
        let name = self.name.to_string_lossy();
        let design = parse(&name, &self.text, &self.settings(&place))?;
        let current_a = match self.power_w {
            Some(power_w) => (power_w / design.resistance_ohm()).sqrt(),
            None => design.current_a,
        };
        let wanted = match self.arguments.limits.has_plates() {
            true => Wanted::Only(&JUDGED_WITH_PLATES),
            false => Wanted::Only(&JUDGED),
        };
        let saturating = Drive::of(&design, Some(current_a))?;
        let solved = if self.linear {
            let excitation = Excitation::small(&design, current_a);
            field_for(&design, &excitation, &self.effort, wanted)?
        } else {
            saturating.attempt_for(&design, &self.effort, wanted)?
        };
        reached(&design, &solved)?;
        let SearchArguments { goal, limits, .. } = self.arguments;
        let candidate = Candidate::of(&design, current_a, &self.elastomer, &solved, *goal)?;
        let score = candidate.score(*goal, limits)?;
        Ok(Tried {
            place,
            candidate,
            score,
        })
    }

    /// Improves a design by a compass search: tries both directions along each number, moves to the
    /// best, and halves the step when no neighbour is better. `first_step` is a share of the range
    /// between a number's bounds. After each round the search calls `tried` with the best design so
    /// far, the number of tried designs, and whether the best is new. Returns the best design and
    /// the number of tried designs.
    pub(super) fn climb(
        &self,
        start: Tried,
        first_step: f64,
        budget: u64,
        mut tried: impl FnMut(&Tried, u64, bool) -> Result<(), Failure>,
    ) -> Result<(Tried, u64), Failure> {
        let mut seen = vec![start.place.clone()];
        let mut best = start;
        let mut step = first_step;
        while step >= FINEST && (seen.len() as u64) < budget {
            let mut places = neighbours(&best.place, step);
            places.retain(|place| !seen.iter().any(|other| is_same(place, other)));
            seen.extend_from_slice(&places);
            let round = places.into_par_iter();
            let round: Vec<Tried> = round.filter_map(|place| self.attempt(place).ok()).collect();
            let before = best.score;
            for other in round {
                if other.score.is_better_than(&best.score) {
                    best = other;
                }
            }
            let better = best.score.is_better_than(&before);
            tried(&best, seen.len() as u64, better)?;
            if !better {
                step *= 0.5;
            }
        }
        Ok((best, seen.len() as u64))
    }
}

/// Whether two points are equal within [`SAME`].
pub(super) fn is_same(one: &[f64], other: &[f64]) -> bool {
    one.iter().zip(other).all(|(a, b)| (a - b).abs() < SAME)
}

/// Neighbours one step away along each number, within the bounds.
fn neighbours(best: &[f64], step: f64) -> Vec<Vec<f64>> {
    let mut points = Vec::new();
    for axis in 0..best.len() {
        for side in [-step, step] {
            let mut point = best.to_vec();
            if let Some(s) = point.get_mut(axis) {
                *s = (*s + side).clamp(0.0, 1.0);
            }
            if point != best {
                points.push(point);
            }
        }
    }
    points
}

/// Returns a point of a sequence with low discrepancy in n dimensions, so that different numbers
/// give distant points: the additive sequence of the root of x^(n+1) = x + 1 (Roberts, 2018).
pub(super) fn spread(number: u32, dimensions: usize) -> Vec<f64> {
    let power = 1.0 / (dimensions as f64 + 1.0);
    let mut root = 1.5_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(power);
    }
    let along = |axis: usize| (0.5 + f64::from(number) * root.powi(-(axis as i32 + 1))).fract();
    (0..dimensions).map(along).collect()
}

/// Returns the Pareto front by rising power: each design is better than all designs of less power.
pub(super) fn not_beaten<T>(
    mut tried: Vec<T>,
    power_w: impl Fn(&T) -> f64,
    is_better: impl Fn(&T, &T) -> bool,
) -> Vec<T> {
    tried.sort_by(|a, b| power_w(a).total_cmp(&power_w(b)));
    let mut front: Vec<T> = Vec::new();
    for other in tried {
        match front.last_mut() {
            Some(last) if !is_better(&other, last) => {}
            // Keeps only the best of several designs with the same power.
            Some(last) if power_w(&other) <= power_w(last) => *last = other,
            _ => front.push(other),
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_another_beats_is_not_on_the_front() {
        let tried = vec![
            (3.0, 5.0),
            (1.0, 1.0),
            (2.0, 4.0),
            (2.0, 3.0),
            (2.5, 2.0),
            (1.0, 2.0),
        ];
        let front = not_beaten(tried, |design| design.0, |one, other| one.1 > other.1);
        assert_eq!(front, [(1.0, 2.0), (2.0, 4.0), (3.0, 5.0)]);
    }

    #[test]
    fn starts_are_spread_over_the_bounds() {
        let places: Vec<Vec<f64>> = (0..20).map(|number| spread(number, 2)).collect();
        let quarter = |place: &[f64]| (place[0] < 0.5, place[1] < 0.5);
        for which in [(true, true), (true, false), (false, true), (false, false)] {
            let count = places
                .iter()
                .filter(|place| quarter(place) == which)
                .count();
            assert!((4..=6).contains(&count), "{count} in {which:?}");
        }
    }
}
