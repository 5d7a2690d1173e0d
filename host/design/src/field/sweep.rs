//! `palpate field sweep`: figures over a grid of parameters.

use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::notice::say;
use palpate_cli::progress::Progress;
use palpate_field::design::Design;
use palpate_field::figures::Figures;
use palpate_simulate::shard::Run;
use palpate_wire::crc32;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::drive::Drive;
use super::input::{DesignSource, current, parse, say_files, text_of};
use super::quantities::{Asked, Quantity};
use super::rows::RowFile;
use super::solve::SolvedFigures;

/// Solve a design over a grid of any of its numbers; prints CSV
#[derive(Args)]
#[command(after_help = "\
Example: the gap and the radius of the body, 20 designs on all cores
  palpate field sweep B1 --vary parameters.gap=3..7:5 --vary body.mse.shape.semi_r=10..20:4

A point that is no design (parts that overlap, say) keeps its row, with the reason. \
Rows are written as they are computed: an interrupted sweep has the rows of its first points. With \
--out the same command goes on after the rows that the file has.

On many computers: the same command with --points FROM..TO --shard FILE, as often as there are parts, and at last \
without --points and with --merge FILE... It gives the rows of one run. A shard gets its name when it is complete; a \
call whose shard is complete ends at once.

Exit code 1 when every point is refused.")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    #[command(flatten)]
    asked: Asked,
    /// A number of the design, its range and how many values
    #[arg(long, required = true, value_name = "PATH=FROM..TO:COUNT", value_parser = axis)]
    vary: Vec<Axis>,
    /// Figures and their derivatives at this current, with saturation, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// Write there instead of to standard output; what the file has of the same sweep is kept
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the rows to this file, for --merge, unless it has them already
    #[arg(long, value_name = "FILE", conflicts_with_all = ["merge", "out"])]
    shard: Option<PathBuf>,
    /// Of the rows only these, counted from 1
    #[arg(long, value_name = "FROM..TO", requires = "shard", value_parser = points)]
    points: Option<RangeInclusive<u64>>,
    /// Take the rows from these files of --shard, which have each point of the sweep once
    #[arg(long, value_name = "FILE", num_args = 1..)]
    merge: Vec<PathBuf>,
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

