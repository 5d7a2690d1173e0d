//! `palpate demo`: a row of springs, much softer to much stiffer than the sensor.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::mechanics::load::Load;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::Holder;

use crate::engine::{Engine, EngineChoice, press};
use crate::instrument::{CalibratedInstrument, SPEED_M_PER_S, default_settings};
use crate::press::{CLEARANCE_M, Press};
use crate::report;
use crate::results::{self, Measured};
use crate::touch;

/// Press a row of springs on a simulated sensor, and show its estimates
///
/// The sensor is drawn from a stack and calibrated on its own simulated bench at two temperatures, with all
/// that disturbs both. Driver, procedure and estimator are the firmware's own.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments<E: EngineChoice> {
    #[command(subcommand)]
    other: Option<Other>,
    /// Which sensor of the stack is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "ultrasoft")]
    stack: String,
    /// Without disturbances, noise and quantisation
    #[arg(long)]
    ideal: bool,
    /// Where the report is written
    #[arg(long, default_value = "palpate-demo.html", value_name = "FILE.html")]
    report: PathBuf,
    /// One JSON object for each load, and no report
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    engine: E,
}

/// Demonstrations beside the row of springs.
#[derive(Subcommand)]
enum Other {
    Touch(touch::Arguments),
}

/// Springs, relative to the sensing layer. A rigid block follows them as the last load.
const RATIOS: [f64; 7] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run<E: EngineChoice>(arguments: &Arguments<E>) -> Result<(), Failure> {
    if let Some(Other::Touch(arguments)) = &arguments.other {
        return touch::run(arguments);
    }
    let report = (!arguments.json)
        .then(|| OutputFile::new("--report", &arguments.report))
        .transpose()?;
    let engine = arguments.engine.engine()?;
    let switches = if arguments.ideal {
        Switches::none()
    } else {
        Switches::all()
    };
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let stack = Stack::named(&arguments.stack, Path::new(""))?;
    let progress = engine.progress(RATIOS.len() + 2);
    progress.say("calibrating on the bench");
    let instrument = CalibratedInstrument::at_two_temperatures(
        &stack,
        &disturbances,
        arguments.seed,
        switches,
        &default_settings(),
    )?;
    progress.step();
    let mut row = Vec::new();
    for (name, load) in loads(instrument.plant.sensing.spring_n_per_m) {
        progress.say(&format!("pressing {name}"));
        row.push(measure(&instrument, name, load, 1.0, engine.as_ref())?);
        progress.step();
    }
    progress.finish();
    let Some(file) = report else {
        return results::print_json(&row);
    };
    let title = results::title(&instrument, &stack.name, arguments.seed);
    results::print(&instrument, &row, &title)?;
    file.write(report::page(&instrument, &row, &title)?)?;
    Ok(writeln!(io::stdout(), "Report: {}", file.path().display())?)
}

/// Loads for a sensor with this c_S, with names.
pub fn loads(sensing_n_per_m: f64) -> Vec<(String, Load)> {
    let spring = |ratio: f64| {
        let n_per_m = ratio * sensing_n_per_m;
        (format!("{ratio} c_S"), Load::Spring { n_per_m })
    };
    let springs = RATIOS.into_iter().map(spring);
    springs.chain([("block".to_owned(), Load::Rigid)]).collect()
}

/// Presses one load to `depth` times the working depth.
pub fn measure(
    instrument: &CalibratedInstrument,
    name: String,
    load: Load,
    depth: f64,
    engine: &dyn Engine,
) -> Result<Measured, Failure> {
    let how = Press {
        name: name.clone(),
        load,
        contact: Contact::default(),
        holder: Holder::Stand,
        clearance_m: CLEARANCE_M,
        depth_m: depth * instrument.depth_m,
        speed_m_per_s: SPEED_M_PER_S,
    };
    Ok(Measured::new(name, press(instrument, &how, engine)?))
}
