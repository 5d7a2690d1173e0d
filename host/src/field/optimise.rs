//! `palpate field optimise`: better numbers within bounds.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use palpate_field::design::Design;
use palpate_field::layer::Layer;
use rayon::prelude::*;

use super::drive::Drive;
use super::input::{DesignSource, parse, text_of};
use super::mse::elastomer;
use super::sweep::range;
use crate::failure::Failure;
use crate::progress::Progress;

/// Improve a design by changing some of its numbers within bounds
#[derive(Args)]
#[command(after_help = "\
A compass search: from the middle of the bounds it looks both ways along each number, on all
cores, goes where it is best, and halves its steps where nothing is better. It finds a local
optimum; start it from other bounds to see whether there is another.
Every better design is printed as it is found, as a line that begins with #, so that an interrupted
search leaves its best.

Example
  palpate field optimise closed --goal stiffness-per-watt --mse ultrasoft \\
      --vary parameters.disc=4..7.9 --vary parameters.rim=1..6")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// What is to be better
    #[arg(long, value_enum)]
    goal: Goal,
    /// A number of the design and its bounds
    #[arg(long, required = true, value_name = "PATH=FROM..TO", value_parser = range)]
    vary: Vec<(String, f64, f64)>,
    /// The elastomer, for the stiffness: soft, ultrasoft or a file
    #[arg(long, default_value = "soft", value_name = "NAME|FILE")]
    mse: String,
    /// Ends after so many designs
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    budget: u64,
    /// Print the design's text with the numbers found
    #[arg(long)]
    print: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Goal {
    /// Relative rise of the actuated spring at the design's current, per watt
    StiffnessPerWatt,
    /// Least std/mean of |B| in the core
    Homogeneity,
}

/// Steps end at this share of the bounds.
const FINEST: f64 = 0.01;

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (name, text) = text_of(&arguments.source.design)?;
    let settings = |point: &[f64]| {
        let mut settings = arguments.source.effort.settings.clone();
        let places = arguments.vary.iter().zip(point);
        settings
            .extend(places.map(|((path, low, high), s)| (path.clone(), low + s * (high - low))));
        settings
    };
    let score = |point: &[f64]| -> Result<f64, Failure> {
        score(arguments, &parse(&name, &text, &settings(point))?)
    };
    let progress = Progress::new(arguments.budget as usize);
    let mut best = vec![0.5; arguments.vary.len()];
    let mut value = score(&best)?;
    let start = value;
    let mut used = 1;
    let mut step = 0.25;
    let mut out = io::stdout().lock();
    report(&mut out, arguments.goal, used, value, &settings(&best))?;
    while step >= FINEST && used < arguments.budget {
        let candidates = neighbours(&best, step);
        used += candidates.len() as u64;
        let scores: Vec<Option<f64>> = candidates
            .par_iter()
            .map(|point| score(point).ok())
            .collect();
        progress.at(used);
        let found = candidates
            .iter()
            .zip(scores)
            .filter_map(|(point, score)| Some((point, score?)));
        match found.max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((point, better)) if better > value => {
                (best, value) = (point.clone(), better);
                report(&mut out, arguments.goal, used, value, &settings(&best))?;
            }
            _ => step *= 0.5,
        }
    }
    progress.finish();
    if arguments.print {
        let text =
            palpate_field::design::vary::set(&text, &settings(&best)).map_err(Failure::Refused)?;
        return Ok(out.write_all(text.as_bytes())?);
    }
    for (path, value) in settings(&best) {
        writeln!(out, "{path} = {value}")?;
    }
    let [start, value] = [start, value].map(|score| arguments.goal.figure(score));
    Ok(writeln!(
        out,
        "{}: {value:.6e} (from {start:.6e} in the middle), {used} designs",
        arguments.goal.name()
    )?)
}

/// A better design, as a line that a design's file takes as a comment.
fn report(
    out: &mut impl Write,
    goal: Goal,
    used: u64,
    score: f64,
    settings: &[(String, f64)],
) -> Result<(), Failure> {
    let (name, figure) = (goal.name(), goal.figure(score));
    write!(out, "# {used} designs, {name} {figure:.6e}:")?;
    for (path, value) in settings {
        write!(out, " {path}={value}")?;
    }
    writeln!(out)?;
    Ok(out.flush()?)
}

impl Goal {
    const fn name(self) -> &'static str {
        match self {
            Self::StiffnessPerWatt => "relative rise of the spring per watt",
            Self::Homogeneity => "std/mean of |B| in the core",
        }
    }

    /// The figure that a score stands for.
    fn figure(self, score: f64) -> f64 {
        match self {
            Self::StiffnessPerWatt => score,
            Self::Homogeneity => -score,
        }
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

/// The greater the better.
fn score(arguments: &Arguments, design: &Design) -> Result<f64, Failure> {
    let effort = &arguments.source.effort;
    match arguments.goal {
        Goal::Homogeneity => Ok(-Drive::of(design, None)?.solve(design, effort)?.figures.cv[0]),
        Goal::StiffnessPerWatt => {
            let solved = Drive::Current(design.current_a).solve(design, effort)?;
            let layer =
                Layer::of(design, &solved, &elastomer(&arguments.mse)?).ok_or_else(|| {
                    Failure::Refused("there is no elastomer between the boards".to_owned())
                })?;
            Ok(layer.stiffening / (design.current_a.powi(2) * design.resistance_ohm()))
        }
    }
}
