//! `cargo campaign springs`: a calibration by springs alone beside one with a load cell, and the
//! check figures of good sessions.

use std::collections::BTreeMap;
use std::io::{self, Write};

use clap::Args;
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_calibration::Known;
use palpate_calibration::checks::{self, Check, CheckedFigure};
use palpate_calibration::session::Session;
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_simulate::campaign::counted::quantile;
use palpate_simulate::campaign::coverage::{Coverage, Judgement};
use palpate_simulate::demo;
use palpate_simulate::engine::Native;
use palpate_simulate::instrument::{BenchTask, CalibratedInstrument, default_settings};
use palpate_simulate::results::Measured;

/// Calibrate many simulated sensors by load cell and by springs alone, press the demo's loads on
/// both, and compare errors and intervals; print the check figures of good data
#[derive(Args)]
pub(crate) struct Arguments {
    /// Number of sensors
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    plants: u64,
    /// Seed of the first sensor; the next sensors have the next seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kind of sensor: paper, soft-closed, ultrasoft
    #[arg(long, value_name = "NAME", default_value = "ultrasoft")]
    stack: String,
}

/// Both methods, in the order of the columns.
const WAYS: [&str; 2] = ["load cell", "springs alone"];

/// One sensor: the results of each method on the loads, and all checks of both.
struct Plant {
    ways: [Result<Vec<Measured>, String>; 2],
    checked: Vec<CheckedFigure>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let stack = Stack::builtin(&arguments.stack).map_err(LoadError::from)?;
    let seed_of = |index: usize| arguments.seed.saturating_add(index as u64);
    let mut plants = Vec::new();
    let compute = |index| plant(&stack, &disturbances, seed_of(index));
    in_order(arguments.plants as usize, compute, |index, plant| {
        match plant {
            Ok(plant) => {
                say(seed_of(index), &plant)?;
                plants.push(plant);
            }
            Err(failure) => println!("seed {}: {failure}", seed_of(index)),
        }
        Ok(())
    })?;
    print(arguments, &plants)
}

fn plant(stack: &Stack, disturbances: &Disturbances, seed: u64) -> Result<Plant, Failure> {
    let switches = Switches::all();
    let plant = draw(stack, disturbances, seed);
    let task = BenchTask::of(&plant, stack, switches, &default_settings());
    let session = task.session(&plant, switches, 0.0)?;
    let by_springs = BenchTask {
        known: Known {
            load_cell_gain: None,
            ..task.known.clone()
        },
        ..task.clone()
    };
    let without = session.clone().without_load_cell();
    let mut checked = checked(&session, &task.known);
    checked.extend(self::checked(&without, &by_springs.known));
    let pressed = |session: &Session, task: BenchTask| {
        let plant = plant.clone();
        let instrument = CalibratedInstrument::of_session(session, task, plant, switches);
        instrument
            .and_then(|of| row(&of))
            .map_err(|error| error.to_string())
    };
    Ok(Plant {
        ways: [pressed(&session, task), pressed(&without, by_springs)],
        checked,
    })
}

fn row(instrument: &CalibratedInstrument) -> Result<Vec<Measured>, Failure> {
    demo::loads(instrument.plant.sensing.spring_n_per_m)
        .into_iter()
        .map(|(name, load)| demo::measure(instrument, name, load, 1.0, &Native))
        .collect()
}

/// All check figures of a session.
fn checked(session: &Session, known: &Known) -> Vec<CheckedFigure> {
    let untouched = session.runs.first();
    let runs = session.runs.iter().chain([&session.deepest_press]);
    let mut checked: Vec<CheckedFigure> = runs
        .flat_map(|run| checks::of_run(run, untouched, known))
        .collect();
    checked.extend(checks::of_session(session, known).unwrap_or_default());
    checked
}

/// Greatest figure of each check.
fn greatest(checked: &[CheckedFigure]) -> BTreeMap<Check, f64> {
    let mut greatest = BTreeMap::new();
    for of in checked {
        let before = greatest.entry(of.check).or_insert(f64::NEG_INFINITY);
        *before = f64::max(*before, of.value);
    }
    greatest
}

fn say(seed: u64, plant: &Plant) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    write!(out, "seed {seed}:")?;
    for (way, row) in WAYS.iter().zip(&plant.ways) {
        match row {
            Ok(row) => {
                let (covered, all) = palpate_simulate::results::covered(row);
                write!(out, " {way} {covered} of {all};")?;
            }
            Err(reason) => write!(out, " {way}: {reason};")?,
        }
    }
    let beyond = plant
        .checked
        .iter()
        .filter(|of| of.value > of.check.limit());
    for of in beyond {
        write!(out, " {:?} {} at {};", of.check, of.value, of.place)?;
    }
    writeln!(out)?;
    Ok(out.flush()?)
}