fn points(text: &str) -> Result<RangeInclusive<u64>, String> {
    let parsed = text
        .split_once("..")
        .and_then(|(from, to)| Some(from.trim().parse().ok()?..=to.trim().parse().ok()?));
    let points = parsed.filter(|points| *points.start() > 0 && !points.is_empty());
    points.ok_or_else(|| format!("allowed: FROM..TO, of 1 to {MOST}"))
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
    let asked = &arguments.asked;
    let heads: Vec<String> = arguments
        .vary
        .iter()
        .map(|axis| axis.path.clone())
        .collect();
    let heads: Vec<String> = heads.into_iter().chain(columns(asked, drive)).collect();
    let varied = |point: usize| varied(&arguments.vary, &settings(point));
    let solve = |point: usize| {
        let outcome = parse(&name, &text, &settings(point)).and_then(|design| {
            let solved = SolvedFigures::solve(&design, drive, &arguments.source.effort, asked)?;
            Ok((design.resistance_ohm(), solved))
        });
        Point {
            is_beyond: matches!(&outcome, Ok((_, solved)) if !solved.beyond_tables.is_empty()),
            row: row(varied(point), heads.len(), &outcome),
        }
    };
    let all = 1..=total as u64;
    let run = || run_of(arguments, &text, &design);
    if let Some(file) = &arguments.shard {
        let points = arguments.points.clone().unwrap_or(all);
        return write_shard(&run()?, file, &points, total, solve);
    }
    let merged: Option<Vec<Point>> = match &arguments.merge[..] {
        [] => None,
        files => Some(run()?.merged(files, &all)?),
    };
    let mut rows = match &arguments.out {
        None => RowFile::standard_output(&heads)?,
        Some(path) => RowFile::resumed(path, &heads, varied)?,
    };
    let done = rows.count.min(total);
    let mut beyond = 0;
    let mut receive = |point: Point| {
        beyond += usize::from(point.is_beyond);
        rows.write(&point.row)
    };
    match merged {
        None => in_progress(done..total, solve, receive)?,
        Some(points) => points.into_iter().skip(done).try_for_each(&mut receive)?,
    }
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

/// A solved or refused point.
#[derive(Serialize, Deserialize)]
struct Point {
    row: Vec<String>,
    /// Whether its field is beyond the table of a material.
    is_beyond: bool,
}

/// Solves points on all cores and passes them on in order.
fn in_progress(
    points: Range<usize>,
    solve: impl Fn(usize) -> Point + Sync,
    mut receive: impl FnMut(Point) -> Result<(), Failure> + Send,
) -> Result<(), Failure> {
    let progress = Progress::new(points.len());
    let solve = |index| solve(points.start + index);
    in_order(points.len(), solve, |_, point| {
        receive(point)?;
        progress.step();
        Ok(())
    })?;
    progress.finish();
    Ok(())
}

/// Solves points, counted from 1, and writes their shard, unless it is complete.
fn write_shard(
    run: &Run,
    file: &Path,
    points: &RangeInclusive<u64>,
    total: usize,
    solve: impl Fn(usize) -> Point + Sync,
) -> Result<(), Failure> {
    if *points.end() > total as u64 {
        return Err(Failure::Argument(format!(
            "--points {}..{}: the sweep has {total} points",
            points.start(),
            points.end()
        )));
    }
    let Some(shard) = run.shard(file, points)? else {
        say(format!("{}: is complete", file.display()));
        return Ok(());
    };
    let mut solved = Vec::new();
    let points = *points.start() as usize - 1..*points.end() as usize;
    in_progress(points, solve, |point| {
        solved.push(point);
        Ok(())
    })?;
    shard.write(&solved)
}

/// The sweep as a run that can be split: all that its rows depend on, apart from the program.
fn run_of(arguments: &Arguments, text: &str, design: &Design) -> Result<Run, Failure> {
    // The text has the parameters; the design has the contents of the files that it names.
    let design_read = crc32(format!("{text}{design:?}").as_bytes());
    let effort = &arguments.source.effort;
    let accuracy = effort.accuracy();
    let axis = |axis: &Axis| json!([axis.path, axis.from, axis.to, axis.count]);
    let figures = arguments.asked.quantities().map(|quantity| quantity.name);
    let settings: [(&str, Value); 8] = [
        ("design", json!(design.name)),
        (
            "checksum of the design",
            json!(format!("{design_read:08x}")),
        ),
        ("--vary", arguments.vary.iter().map(axis).collect()),
        ("--set", json!(effort.settings)),
        ("--accuracy", json!(accuracy.relative)),
        ("--order", json!(accuracy.order)),
        ("--current", json!(arguments.current)),
        ("--figures", figures.collect()),
    ];
    let settings = settings.map(|(name, value)| (name.to_owned(), value));
    Run::new("field sweep", "point", Map::from_iter(settings), |points| {
        format!("--points {}..{}", points.start(), points.end())
    })
}

/// Column heads: figures, other results, the estimated error of each figure, and at a current its
/// derivative.
fn columns(asked: &Asked, drive: Drive) -> impl Iterator<Item = String> {
    let figures = asked.quantities().map(move |q| q.key(drive).to_owned());
    let errors = asked.quantities();
    let errors = errors.map(move |q| format!("{}_error", q.key(drive)));
    let rest = ["resistance_ohm", "error_estimate"].map(str::to_owned);
    let derivatives = asked
        .quantities()
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
            let asked = solved.keyed.asked.quantities();
            let of = |figures: &Figures| -> Vec<f64> {
                asked.clone().map(|q| (q.value)(figures)).collect()
            };
            let rest = [Some(*resistance_ohm), solved.error_estimate];
            let derivatives = solved.derivatives.iter();
            let derivatives = derivatives.flat_map(|slopes| of(&slopes.figures));
            let numbers = of(&solved.keyed.figures).into_iter().map(Some).chain(rest);
            let errors = of(&solved.errors.figures).into_iter().chain(derivatives);
            let text = |number: Option<f64>| number.map_or(String::new(), |n| format!("{n:.9e}"));
            row.extend(numbers.chain(errors.map(Some)).map(text));
            row.push(String::new());
        }
        Err(failure) => {
            row.resize(columns - 1, String::new());
            row.push(failure.to_string());
        }
    }
    row
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use clap::Parser;
    use palpate_cli::failure::Failure;

    use super::{Arguments, run};

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        arguments: Arguments,
    }

    /// A sweep of five points, of which the first is no design; `file` takes its rows.
    fn sweep(file: &Path, options: &[&str]) -> Result<(), Failure> {
        let sweep = "sweep B1 --accuracy 1e-2 --vary parameters.gap=0..8:5";
        let words: Vec<&str> = sweep.split(' ').chain(options.iter().copied()).collect();
        run(&Cli::parse_from([&words[..], &[file.to_str().unwrap()]].concat()).arguments)
    }

    #[test]
    fn merged_shards_are_the_rows_of_one_sweep() {
        let folder = tempfile::tempdir().unwrap();
        let [one, merged, first, rest] =
            ["one.csv", "merged.csv", "first", "rest"].map(|name| folder.path().join(name));
        sweep(&one, &["--out"]).unwrap();
        sweep(&rest, &["--points", "2..5", "--shard"]).unwrap();
        let merge = ["--merge", rest.to_str().unwrap(), first.to_str().unwrap()];
        let without = sweep(&merged, &[&merge[..2], &["--out"]].concat()).unwrap_err();
        let missing = "no file has the point 1. Run the same command with --points 1..1 --shard";
        assert!(without.to_string().contains(missing), "{without}");
        sweep(&first, &["--points", "1..1", "--shard"]).unwrap();
        sweep(&merged, &[&merge[..], &["--out"]].concat()).unwrap();
        assert_eq!(fs::read(&merged).unwrap(), fs::read(&one).unwrap());

        let written = fs::metadata(&rest).unwrap().modified().unwrap();
        sweep(&rest, &["--points", "2..5", "--shard"]).unwrap();
        let again = fs::metadata(&rest).unwrap().modified().unwrap();
        assert_eq!(again, written, "a complete shard is not computed again");
        let of_another = [
            "--set",
            "body.mse.shape.semi_r=12",
            "--points",
            "2..5",
            "--shard",
        ];
        let other = sweep(&rest, &of_another).unwrap_err().to_string();
        assert!(other.contains("its --set is [], and here it is"), "{other}");
        let beyond = sweep(&first, &["--points", "4..6", "--shard"]).unwrap_err();
        assert!(beyond.to_string().contains("has 5 points"), "{beyond}");
    }
}
