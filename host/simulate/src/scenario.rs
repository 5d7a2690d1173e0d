//! `palpate simulate`: a scenario from a file.

use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::jsonl::{self, Note};
use palpate_cli::output::{OutputFile, distinct};
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::scenario::{self, Scenario};
use palpate_sim::stack::{Disturbances, LoadError};

use crate::engine::{Engine, EngineChoice, press};
use crate::instrument::{CalibratedInstrument, SPEED_M_PER_S, default_settings};
use crate::press::{CLEARANCE_M, Press};
use crate::report;
use crate::results::{self, Measured};

/// Run a scenario: press objects upon a simulated sensor that was calibrated on its own bench
#[derive(Args)]
#[command(after_help = "\
Exit code 2 when the scenario is refused: the message names file, line, key and what is allowed. \
The same scenario and seed give the same bytes.

Example, with creep and vibration only:
  stack = \"ultrasoft\"           # paper, soft-closed, ultrasoft, or a stack file beside this one
  disturbances = \"none\"         # or \"all\"
  except = [\"creep\", \"vibration\"]

  [[press]]
  load = \"hardening\"            # spring, hardening, pin, ball, rigid; viscoelastic:
                                # with creep = 0.5 and creep_time_s = 2
  stiffness_N_per_m = 3e3
  cubic_N_per_m3 = 1e10
  depth_m = 0.3e-3              # of the sensing layer; optional, as the following
  speed_m_per_s = 2e-3
  holder = \"hand\"               # or \"stand\"
  name = \"a finger\"

  [[press]]
  load = \"ball\"                 # or \"pin\": a tip on an elastic object
  radius_m = 8e-3
  modulus_Pa = 300e3
  poisson_ratio = 0.5
  thickness_m = 10e-3           # optional: bonded to a rigid base")]
pub struct Arguments<E: EngineChoice> {
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
    /// Write all records of the instrument to this file, one JSON object a line: `palpate decode` has
    /// the same lines, and here a line with the name of each press precedes its records
    #[arg(long, value_name = "FILE.jsonl")]
    records: Option<PathBuf>,
    #[command(flatten)]
    engine: E,
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run<E: EngineChoice>(arguments: &Arguments<E>) -> Result<(), Failure> {
    let scenario = Scenario::load(&arguments.scenario)?;
    let report = OutputFile::optional("--report", arguments.report.as_ref())?;
    let records = OutputFile::optional("--records", arguments.records.as_ref())?;
    for file in report.iter().chain(&records) {
        file.clone().apart_from(&arguments.scenario)?;
    }
    distinct(report.iter().chain(&records))?;
    let engine = arguments.engine.engine()?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let progress = engine.progress(scenario.presses.len() + 1);
    progress.say("calibrating on the bench");
    let instrument = CalibratedInstrument::calibrated(
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
        row.push(measure(&instrument, what, engine.as_ref())?);
        progress.step();
    }
    progress.finish();
    let title = results::title(&instrument, &scenario.stack.name, arguments.seed);
    let recorded = records.map_or(Ok(()), |file| file.write(lines(&row)?));
    let reported = report.map_or(Ok(()), |file| {
        file.write(report::page(&instrument, &row, &title)?)
    });
    // Results are printed even if writing a file failed.
    let printed = if arguments.json {
        results::print_json(&row)
    } else {
        results::print(&instrument, &row, &title)
    };
    recorded.and(reported).and(printed)
}

fn measure(
    instrument: &CalibratedInstrument,
    what: &scenario::Press,
    engine: &dyn Engine,
) -> Result<Measured, Failure> {
    let pressed = press(instrument, &profile(instrument, what), engine)?;
    Ok(Measured::new(what.name.clone(), pressed))
}

/// Profile of a scenario's press, with the instrument's depth and speed where it states none.
pub fn profile(instrument: &CalibratedInstrument, what: &scenario::Press) -> Press {
    Press {
        name: what.name.clone(),
        load: what.load,
        contact: Contact::default(),
        holder: what.holder,
        clearance_m: CLEARANCE_M,
        depth_m: what.depth_m.unwrap_or(instrument.depth_m),
        speed_m_per_s: what.speed_m_per_s.unwrap_or(SPEED_M_PER_S),
    }
}

/// Formats the frames of all presses, press by press.
fn lines(row: &[Measured]) -> Result<String, Failure> {
    let mut text = String::new();
    for measured in row {
        let press = Note::Press {
            press: &measured.load,
        };
        text.push_str(&jsonl::note(&press)?);
        text.push('\n');
        for frame in &measured.pressed.frames {
            text.push_str(&jsonl::frame(frame)?);
            text.push('\n');
        }
    }
    Ok(text)
}
