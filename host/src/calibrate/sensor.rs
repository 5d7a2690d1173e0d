//! `palpate calibrate sensor`: from specimens on a bench to a calibration that the board keeps.

use std::io::{self, Write};
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use palpate_sim::switches::Switches;
use palpate_wire::command::CalibrationIdentity;
use palpate_wire::{Command, configuration_crc};
use serde::Serialize;

use super::bench::{self, BenchPlan, LinkedBench, Pressed, Session};
use super::{Calibration, evaluate};
use crate::confirmation::{can_be_confirmed, is_confirmed};
use crate::failure::Failure;
use crate::instrument::{BenchTask, default_settings};
use crate::link::{self, Link};
use crate::progress::Progress;
use crate::results::stiffness;
use crate::storage;

/// Calibrate a board's sensor on a bench, and store the calibration in the board
///
/// Presses a block and six springs upon the sensor, each to three depths, drives the train of ramps on
/// each, evaluates what board and gauges say, and stores what it finds.
#[derive(Args)]
#[command(after_help = "\
The emulated board has a simulated bench, with a stage, a load cell and springs that are as good as
their tolerance. What was stored before stays in force until the end, and for good if anything fails.

Example:
  palpate calibrate sensor --board emulated")]
pub(crate) struct Arguments {
    #[command(flatten)]
    link: link::Arguments,
    /// Number of the calibration, which the board reports. Otherwise the seconds since 1970
    #[arg(long, value_name = "NUMBER")]
    id: Option<u32>,
    /// Store without asking
    #[arg(long)]
    yes: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Found {
    simulated: bool,
    pub(crate) calibration_id: u32,
    calibrated_at_s: u32,
    calibrated_at_c: f32,
    runs: usize,
    sensing_n_per_m: f64,
    actuated_n_per_m: f64,
    peak_current_a: f32,
    /// Relative, at the peak current.
    rise: f64,
    attraction_n: f64,
    /// Relative standard uncertainties of 1/c_L and 1/c_S.
    scale_uncertainty: f64,
    constant_uncertainty: f64,
    pub(crate) stored: bool,
    pub(crate) configuration_crc: u32,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if !arguments.yes {
        can_be_confirmed("storing")?;
    }
    let mut link = arguments.link.open()?;
    let done = calibrated(&mut link, arguments);
    if done.is_err() {
        // What is stored is in force again, as if nothing had been.
        let _ = link.ask(&Command::Disarm);
        let _ = link.ask(&Command::Load);
    }
    print(&done?, arguments.json)
}

fn calibrated(link: &mut Link, arguments: &Arguments) -> Result<Found, Failure> {
    let (stack, plant) = arguments.link.emulated.stack_and_plant()?;
    let task = BenchTask::of(&plant, &stack, Switches::all(), &default_settings());
    let progress = Progress::new(task.plan.runs());
    let mut say = |pressed: Pressed, depth_m: f64| {
        progress.say(&describe(pressed, depth_m));
        progress.step();
    };
    let session = bench::hold(&mut LinkedBench::new(link, &plant), &task.plan, &mut say)?;
    progress.finish();
    let calibration = evaluate(&session, &task.known)
        .map_err(|error| Failure::Refused(format!("calibration: {error}")))?;
    let identity = identity(arguments.id, session.temperature_c, &calibration);
    let mut found = Found::new(&task.plan, &session, &calibration, &identity);
    put_in_force(link, &calibration, identity)?;
    if arguments.yes || is_confirmed("Store this calibration in the board?")? {
        found.configuration_crc = storage::store(link)?.stored_crc;
        found.stored = true;
    }
    Ok(found)
}

impl Found {
    /// What is said of a calibration that is not stored yet.
    pub(crate) fn new(
        plan: &BenchPlan,
        session: &Session,
        calibration: &Calibration,
        identity: &CalibrationIdentity,
    ) -> Self {
        let peak_a = f64::from(plan.settings.peak_current_a);
        let actuated = &calibration.actuated;
        Self {
            simulated: true,
            calibration_id: identity.id,
            calibrated_at_s: identity.calibrated_at_s,
            calibrated_at_c: identity.calibrated_at_c,
            runs: session.runs.len() + 1,
            sensing_n_per_m: calibration.sensing_n_per_m,
            actuated_n_per_m: calibration.sensing_n_per_m / actuated.ratio,
            peak_current_a: plan.settings.peak_current_a,
            rise: actuated.rise(peak_a),
            attraction_n: actuated.attraction_n_per_a2 * peak_a * peak_a,
            scale_uncertainty: calibration.uncertainty.scale,
            constant_uncertainty: calibration.uncertainty.constant,
            stored: false,
            configuration_crc: 0,
        }
    }
}

/// What is pressed in a run, in words.
pub(crate) fn describe(pressed: Pressed, depth_m: f64) -> String {
    let depth = format!("{:.2} mm deep", 1e3 * depth_m);
    match pressed {
        Pressed::Nothing => "nothing touches".to_owned(),
        Pressed::Block => format!("block, {depth}"),
        Pressed::Spring { n_per_m } => format!("spring of {}, {depth}", stiffness(n_per_m)),
    }
}

/// Number, date and hash of a calibration's parts.
pub(crate) fn identity(
    id: Option<u32>,
    temperature_c: f64,
    calibration: &Calibration,
) -> CalibrationIdentity {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
    let now_s = since_1970.map_or(0, |time| time.as_secs());
    let now_s = u32::try_from(now_s).unwrap_or(u32::MAX);
    let parts = calibration.commands.iter();
    let parts = parts.filter(|command| !matches!(command, Command::SetSettings(_)));
    CalibrationIdentity {
        id: id.unwrap_or(now_s),
        calibrated_at_s: now_s,
        calibrated_at_c: temperature_c as f32,
        hash: configuration_crc(parts),
    }
}

/// Sets a calibration, which is lost with the power unless it is stored.
pub(crate) fn put_in_force(
    link: &mut Link,
    calibration: &Calibration,
    identity: CalibrationIdentity,
) -> Result<(), Failure> {
    link.must(&Command::Disarm)?;
    for command in &calibration.commands {
        link.must(command)?;
    }
    link.must(&Command::SetCalibrationIdentity(identity))?;
    Ok(())
}

fn print(found: &Found, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(found)?)?);
    }
    let mut table = Table::new();
    table.load_style(NOTHING);
    let percent = |part: f64| format!("{:.1} %", 1e2 * part);
    for [what, value] in [
        ["actuated layer", &stiffness(found.actuated_n_per_m)],
        ["for a sensing layer of", &stiffness(found.sensing_n_per_m)],
        [
            &format!("stiffer at {:.1} A by", found.peak_current_a),
            &percent(found.rise),
        ],
        [
            "attraction then",
            &format!("{:.0} mN", 1e3 * found.attraction_n),
        ],
        ["uncertainty of 1/c_L", &percent(found.scale_uncertainty)],
        ["and of 1/c_S besides", &percent(found.constant_uncertainty)],
    ] {
        table.add_row([what, value]);
    }
    writeln!(out, "{table}")?;
    if found.stored {
        let id = found.calibration_id;
        return Ok(writeln!(out, "Calibration {id} is in force, and stored.")?);
    }
    Ok(writeln!(
        out,
        "It is in force, and not stored: it is lost with the power."
    )?)
}
