//! `palpate field optimise`: better numbers within bounds.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::progress::Progress;

use super::candidate::Goal;
use super::search::{FAR, Search, SearchArguments, Tried};

/// Improve a design by changing some of its numbers within bounds
#[derive(Args)]
#[command(after_help = "\
A compass search: from the design as it is it looks both ways along each number, on all cores, goes \
where it is best, and halves its steps where nothing is better. It finds a local optimum; start it \
from another design to see whether there is another. Designs beyond a limit count as worse than all \
within, the less the farther beyond. \
Every better design is printed as it is found, as a line that begins with #, and written to --out: \
an interrupted search goes on from that file as its design.

Example:
  palpate field optimise closed --most-power 10 --most-force 0.4 \\
      --vary parameters.disc=4..7.9 --vary parameters.rim=1..6 --out better.toml")]
pub(super) struct Arguments {
    #[command(flatten)]
    search: SearchArguments,
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

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let search = arguments.search.open()?;
    let file = OutputFile::optional("--out", arguments.out.as_ref())?;
    let start = search.attempt(search.start()?)?;
    let progress = Progress::new(arguments.budget as usize);
    let mut out = io::stdout().lock();
    report(&mut out, arguments, &search, 1, &start)?;
    let (best, used) = search.climb(
        start.clone(),
        FAR,
        arguments.budget,
        |best, used, better| {
            progress.at(used);
            if !better {
                return Ok(());
            }
            report(&mut out, arguments, &search, used, best)?;
            match &file {
                Some(file) => file.write(search.text_at(&best.place)?),
                None => Ok(()),
            }
        },
    )?;
    progress.finish();
    if arguments.print {
        return Ok(out.write_all(search.text_at(&best.place)?.as_bytes())?);
    }
    write!(out, "{}", summary(arguments, &start, &best, used))?;
    if best.score.is_allowed() {
        return Ok(());
    }
    Err(Failure::Refused(
        "no design within the limits was found: widen bounds or limits, or start from a design within them".to_owned(),
    ))
}

/// Prints a better design as a comment line of a design file.
fn report(
    out: &mut impl Write,
    arguments: &Arguments,
    search: &Search<'_>,
    used: u64,
    tried: &Tried,
) -> Result<(), Failure> {
    let (goal, figure) = (arguments.search.goal.name(), tried.score.figure());
    write!(out, "# {used} designs, {goal} {figure:.6e}")?;
    if !tried.score.is_allowed() {
        write!(out, " (beyond a limit)")?;
    }
    write!(out, ":")?;
    for (path, value) in search.settings(&tried.place) {
        write!(out, " {path}={value}")?;
    }
    writeln!(out)?;
    Ok(out.flush()?)
}

fn summary(arguments: &Arguments, start: &Tried, best: &Tried, used: u64) -> String {
    let mut text = String::new();
    let places = arguments.search.vary.iter().zip(&best.place);
    for ((path, low, high), place) in places {
        let value = low + place * (high - low);
        let end = match *place {
            p if p <= 0.0 => ", at its lower bound",
            p if p >= 1.0 => ", at its upper bound",
            _ => "",
        };
        text.push_str(&format!("{path} = {value}{end}\n"));
    }
    let limits = &arguments.search.limits;
    text.push_str(&format!(
        "the design as it was\n{}",
        start.candidate.explain(limits)
    ));
    text.push_str(&format!(
        "the best found\n{}",
        best.candidate.explain(limits)
    ));
    let [before, after] = [start, best].map(|tried| tried.score.figure());
    let goal = arguments.search.goal.name();
    text.push_str(&format!(
        "{goal}: {after:.6e}, from {before:.6e}, {used} designs\n"
    ));
    text
}

impl Goal {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Merit => "merit eps w_D w_L",
            Self::RisePerWatt => "relative rise of the spring per watt",
            Self::Homogeneity => "std/mean of |B| in the core",
            Self::StiffnessError => "expected error of the stiffness at c_S",
        }
    }
}
