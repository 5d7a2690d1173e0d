//! Writes a recording.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Write};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions};
use palpate_wire::{Message, Record};
use serde_json::json;

use super::date::NS_PER_S;
use super::{Entry, Logged, Note, PROFILE, Recorded, schema, topic};

/// Topic and schema of the board's log, which viewers know (Foxglove's schemas, `Log`).
const LOG: &str = "/log";
const LOG_SCHEMA: &str = "foxglove.Log";
/// Numbers of the log's levels in Foxglove's schema `Log`.
const LEVELS: [(&str, u8); 4] = [("debug", 1), ("info", 2), ("warn", 3), ("error", 4)];

/// Writer of a recording. Entries since the last [`flush`](Self::flush) are lost if the program is
/// killed.
pub(super) struct Writer<W: Write> {
    mcap: mcap::Writer<NoSeek<W>>,
    /// Channels of the file by kind of record.
    channels: HashMap<u8, u16>,
    /// Channel of the log; `None` before its first line.
    log: Option<u16>,
}

impl<W: Write> Writer<W> {
    /// Starts a recording.
    pub(super) fn new(to: W) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile(PROFILE)
            .compression(None)
            // Writes only complete chunks: an unfinished chunk has no length yet, and a reader of a
            // file truncated within it would misread the rest.
            .disable_seeking(true);
        Ok(Self {
            mcap: options.create(NoSeek::new(to)).map_err(io_error)?,
            channels: HashMap::new(),
            log: None,
        })
    }

    /// Adds an entry.
    pub(super) fn add(&mut self, entry: &Entry) -> io::Result<()> {
        match entry {
            Entry::Frame(recorded) => self.frame(recorded),
            Entry::Note(note) => self.note(note),
            Entry::Log(logged) => self.log(logged),
        }
    }

    fn frame(&mut self, recorded: &Recorded) -> io::Result<()> {
        let frame = &recorded.frame;
        let header = MessageHeader {
            channel_id: self.channel(&frame.message)?,
            sequence: frame.header.sequence,
            log_time: recorded.host_ns,
            publish_time: recorded.device_ns,
        };
        let text = serde_json::to_string(frame)?;
        let written = self.mcap.write_to_known_channel(&header, text.as_bytes());
        written.map_err(io_error)
    }

    /// Returns the channel of a record's kind; creates it at the first record of the kind.
    fn channel(&mut self, record: &Record) -> io::Result<u16> {
        if let Some(&channel) = self.channels.get(&record.kind()) {
            return Ok(channel);
        }
        let mut kinds = Record::KINDS.iter();
        let kind = kinds.find(|kind| kind.number == record.kind());
        let schema = kind.map_or_else(String::new, |kind| schema::of_kind(kind).to_string());
        let name = format!("palpate.{}", record.name());
        let added = self.mcap.add_schema(&name, "jsonschema", schema.as_bytes());
        let schema = added.map_err(io_error)?;
        let topic = topic(record.name());
        let added = self
            .mcap
            .add_channel(schema, &topic, "json", &BTreeMap::new());
        let channel = added.map_err(io_error)?;
        self.channels.insert(record.kind(), channel);
        Ok(channel)
    }

    fn log(&mut self, logged: &Logged) -> io::Result<()> {
        let header = MessageHeader {
            channel_id: self.log_channel()?,
            sequence: 0,
            log_time: logged.host_ns,
            publish_time: logged.host_ns,
        };
        let level = LEVELS.iter().find(|(name, _)| *name == logged.line.level);
        let text = json!({
            "timestamp": {"sec": logged.host_ns / NS_PER_S, "nsec": logged.host_ns % NS_PER_S},
            "level": level.map_or(0, |(_, number)| *number),
            "message": logged.line.message,
            "name": "firmware",
            "file": "",
            "line": 0,
        });
        let text = text.to_string();
        let written = self.mcap.write_to_known_channel(&header, text.as_bytes());
        written.map_err(io_error)
    }

    fn log_channel(&mut self) -> io::Result<u16> {
        if let Some(channel) = self.log {
            return Ok(channel);
        }
        let schema = schema::of_log().to_string();
        let added = self
            .mcap
            .add_schema(LOG_SCHEMA, "jsonschema", schema.as_bytes());
        let schema = added.map_err(io_error)?;
        let added = self.mcap.add_channel(schema, LOG, "json", &BTreeMap::new());
        let channel = added.map_err(io_error)?;
        self.log = Some(channel);
        Ok(channel)
    }

    fn note(&mut self, note: &Note) -> io::Result<()> {
        let metadata = Metadata {
            name: note.name.clone(),
            metadata: note.fields.clone(),
        };
        self.mcap.write_metadata(&metadata).map_err(io_error)
    }

    /// Passes all entries to the operating system.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.mcap.flush().map_err(io_error)
    }

    /// Ends the recording with its index.
    pub(super) fn finish(mut self) -> io::Result<W> {
        self.mcap.finish().map_err(io_error)?;
        let mut file = self.mcap.into_inner().into_inner();
        file.flush()?;
        Ok(file)
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}
