//! Recordings of a board: every record as it came, with the time of either side, in a file that public
//! viewers open.
//!
//! The file is [MCAP](https://mcap.dev/spec), docs/desk.md says what stands in it. A `Recorder` writes
//! one while a board is read, a [`Reader`] reads it back, whole or cut off.

mod contents;
pub mod date;
pub(crate) mod parquet_file;
mod reader;
mod recorder;
mod schema;
#[cfg(test)]
mod tests;
mod writer;

use std::collections::BTreeMap;

use palpate_wire::{Frame, Record};

use crate::board::log::LogLine;

pub use contents::{BootLosses, Contents};
pub use reader::Reader;
pub(crate) use recorder::Recorder;

/// The file's profile: whose recording it is.
const PROFILE: &str = "palpate";
/// Name of the note at the beginning: tool, protocol, board.
pub const ABOUT: &str = "recording";
/// Name of the note about a boot of the board: what it is, and what is in force.
pub const BOOT: &str = "boot";
/// Name of the note at the end: clocks and losses.
pub const END: &str = "end";

/// A frame as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// When it arrived, by the computer's clock, ns since 1970-01-01 UTC.
    pub host_ns: u64,
    /// The time in its header, by the same clock, as far as the two are compared.
    pub device_ns: u64,
    /// The frame.
    pub frame: Frame<Record>,
}

/// What is said about a recording in the recording, by names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Its name.
    pub name: String,
    /// Its fields, as text.
    pub fields: BTreeMap<String, String>,
}

impl Note {
    /// A note that says nothing yet.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            fields: BTreeMap::new(),
        }
    }

    /// The same with one field more.
    pub fn with(mut self, field: &str, value: impl ToString) -> Self {
        self.fields.insert(field.to_owned(), value.to_string());
        self
    }
}

/// A line of the board's log as it was recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Logged {
    /// When it arrived, by the computer's clock, ns since 1970-01-01 UTC.
    pub host_ns: u64,
    /// The line.
    pub(crate) line: LogLine,
}

/// What a recording consists of. The log is for other programs: reading a recording passes over it.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A frame.
    Frame(Recorded),
    /// A note.
    Note(Note),
    /// A line of the log.
    Log(Logged),
}

/// The topic of a kind of record.
fn topic(kind: &str) -> String {
    format!("/{kind}")
}
