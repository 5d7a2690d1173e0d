//! Reads a recording, whole or cut off.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::Path;

use mcap::McapError;
use mcap::records::{MessageHeader, Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use palpate_wire::{Message, Record};

use super::{Entry, Note, Recorded, topic};
use crate::failure::Failure;

/// Longest piece of a file that is taken into memory. Other tools write chunks of up to some MB; a length
/// that is damaged may say anything.
const LONGEST: usize = 64 << 20;

/// A recording, from its first entry to its end or to where it is damaged.
pub(crate) struct Reader<R> {
    from: R,
    linear: LinearReader,
    channels: HashSet<u16>,
    has_end: bool,
    damage: Option<McapError>,
    unreadable: u64,
}

impl Reader<BufReader<File>> {
    /// Opens a file.
    pub(crate) fn open(file: &Path) -> Result<Self, Failure> {
        let unreadable = |reason| Failure::Unreadable {
            file: file.to_path_buf(),
            reason,
        };
        Ok(Self::new(BufReader::new(
            File::open(file).map_err(unreadable)?,
        )))
    }
}

impl<R: Read> Reader<R> {
    /// Reads from anything.
    pub(crate) fn new(from: R) -> Self {
        let options = LinearReaderOptions::default()
            // A chunk is given back as it was written, or not at all.
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST);
        Self {
            from,
            linear: LinearReader::new_with_options(options),
            channels: HashSet::new(),
            has_end: false,
            damage: None,
            unreadable: 0,
        }
    }

    /// Why it ends before its end, once it has been read; nothing for a file that is whole.
    pub(crate) fn damage(&self) -> Option<String> {
        let damage = self.damage.as_ref()?;
        Some(match damage {
            McapError::UnexpectedEof => {
                "the file is cut off; all that is complete before the cut is read".to_owned()
            }
            McapError::UnsupportedCompression(by) => {
                format!("the file is compressed by {by}: `mcap decompress` makes one that is not")
            }
            McapError::Io(error) => format!("the file cannot be read further: {error}"),
            other => format!("the file is damaged ({other}); all before is read"),
        })
    }

    /// Refuses what turned out to be no recording.
    pub(crate) fn refuse_foreign(&self, file: &Path) -> Result<(), Failure> {
        if matches!(self.damage, Some(McapError::BadMagic)) && !self.has_end {
            return Err(Failure::Argument(format!(
                "{}: this is no MCAP file: name a recording of `palpate record`",
                file.display()
            )));
        }
        Ok(())
    }

    /// Messages that this version of the tool does not understand.
    pub(crate) const fn unreadable(&self) -> u64 {
        self.unreadable
    }

    /// Goes on to the next piece of the file; nothing at its end.
    fn step(&mut self) -> Option<Result<Step, McapError>> {
        Some(match self.linear.next_event()? {
            Ok(LinearReadEvent::ReadRequest(length)) => {
                match read(&mut self.from, self.linear.insert(length)) {
                    Ok(length) => {
                        self.linear.notify_read(length);
                        Ok(Step::Nothing)
                    }
                    Err(error) => Err(error.into()),
                }
            }
            Ok(LinearReadEvent::Record { opcode, data }) => {
                self.has_end |= opcode == op::DATA_END;
                mcap::parse_record(opcode, data).map(|record| taken(&mut self.channels, record))
            }
            Err(error) => Err(error),
        })
    }
}

/// What a piece of the file is to us.
enum Step {
    Entry(Entry),
    /// A message of ours that is not understood.
    Unreadable,
    Nothing,
}

impl<R: Read> Iterator for Reader<R> {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        while self.damage.is_none() {
            match self.step()? {
                Ok(Step::Entry(entry)) => return Some(entry),
                Ok(Step::Unreadable) => self.unreadable += 1,
                Ok(Step::Nothing) => {}
                Err(error) => self.damage = Some(error),
            }
        }
        None
    }
}

fn read(from: &mut impl Read, to: &mut [u8]) -> std::io::Result<usize> {
    loop {
        match from.read(to) {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}

fn taken(channels: &mut HashSet<u16>, record: McapRecord<'_>) -> Step {
    match record {
        McapRecord::Channel(channel) => {
            let mut kinds = Record::KINDS.iter();
            if channel.message_encoding == "json"
                && kinds.any(|kind| topic(kind.name) == channel.topic)
            {
                channels.insert(channel.id);
            }
            Step::Nothing
        }
        McapRecord::Message { header, data } if channels.contains(&header.channel_id) => {
            message(&header, &data)
        }
        McapRecord::Metadata(metadata) => Step::Entry(Entry::Note(Note {
            name: metadata.name,
            fields: metadata.metadata,
        })),
        _ => Step::Nothing,
    }
}

fn message(header: &MessageHeader, data: &[u8]) -> Step {
    let Ok(frame) = serde_json::from_slice(data) else {
        return Step::Unreadable;
    };
    Step::Entry(Entry::Frame(Recorded {
        host_ns: header.log_time,
        device_ns: header.publish_time,
        frame,
    }))
}
