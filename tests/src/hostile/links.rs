//! What may come back by a link, and by which.

use std::collections::{BTreeMap, VecDeque};

use ldc161x_sim::Time;
use palpate_wire::code::StorageAction;
use palpate_wire::{
    Command, CommandDecoder, Frame, FrameError, Header, Message, Record, RecordDecoder, encode,
};

/// Longest wait for an answer: that of a command that waits for the coil's test, which takes a tenth
/// of a second.
const ANSWER: Time = Time::from_ms(500);

/// A PC at one end of a link: it knows what it asked, and judges what comes back.
#[derive(Debug, Default)]
pub(super) struct Peer {
    /// Written, and not taken by the board yet.
    written: VecDeque<u8>,
    asked: CommandDecoder,
    received: RecordDecoder,
    /// Commands without an answer: number, kind and when the board took them.
    open: Vec<(u32, u8, Time)>,
    /// Kinds of records that this link may have for itself, since it asked for them.
    own: Vec<u8>,
    /// Number of the next frame.
    next: u32,
    /// What became of the commands.
    pub(super) outcomes: BTreeMap<&'static str, u64>,
    /// Frames that were damaged or could not be understood.
    pub(super) refused: u64,
    /// What was reported, by what it is.
    pub(super) reports: BTreeMap<&'static str, u64>,
}

impl Peer {
    /// Bytes were written.
    pub(super) fn wrote(&mut self, bytes: &[u8]) {
        self.written.extend(bytes);
    }

    /// The board has taken so many of them.
    pub(super) fn taken(&mut self, count: usize, now: Time) {
        for byte in self.written.drain(..count) {
            let Some(frame) = self.asked.push(byte) else {
                continue;
            };
            self.refused += u64::from(frame.is_err());
            match frame {
                Ok(frame) => {
                    self.own.extend(answers_to(&frame.message));
                    let kind = frame.message.kind();
                    self.open.push((frame.header.sequence, kind, now));
                }
                Err(
                    FrameError::UnknownKind { header, kind }
                    | FrameError::Payload { header, kind, .. },
                ) => self.open.push((header.sequence, kind, now)),
                Err(FrameError::Version { .. }) => self.own.push(HELLO),
                Err(_) => {}
            }
        }
    }

    /// Takes what the board sent in the run with this number; returns the records that are no
    /// acknowledgements, in bytes that can be compared.
    pub(super) fn received(&mut self, bytes: &[u8], boot_id: u32) -> Result<Vec<Vec<u8>>, String> {
        let frames: Vec<_> = self.received.frames(bytes).collect();
        let mut others = Vec::new();
        for frame in frames {
            let frame = frame.map_err(|error| format!("a broken record: {error}"))?;
            self.is_next(&frame.header, boot_id)?;
            match &frame.message {
                Record::Acknowledgement(answer) => {
                    self.answered(answer.command, answer.kind)?;
                    *self.outcomes.entry(answer.outcome.name()).or_default() += 1;
                }
                record => {
                    if let Some(report) = report(record) {
                        *self.reports.entry(report).or_default() += 1;
                    }
                    others.push(without_number(&frame));
                }
            }
        }
        Ok(others)
    }

    /// Every frame has its number, and none is lost.
    fn is_next(&mut self, header: &Header, boot_id: u32) -> Result<(), String> {
        let expected = Header {
            boot_id,
            sequence: self.next,
            dropped: 0,
            ..*header
        };
        self.next += 1;
        if *header == expected {
            Ok(())
        } else {
            Err(format!("{header:?} in the place of {expected:?}"))
        }
    }

    fn answered(&mut self, sequence: u32, kind: u8) -> Result<(), String> {
        let is_it = |open: &(u32, u8, Time)| (open.0, open.1) == (sequence, kind);
        let Some(index) = self.open.iter().position(is_it) else {
            return Err(format!(
                "an answer to {sequence}, 0x{kind:02x}, which this link did not ask or had"
            ));
        };
        self.open.remove(index);
        Ok(())
    }

    /// Every command that was taken has been answered, but one that waits for the coil's test.
    pub(super) fn is_answered(&self, now: Time) -> Result<(), String> {
        match self.open.as_slice() {
            [] => Ok(()),
            [(_, _, since)] if now <= *since + ANSWER => Ok(()),
            open => Err(format!("not answered: {open:?}")),
        }
    }

    /// Whether this link has asked for a record that went to no other.
    pub(super) fn may_have(&self, record: &[u8]) -> bool {
        // Version and kind come first, after the distance to the first zero.
        record.get(2).is_some_and(|kind| self.own.contains(kind))
    }

    /// The board has started anew: what was asked before has been answered.
    pub(super) fn restarted(&mut self) -> Result<(), String> {
        if !self.open.is_empty() {
            return Err(format!("not answered before a restart: {:?}", self.open));
        }
        self.asked = CommandDecoder::new();
        self.own.clear();
        self.next = 0;
        Ok(())
    }
}

/// `hello`, as a number.
const HELLO: u8 = 0x01;

/// Kinds of the records that answer a command, the acknowledgement apart.
fn answers_to(command: &Command) -> Vec<u8> {
    let named = |names: &[&str]| {
        let kinds = Record::KINDS.iter();
        let kinds = kinds.filter(|kind| names.contains(&kind.name));
        kinds.map(|kind| kind.number).collect()
    };
    match command {
        Command::Identify => named(&["hello", "status"]),
        Command::GetSettings => named(&["settings"]),
        Command::GetStorage => named(&["storage"]),
        // Whichever part it is.
        Command::GetCalibration(_) => (0x11..=0x1C).collect(),
        _ => Vec::new(),
    }
}

/// What a record reports that shows how far a script has come.
fn report(record: &Record) -> Option<&'static str> {
    Some(match record {
        Record::Estimate(_) => "estimate",
        Record::Refusal(_) => "refusal",
        Record::Fault(fault) if fault.active => "fault",
        Record::CoilTest(_) => "coil test",
        Record::Storage(storage) if storage.succeeded => match storage.action {
            StorageAction::Store => "save",
            StorageAction::Load => "load",
            StorageAction::Erase => "erasure",
            _ => return None,
        },
        _ => return None,
    })
}

/// A record with its time: a frame with the number 0, which no link gave it.
fn without_number(frame: &Frame<Record>) -> Vec<u8> {
    let header = Header {
        boot_id: 0,
        sequence: 0,
        ..frame.header
    };
    let mut buffer = [0; Record::MAX_FRAME];
    let bytes = encode(&header, &frame.message, &mut buffer);
    bytes.map(<[u8]>::to_vec).unwrap_or_default()
}
