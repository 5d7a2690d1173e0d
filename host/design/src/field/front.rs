//! `palpate field front`: the best designs by power.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::plot::{Axis, BLUE, Chart, GREY, Marks, Series};
use rayon::prelude::*;
use serde::Serialize;

use super::candidate::Goal;
use super::search::{FAR, NEAR, Search, SearchArguments, Tried, is_same, not_beaten, spread};

/// The best of a goal for each power: a Pareto front from several starts
#[derive(Args)]
#[command(after_help = "\
The current is not searched for: each start has its own power, spread evenly by its logarithm over \
--power, and each of its designs the current at which it takes that power. A start searches as \
`palpate field optimise` does, at an accuracy of 1e-2: the first from the design as it is, the others \
from places spread over the bounds; first as if nothing saturated, then with saturation about what that \
found. What a start finds is solved at its own power and at those of its two neighbours to the accuracy \
that is asked for; those are printed that no other beats in both goal and power, \
beside the design as it is.

Example:
  palpate field front closed --power 2..20 --starts 4 --most-height 10.29 \\
      --vary parameters.disc=4..7.9 --vary parameters.rim=1..6 --picture front.svg")]
pub(super) struct Arguments {
    #[command(flatten)]
    search: SearchArguments,
    /// Least and greatest power, W
    #[arg(long, value_name = "FROM..TO", value_parser = powers)]
    power: [f64; 2],
    /// Starts
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(2..=1_000))]
    starts: u32,
    /// Each start ends after so many designs
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    budget: u64,
    /// Draw the front there, as SVG
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
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

/// Key of the current in a design file; the search sets the current that gives the requested power.
const CURRENT: &str = "conductor.current_A";
/// Relative accuracy of the field solutions during the search.
const SEARCHING: f64 = 1e-2;

/// A design on the Pareto front.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct OnFront {
    power_W: f64,
    figure: f64,
    /// Figure of the unchanged design at the same power.
    figure_as_it_is: f64,
    /// Parameters set with `--vary`: key in the design file, and value.
    numbers: Vec<(String, f64)>,
}

/// Result of one start.
struct Optimum {
    place: Vec<f64>,
    /// Number of tried designs.
    designs: u64,
}

/// Result of all starts.
#[derive(Serialize)]
struct Front {
    starts: u32,
    /// Number of designs solved during the search.
    designs: u64,
    front: Vec<OnFront>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments
        .search
        .vary
        .iter()
        .any(|(path, _, _)| path == CURRENT)
    {
        return Err(Failure::Argument(format!(
            "--vary {CURRENT}: the current follows from --power: leave it out"
        )));
    }
    let picture = OutputFile::optional("--picture", arguments.picture.as_ref())?;
    let search = arguments.search.open()?;
    let front = Front::of(arguments, &search)?;
    if let Some(file) = picture {
        file.write(front.chart(arguments.search.goal).svg()?)?;
    }
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &front)?;
        writeln!(out)?;
    } else {
        write!(out, "{}", front.explain(arguments.search.goal))?;
    }
    if front.front.is_empty() {
        return Err(Failure::Refused(
            "no design within the limits was found: widen bounds or limits".to_owned(),
        ));
    }
    Ok(())
}

impl Front {
    fn of(arguments: &Arguments, search: &Search<'_>) -> Result<Self, Failure> {
        let own = search.start()?;
        let coarse = search.at_most_accurate(SEARCHING);
        let powers_w = evenly_by_logarithm(arguments.power, arguments.starts);
        let starts = powers_w.par_iter().zip(0..arguments.starts);
        let found: Vec<Optimum> = starts
            .map(|(&power_w, start)| {
                climb(&coarse.at_power(power_w), start, &own, arguments.budget)
            })
            .collect::<Result<_, _>>()?;
        let compared = powers_w.par_iter().enumerate();
        let compared = compared.map(|(start, &power_w)| {
            let search = search.at_power(power_w);
            let as_it_is = search.attempt(own.clone())?;
            let best = best(&search, about(&found, start))?;
            Ok(best.map(|best| (as_it_is, best)))
        });
        let compared: Vec<Option<(Tried, Tried)>> = compared.collect::<Result<_, Failure>>()?;
        let power_w = |(_, best): &(Tried, Tried)| best.candidate.power_w();
        let is_better = |(_, one): &(Tried, Tried), (_, other): &(Tried, Tried)| {
            one.score.is_better_than(&other.score)
        };
        let front = not_beaten(compared.into_iter().flatten().collect(), power_w, is_better);
        let front = front.into_iter().map(|(as_it_is, best)| OnFront {
            power_W: best.candidate.power_w(),
            figure: best.score.figure(),
            figure_as_it_is: as_it_is.score.figure(),
            numbers: search
                .settings(&best.place)
                .into_iter()
                .chain([(CURRENT.to_owned(), best.candidate.current_a())])
                .collect(),
        });
        Ok(Self {
            starts: arguments.starts,
            designs: found.iter().map(|found| found.designs).sum(),
            front: front.collect(),
        })
    }

