//! Check by a press onto a known spring.

use std::io::{self, Write};

use palpate_calibration::{KnownPress, LOADS};
use palpate_cli::describe::stiffness;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_wire::Command;
use serde::Serialize;

use super::arguments::Arguments;
use super::in_force::{in_force, keep};
use crate::board::link::Run;
use crate::board::storage;
use crate::commands::measure::{arm, measured, truth};

/// JSON output.
#[derive(Serialize)]
struct SpringCheckLine {
    simulated: bool,
    spring_n_per_m: f64,
    measured_n_per_m: Option<f32>,
    lower_n_per_m: f32,
    upper_n_per_m: Option<f32>,
    /// Deviation in standard errors; positive where the spring was read too stiff.
    deviation: f64,
    /// Relative change of the stiffening.
    rise_change: f64,
    /// Relative standard uncertainty of 1/c_L for loads of `loads` times c_S, without the noise of
    /// a press.
    uncertainty_before: [f64; LOADS.len()],
    uncertainty_after: [f64; LOADS.len()],
    loads: [f64; LOADS.len()],
    temperature_c: Option<f32>,
    configuration_crc: u32,
    stored: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let emulated = arguments.link.is_emulated();
    let load = emulated.then_some(arguments.load);
    let mut link = arguments.link.open_pressed(Run::AsFastAsItCan, load)?;
    if link.is_recording() {
        return Err(Failure::Argument(
            "--board: a recording cannot measure a press; name a board".to_owned(),
        ));
    }
    if arguments.spring.is_none() && !emulated {
        return Err(Failure::Argument(
            "--spring: the stiffness of the spring in series with its stand, in N/m".to_owned(),
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
    link.send_accepted(&Command::Disarm)?;
    let spring_n_per_m = arguments.spring.or(own).ok_or_else(|| {
        Failure::Argument("--load: the emulated board did not press a spring".to_owned())
    })?;
    let press = KnownPress {
        spring_n_per_m,
        tolerance: arguments.tolerance,
        load_ratio: estimate.load_ratio.into(),
        standard_error: estimate.load_ratio_standard_error.into(),
        force_n: estimate.force_n.into(),
        temperature_c: estimate.temperature_c.map(f64::from),
    };
    let checked = palpate_calibration::check(&commands, &press).map_err(|cause| {
        Failure::Refused(format!(
            "--spring {spring_n_per_m} N/m is {}, and measured as {}: {cause}",
            stiffness(spring_n_per_m),
            or_rigid(estimate.stiffness_n_per_m)
        ))
    })?;
    keep(&mut link, &checked.commands, press.temperature_c)?;
    let stored = if arguments.store {
        Some(storage::store(&mut link)?)
    } else {
        None
    };
    let line = SpringCheckLine {
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
    print(&line, emulated, arguments.json)
}

fn or_rigid(n_per_m: Option<f32>) -> String {
    n_per_m.map(f64::from).map_or("rigid".to_owned(), stiffness)
}

fn print(line: &SpringCheckLine, emulated: bool, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(line)?)?);
    }
    writeln!(
        out,
        "The spring of {} is measured as {}, 95 % between {} and {}: {:.1} standard errors too {}. The \
         calibration holds.",
        stiffness(line.spring_n_per_m),
        or_rigid(line.measured_n_per_m),
        or_rigid(Some(line.lower_n_per_m)),
        or_rigid(line.upper_n_per_m),
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
            storage::lasts(emulated)
        }
    )?)
}
