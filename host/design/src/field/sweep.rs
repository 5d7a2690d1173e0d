//! `palpate field sweep`: figures over a grid of parameters.

use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::notice::say;
use palpate_cli::progress::Progress;

use super::drive::Drive;
use super::input::{DesignSource, current, parse, say_files, text_of};
use super::quantities::{QUANTITIES, Quantity};
use super::rows::RowFile;
use super::solve::SolvedFigures;

/// Solve a design over a grid of any of its numbers; prints CSV
#[derive(Args)]
#[command(after_help = "\
Example: the gap and the radius of the body, 20 designs on all cores
  palpate field sweep B1 --vary parameters.gap=3..7:5 --vary body.mse.shape.semi_r=10..20:4

A point that is no design (parts that overlap, say) keeps its row, with the reason. \
Rows are written as they are computed: an interrupted sweep has the rows of its first points. With \
--out the same command goes on after the rows that the file has. \
Exit code 1 when every point is refused.")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// A number of the design, its range and how many values
    #[arg(long, required = true, value_name = "PATH=FROM..TO:COUNT", value_parser = axis)]
    vary: Vec<Axis>,
    /// Figures and their derivatives at this current, with saturation, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// Write there instead of to standard output; what the file has of the same sweep is kept
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// One varied number.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    path: String,
    from: f64,
    to: f64,
    count: usize,
}

/// Maximum number of points of a sweep, which take a day on two cores.
const MOST: usize = 500_000;

pub(super) fn range(text: &str) -> Result<(String, f64, f64), String> {
    let allowed = "allowed: PATH=FROM..TO";
    let (path, rest) = text.split_once('=').ok_or(allowed)?;
    let (from, to) = rest.split_once("..").ok_or(allowed)?;
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{text:?} is not a number; {allowed}")),
    };
    Ok((path.trim().to_owned(), number(from)?, number(to)?))
}

fn axis(text: &str) -> Result<Axis, String> {
    let (rest, count) = text
        .rsplit_once(':')
        .ok_or("allowed: PATH=FROM..TO:COUNT")?;
    let (path, from, to) = range(rest)?;
    match count.trim().parse() {
        Ok(count) if (1..=MOST).contains(&count) => Ok(Axis {
            path,
            from,
            to,
            count,
        }),
        _ => Err(format!("{count:?} is not a count; allowed: 1 to {MOST}")),
    }
}

impl Axis {
    fn value(&self, index: usize) -> f64 {
        let share = if self.count > 1 {
            index as f64 / (self.count - 1) as f64
        } else {
            0.0
        };
        self.from + share * (self.to - self.from)
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (name, text) = text_of(&arguments.source.design)?;
    let counts = arguments.vary.iter().map(|axis| axis.count);
    let total = counts.fold(1_usize, usize::saturating_mul);
    if total > MOST {
        return Err(Failure::Argument(format!(
            "{total} points: at most {MOST} in one sweep"
        )));
    }
    let settings = |mut point: usize| {
        let mut settings = arguments.source.effort.settings.clone();
        for axis in arguments.vary.iter().rev() {
            settings.push((axis.path.clone(), axis.value(point % axis.count)));
            point /= axis.count;
        }
        settings
    };
    // An unknown path is an error of the command, not of each point.
    palpate_field::design::vary::set(&text, &settings(0)).map_err(Failure::Argument)?;
    let design = parse(&name, &text, &[])?;
    say_files(&design);
    let drive = Drive::of(&design, arguments.current)?;
    let heads: Vec<String> = arguments
        .vary
        .iter()
        .map(|axis| axis.path.clone())
        .collect();
    let heads: Vec<String> = heads.into_iter().chain(columns(drive)).collect();
    let varied = |point: usize| varied(&arguments.vary, &settings(point));
    let mut rows = match &arguments.out {
        None => RowFile::standard_output(&heads)?,
        Some(path) => RowFile::resumed(path, &heads, varied)?,
    };
    let done = rows.count.min(total);
    let progress = Progress::new(total - done);
    let outcome = |index| {
        let design = parse(&name, &text, &settings(done + index))?;
        let solved = SolvedFigures::solve(&design, drive, &arguments.source.effort)?;
        Ok((design.resistance_ohm(), solved))
    };
    let mut beyond = 0;
    in_order(total - done, outcome, |index, outcome| {
        beyond +=
            usize::from(matches!(&outcome, Ok((_, solved)) if !solved.beyond_tables.is_empty()));
        rows.write(&row(varied(done + index), heads.len(), &outcome))?;
        progress.step();
        Ok(())
    })?;
    progress.finish();
    if beyond > 0 {
        say(format!(
            "{beyond} rows have a field beyond the table of a material, where B rises as in vacuum: see one with `palpate field solve`"
        ));
    }
    if rows.all_refused {
        return Err(Failure::Refused(
            "every point is refused: the last column says why".to_owned(),
        ));
    }
    Ok(())
}

/// Column heads: figures, other results, the estimated error of each figure, and at a current its
/// derivative.
fn columns(drive: Drive) -> impl Iterator<Item = String> {
    let figures = QUANTITIES.iter().map(move |q| q.key(drive).to_owned());
    let errors = QUANTITIES.iter();
    let errors = errors.map(move |q| format!("{}_error", q.key(drive)));
    let rest = ["resistance_ohm", "error_estimate"].map(str::to_owned);
    let derivatives = QUANTITIES
        .iter()
        .filter(move |_| matches!(drive, Drive::Current(_)));
    let derivatives = derivatives.map(Quantity::derivative_key);
    let numbers = figures.chain(rest).chain(errors).chain(derivatives);
    numbers.chain(["refused".to_owned()])
}

/// Returns the varied numbers of a point as text.
fn varied(vary: &[Axis], settings: &[(String, f64)]) -> Vec<String> {
    let value = |axis: &Axis| {
        let set = settings.iter().rfind(|(path, _)| *path == axis.path);
        set.map_or(String::new(), |(_, value)| value.to_string())
    };
    vary.iter().map(value).collect()
}

/// Row of a point: the varied numbers and [`columns`].
fn row(
    mut row: Vec<String>,
    columns: usize,
    outcome: &Result<(f64, SolvedFigures), Failure>,
) -> Vec<String> {
    match outcome {
        Ok((resistance_ohm, solved)) => {
            let figures = QUANTITIES.iter().map(|q| (q.value)(&solved.keyed.figures));
            let errors = QUANTITIES.iter().map(|q| (q.value)(&solved.errors.figures));
            let rest = [*resistance_ohm, solved.error_estimate];
            let derivatives = solved.derivatives.iter();
            let derivatives =
                derivatives.flat_map(|slopes| QUANTITIES.iter().map(|q| (q.value)(&slopes.0)));
            let numbers = figures.chain(rest).chain(errors).chain(derivatives);
            row.extend(numbers.map(|number| format!("{number:.9e}")));
            row.push(String::new());
        }
        Err(failure) => {
            row.resize(columns - 1, String::new());
            row.push(failure.to_string());
        }
    }
    row
}
