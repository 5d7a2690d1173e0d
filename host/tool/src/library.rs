//! The tool's verbs as functions, for a program that contains them, such as the Python package.
//!
//! Each does what the verb of its name does, with the arguments of that verb; a failure has the verb's
//! text.

use std::path::Path;
use std::time::Duration;

use clap::Parser;
use palpate_cli::failure::Failure;
use palpate_wire::command::Settings;
use palpate_wire::record::{Hello, Storage};
use palpate_wire::{Command, Frame, Record};
use serde::Serialize;

pub use crate::commands::replay::{compare, nothing_compared};
pub use crate::interrupt::set_check;

use crate::board::configuration;
use crate::board::link::Link;
use crate::board::storage;
use crate::commands::record::{inspection, session};
use crate::commands::settings::change::assignment;
use crate::commands::{encode, measure, settings};
use crate::recording::{Recorded, Recorder};

/// Commands whose answers are a board's identity and its configuration in force.
pub fn questions() -> Vec<Command> {
    let first = [Command::Identify, Command::GetSettings, Command::GetStorage];
    let parts = configuration::questions().into_iter();
    first
        .into_iter()
        .chain(parts.map(Command::GetCalibration))
        .collect()
}

/// Writes the frames of a simulated board as a recording, as `palpate record` writes those of a real one.
/// `answers` are those to [`questions`], which came after the frames. The board's clock begins at 1970, so the same frames make the
/// same times.
///
/// # Errors
/// If the file exists already or cannot be written.
pub fn write_recording(
    path: &Path,
    answers: &[Frame<Record>],
    frames: &[Frame<Record>],
) -> Result<(), Failure> {
    let mut recorder = Recorder::create(path)?;
    recorder.note(session::about("a simulated sensor", 0));
    if let Some(first) = frames.first() {
        recorder.note(inspection::note(first.header.boot_id, answers.iter()));
    }
    for frame in frames.iter().chain(answers) {
        let host_ns = frame.header.time_us.saturating_mul(1000);
        let is_written = recorder.add_patiently(Recorded {
            host_ns,
            device_ns: host_ns,
            frame: frame.clone(),
        });
        if !is_written {
            break;
        }
    }
    recorder.finish().map(drop)
}

/// A connected board, over any of the tool's links.
pub struct Board {
    link: Link,
    options: Options,
}

/// Arguments of `palpate measure`, which select a board.
#[derive(Parser)]
#[command(name = "palpate")]
struct Options {
    #[command(flatten)]
    measure: measure::Arguments,
}

impl Board {
    /// Connects; the arguments are those of `palpate measure`, such as `--board`, `--load` and `--wait`.
    ///
    /// # Errors
    /// If an argument is refused, or no board answers.
    pub fn open(arguments: &[String]) -> Result<Self, Failure> {
        let name = "palpate".to_owned();
        let options = Options::try_parse_from(std::iter::once(&name).chain(arguments));
        let options = options.map_err(|error| Failure::Argument(error.to_string()))?;
        let link = options.measure.open()?;
        Ok(Self { link, options })
    }

    /// Location of the board.
    pub fn name(&self) -> &str {
        self.link.name()
    }

    /// Identity of the board.
    pub const fn hello(&self) -> Option<&Hello> {
        self.link.hello()
    }

    /// Whether this is a recording, which ends and accepts no commands.
    pub fn is_recording(&self) -> bool {
        self.link.is_recording()
    }

    /// Whether this is the emulated board of this program, whose time passes only while it is waited for.
    pub fn is_emulated(&self) -> bool {
        self.options.measure.link.is_emulated()
    }

    /// Receives for at most `wait`; returns after the first bytes.
    ///
    /// # Errors
    /// If the board is gone, or the recording has ended.
    pub fn receive(&mut self, wait: Duration) -> Result<Vec<Frame<Record>>, Failure> {
        if self.link.received().is_empty() {
            self.link.listen(wait)?;
        }
        let arrivals = self.link.take().into_iter();
        Ok(arrivals.map(|arrival| arrival.frame).collect())
    }

    /// Arms the board, measures at the next contact, and disarms it: a line of `palpate measure --json`.
    ///
    /// # Errors
    /// If the board refuses, or nothing touches the sensor in time.
    pub fn measure(&mut self) -> Result<impl Serialize + use<>, Failure> {
        let options = &self.options.measure;
        let armed = measure::ArmedBoard::arm(&mut self.link, &options.link)?;
        let measured = armed.measure(&mut self.link, options.wait);
        // Disarmed also without a result; the first failure is the one to report.
        let disarmed = self.link.send_accepted(&Command::Disarm);
        let line = measured?;
        disarmed?;
        Ok(line)
    }

    /// Settings in force.
    ///
    /// # Errors
    /// If the board is gone or does not answer.
    pub fn settings(&mut self) -> Result<Settings, Failure> {
        configuration::settings(&mut self.link)
    }

    /// Changes settings, each as `NAME=VALUE`; returns all of them.
    ///
    /// # Errors
    /// If a name or value is not allowed, or the board refuses it.
    pub fn set(&mut self, assignments: &[String]) -> Result<Settings, Failure> {
        let assignments = assignments.iter().map(|text| assignment(text));
        let assignments: Vec<_> = assignments
            .collect::<Result<_, _>>()
            .map_err(Failure::Argument)?;
        let [_, after] = settings::change_on(&mut self.link, &assignments)?;
        Ok(after)
    }

    /// Stores settings and calibration in force, so that they survive power-off.
    ///
    /// # Errors
    /// If the board is gone, refuses it, or could not store them.
    pub fn store(&mut self) -> Result<Storage, Failure> {
        self.link.send_accepted(&Command::Disarm)?;
        storage::store(&mut self.link)
    }

    /// Sends commands, one a line as `palpate encode` reads them; each must be accepted.
    ///
    /// # Errors
    /// If a line is no command, or the board refuses it.
    pub fn send(&mut self, lines: &str) -> Result<(), Failure> {
        for command in encode::from_lines(lines.as_bytes())? {
            self.link.send_accepted(&command)?;
        }
        Ok(())
    }
}
