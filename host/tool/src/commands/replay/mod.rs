//! `palpate replay`: recomputes the estimates of a recording.

mod agreement;
#[cfg(test)]
mod tests;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use agreement::Agreement;
use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_sim::replay::{ActiveConfiguration, Compared, Replay};
use palpate_wire::{Command, Record, configuration_crc};
use serde::Serialize;

use crate::board::configuration::setting;
use crate::recording::{BOOT, Entry, Note, Reader};

/// Compute the estimates of recordings again, and compare them
///
/// Contact, deformation, force and stiffness with its interval are computed again from the recorded
/// conversions by the firmware's own code, and compared with what the board sent, bit by bit.
#[derive(Args)]
#[command(after_help = "\
A replay begins where the board has measured the untouched sensor again: after a release, or at the \
beginning of a recording with --arm. It pauses where records are missing. Skipped records are counted \
with the reason.

Exit code 1 if anything differs (the first difference is named), or nothing could be compared.

Examples:
  palpate replay press.mcap
  palpate replay --json monday/*.mcap")]
pub(crate) struct Arguments {
    /// The recordings
    #[arg(value_name = "FILE.mcap", required = true)]
    files: Vec<PathBuf>,
    /// Print JSON, a line for each recording
    #[arg(long)]
    json: bool,
}

/// Result for a recording.
#[derive(Serialize)]
struct ReplayLine {
    file: String,
    /// Damage that ends the recording early.
    damage: Option<String>,
    #[serde(flatten)]
    agreement: Agreement,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut differing = Vec::new();
    let mut passed_over = Vec::new();
    for file in &arguments.files {
        let (agreement, damage) = replayed(file)?;
        if !agreement.has_replayed() {
            passed_over.push(file.display().to_string());
        }
        if agreement.first_difference().is_some() {
            differing.push(file.display().to_string());
        }
        let line = ReplayLine {
            file: file.display().to_string(),
            damage,
            agreement,
        };
        print(&line, arguments.json)?;
    }
    if differing.is_empty() && passed_over.is_empty() {
        return Ok(());
    }
    if differing.is_empty() {
        return Err(nothing_compared(&passed_over));
    }
    Err(Failure::Refused(format!(
        "{}: the replay differs from what the board sent. The board's firmware has another version \
         than this tool, or its memory is faulty: compare the versions with `palpate info`",
        differing.join(", ")
    )))
}

/// Failure for recordings of which no result could be computed again.
pub fn nothing_compared(files: &[String]) -> Failure {
    Failure::Refused(format!(
        "{}: nothing could be compared. Record with --arm, from before the first touch",
        files.join(", ")
    ))
}

/// Replays a file. Also returns the damage that ends it early.
fn replayed(file: &Path) -> Result<(Agreement, Option<String>), Failure> {
    let mut agreement = Agreement::default();
    let damage = compare(file, |compared| agreement.enter(compared))?;
    Ok((agreement, damage))
}

/// Computes the results in a recording again, and passes each comparison with what the board sent to
/// `take`. Returns the damage that ends the recording early.
///
/// # Errors
/// If the file is no recording, or has no record.
pub fn compare(file: &Path, mut take: impl FnMut(&[Compared])) -> Result<Option<String>, Failure> {
    let mut reader = Reader::open(file)?;
    let mut replay = Replay::default();
    // The first note of each boot applies from its start, wherever it is in the file.
    for note in Reader::boot_notes(file)?.iter().rev() {
        configure(&mut replay, note);
    }
    for entry in &mut reader {
        match entry {
            Entry::Note(note) => configure(&mut replay, &note),
            Entry::Frame(recorded) => take(&replay.take(&recorded.frame)),
            Entry::Log(_) => {}
        }
    }
    take(&replay.finish());
    reader.refuse_empty(file)?;
    let damage = reader.damage();
    if let Some(damage) = &damage {
        notice::say(format_args!("{}: {damage}.", file.display()));
    }
    Ok(damage)
}

/// Applies the configuration in a note.
fn configure(replay: &mut Replay, note: &Note) {
    if let Some((boot_id, active_configuration)) = active_configuration(note) {
        replay.configure(boot_id, active_configuration);
    }
}

/// Returns the configuration in force from a boot note; `None` for another note or an incomplete
/// one.
fn active_configuration(note: &Note) -> Option<(u32, ActiveConfiguration)> {
    if note.name != BOOT {
        return None;
    }
    let field = |name| note.fields.get(name);
    let boot_id = field("boot_id")?.parse().ok()?;
    let Record::Hello(hello) = serde_json::from_str(field("hello")?).ok()? else {
        return None;
    };
    let Record::Settings(settings) = serde_json::from_str(field("settings")?).ok()? else {
        return None;
    };
    let Record::Storage(storage) = serde_json::from_str(field("storage")?).ok()? else {
        return None;
    };
    let parts: Vec<Record> = serde_json::from_str(field("calibration")?).ok()?;
    let calibration: Vec<Command> = parts.into_iter().filter_map(setting).collect();
    // A part may have been lost in transmission. Settings that were never set are not in the CRC.
    let settings_too = [Command::SetSettings(settings.clone())];
    let with_settings: Vec<Command> = settings_too
        .into_iter()
        .chain(calibration.clone())
        .collect();
    let is_whole = [&calibration, &with_settings]
        .into_iter()
        .any(|commands| configuration_crc(commands) == storage.in_force_crc);
    is_whole.then_some(())?;
    let active_configuration = ActiveConfiguration {
        hello,
        settings,
        calibration,
    };
    Some((boot_id, active_configuration))
}

fn print(line: &ReplayLine, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(line)?)?);
    }
    writeln!(out, "{}", line.file)?;
    for sentence in line.agreement.sentences() {
        writeln!(out, "  {sentence}")?;
    }
    Ok(())
}
