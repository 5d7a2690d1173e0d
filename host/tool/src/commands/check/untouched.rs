//! Check by a train without a press.

use std::io::{self, Write};
use std::path::Path;

use palpate_calibration::bench;
use palpate_calibration::{OnTheBench, Untouched, check_untouched};
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_wire::Command;
use palpate_wire::command::{Coil, Settings};
use serde::Serialize;

use super::arguments::Arguments;
use super::in_force::{in_force, keep};
use crate::board::bench::BareInstrument;
use crate::board::link::Link;
use crate::board::storage;
use crate::commands::calibrate::written::{self, Written};
use crate::interrupt::Interrupt;

/// JSON output.
#[derive(Serialize)]
struct UntouchedCheckLine {
    simulated: bool,
    /// Relative change of the cross-talk of the untouched sensor.
    change: f64,
    standard_error: f64,
    /// Whether the calibration was corrected.
    corrected: bool,
    configuration_crc: u32,
    stored: bool,
}

pub(super) fn run(arguments: &Arguments, session: &Path) -> Result<(), Failure> {
    let written = written::read(session)?;
    let bench = on_the_bench(&written)?;
    let mut link = arguments.link.open()?;
    let interrupt = Interrupt::catch()?;
    if link.is_recording() {
        return Err(Failure::Argument(
            "--board: a recording cannot drive a train; name a board".to_owned(),
        ));
    }
    let commands = in_force(&mut link)?;
    let (settings, coil) = driven_by(&commands)?;
    if !arguments.link.is_emulated() {
        notice::say("Leave the sensor untouched.");
    }
    let run = bench::untouched(
        &mut BareInstrument::new(&mut link, interrupt),
        (settings, coil),
    );
    let checked = run.and_then(|run| {
        check_untouched(&commands, bench, &run).map_err(|cause| Failure::Refused(cause.to_string()))
    });
    // The train has changed settings and coil data, whatever its outcome.
    let kept = match &checked {
        Ok(checked) if checked.corrected => keep(&mut link, &checked.commands, None),
        _ => put_back(&mut link, &commands),
    };
    let checked = checked?;
    kept?;
    let stored = if arguments.store {
        storage::store(&mut link)?;
        true
    } else {
        false
    };
    let line = UntouchedCheckLine {
        simulated: arguments.link.is_simulated(&link),
        change: checked.change,
        standard_error: checked.standard_error,
        corrected: checked.corrected,
        configuration_crc: storage::inspect(&mut link)?.in_force_crc,
        stored,
    };
    print(
        &line,
        &checked,
        arguments.link.is_emulated(),
        arguments.json,
    )
}

/// The bench's own train and calibration.
fn on_the_bench(written: &Written) -> Result<OnTheBench<'_>, Failure> {
    let run = written.session.untouched();
    let (run, commands) = run.zip(written.calibration.as_deref()).ok_or_else(|| {
        Failure::Refused(
            "--untouched: the session gave no calibration: name the file of one that did"
                .to_owned(),
        )
    })?;
    Ok(OnTheBench { run, commands })
}

/// Sets the previous configuration, with its identity last.
fn put_back(link: &mut Link, commands: &[Command]) -> Result<(), Failure> {
    link.send_accepted(&Command::Disarm)?;
    commands
        .iter()
        .try_for_each(|command| link.send_accepted(command).map(drop))
}

/// Settings and coil data that drive a train.
fn driven_by(commands: &[Command]) -> Result<(&Settings, &Coil), Failure> {
    let (mut settings, mut coil) = (None, None);
    for command in commands {
        match command {
            Command::SetSettings(of) => settings = Some(of),
            Command::SetCoil(of) => coil = Some(of),
            _ => {}
        }
    }
    settings.zip(coil).ok_or_else(|| {
        Failure::Refused(
            "the board is not calibrated: calibrate it with `palpate calibrate sensor`".to_owned(),
        )
    })
}

fn print(
    line: &UntouchedCheckLine,
    checked: &Untouched,
    emulated: bool,
    json: bool,
) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(line)?)?);
    }
    writeln!(
        out,
        "The effect of the coil's current on the reading of the untouched sensor has changed by {:+.1} \
         % since the calibration, with a standard error of {:.1} %.",
        checked.change * 100.0,
        checked.standard_error * 100.0
    )?;
    if !checked.corrected {
        return Ok(writeln!(
            out,
            "That is within the uncertainty: nothing is corrected."
        )?);
    }
    Ok(writeln!(
        out,
        "It is corrected. If the true current differs from the measured one, the stiffening has \
         changed by as much: that counts as its uncertainty until `palpate check --spring`. {}",
        if line.stored {
            "Stored."
        } else {
            storage::lasts(emulated)
        }
    )?)
}
