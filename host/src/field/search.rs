//! Designs that a text's numbers span, and a compass search among them.

use std::path::PathBuf;

use palpate_field::design::vary;
use palpate_field::layer::Elastomer;
use rayon::prelude::*;

use super::candidate::{Candidate, Goal, Limits, Score};
use super::input::{DesignSource, parse, text_of};
use crate::failure::Failure;

/// A number of the design by its path, and its bounds.
pub(super) type Varied = (String, f64, f64);

/// Steps end at this share of the bounds.
const FINEST: f64 = 0.01;

/// The designs that a text spans.
pub(super) struct Search<'s> {
    name: PathBuf,
    text: String,
    source: &'s DesignSource,
    vary: &'s [Varied],
    elastomer: Elastomer,
    goal: Goal,
}

/// A place within the bounds, from 0 to 1 along each number, and what was found there.
#[derive(Clone)]
pub(super) struct Tried {
    pub(super) place: Vec<f64>,
    pub(super) candidate: Candidate,
    pub(super) score: Score,
}

impl<'s> Search<'s> {
    /// The designs of a source, of which some numbers vary.
    pub(super) fn of(
        source: &'s DesignSource,
        vary: &'s [Varied],
        elastomer: Elastomer,
        goal: Goal,
    ) -> Result<Self, Failure> {
        let (name, text) = text_of(&source.design)?;
        Ok(Self {
            name: name.into(),
            text,
            source,
            vary,
            elastomer,
            goal,
        })
    }

    /// The user's own design as a place within the bounds.
    pub(super) fn start(&self) -> Result<Vec<f64>, Failure> {
        let settings = &self.source.effort.settings;
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
        self.vary.iter().map(share).collect()
    }

    /// The numbers of a place, after those of `--set`.
    pub(super) fn settings(&self, place: &[f64]) -> Vec<(String, f64)> {
        let mut settings = self.source.effort.settings.clone();
        let places = self.vary.iter().zip(place);
        settings
            .extend(places.map(|((path, low, high), s)| (path.clone(), low + s * (high - low))));
        settings
    }

    /// The design's text at a place.
    pub(super) fn text_at(&self, place: &[f64]) -> Result<String, Failure> {
        vary::set(&self.text, &self.settings(place)).map_err(Failure::Refused)
    }

    /// Solves the design at a place.
    pub(super) fn attempt(&self, place: Vec<f64>, limits: &Limits) -> Result<Tried, Failure> {
        let name = self.name.to_string_lossy();
        let design = parse(&name, &self.text, &self.settings(&place))?;
        let candidate = Candidate::of(&design, &self.elastomer, &self.source.effort)?;
        let score = candidate.score(self.goal, limits)?;
        Ok(Tried {
            place,
            candidate,
            score,
        })
    }

    /// Goes from a design to better ones: looks both ways along each number, goes where it is best, and
    /// halves its steps where nothing is better. Calls `tried` with all designs of each round and the best so
    /// far, and whether that is new. Returns the best, and how many designs were tried.
    pub(super) fn climb(
        &self,
        start: Tried,
        limits: &Limits,
        budget: u64,
        mut tried: impl FnMut(&[Tried], &Tried, u64, bool) -> Result<(), Failure>,
    ) -> Result<(Tried, u64), Failure> {
        let mut best = start;
        let mut used = 1;
        let mut step = 0.25;
        while step >= FINEST && used < budget {
            let places = neighbours(&best.place, step);
            used += places.len() as u64;
            let round: Vec<Tried> = places
                .into_par_iter()
                .filter_map(|place| self.attempt(place, limits).ok())
                .collect();
            let before = best.score;
            for other in &round {
                if other.score.is_better_than(&best.score) {
                    best = other.clone();
                }
            }
            let better = best.score.is_better_than(&before);
            tried(&round, &best, used, better)?;
            if !better {
                step *= 0.5;
            }
        }
        Ok((best, used))
    }
}

/// One step each way along each number, within the bounds.
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
