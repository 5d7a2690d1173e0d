//! Reads a recording, whole or cut off.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::Path;

use mcap::McapError;
use mcap::records::{Channel, MessageHeader, Record as McapRecord, op};
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
    messages: Messages,
    has_end: bool,
    damage: Option<McapError>,
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
            messages: Messages::default(),
            has_end: false,
            damage: None,
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
        self.messages.unreadable
    }

    /// Goes on to the next piece of the file; nothing at its end.
    fn step(&mut self) -> Option<Result<Option<Entry>, McapError>> {
        Some(match self.linear.next_event()? {
            Ok(LinearReadEvent::ReadRequest(length)) => {
                match read(&mut self.from, self.linear.insert(length)) {
                    Ok(length) => {
                        self.linear.notify_read(length);
                        Ok(None)
                    }
                    Err(error) => Err(error.into()),
                }
            }
            Ok(LinearReadEvent::Record { opcode, data }) => {
                self.has_end |= opcode == op::DATA_END;
                mcap::parse_record(opcode, data).map(|record| self.messages.entry(record))
            }
            Err(error) => Err(error),
        })
    }
}

impl<R: Read> Iterator for Reader<R> {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        while self.damage.is_none() {
            match self.step()? {
                Ok(Some(entry)) => return Some(entry),
                Ok(None) => {}
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

/// The messages of a file, as far as they are records of a board.
#[derive(Default)]
struct Messages {
    /// The channels with such records.
    channels: HashSet<u16>,
    /// Those of them that are not understood.
    unreadable: u64,
}

impl Messages {
    /// What a piece of the file says of a recording.
    fn entry(&mut self, piece: McapRecord<'_>) -> Option<Entry> {
        match piece {
            McapRecord::Channel(channel) => {
                if is_ours(&channel) {
                    self.channels.insert(channel.id);
                }
                None
            }
            McapRecord::Message { header, data } if self.channels.contains(&header.channel_id) => {
                self.frame(&header, &data)
            }
            McapRecord::Metadata(metadata) => Some(Entry::Note(Note {
                name: metadata.name,
                fields: metadata.metadata,
            })),
            _ => None,
        }
    }

    fn frame(&mut self, header: &MessageHeader, text: &[u8]) -> Option<Entry> {
        let Ok(frame) = serde_json::from_slice(text) else {
            self.unreadable += 1;
            return None;
        };
        Some(Entry::Frame(Recorded {
            host_ns: header.log_time,
            device_ns: header.publish_time,
            frame,
        }))
    }
}

fn is_ours(channel: &Channel) -> bool {
    let mut kinds = Record::KINDS.iter();
    channel.message_encoding == "json" && kinds.any(|kind| topic(kind.name) == channel.topic)
}
