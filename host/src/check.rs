//! `palpate check`: is a board's calibration still true? By a spring that is known.

use std::io::{self, Write};

use clap::Args;
use palpate_calibration::{Checked, KnownPress, LOADS};
use palpate_wire::Command;
use serde::Serialize;

use crate::calibrate::sensor::{identity, put_in_force, spring, tolerance};
use crate::configuration;
use crate::failure::Failure;
use crate::link::{self, Link, Run};
use crate::measure::{arm, measured, truth};
use crate::notice;
use crate::results::stiffness;
use crate::storage;

/// Check a board's calibration by a spring that is known, and correct the size of its stiffening
///
/// Temperature and age change the stiffening, which no press upon an unknown object shows. One press upon a
/// spring of known stiffness does: what the calibration leaves open of the stiffening is corrected, and a
/// calibration that is off by more than three standard errors is refused.
#[derive(Args)]
#[command(after_help = "\
The spring should be about as stiff as the sensing layer, and be pressed as deep as objects are. The
corrected calibration is in force at once, and lost with the power unless it is stored.

Exit code 1 if the press contradicts the calibration, or the board refuses the measurement.

Examples:
  palpate check --spring 8000 --store
  palpate check --board emulated --seed 7 --load 1")]
pub(crate) struct Arguments {
    #[command(flatten)]
    link: link::Arguments,
    /// Stiffness of the spring with what it stands on, N/m. The emulated board knows its own
    #[arg(long, value_name = "N_PER_M", value_parser = spring)]
    spring: Option<f64>,
    /// How far that may be off, relative
    #[arg(long, value_name = "PART", default_value_t = 0.01, value_parser = tolerance)]
    tolerance: f64,
    /// What the emulated board presses: a spring of this multiple of the sensing layer's nominal
    /// stiffness
    #[arg(long, value_name = "RATIO", default_value_t = 1.0)]
    load: f64,
    /// Longest that is waited for a contact, s
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    wait: f64,
    /// Store the corrected calibration
    #[arg(long)]
    store: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The JSON output.
#[derive(Serialize)]
struct Line {
    simulated: bool,
    spring_n_per_m: f64,
    measured_n_per_m: Option<f32>,
    lower_n_per_m: f32,
    upper_n_per_m: Option<f32>,
    /// In standard errors; positive where the spring was read too stiff.
    deviation: f64,
    /// Of the stiffening, relative.
    rise_change: f64,
    /// Relative standard uncertainty of 1/c_L upon loads of `loads` times c_S, noise of a press apart.
    uncertainty_before: [f64; LOADS.len()],
    uncertainty_after: [f64; LOADS.len()],
    loads: [f64; LOADS.len()],
    temperature_c: Option<f32>,
    configuration_crc: u32,
    stored: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let emulated = arguments.link.is_emulated();
    let load = emulated.then_some(arguments.load);
    let mut link = arguments.link.open_pressed(Run::AsFastAsItCan, load)?;
    if link.is_recording() {
        return Err(Failure::Argument(
            "--board: a recording cannot be pressed; name a board".to_owned(),
        ));
    }
    if arguments.spring.is_none() && !emulated {
        return Err(Failure::Argument(
            "--spring: how stiff the spring is, with what it stands on, in N/m".to_owned(),
        ));
    }
    let commands = in_force(&mut link)?;
    arm(&mut link)?;
    if !emulated {
        notice::say(
            "Press the spring upon the sensor, as deep as objects are pressed, and hold still.",
        );
    }
    let estimate = measured(&mut link, arguments.wait)?;
    let own = truth(&mut link);
    link.must(&Command::Disarm)?;
    let spring_n_per_m = arguments.spring.or(own).ok_or_else(|| {
        Failure::Argument("--load: the emulated board pressed no spring".to_owned())
    })?;
    let press = KnownPress {
        spring_n_per_m,
        tolerance: arguments.tolerance,
        load_ratio: estimate.load_ratio.into(),
        standard_error: estimate.load_ratio_standard_error.into(),
        force_n: estimate.force_n.into(),
        temperature_c: estimate.temperature_c.map(f64::from),
    };
    let checked = palpate_calibration::check(&commands, &press)
        .map_err(|cause| Failure::Refused(cause.to_string()))?;
    keep(&mut link, &checked, &press)?;
    let stored = if arguments.store {
        Some(storage::store(&mut link)?)
    } else {
        None
    };
    let line = Line {
        simulated: arguments.link.is_simulated(&link),
        spring_n_per_m,
        measured_n_per_m: estimate.stiffness_n_per_m,
        lower_n_per_m: estimate.lower_n_per_m,
        upper_n_per_m: estimate.upper_n_per_m,
        deviation: checked.deviation,
        rise_change: checked.rise_change,
        uncertainty_before: checked.uncertainty_before,
        uncertainty_after: checked.uncertainty_after,
        loads: LOADS,
        temperature_c: estimate.temperature_c,
        configuration_crc: storage::inspect(&mut link)?.in_force_crc,
        stored: stored.is_some(),
    };
    print(&line, arguments.json)
}

/// The calibration in force with the settings, which a board may have without their being set.
fn in_force(link: &mut Link) -> Result<Vec<Command>, Failure> {
    let mut commands = configuration::read(link)?;
    let has_settings = commands
        .iter()
        .any(|command| matches!(command, Command::SetSettings(_)));
    if !has_settings {
        let settings = configuration::settings(link)?;
        commands.insert(0, Command::SetSettings(settings));
    }
    Ok(commands)
}

/// Puts the corrected calibration in force, under the number that it had.
fn keep(link: &mut Link, checked: &Checked, press: &KnownPress) -> Result<(), Failure> {
    let before = checked.commands.iter().find_map(|command| match command {
        Command::SetCalibrationIdentity(identity) => Some(identity.clone()),
        _ => None,
    });
    let parts: Vec<Command> = checked
        .commands
        .iter()
        .filter(|command| !matches!(command, Command::SetCalibrationIdentity(_)))
        .cloned()
        .collect();
    let calibrated_at_c = before.as_ref().map(|identity| identity.calibrated_at_c);
    let temperature_c = press.temperature_c.or(calibrated_at_c.map(f64::from));
    let identity = identity(
        before.map(|identity| identity.id),
        temperature_c.unwrap_or_default(),
        &parts,
    );
    put_in_force(link, &parts, identity)
}

fn print(line: &Line, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(line)?)?);
    }
    let of = |n_per_m: Option<f32>| n_per_m.map(f64::from).map_or("rigid".to_owned(), stiffness);
    writeln!(
        out,
        "The spring of {} is measured as {}, 95 % between {} and {}: {:.1} standard errors too {}. The \
         calibration holds.",
        stiffness(line.spring_n_per_m),
        of(line.measured_n_per_m),
        of(Some(line.lower_n_per_m)),
        of(line.upper_n_per_m),
        line.deviation.abs(),
        if line.deviation > 0.0 {
            "stiff"
        } else {
            "soft"
        },
    )?;
    let percent = |part: f64| part * 100.0;
    writeln!(
        out,
        "The stiffening is changed by {:+.1} %. Uncertain, one standard error of 1/c_L:",
        percent(line.rise_change)
    )?;
    let uncertain = line.uncertainty_before.iter().zip(line.uncertainty_after);
    for (load, (before, after)) in line.loads.iter().zip(uncertain) {
        writeln!(
            out,
            "  {load} c_S  {:.1} %, before the check {:.1} %",
            percent(after),
            percent(*before)
        )?;
    }
    Ok(writeln!(
        out,
        "{}",
        if line.stored {
            "Stored."
        } else {
            "In force until the power is off; `palpate settings store` keeps it."
        }
    )?)
}
