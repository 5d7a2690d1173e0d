//! `palpate coverage`: how often claims hold, over many sensors of a kind.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use serde::Serialize;

use crate::demo;
use crate::engine::Native;
use crate::evidence::{BEGIN, END};
use crate::failure::Failure;
use crate::in_order::in_order;
use crate::instrument::{CalibratedInstrument, default_settings};
use crate::output::OutputFile;
use crate::progress::Progress;
use crate::results::{self, Measured};

/// Press the demo's row upon many sensors, each calibrated on its own bench, and count how often
/// their intervals cover the truth
#[derive(Args)]
#[command(after_help = "\
Prints Markdown: a line for each sensor as it is done, then the table. An interrupted run has its lines,
and with --rows every press of the sensors that were done. Exit code 1 when fewer than 94 % of all
intervals cover the truth, since an interval of 95 % is then no such interval, and when there is no
estimate at all.")]
pub(crate) struct Arguments {
    /// How many sensors are drawn
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    plants: u64,
    /// The first sensor; the following have the following seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "ultrasoft")]
    stack: String,
    /// How deep the loads are pressed, in units of the depth that the sensor was drawn for; the
    /// bench presses 0.6 to 1.4 deep
    #[arg(long, default_value_t = 1.0, value_parser = depth)]
    depth: f64,
    /// Write every press to this file as its sensor is done, as CSV
    #[arg(long, value_name = "FILE.csv")]
    rows: Option<PathBuf>,
}

fn depth(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(depth) if (0.1..=2.0).contains(&depth) => Ok(depth),
        _ => Err("not a number from 0.1 to 2".to_owned()),
    }
}

/// Of the estimates of an honest instrument, so many hold at least, in percent: 95, and one for
/// what is random about a few hundred plants.
const HONEST: usize = 94;

/// What one sensor made of the row, or why it could not be calibrated.
type PlantResult = Result<Vec<Measured>, String>;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let stack = Stack::named(&arguments.stack, Path::new(""))?;
    let mut rows = arguments.rows.as_deref().map(Rows::create).transpose()?;
    let progress = Progress::new(arguments.plants as usize);
    let seed_of = |index: usize| arguments.seed.saturating_add(index as u64);
    let plant = |index| -> PlantResult {
        let row = row(&stack, &disturbances, seed_of(index), arguments.depth);
        row.map_err(|failure| failure.to_string())
    };
    let mut plants: Vec<PlantResult> = Vec::new();
    in_order(arguments.plants as usize, plant, |index, plant| {
        let seed = seed_of(index);
        if let Some(rows) = &mut rows {
            rows.write(seed, &plant)?;
        }
        plants.push(plant);
        progress.step();
        say(seed, &plants)
    })?;
    progress.finish();
    let mut out = io::stdout().lock();
    writeln!(out, "{BEGIN}")?;
    writeln!(
        out,
        "{} sensors of the stack {} from seed {}, all disturbances, each calibrated on its own \
         simulated bench and pressed to {} of its working depth:\n",
        arguments.plants, stack.name, arguments.seed, arguments.depth
    )?;
    let loads = by_load(&plants);
    writeln!(out, "{}\n", table(&loads))?;
    for (reason, count) in reasons(&plants) {
        writeln!(out, "- {count} without an estimate: {reason}")?;
    }
    let (covered, estimated) = loads.iter().fold((0, 0), |(covered, estimated), load| {
        (covered + load.covered, estimated + load.widths.len())
    });
    writeln!(
        out,
        "\n{covered} of {estimated} intervals cover the truth.\n{END}"
    )?;
    if estimated == 0 {
        return Err(Failure::Refused(
            "no press came to an estimate, so that there is no claim to count".to_owned(),
        ));
    }
    if covered * 100 < estimated * HONEST {
        return Err(Failure::Refused(format!(
            "{covered} of {estimated} intervals of 95 % cover the truth, fewer than {HONEST} %"
        )));
    }
    Ok(())
}

/// A line for a sensor that is done, the last one, with what all have come to.
fn say(seed: u64, plants: &[PlantResult]) -> Result<(), Failure> {
    let of_last = match plants.last() {
        Some(Ok(row)) => {
            let (covered, estimated) = results::covered(row);
            format!("{covered} of {estimated} intervals cover the truth")
        }
        Some(Err(reason)) => reason.clone(),
        None => return Ok(()),
    };
    let all = plants.iter().flatten().map(|row| results::covered(row));
    let (covered, estimated) = all.fold((0, 0), |sum, of| (sum.0 + of.0, sum.1 + of.1));
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "seed {seed}: {of_last}; {covered} of {estimated} so far, {} sensors",
        plants.len()
    )?;
    Ok(out.flush()?)
}

/// The file of presses, written sensor by sensor.
struct Rows {
    path: PathBuf,
    file: csv::Writer<File>,
}

/// A row of the file: a press, or a sensor that could not be calibrated.
#[derive(Default, Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct CoverageRow<'m> {
    seed: u64,
    load: &'m str,
    true_N_per_m: Option<f64>,
    estimate_N_per_m: Option<f32>,
    lower_N_per_m: Option<f32>,
    upper_N_per_m: Option<f32>,
    covered: Option<bool>,
    reason: Option<String>,
}

