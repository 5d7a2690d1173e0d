//! The committed fixture: frames with their decoded content.

use std::path::PathBuf;

use palpate_wire::loss::{Account, Arrival, Tally};
use palpate_wire::schema::{Kind, Type};
use palpate_wire::{Command, Counts, Frame, Header, Message, Record, RecordDecoder, VERSION};
use serde::{Deserialize, Serialize};

use super::reference::{self, Value};
use super::{bytes_of, header, specimens};

/// Returns the folder of the fixture.
pub(crate) fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixture")
}

/// Returns the expected files, by name.
pub(crate) fn files() -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for (name, (bytes, lines)) in [
        ("records", listing(&records())),
        ("commands", listing(&commands())),
        ("damaged", decoded(&damaged())),
    ] {
        files.push((format!("v{VERSION}-{name}.bin"), bytes));
        let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
        files.push((format!("v{VERSION}-{name}.jsonl"), text.into_bytes()));
    }
    files
}

/// Returns typical records, then the smallest and the largest of every kind.
pub(crate) fn records() -> Vec<Frame<Record>> {
    numbered(specimens::records())
}

/// Returns typical commands, then the smallest and the largest of every kind.
pub(crate) fn commands() -> Vec<Frame<Command>> {
    numbered(specimens::commands())
}

/// Returns the smallest or the largest value of a type.
type Extreme = fn(&Type) -> Value;

fn numbered<M: Message>(typical: Vec<M>) -> Vec<Frame<M>> {
    let mut frames: Vec<_> = (0..)
        .zip(typical)
        .map(|(sequence, message)| Frame {
            header: header(sequence),
            message,
        })
        .collect();
    let extremes: [(Extreme, Header); 2] = [
        (
            reference::smallest,
            Header {
                boot_id: 0,
                sequence: 0,
                time_us: 0,
                dropped: 0,
            },
        ),
        (
            reference::largest,
            Header {
                boot_id: u32::MAX,
                sequence: u32::MAX,
                time_us: u64::MAX,
                dropped: u32::MAX,
            },
        ),
    ];
    for (value, header) in extremes {
        for kind in M::KINDS {
            let payload = kind.payload.map(|of| value(&Type::Structure(of)));
            let payload = reference::payload_bytes(payload.as_ref(), kind);
            frames.push(decode_one(&reference::framed(&reference::content_bytes(
                &header,
                kind.number,
                &payload,
            ))));
        }
    }
    frames
}

/// Decodes exactly one frame.
pub(crate) fn decode_one<M: Message>(bytes: &[u8]) -> Frame<M> {
    let mut decoder = palpate_wire::Decoder::<M, 256>::new();
    let mut frames: Vec<_> = decoder.frames(bytes).collect();
    assert_eq!(frames.len(), 1, "one frame in {bytes:02x?}");
    frames.remove(0).expect("the frame is sound")
}

/// A line of a listing: position and content of a frame.
#[derive(Serialize, Deserialize)]
pub(crate) struct FixtureLine<M> {
    /// Offset of the frame's first byte from the start of the file.
    pub(crate) offset: usize,
    /// Number of the frame's bytes, including the zero.
    pub(crate) length: usize,
    /// Header of the frame.
    pub(crate) header: Header,
    /// Message of the frame.
    pub(crate) message: M,
}

fn listing<M: Message + Serialize>(frames: &[Frame<M>]) -> (Vec<u8>, Vec<String>) {
    let mut bytes = Vec::new();
    let mut lines = Vec::new();
    for frame in frames {
        let coded = bytes_of(frame);
        lines.push(json(&FixtureLine {
            offset: bytes.len(),
            length: coded.len(),
            header: frame.header,
            message: &frame.message,
        }));
        bytes.extend(coded);
    }
    (bytes, lines)
}

fn json(line: &impl Serialize) -> String {
    serde_json::to_string(line).expect("everything can be written")
}

