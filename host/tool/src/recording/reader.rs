//! Reads a recording: complete, truncated, or several joined in one file.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind};
use std::path::Path;

use mcap::McapError;
use mcap::records::{Channel, MessageHeader, Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use palpate_cli::failure::Failure;
use palpate_wire::{Message, Record};

use super::{BOOT, Entry, Note, PROFILE, Recorded, topic};

/// Longest piece of a file read into memory, bytes. Other tools write chunks of a few MB; a damaged
/// length may have any value.
const LONGEST: usize = 64 << 20;

/// Iterator over the entries of a recording, up to its end or its damage.
pub struct Reader<R> {
    from: R,
    linear: LinearReader,
    messages: Messages,
    /// Whether the end of a recording was read.
    has_end: bool,
    /// Whether anything was read.
    is_begun: bool,
    damage: Option<McapError>,
}

impl Reader<BufReader<File>> {
    /// Opens a file.
    pub fn open(file: &Path) -> Result<Self, Failure> {
        let unreadable = |reason| Failure::Unreadable {
            file: file.to_path_buf(),
            reason,
        };
        let opened = File::open(file).map_err(unreadable)?;
        if opened.metadata().map_err(unreadable)?.is_dir() {
            return Err(unreadable(ErrorKind::IsADirectory.into()));
        }
        Ok(Self::new(BufReader::new(opened)))
    }

    /// Reads the boot notes of a file. Files that other programs have rewritten have them after the messages.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub fn boot_notes(file: &Path) -> Result<Vec<Note>, Failure> {
        let mut reader = Self::open(file)?;
        reader.messages.only_notes = true;
        let notes = reader.filter_map(|entry| match entry {
            Entry::Note(note) if note.name == BOOT => Some(note),
            _ => None,
        });
        Ok(notes.collect())
    }
}

/// Remedy for a file that is not a recording.
const NAME: &str = "name a recording of `palpate record`";

fn refused(file: &Path, problem: &str) -> Failure {
    Failure::Argument(format!("{}: {problem}", file.display()))
}

/// Creates a reader of one recording.
fn linear() -> LinearReader {
    let options = LinearReaderOptions::default()
        // Returns a chunk only after a check of its CRC.
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(LONGEST);
    LinearReader::new_with_options(options)
}

impl<R: BufRead> Reader<R> {
    /// Creates a reader of any input.
    pub fn new(from: R) -> Self {
        Self {
            from,
            linear: linear(),
            messages: Messages::default(),
            has_end: false,
            is_begun: false,
            damage: None,
        }
    }

    /// Damage that ended the reading early; `None` for a whole file. Valid after the last entry.
    pub fn damage(&self) -> Option<String> {
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

    /// Remarks about what could not be read. Valid after the last entry.
    pub fn remarks(&self, file: &Path) -> Vec<String> {
        let file = file.display();
        let damage = self.damage().map(|damage| format!("{file}: {damage}."));
        let other_version = (self.unreadable() > 0).then(|| {
            format!(
                "{file}: {} messages are of another version of the protocol and left out.",
                self.unreadable()
            )
        });
        damage.into_iter().chain(other_version).collect()
    }

    /// Fails if the file proved not to be a readable recording.
    pub fn refuse_foreign(&self, file: &Path) -> Result<(), Failure> {
        let problem = match &self.damage {
            Some(McapError::UnsupportedCompression(_)) => self.damage().unwrap_or_default(),
            Some(McapError::UnexpectedEof) if !self.is_begun => {
                format!("the file is empty: {NAME}")
            }
            _ if self.messages.is_ours => return Ok(()),
            Some(McapError::Io(_)) => self.damage().unwrap_or_default(),
            Some(_) if !self.has_end => format!("this is not an MCAP file: {NAME}"),
            _ => format!("there are no records of palpate in this file: {NAME}"),
        };
        Err(refused(file, &problem))
    }

    /// Fails if the file is not a readable recording, or has no readable record.
    pub fn refuse_empty(&self, file: &Path) -> Result<(), Failure> {
        self.refuse_foreign(file)?;
        match (self.messages.frames, self.unreadable()) {
            (1.., _) => Ok(()),
            (0, 0) => Err(refused(
                file,
                "there is no record in it: name another recording",
            )),
            (0, unreadable) => Err(refused(
                file,
                &format!(
                    "there is no record in it that this tool understands, and {unreadable} of another version of \
                     the protocol: use the tool that recorded it"
                ),
            )),
        }
    }

    /// Number of messages that this version of the tool does not understand.
    pub const fn unreadable(&self) -> u64 {
        self.messages.unreadable
    }

    /// Reads the next piece of the file; `None` at its end.
    fn step(&mut self) -> Option<Result<Option<Entry>, McapError>> {
        let Some(event) = self.linear.next_event() else {
            return self.next_part();
        };
        Some(match event {
            Ok(LinearReadEvent::ReadRequest(length)) => {
                match read(&mut self.from, self.linear.insert(length)) {
                    Ok(length) => {
                        self.is_begun |= length > 0;
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

    /// Starts the next recording joined to the file; `None` at the end of the file.
    fn next_part(&mut self) -> Option<Result<Option<Entry>, McapError>> {
        match self.from.fill_buf() {
            Ok([]) => None,
            Ok(_) => {
                self.linear = linear();
                // Each recording numbers its own channels.
                self.messages.channels.clear();
                Some(Ok(None))
            }
            Err(error) => Some(Err(error.into())),
        }
    }
}

impl<R: BufRead> Iterator for Reader<R> {
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

fn read(from: &mut impl io::Read, to: &mut [u8]) -> io::Result<usize> {
    loop {
        match from.read(to) {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}

/// State of the messages of a file that are records of a board.
#[derive(Default)]
struct Messages {
    /// Channels with records of a board.
    channels: HashSet<u16>,
    /// Whether the file is a recording of a board, written by any program.
    is_ours: bool,
    /// Whether messages are skipped.
    only_notes: bool,
    /// Number of understood messages.
    frames: u64,
    /// Number of messages not understood.
    unreadable: u64,
}

impl Messages {
    /// Converts a piece of the file to an entry of the recording.
    fn entry(&mut self, piece: McapRecord<'_>) -> Option<Entry> {
        match piece {
            McapRecord::Header(header) => {
                self.is_ours |= header.profile == PROFILE;
                None
            }
            McapRecord::Channel(channel) => {
                if is_ours(&channel) {
                    self.is_ours = true;
                    self.channels.insert(channel.id);
                }
                None
            }
            McapRecord::Message { .. } if self.only_notes => None,
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
        self.frames += 1;
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
