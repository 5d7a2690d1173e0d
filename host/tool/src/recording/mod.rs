//! Recordings of a board: every received record, with the times of both clocks, in a file that
//! public viewers open.
//!
//! The file is [MCAP](https://mcap.dev/spec); docs/desk.md describes its contents. A `Recorder`
//! writes a file while a board is read, and a [`Reader`] reads a complete or truncated one.

mod contents;
pub mod date;
pub(crate) mod parquet_file;
mod reader;
mod recorder;
mod schema;
pub mod tables;
#[cfg(test)]
mod tests;
mod writer;

use std::collections::BTreeMap;

use palpate_wire::{Frame, Record};

use crate::board::log::LogLine;

pub use contents::{BootLosses, Contents};
pub use reader::Reader;
pub(crate) use recorder::Recorder;

/// Profile of the file, which marks it as a palpate recording.
const PROFILE: &str = "palpate";
/// Name of the note at the beginning: tool, protocol, board.
pub const ABOUT: &str = "recording";
/// Name of the note about a boot of the board: identity, and configuration in force.
pub const BOOT: &str = "boot";
/// Name of the note at the end: clocks and losses.
pub const END: &str = "end";

/// A recorded frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Arrival by the computer's clock, ns since 1970-01-01 UTC.
    pub host_ns: u64,
    /// Time in the frame's header converted to the computer's clock, ns; the arrival before the
    /// first comparison of the clocks.
    pub device_ns: u64,
    /// The frame.
    pub frame: Frame<Record>,
}

/// A note about the recording, stored in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Name.
    pub name: String,
    /// Fields as text.
    pub fields: BTreeMap<String, String>,
}

impl Note {
    /// Creates an empty note.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            fields: BTreeMap::new(),
        }
    }

    /// Adds a field.
    pub fn with(mut self, field: &str, value: impl ToString) -> Self {
        self.fields.insert(field.to_owned(), value.to_string());
        self
    }
}

/// A recorded line of the board's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Logged {
    /// Arrival by the computer's clock, ns since 1970-01-01 UTC.
    pub host_ns: u64,
    /// The line.
    pub(crate) line: LogLine,
}

/// An entry of a recording. The log is for other programs; a [`Reader`] skips it.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A frame.
    Frame(Recorded),
    /// A note.
    Note(Note),
    /// A line of the log.
    Log(Logged),
}

/// Topic of a kind of record.
fn topic(kind: &str) -> String {
    format!("/{kind}")
}