    /// Prints one line for each design.
    fn explain(&self, goal: Goal) -> String {
        let mut text = format!(
            "{} designs from {} starts, {} on the front\n  power W  {}; of the design as it is\n",
            self.designs,
            self.starts,
            self.front.len(),
            goal.name()
        );
        for design in &self.front {
            let figures =
                [design.figure, design.figure_as_it_is].map(|figure| format!("  {figure:.6}"));
            let numbers = design.numbers.iter();
            let numbers = numbers.map(|(path, value)| format!("  {path}={value:.4}"));
            let rest: String = figures.into_iter().chain(numbers).collect();
            text.push_str(&format!("{:>9.3}{rest}\n", design.power_W));
        }
        text
    }

    /// Chart of the front and of the unchanged design at the same powers.
    fn chart(&self, goal: Goal) -> Chart {
        let line = |figure: fn(&OnFront) -> f64| {
            let places = self.front.iter();
            Marks::Line(
                places
                    .map(|design| (design.power_W, figure(design)))
                    .collect(),
            )
        };
        Chart {
            title: format!("Best of {} starts: {}", self.starts, goal.name()),
            x: Axis::logarithmic("power / W"),
            y: Axis::linear(goal.name()),
            series: vec![
                Series {
                    name: "the best found".to_owned(),
                    colour: BLUE,
                    marks: line(|design| design.figure),
                },
                Series {
                    name: "the design as it is".to_owned(),
                    colour: GREY,
                    marks: line(|design| design.figure_as_it_is),
                },
            ],
        }
    }
}

/// Returns `count` values from the minimum to the maximum, evenly spaced in the logarithm.
fn evenly_by_logarithm([least, most]: [f64; 2], count: u32) -> Vec<f64> {
    let share = |index: u32| f64::from(index) / f64::from(count - 1);
    let value = |index: u32| least * (most / least).powf(share(index));
    (0..count).map(value).collect()
}

/// Searches from a start. Start 0, and any start that cannot be built, is the unchanged design.
fn climb(search: &Search<'_>, start: u32, own: &[f64], budget: u64) -> Result<Optimum, Failure> {
    let place = match start {
        0 => own.to_vec(),
        start => spread(start, own.len()),
    };
    // Begins without saturation, since a linear solution takes a fifth of the time.
    let linear = search.linear();
    let first = linear.attempt(place);
    let first = first.or_else(|_| linear.attempt(own.to_vec()))?;
    let (best, before) = linear.climb(first, FAR, budget, |_, _, _| Ok(()))?;
    let first = search.attempt(best.place)?;
    let (best, after) = search.climb(first, NEAR, budget, |_, _, _| Ok(()))?;
    Ok(Optimum {
        place: best.place,
        designs: before + after,
    })
}

/// Returns the results of a start and its two neighbours, without duplicates.
fn about(found: &[Optimum], start: usize) -> Vec<&[f64]> {
    let mut places: Vec<&[f64]> = Vec::new();
    for found in found
        .iter()
        .skip(start.saturating_sub(1))
        .take(3 - usize::from(start == 0))
    {
        if !places.iter().any(|place| is_same(place, &found.place)) {
            places.push(&found.place);
        }
    }
    places
}

/// Returns the best of several designs within the limits; `None` if none is within.
fn best(search: &Search<'_>, places: Vec<&[f64]>) -> Result<Option<Tried>, Failure> {
    let mut best: Option<Tried> = None;
    for place in places {
        let tried = search.attempt(place.to_vec())?;
        let is_best = |best: &Tried| tried.score.is_better_than(&best.score);
        if tried.score.is_allowed() && best.as_ref().is_none_or(is_best) {
            best = Some(tried);
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_power_is_tried_with_what_its_neighbours_found() {
        let found = [1.0, 2.0, 2.0, 3.0].map(|at| Optimum {
            place: vec![at],
            designs: 1,
        });
        assert_eq!(about(&found, 0), [[1.0], [2.0]]);
        assert_eq!(about(&found, 1), [[1.0], [2.0]]);
        assert_eq!(about(&found, 3), [[2.0], [3.0]]);
    }
}
