//! `palpate simulate`: a scenario from a file.

use std::fs;
use std::path::PathBuf;

use clap::Args;
use palpate_sim::scenario::{self, Scenario};
use palpate_sim::stack::{Disturbances, LoadError};
use palpate_wire::Record;
use serde::Serialize;

use crate::engine::{self, Engine};
use crate::failure::Failure;
use crate::instrument::{Instrument, SPEED_M_PER_S, default_settings};
use crate::press::{Press, press};
use crate::report;
use crate::results::{self, Measured};

/// Run a scenario: press objects upon a simulated sensor that was calibrated on its own bench
#[derive(Args)]
#[command(after_help = "\
Exit code 2 when the scenario is refused: the message names file, line, key and what is allowed.
The same scenario and seed give the same bytes.

Example, with creep and vibration only:
  stack = \"ultrasoft\"           # paper, soft-closed, ultrasoft, or a stack file beside this one
  disturbances = \"none\"         # or \"all\"
  except = [\"creep\", \"vibration\"]

  [[press]]
  load = \"hardening\"            # spring, hardening or rigid
  stiffness_N_per_m = 3e3
  cubic_N_per_m3 = 1e10
  depth_m = 0.3e-3              # of the sensing layer; optional, as the following
  speed_m_per_s = 2e-3
  holder = \"hand\"               # or \"stand\"
  name = \"a finger\"")]
pub(crate) struct Arguments {
    /// The scenario
    #[arg(value_name = "SCENARIO.toml")]
    scenario: PathBuf,
    /// Which sensor of the stack is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// One JSON object for each press, instead of a table
    #[arg(long)]
    json: bool,
    /// Write a report to this file
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write everything that the instrument tells to this file, one JSON object a line
    #[arg(long, value_name = "FILE.jsonl")]
    records: Option<PathBuf>,
    #[command(flatten)]
    engine: engine::Arguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let engine = arguments.engine.engine()?;
    let scenario = Scenario::load(&arguments.scenario)?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let progress = arguments.engine.progress(scenario.presses.len() + 1);
    progress.say("calibrating on the bench");
    let instrument = Instrument::calibrated(
        &scenario.stack,
        &disturbances,
        arguments.seed,
        scenario.switches,
        &default_settings(),
    )?;
    progress.step();
    let mut row = Vec::new();
    for what in &scenario.presses {
        progress.say(&format!("pressing {}", what.name));
        row.push(measure(&instrument, what, &engine)?);
        progress.step();
    }
    progress.finish();
    if let Some(file) = &arguments.records {
        fs::write(file, records(&row)?)?;
    }
    let title = results::title(&instrument, &scenario.stack.name, arguments.seed);
    if let Some(file) = &arguments.report {
        fs::write(file, report::page(&instrument, &row, &title)?)?;
    }
    if arguments.json {
        return results::print_json(&row);
    }
    results::print(&instrument, &row, &title)
}

fn measure(
    instrument: &Instrument,
    what: &scenario::Press,
    engine: &Engine,
) -> Result<Measured, Failure> {
    let how = Press {
        name: what.name.clone(),
        load: what.load,
        holder: what.holder,
        depth_m: what.depth_m.unwrap_or(instrument.plant.press.depth_m),
        speed_m_per_s: what.speed_m_per_s.unwrap_or(SPEED_M_PER_S),
    };
    let pressed = press(instrument, &how, engine)?;
    Ok(Measured::new(what.name.clone(), pressed))
}

/// A record of a press, as a line.
#[derive(Serialize)]
struct Line<'r> {
    simulated: bool,
    press: &'r str,
    time_us: u64,
    record: &'r Record,
}

fn records(row: &[Measured]) -> Result<String, Failure> {
    let mut text = String::new();
    for measured in row {
        for (at, record) in &measured.pressed.records {
            let line = Line {
                simulated: true,
                press: &measured.load,
                time_us: at.as_ticks(),
                record,
            };
            text.push_str(&serde_json::to_string(&line)?);
            text.push('\n');
        }
    }
    Ok(text)
}