/// Returns a damaged stream.
fn damaged() -> Vec<u8> {
    let record = |header: Header| {
        let message = specimens::records().swap_remove(7);
        bytes_of(&Frame { header, message })
    };
    let sound = |sequence| record(header(sequence));
    let foreign = |version: u8, kind: u8, tail: &[u8], sequence| {
        let smallest = Type::Structure(payload_of(0x05));
        let mut payload = Vec::new();
        reference::write(&reference::smallest(&smallest), &mut payload, &smallest);
        payload.extend(tail);
        let mut content = reference::content_bytes(&header(sequence), kind, &payload);
        content[0] = version;
        reference::framed(&content)
    };
    let mut stream = Vec::new();
    // Reception begins within a frame.
    stream.extend(&sound(9)[7..]);
    stream.extend(sound(10));
    // Zeros between frames have no meaning.
    stream.extend([0, 0, 0]);
    stream.extend(sound(11));
    // One bit of frame 12 is wrong; the zero between frames 13 and 14 is missing; frame 15 is cut short.
    let mut flipped = sound(12);
    flipped[9] ^= 0x10;
    stream.extend(flipped);
    stream.extend(&sound(13)[..sound(13).len() - 1]);
    stream.extend(sound(14));
    let short = sound(15);
    stream.extend(&short[..short.len() / 2]);
    stream.push(0);
    // Frame 16 comes twice, and frame 13 arrives late.
    stream.extend(sound(16));
    stream.extend(sound(16));
    stream.extend(sound(13));
    // Frames of a later minor version, of another major version, with a byte too many, and of the other
    // direction.
    stream.extend(foreign(VERSION, 0x7F, &[1, 2, 3], 17));
    stream.extend(foreign(VERSION + 1, 0x05, &[], 18));
    stream.extend(foreign(VERSION, 0x05, &[0], 19));
    stream.extend(foreign(VERSION, 0x81, &[], 20));
    // Bytes longer than the longest frame, and bytes shorter than the shortest.
    stream.extend([0x55; 600]);
    stream.push(0);
    stream.extend([0x01, 0x01, 0x00]);
    // The device dropped frames 22 and 23, and frame 24 was lost.
    stream.extend(sound(21));
    stream.extend(record(Header {
        dropped: 2,
        ..header(25)
    }));
    // The device restarts; a frame of the previous boot comes late.
    stream.extend(record(Header {
        boot_id: 0x9ABC_DEF0,
        ..header(0)
    }));
    stream.extend(record(Header {
        dropped: 2,
        ..header(24)
    }));
    stream.extend(record(Header {
        boot_id: 0x9ABC_DEF0,
        ..header(1)
    }));
    stream
}

fn payload_of(number: u8) -> &'static palpate_wire::schema::Structure {
    let kind: &Kind = Record::KINDS
        .iter()
        .find(|kind| kind.number == number)
        .expect("the kind is there");
    kind.payload.expect("it has a payload")
}

/// Result of decoding the bytes up to a zero.
#[derive(Serialize)]
struct Reception {
    /// Offset of its end in the file.
    end: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    header: Option<Header>,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<Record>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    arrival: Option<Arrival>,
}

/// Last line of a listing: the receiver's counts.
#[derive(Serialize)]
struct Sums {
    counts: Counts,
    boots: Vec<Boot>,
}

#[derive(Serialize)]
struct Boot {
    boot_id: u32,
    before_first: u64,
    produced: u64,
    received: u64,
    missing: u64,
    dropped_by_device: u64,
    lost_on_the_way: Option<u64>,
    duplicates: u64,
    stale: u64,
}

/// Decodes a stream of records: every frame and every error, then the counts.
fn decoded(stream: &[u8]) -> (Vec<u8>, Vec<String>) {
    let mut decoder = RecordDecoder::new();
    let mut account = Account::new();
    let mut lines = Vec::new();
    for (offset, &byte) in stream.iter().enumerate() {
        let Some(result) = decoder.push(byte) else {
            continue;
        };
        let (header, message, error) = match result {
            Ok(frame) => (Some(frame.header), Some(frame.message), None),
            Err(error) => (error.header().copied(), None, Some(error.to_string())),
        };
        lines.push(json(&Reception {
            end: offset + 1,
            header,
            message,
            error,
            arrival: header.map(|header| account.take(&header)),
        }));
    }
    let boots = [account.previous(), account.current()];
    lines.push(json(&Sums {
        counts: *decoder.counts(),
        boots: boots.into_iter().flatten().map(boot).collect(),
    }));
    (stream.to_vec(), lines)
}

fn boot(tally: &Tally) -> Boot {
    Boot {
        boot_id: tally.boot_id(),
        before_first: tally.before_first(),
        produced: tally.produced(),
        received: tally.received(),
        missing: tally.missing(),
        dropped_by_device: tally.dropped_by_device(),
        lost_on_the_way: tally.lost_on_the_way(),
        duplicates: tally.duplicates(),
        stale: tally.stale(),
    }
}
