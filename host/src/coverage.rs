//! `palpate coverage`: how often claims hold, over many sensors of a kind.

use std::collections::BTreeMap;
use std::io::{self, Write};

use clap::Args;
use clap::builder::PossibleValuesParser;
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use rayon::prelude::*;

use crate::demo;
use crate::engine::Engine;
use crate::failure::Failure;
use crate::instrument::{Instrument, default_settings};
use crate::progress::Progress;
use crate::results::Measured;

/// Press the demo's row upon many sensors, each calibrated on its own bench, and count how often
/// the claims hold
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Exit code 1 when fewer than 94 % of all estimates hold, since an interval of 95 % is
then no such interval, and when there is no estimate at all.")]
pub(crate) struct Arguments {
    /// How many sensors are drawn
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    plants: u64,
    /// The first sensor; the following have the following seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kind of sensor
    #[arg(long, default_value = "ultrasoft", value_parser = PossibleValuesParser::new(Stack::BUILTIN))]
    stack: String,
    /// How deep the loads are pressed, in units of the depth that the sensor was drawn for; the
    /// bench presses 0.6 to 1.4 deep
    #[arg(long, default_value_t = 1.0, value_parser = depth)]
    depth: f64,
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

/// Comments that `cargo xtask evidence` looks for around what it keeps.
pub(crate) const BEGIN: &str = "<!-- evidence:begin -->";
pub(crate) const END: &str = "<!-- evidence:end -->";

/// What one sensor made of the row, or why it could not be calibrated.
type Plant = Result<Vec<Measured>, String>;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let stack = Stack::builtin(&arguments.stack).map_err(LoadError::from)?;
    let last = arguments.seed.saturating_add(arguments.plants - 1);
    let progress = Progress::new(arguments.plants as usize);
    let plants: Vec<Plant> = (arguments.seed..=last)
        .into_par_iter()
        .map(|seed| {
            let row = row(&stack, &disturbances, seed, arguments.depth);
            progress.step();
            row.map_err(|failure| failure.to_string())
        })
        .collect();
    progress.finish();
    let mut out = io::stdout().lock();
    writeln!(out, "{BEGIN}")?;
    writeln!(
        out,
        "{} sensors of the stack {} from seed {}, all disturbances, each calibrated on its own \
         simulated bench and pressed to {} of its working depth:\n",
        arguments.plants, arguments.stack, arguments.seed, arguments.depth
    )?;
    let loads = by_load(&plants);
    writeln!(out, "{}\n", table(&loads))?;
    for (reason, count) in reasons(&plants) {
        writeln!(out, "- {count} without an estimate: {reason}")?;
    }
    let (held, estimated) = loads.iter().fold((0, 0), |(held, estimated), load| {
        (held + load.held, estimated + load.widths.len())
    });
    writeln!(out, "\n{held} of {estimated} estimates hold.\n{END}")?;
    if estimated == 0 {
        return Err(Failure::Refused(
            "no press came to an estimate, so that there is no claim to count".to_owned(),
        ));
    }
    if held * 100 < estimated * HONEST {
        return Err(Failure::Refused(format!(
            "{held} of {estimated} claims of 95 % hold, fewer than {HONEST} %"
        )));
    }
    Ok(())
}

fn row(
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
    depth: f64,
) -> Result<Vec<Measured>, Failure> {
    let settings = default_settings();
    let instrument = Instrument::calibrated(stack, disturbances, seed, Switches::all(), &settings)?;
    demo::loads(instrument.plant.sensing.spring_n_per_m)
        .into_iter()
        .map(|(name, load)| demo::measure(&instrument, name, load, depth, &Engine::Native))
        .collect()
}

/// All sensors' results with one load.
#[derive(Default)]
struct ByLoad {
    name: String,
    pressed: usize,
    held: usize,
    /// Half the width of each interval of c_S/c_L, over its value.
    widths: Vec<f64>,
    /// Error of each c_S/c_L over its value.
    errors: Vec<f64>,
}

fn by_load(plants: &[Plant]) -> Vec<ByLoad> {
    let mut loads: Vec<ByLoad> = Vec::new();
    for measured in plants.iter().flatten().flatten() {
        let place = loads.iter().position(|load| load.name == measured.load);
        let place = place.unwrap_or_else(|| {
            loads.push(ByLoad {
                name: measured.load.clone(),
                ..ByLoad::default()
            });
            loads.len() - 1
        });
        if let Some(load) = loads.get_mut(place) {
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
        self.held += usize::from(measured.verdict.holds(truth) == Some(true));
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
            load.held.to_string(),
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
    let place = part * sorted.len().saturating_sub(1) as f64;
    sorted.get(place.round() as usize).copied()
}

/// Reasons without their numbers, and how many results each took.
fn reasons(plants: &[Plant]) -> BTreeMap<String, usize> {
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
