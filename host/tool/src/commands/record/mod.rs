//! `palpate record`: every record of a board, in a file.

mod arming;
pub(crate) mod inspection;
pub(crate) mod session;

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_cli::quantity;
use serde::Serialize;
use session::RecordingSession;

use crate::board::link::{self, Run};
use crate::interrupt::Interrupt;
use crate::recording::{BootLosses, Contents, Recorder, date};

/// Record everything that a board sends
///
/// Writes every record with its time by both clocks, and what is in force: settings, calibration, versions.
/// What is recorded goes on over a reset of the board, and over an unplugged cable.
#[derive(Args)]
#[command(after_help = "\
The file is MCAP, which public viewers open; `palpate info` says what is in one, and `palpate export` \
makes CSV of it. Until it is complete, .partial follows its name; a program that is killed leaves that, \
which can be read up to the last second.

Ctrl-C ends the recording and completes the file; a second one ends the program at once. Lost records \
are counted and reported.

Examples:
  palpate record press.mcap
  palpate record --board emulated --load 1.5 --for 10
  palpate record measured.mcap --arm")]
pub(crate) struct Arguments {
    /// The file. Otherwise palpate-DATE-TIME.mcap, UTC, in this folder
    #[arg(value_name = "FILE.mcap")]
    file: Option<PathBuf>,
    #[command(flatten)]
    link: link::Arguments,
    /// Duration. Otherwise until Ctrl-C
    #[arg(long = "for", value_name = "SECONDS", value_parser = quantity::duration, allow_negative_numbers = true)]
    duration: Option<Duration>,
    /// What the emulated board presses, again and again: a spring of this multiple of the sensing layer's
    /// nominal stiffness
    #[arg(long, value_name = "RATIO", value_parser = quantity::load, allow_negative_numbers = true)]
    load: Option<f64>,
    /// Arm the board, and measure at every contact: the coil is driven. The board measures the
    /// untouched sensor again: lift off first
    #[arg(long)]
    arm: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Summary of the recording.
#[derive(Serialize)]
struct Summary {
    file: String,
    duration_s: f64,
    records: u64,
    boots: Vec<BootLosses>,
    /// Frames that were damaged, or belong to a later version of the protocol.
    unreadable: u32,
    /// Records that the disk did not accept in time.
    not_written: u64,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = arguments
        .file
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("palpate-{}.mcap", date::name(date::now_ns()))));
    // Recorded times are those of the board's clock, at any speed.
    let run = match arguments.duration {
        Some(_) => Run::AsFastAsItCan,
        None => Run::AtRealPace,
    };
    let mut link = arguments.link.open_pressed(run, arguments.load)?;
    let interrupt = Interrupt::catch().map_err(|error| {
        Failure::Refused(format!(
            "Ctrl-C cannot be caught ({error}): record with --for"
        ))
    })?;
    if arguments.arm {
        arming::arm(&mut link)?;
    }
    let recorder = Recorder::create(&file)?;
    notice::say(format_args!(
        "Recording to {}; Ctrl-C ends it.",
        recorder.partial().display()
    ));
    let mut session = RecordingSession::new(link, recorder, arguments.arm);
    let ran = session.run(arguments.duration, &interrupt);
    let unreadable = session.unreadable();
    let not_written = session.not_written();
    let (contents, finished) = session.finish();
    let file = finished?;
    if not_written > 0 {
        notice::say(format_args!(
            "{not_written} records are lost, since the disk was too slow: record to a faster one."
        ));
    }
    let summary = Summary {
        file: file.display().to_string(),
        duration_s: contents.duration_s(),
        records: contents.frames() - not_written,
        boots: contents.boots(),
        unreadable,
        not_written,
    };
    print(&summary, &contents, arguments.json)?;
    ran
}

fn print(summary: &Summary, contents: &Contents, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(summary)?)?);
    }
    writeln!(
        out,
        "{}: {} records in {:.1} s",
        summary.file, summary.records, summary.duration_s
    )?;
    for (kind, count) in contents.kinds() {
        writeln!(out, "  {kind}  {count}")?;
    }
    for boot in &summary.boots {
        writeln!(out, "{}", boot.sentence())?;
    }
    Ok(())
}
