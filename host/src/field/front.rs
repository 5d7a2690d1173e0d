//! `palpate field front`: the best of a goal for each power.

use std::io::{self, Write};

use clap::Args;
use rayon::prelude::*;
use serde::Serialize;

use super::candidate::{Goal, Limits};
use super::input::DesignSource;
use super::mse::elastomer;
use super::search::{Search, Tried};
use super::sweep::range;
use crate::failure::Failure;

/// The best of a goal for each power: a Pareto front from several starts
#[derive(Args)]
#[command(after_help = "\
Each start has its own limit of the power, spread evenly by its logarithm over --power, and searches as
`palpate field optimise` does: the first from the design as it is, the others from places spread over the
bounds. Of all designs that were tried, those are printed that no other beats in both goal and power.
Let the current vary too: conductor.current_A.

Example
  palpate field front closed --goal merit --power 2..20 --starts 20 --most-height 10.28 \\
      --vary conductor.current_A=1..8 --vary parameters.disc=4..7.9 --vary parameters.rim=1..6")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// What is to be better
    #[arg(long, value_enum, default_value = "merit")]
    goal: Goal,
    /// A number of the design and its bounds
    #[arg(long, required = true, value_name = "PATH=FROM..TO", value_parser = range)]
    vary: Vec<(String, f64, f64)>,
    /// Least and greatest limit of the power, W
    #[arg(long, value_name = "FROM..TO", value_parser = powers)]
    power: [f64; 2],
    /// Starts
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(2..=1_000))]
    starts: u32,
    #[command(flatten)]
    limits: Limits,
    /// The elastomer, for the stiffness: soft, ultrasoft or a file
    #[arg(long, default_value = "soft", value_name = "NAME|FILE")]
    mse: String,
    /// Each start ends after so many designs
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    budget: u64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

fn powers(text: &str) -> Result<[f64; 2], String> {
    let allowed = "allowed: FROM..TO in W, growing and above 0";
    let (from, to) = text.split_once("..").ok_or(allowed)?;
    match [from, to].map(|text| text.trim().parse::<f64>()) {
        [Ok(from), Ok(to)] if from > 0.0 && to > from && to.is_finite() => Ok([from, to]),
        _ => Err(allowed.into()),
    }
}

/// A design that no other beats.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct OnFront {
    power_W: f64,
    figure: f64,
    /// Paths and numbers of the design.
    numbers: Vec<(String, f64)>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let elastomer = elastomer(&arguments.mse)?;
    let search = Search::of(
        &arguments.source,
        &arguments.vary,
        elastomer,
        arguments.goal,
    )?;
    let own = search.start()?;
    let [least, most] = arguments.power;
    let from_start = |number: u32| -> Result<Vec<Tried>, Failure> {
        let share = f64::from(number) / f64::from(arguments.starts - 1);
        let limits = arguments
            .limits
            .with_power(least * (most / least).powf(share));
        let place = match number {
            0 => own.clone(),
            number => spread(number, own.len()),
        };
        // A start that cannot be built is left out: others are near it.
        let Ok(start) = search.attempt(place, &limits) else {
            return Ok(Vec::new());
        };
        let mut all = vec![start.clone()];
        search.climb(start, &limits, arguments.budget, |round, _, _, _| {
            all.extend_from_slice(round);
            Ok(())
        })?;
        Ok(all)
    };
    let numbers: Vec<u32> = (0..arguments.starts).collect();
    let tried: Result<Vec<Vec<Tried>>, Failure> = numbers.into_par_iter().map(from_start).collect();
    let tried: Vec<Tried> = tried?.into_iter().flatten().collect();
    let count = tried.len();
    // The limits that all designs keep; a start's own limit of the power is no limit of the front.
    let within = arguments.limits.with_power(most);
    let mut kept = Vec::new();
    for mut tried in tried {
        tried.score = tried.candidate.score(arguments.goal, &within)?;
        if tried.score.is_allowed() {
            kept.push(tried);
        }
    }
    let power_w = |tried: &Tried| tried.candidate.power_w();
    let is_better = |one: &Tried, other: &Tried| one.score.is_better_than(&other.score);
    let front: Vec<OnFront> = not_beaten(kept, power_w, is_better)
        .into_iter()
        .map(|tried| OnFront {
            power_W: tried.candidate.power_w(),
            figure: tried.score.figure(),
            numbers: search.settings(&tried.place),
        })
        .collect();
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &front)?;
        return Ok(writeln!(out)?);
    }
    writeln!(
        out,
        "{count} designs from {} starts, {} on the front",
        arguments.starts,
        front.len()
    )?;
    writeln!(out, "  power W  {}", arguments.goal.name())?;
    for design in &front {
        write!(out, "{:>9.3}  {:.6}", design.power_W, design.figure)?;
        for (path, value) in &design.numbers {
            write!(out, "  {path}={value:.4}")?;
        }
        writeln!(out)?;
    }
    if front.is_empty() {
        return Err(Failure::Refused(
            "no design within the limits was found: widen bounds or limits".to_owned(),
        ));
    }
    Ok(())
}

/// A place that is far from those of all other numbers: the additive sequence of the root of
/// x^(n+1) = x + 1 (Roberts, 2018), whose discrepancy is low in n dimensions.
fn spread(number: u32, dimensions: usize) -> Vec<f64> {
    let power = 1.0 / (dimensions as f64 + 1.0);
    let mut root = 1.5_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(power);
    }
    let along = |axis: usize| (0.5 + f64::from(number) * root.powi(-(axis as i32 + 1))).fract();
    (0..dimensions).map(along).collect()
}

/// By rising power, the designs of which each is better than all that take less.
fn not_beaten<T>(
    mut tried: Vec<T>,
    power_w: impl Fn(&T) -> f64,
    is_better: impl Fn(&T, &T) -> bool,
) -> Vec<T> {
    tried.sort_by(|a, b| power_w(a).total_cmp(&power_w(b)));
    let mut front: Vec<T> = Vec::new();
    for other in tried {
        match front.last_mut() {
            Some(last) if !is_better(&other, last) => {}
            // Of the same power only the best.
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
