//! `palpate field optimise`: better numbers within bounds.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_field::design::vary;
use rayon::prelude::*;

use super::candidate::{Candidate, Goal, Limits, Score};
use super::input::{DesignSource, parse, text_of};
use super::mse::elastomer;
use super::sweep::range;
use crate::failure::Failure;
use crate::output::OutputFile;
use crate::progress::Progress;

/// Improve a design by changing some of its numbers within bounds
#[derive(Args)]
#[command(after_help = "\
A compass search: from the design as it is it looks both ways along each number, on all cores, goes
where it is best, and halves its steps where nothing is better. It finds a local optimum; start it
from another design to see whether there is another. Designs beyond a limit count as worse than all
within, the less the farther beyond.
Every better design is printed as it is found, as a line that begins with #, and written to --out:
an interrupted search goes on from that file as its design.

Example
  palpate field optimise closed --goal merit --most-power 10 --most-force 0.4 \\
      --vary parameters.disc=4..7.9 --vary parameters.rim=1..6 --out better.toml")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// What is to be better
    #[arg(long, value_enum)]
    goal: Goal,
    /// A number of the design and its bounds
    #[arg(long, required = true, value_name = "PATH=FROM..TO", value_parser = range)]
    vary: Vec<(String, f64, f64)>,
    #[command(flatten)]
    limits: Limits,
    /// The elastomer, for the stiffness: soft, ultrasoft or a file
    #[arg(long, default_value = "soft", value_name = "NAME|FILE")]
    mse: String,
    /// Ends after so many designs
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    budget: u64,
    /// Print the design's text with the numbers found, comments included
    #[arg(long)]
    print: bool,
    /// Write the best design there, each time that a better one is found
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Steps end at this share of the bounds.
const FINEST: f64 = 0.01;

/// A place within the bounds, from 0 to 1 along each number, and what was found there.
#[derive(Clone)]
struct Tried {
    place: Vec<f64>,
    candidate: Candidate,
    score: Score,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (name, text) = text_of(&arguments.source.design)?;
    let elastomer = elastomer(&arguments.mse)?;
    let file = OutputFile::optional("--out", arguments.out.as_ref())?;
    let place = start(arguments, &text)?;
    let attempt = |place: Vec<f64>| -> Result<Tried, Failure> {
        let design = parse(&name, &text, &settings(arguments, &place))?;
        let candidate = Candidate::of(&design, &elastomer, &arguments.source.effort)?;
        let score = candidate.score(arguments.goal, &arguments.limits)?;
        Ok(Tried {
            place,
            candidate,
            score,
        })
    };
    let changed = |tried: &Tried| {
        vary::set(&text, &settings(arguments, &tried.place)).map_err(Failure::Refused)
    };
    let progress = Progress::new(arguments.budget as usize);
    let start = attempt(place)?;
    let mut best = start.clone();
    let mut used = 1;
    let mut step = 0.25;
    let mut out = io::stdout().lock();
    report(&mut out, arguments, used, &best)?;
    while step >= FINEST && used < arguments.budget {
        let candidates = neighbours(&best.place, step);
        used += candidates.len() as u64;
        let tried: Vec<Tried> = candidates
            .into_par_iter()
            .filter_map(|place| attempt(place).ok())
            .collect();
        progress.at(used);
        let before = best.score;
        for tried in tried {
            if tried.score.is_better_than(&best.score) {
                best = tried;
            }
        }
        if best.score.is_better_than(&before) {
            report(&mut out, arguments, used, &best)?;
            if let Some(file) = &file {
                file.write(changed(&best)?)?;
            }
        } else {
            step *= 0.5;
        }
    }
    progress.finish();
    if arguments.print {
        return Ok(out.write_all(changed(&best)?.as_bytes())?);
    }
    write!(out, "{}", summary(arguments, &start, &best, used))?;
    if best.score.is_allowed() {
        return Ok(());
    }
    Err(Failure::Refused(
        "no design within the limits was found: widen bounds or limits, or start from a design within them".to_owned(),
    ))
}

/// The user's own design as a place within the bounds.
fn start(arguments: &Arguments, text: &str) -> Result<Vec<f64>, Failure> {
    let text = vary::set(text, &arguments.source.effort.settings).map_err(Failure::Argument)?;
    let share = |(path, low, high): &(String, f64, f64)| {
        let value = vary::get(&text, path).map_err(Failure::Argument)?;
        if low < high && (*low..=*high).contains(&value) {
            return Ok((value - low) / (high - low));
        }
        Err(Failure::Argument(format!(
            "--vary {path}={low}..{high}: the design has {value}, where the search begins: choose growing bounds around it, or --set another"
        )))
    };
    arguments.vary.iter().map(share).collect()
}

/// The numbers of a place, after those of `--set`.
fn settings(arguments: &Arguments, place: &[f64]) -> Vec<(String, f64)> {
    let mut settings = arguments.source.effort.settings.clone();
    let places = arguments.vary.iter().zip(place);
    settings.extend(places.map(|((path, low, high), s)| (path.clone(), low + s * (high - low))));
    settings
}

/// A better design, as a line that a design's file takes as a comment.
fn report(
    out: &mut impl Write,
    arguments: &Arguments,
    used: u64,
    tried: &Tried,
) -> Result<(), Failure> {
    let (goal, figure) = (arguments.goal.name(), tried.score.figure());
    write!(out, "# {used} designs, {goal} {figure:.6e}")?;
    if !tried.score.is_allowed() {
        write!(out, " (beyond a limit)")?;
    }
    write!(out, ":")?;
    for (path, value) in settings(arguments, &tried.place) {
        write!(out, " {path}={value}")?;
    }
    writeln!(out)?;
    Ok(out.flush()?)
}

fn summary(arguments: &Arguments, start: &Tried, best: &Tried, used: u64) -> String {
    let mut text = String::new();
    let places = arguments.vary.iter().zip(&best.place);
    for ((path, low, high), place) in places {
        let value = low + place * (high - low);
        let end = match *place {
            p if p <= 0.0 => ", at its lower bound",
            p if p >= 1.0 => ", at its upper bound",
            _ => "",
        };
        text.push_str(&format!("{path} = {value}{end}\n"));
    }
    let limits = &arguments.limits;
    text.push_str(&format!(
        "the design as it was\n{}",
        start.candidate.explain(limits)
    ));
    text.push_str(&format!(
        "the best found\n{}",
        best.candidate.explain(limits)
    ));
    let [before, after] = [start, best].map(|tried| tried.score.figure());
    let goal = arguments.goal.name();
    text.push_str(&format!(
        "{goal}: {after:.6e}, from {before:.6e}, {used} designs\n"
    ));
    text
}

impl Goal {
    const fn name(self) -> &'static str {
        match self {
            Self::Merit => "merit eps w_D w_L",
            Self::RisePerWatt => "relative rise of the spring per watt",
            Self::Homogeneity => "std/mean of |B| in the core",
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
