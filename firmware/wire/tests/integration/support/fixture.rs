//! The committed fixture: frames with their decoded content.

use std::fs;
use std::path::PathBuf;

use palpate_wire::loss::{Account, Arrival, Tally};
use palpate_wire::schema::{Kind, Type};
use palpate_wire::{
    Command, Counts, Frame, Header, Message, Record, RecordDecoder, SCHEMA_HASH, VERSION,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::payloads::{largest, payload_of, smallest};
use super::{bytes_of, content, decode_one, frame_of, framed, header, sound};

/// Boot id of the typical messages in a listing; the smallest and the largest have other ones.
pub(crate) const BOOT_ID: u32 = 0x1234_5678;

/// Returns the path of a file of the fixture.
pub(crate) fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("fixture")
        .join(name)
}

/// Returns a committed file.
pub(crate) fn committed(name: &str) -> Vec<u8> {
    fs::read(path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
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

/// Returns the typical records, then the smallest and the largest of every kind.
pub(crate) fn records() -> Vec<Frame<Record>> {
    let mut records = typical_messages("records");
    for record in &mut records {
        if let Record::Hello(hello) = record {
            hello.schema_hash = SCHEMA_HASH;
        }
    }
    numbered(records)
}

/// Returns the typical commands, then the smallest and the largest of every kind.
pub(crate) fn commands() -> Vec<Frame<Command>> {
    numbered(typical_messages("commands"))
}

/// Returns the payload of the typical record of a kind.
pub(crate) fn typical<T: DeserializeOwned>(kind: &str) -> T {
    let mut records = records().into_iter().map(|frame| frame.message);
    let record = records.find(|record| record.name() == kind);
    let mut record = serde_json::to_value(record).expect("a record can be written");
    serde_json::from_value(record[kind].take()).expect("the type is that of the kind")
}

/// Reads the typical messages from their committed listing, which is written by hand. All other files
/// and lines are made from these messages and from the schema.
fn typical_messages<M: DeserializeOwned>(what: &str) -> Vec<M> {
    #[derive(Deserialize)]
    struct Numbered {
        header: Header,
    }
    #[derive(Deserialize)]
    struct Line<M> {
        message: M,
    }
    let listing = committed(&format!("v{VERSION}-{what}.jsonl"));
    let listing = String::from_utf8(listing).expect("a listing is text");
    let is_typical = |line: &&str| {
        let line: Numbered = serde_json::from_str(line).expect("a line has a header");
        line.header.boot_id == BOOT_ID
    };
    let message = |line: &str| match serde_json::from_str::<Line<M>>(line) {
        Ok(line) => line.message,
        Err(error) => panic!("{line}: {error}"),
    };
    listing.lines().filter(is_typical).map(message).collect()
}

/// The shortest header.
const LEAST: Header = Header {
    boot_id: 0,
    sequence: 0,
    time_us: 0,
    dropped: 0,
};

/// The longest header.
pub(crate) const GREATEST: Header = Header {
    boot_id: u32::MAX,
    sequence: u32::MAX,
    time_us: u64::MAX,
    dropped: u32::MAX,
};

fn numbered<M: Message>(typical: Vec<M>) -> Vec<Frame<M>> {
    let typical = (0..).zip(typical).map(|(sequence, message)| Frame {
        header: header(sequence),
        message,
    });
    let extremes = |header: Header, value: fn(&Type) -> Vec<u8>| {
        let frame = move |kind: &Kind| frame_of(&header, kind.number, &payload_of(kind, value));
        M::KINDS.iter().map(move |kind| decode_one(&frame(kind)))
    };
    typical
        .chain(extremes(LEAST, smallest))
        .chain(extremes(GREATEST, largest))
        .collect()
}

/// A line of a listing: position and content of a frame.
#[derive(Serialize)]
struct FixtureLine<'a, M> {
    /// Offset of the frame's first byte from the start of the file.
    offset: usize,
    /// Number of the frame's bytes, including the zero.
    length: usize,
    header: Header,
    message: &'a M,
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
    let typical = |sequence| sound(header(sequence));
    let foreign = |version: u8, kind: u8, tail: &[u8], sequence| {
        let payload = [&[0; 5], tail].concat();
        let mut content = content(&header(sequence), kind, &payload);
        content[0] = version;
        framed(&content)
    };
    let dropped = |dropped, sequence| {
        sound(Header {
            dropped,
            ..header(sequence)
        })
    };
    let restarted = |sequence| {
        sound(Header {
            boot_id: 0x9ABC_DEF0,
            ..header(sequence)
        })
    };
    let mut flipped = typical(12);
    flipped[9] ^= 0x10;
    let (unended, short) = (typical(13), typical(15));
    [
        // Reception begins within a frame.
        &typical(9)[7..],
        &typical(10),
        // Zeros between frames have no meaning.
        &[0, 0, 0],
        &typical(11),
        // One bit of frame 12 is wrong; the zero between frames 13 and 14 is missing; frame 15 is cut
        // short.
        &flipped,
        &unended[..unended.len() - 1],
        &typical(14),
        &short[..short.len() / 2],
        &[0],
        // Frame 16 comes twice, and frame 13 arrives late.
        &typical(16),
        &typical(16),
        &typical(13),
        // Frames of a later minor version, of another major version, with a byte too many, and of the
        // other direction.
        &foreign(VERSION, 0x7F, &[1, 2, 3], 17),
        &foreign(VERSION + 1, 0x05, &[], 18),
        &foreign(VERSION, 0x05, &[0], 19),
        &foreign(VERSION, 0x81, &[], 20),
        // Bytes longer than the longest frame, and bytes shorter than the shortest.
        &[0x55; 600],
        &[0],
        &[0x01, 0x01, 0x00],
        // The device dropped frames 22 and 23, and frame 24 was lost.
        &typical(21),
        &dropped(2, 25),
        // The device restarts; a frame of the previous boot comes late.
        &restarted(0),
        &dropped(2, 24),
        &restarted(1),
    ]
    .concat()
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
