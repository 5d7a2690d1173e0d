//! Checks the records that return over each link.

use std::collections::{BTreeMap, VecDeque};

use ldc161x_sim::Time;
use palpate_wire::code::StorageAction;
use palpate_wire::{
    Command, CommandDecoder, Frame, FrameError, Header, Message, Record, RecordDecoder, encode,
};

/// Longest wait for an answer: a command may wait for the coil's test, which takes a tenth of a
/// second.
const ANSWER: Time = Time::from_ms(500);

/// A PC at one end of a link: it records its requests, and checks the answers.
#[derive(Debug, Default)]
pub(super) struct Peer {
    /// Bytes written and not yet read by the board.
    written: VecDeque<u8>,
    asked: CommandDecoder,
    received: RecordDecoder,
    /// Commands without an answer: number, kind and the time at which the board read them.
    open: Vec<(u32, u8, Time)>,
    /// Kinds of requested records that only this link may receive.
    own: Vec<u8>,
    /// Sequence number of the next frame.
    next: u32,
    /// Counts of the commands' outcomes.
    pub(super) outcomes: BTreeMap<&'static str, u64>,
    /// Number of damaged or invalid frames.
    pub(super) refused: u64,
    /// Counts of the reports, by kind.
    pub(super) reports: BTreeMap<&'static str, u64>,
}

impl Peer {
    /// Records written bytes.
    pub(super) fn wrote(&mut self, bytes: &[u8]) {
        self.written.extend(bytes);
    }

    /// Records that the board has read `count` bytes.
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

    /// Checks the bytes that the board sent in this run; returns the records other than
    /// acknowledgements, as comparable bytes.
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

    /// Checks that frames are numbered without a gap.
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

    /// Checks that every command read has been answered, except one that waits for the coil's test.
    pub(super) fn is_answered(&self, now: Time) -> Result<(), String> {
        match self.open.as_slice() {
            [] => Ok(()),
            [(_, _, since)] if now <= *since + ANSWER => Ok(()),
            open => Err(format!("not answered: {open:?}")),
        }
    }

    /// Whether this link has requested a record of this kind, which no other link then receives.
    pub(super) fn may_have(&self, record: &[u8]) -> bool {
        // Version and kind come first, after the offset to the first zero.
        record.get(2).is_some_and(|kind| self.own.contains(kind))
    }

    /// Handles a restart of the board: all earlier requests must have been answered.
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

/// Kind number of `hello`.
const HELLO: u8 = 0x01;

/// Kinds of the records that answer a command, except for the acknowledgement.
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
        // Any part of the calibration.
        Command::GetCalibration(_) => (0x11..=0x1C).chain([0x23, 0x28, 0x29, 0x2B]).collect(),
        _ => Vec::new(),
    }
}

/// Name of a report that shows how far a script has come.
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

/// A record with its time: a frame with the sequence number 0, which no link assigned.
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