impl Rows {
    fn create(path: &Path) -> Result<Self, Failure> {
        OutputFile::new("--rows", path)?;
        let file = File::create(path).map_err(|error| Self::unwritten(path, &error))?;
        Ok(Self {
            path: path.to_path_buf(),
            file: csv::Writer::from_writer(file),
        })
    }

    fn unwritten(path: &Path, error: &dyn std::fmt::Display) -> Failure {
        Failure::Refused(format!(
            "--rows {}: {error}. It has the sensors before this one.",
            path.display()
        ))
    }

    fn write(&mut self, seed: u64, plant: &PlantResult) -> Result<(), Failure> {
        let rows = match plant {
            Ok(measured) => measured
                .iter()
                .map(|of| CoverageRow::of(seed, of))
                .collect(),
            Err(reason) => vec![CoverageRow {
                seed,
                reason: Some(reason.clone()),
                ..CoverageRow::default()
            }],
        };
        rows.iter()
            .try_for_each(|row| self.file.serialize(row))
            .and_then(|()| Ok(self.file.flush()?))
            .map_err(|error| Self::unwritten(&self.path, &error))
    }
}

impl<'m> CoverageRow<'m> {
    fn of(seed: u64, measured: &'m Measured) -> Self {
        let truth = measured.pressed.true_n_per_m;
        let estimate = measured.verdict.estimate();
        Self {
            seed,
            load: &measured.load,
            true_N_per_m: truth.is_finite().then_some(truth),
            estimate_N_per_m: estimate.and_then(|of| of.stiffness_n_per_m),
            lower_N_per_m: estimate.map(|of| of.lower_n_per_m),
            upper_N_per_m: estimate.and_then(|of| of.upper_n_per_m),
            covered: measured.verdict.holds(truth),
            reason: measured.verdict.reason(),
        }
    }
}

fn row(
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
    depth: f64,
) -> Result<Vec<Measured>, Failure> {
    let settings = default_settings();
    let instrument =
        CalibratedInstrument::calibrated(stack, disturbances, seed, Switches::all(), &settings)?;
    demo::loads(instrument.plant.sensing.spring_n_per_m)
        .into_iter()
        .map(|(name, load)| demo::measure(&instrument, name, load, depth, &Native))
        .collect()
}

/// All sensors' results with one load.
#[derive(Default)]
struct ByLoad {
    name: String,
    pressed: usize,
    covered: usize,
    /// Half the width of each interval of c_S/c_L, over its value.
    widths: Vec<f64>,
    /// Error of each c_S/c_L over its value.
    errors: Vec<f64>,
}

fn by_load(plants: &[PlantResult]) -> Vec<ByLoad> {
    let mut loads: Vec<ByLoad> = Vec::new();
    for measured in plants.iter().flatten().flatten() {
        let index = loads.iter().position(|load| load.name == measured.load);
        let index = index.unwrap_or_else(|| {
            loads.push(ByLoad {
                name: measured.load.clone(),
                ..ByLoad::default()
            });
            loads.len() - 1
        });
        if let Some(load) = loads.get_mut(index) {
            load.add(measured);
        }
    }
    loads
}

impl ByLoad {
    fn add(&mut self, measured: &Measured) {
        self.pressed += 1;
        let truth = measured.pressed.true_n_per_m;
        let Some(estimate) = measured.verdict.estimate() else {
            return;
        };
        self.covered += usize::from(measured.verdict.holds(truth) == Some(true));
        self.widths.extend(measured.half_width());
        let value = estimate
            .stiffness_n_per_m
            .map_or(0.0, |value| truth / f64::from(value));
        self.errors.push((value - 1.0).abs());
    }
}

fn table(loads: &[ByLoad]) -> Table {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "load",
        "pressed",
        "estimated",
        "hold",
        "of 1/c_L: median half width",
        "median error",
        "95th percentile",
    ]);
    for load in loads {
        let percent = |part: f64| format!("{:.1} %", part * 100.0);
        table.add_row([
            load.name.clone(),
            load.pressed.to_string(),
            load.widths.len().to_string(),
            load.covered.to_string(),
            quantile(&load.widths, 0.5).map_or(String::new(), percent),
            quantile(&load.errors, 0.5).map_or(String::new(), percent),
            quantile(&load.errors, 0.95).map_or(String::new(), percent),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// The value below which this part of the values lies; nothing of none.
pub(crate) fn quantile(values: &[f64], part: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = part * sorted.len().saturating_sub(1) as f64;
    sorted.get(index.round() as usize).copied()
}

/// Reasons without their numbers, and how many results each took.
fn reasons(plants: &[PlantResult]) -> BTreeMap<String, usize> {
    let of_plants = plants
        .iter()
        .filter_map(|plant| plant.as_ref().err().cloned());
    let of_presses = plants
        .iter()
        .flatten()
        .flatten()
        .filter_map(|measured| measured.verdict.reason());
    let mut counts = BTreeMap::new();
    for reason in of_plants.chain(of_presses) {
        let kind = reason
            .split_once(": ")
            .map_or(reason.as_str(), |(kind, _)| kind);
        *counts.entry(kind.to_owned()).or_default() += 1;
    }
    counts
}