fn print(arguments: &Arguments, plants: &[Plant]) -> Result<(), Failure> {
    let checked: Vec<CheckedFigure> = plants.iter().flat_map(|of| of.checked.clone()).collect();
    let refused = plants.iter().filter(|plant| {
        let mut beyond = plant.checked.iter();
        beyond.any(|of| of.value > of.check.limit())
    });
    let refused = refused.count();
    let mut out = io::stdout().lock();
    let mut hold = true;
    let mut ways = Vec::new();
    for (way, name) in WAYS.iter().enumerate() {
        let rows = plants.iter().filter_map(|plant| plant.ways.get(way));
        let failed = rows.clone().filter(|row| row.is_err()).count();
        let counts = rows
            .flatten()
            .map(|row| palpate_simulate::results::covered(row));
        let coverage = Coverage::of(counts);
        let Coverage {
            covered,
            intervals: all,
            ..
        } = coverage;
        hold &= all > 0 && coverage.judgement() != Judgement::Fail;
        ways.push(format!(
            "{covered} of {all} ({name}, {failed} sensors not calibrated)"
        ));
    }
    writeln!(
        out,
        "How close the sessions come to the limits of the checks:\n\n{}\n\n\
         {BEGIN}\nIntervals that cover the truth: {}; {refused} of {} good sessions are refused.\n\n\
         {} sensors of the stack {} from seed {}, all disturbances. Each was calibrated from one session on \
         its simulated bench: with the load cell, and with the stage's scale and the springs alone.\n\n{}\n{END}",
        checks_table(&checked),
        ways.join(", "),
        plants.len(),
        plants.len(),
        arguments.stack,
        arguments.seed,
        loads_table(plants)
    )?;
    if hold && refused == 0 {
        return Ok(());
    }
    Err(Failure::Refused(
        "the intervals of 95 % cover the truth less often than that, or good data are refused"
            .to_owned(),
    ))
}

fn checks_table(checked: &[CheckedFigure]) -> Table {
    let greatest = greatest(checked);
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header(["check", "greatest of all runs", "limit"]);
    for check in Check::ALL {
        let value = greatest.get(&check).copied();
        table.add_row([
            serde_json::to_value(check).map_or(String::new(), |name| {
                name.as_str().unwrap_or_default().to_owned()
            }),
            value.map_or("not seen".to_owned(), |value| format!("{value:.2e}")),
            format!("{:.2e}", check.limit()),
        ]);
    }
    right(table)
}

fn loads_table(plants: &[Plant]) -> Table {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    let mut header = vec!["load".to_owned()];
    for way in WAYS {
        header.extend([
            format!("{way}: error of 1/c_L, root of mean square"),
            "median half width".to_owned(),
            "covered".to_owned(),
        ]);
    }
    table.set_header(header);
    let names = plants.iter().flat_map(|plant| &plant.ways).flatten().next();
    let names = names.into_iter().flatten().map(|of| of.load.clone());
    for name in names {
        let mut cells = vec![name.clone()];
        for way in 0..WAYS.len() {
            let rows = plants
                .iter()
                .filter_map(|plant| plant.ways.get(way)?.as_ref().ok());
            let loads = rows.flatten().filter(|of| of.load == name);
            cells.extend(cells_of(&loads.collect::<Vec<_>>()));
        }
        table.add_row(cells);
    }
    right(table)
}

/// Error, half width and coverage of one load over all sensors; a rigid load has no relative error.
fn cells_of(loads: &[&Measured]) -> [String; 3] {
    let error = |measured: &&Measured| {
        let truth = measured.pressed.true_n_per_m;
        let value = measured.verdict.estimate()?.stiffness_n_per_m;
        let softness = value.map_or(0.0, |value| truth / f64::from(value));
        truth.is_finite().then_some((softness - 1.0).powi(2))
    };
    let errors: Vec<f64> = loads.iter().filter_map(error).collect();
    let widths: Vec<f64> = loads.iter().filter_map(|of| of.half_width()).collect();
    let held = loads
        .iter()
        .filter_map(|of| of.verdict.holds(of.pressed.true_n_per_m));
    let held: Vec<bool> = held.collect();
    let percent = |part: f64| format!("{:.1} %", 1e2 * part);
    let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    let width = quantile(&widths, 0.5).filter(|width| width.is_finite());
    [
        if errors.is_empty() {
            String::new()
        } else {
            percent(mean.sqrt())
        },
        width.map_or(String::new(), percent),
        format!(
            "{} of {}",
            held.iter().filter(|of| **of).count(),
            held.len()
        ),
    ]
}

fn right(mut table: Table) -> Table {
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
