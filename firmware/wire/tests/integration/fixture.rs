//! The committed fixture, and the document generated from the code.

use std::fs;

use crate::support::document;
use crate::support::fixture::{FixtureLine, files, folder};
use crate::support::{bytes_of, reference};
use palpate_wire::{Command, Decoder, Frame, Message, Record, VERSION};
use serde::de::DeserializeOwned;

const RENEW: &str = "cargo run -p palpate-wire --example generate";

fn committed(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}; {RENEW}"))
}

#[test]
fn the_committed_files_are_what_the_code_makes() {
    for (name, content) in files() {
        assert!(committed(&name) == content, "{name} differs; {RENEW}");
    }
}

/// Decodes the committed bytes, compares with the listing, and encodes the listing again.
fn agree<M: Message + PartialEq + std::fmt::Debug + DeserializeOwned>(what: &str) {
    let bytes = committed(&format!("v{VERSION}-{what}.bin"));
    let listing = String::from_utf8(committed(&format!("v{VERSION}-{what}.jsonl"))).unwrap();
    let mut decoder = Decoder::<M, 256>::new();
    let mut decoded = decoder.frames(&bytes);
    let mut encoded = Vec::new();
    for text in listing.lines() {
        let line: FixtureLine<M> = serde_json::from_str(text).unwrap();
        assert_eq!(line.offset, encoded.len(), "{text}");
        let frame = Frame {
            header: line.header,
            message: line.message,
        };
        assert_eq!(decoded.next().unwrap().as_ref(), Ok(&frame), "{text}");
        encoded.extend(bytes_of(&frame));
        assert_eq!(line.offset + line.length, encoded.len(), "{text}");
    }
    assert!(decoded.next().is_none(), "frames that are not listed");
    assert!(encoded == bytes, "the listing encodes to other bytes");
}

#[test]
fn records_decode_to_their_listing_and_encode_to_their_bytes() {
    agree::<Record>("records");
}

#[test]
fn commands_decode_to_their_listing_and_encode_to_their_bytes() {
    agree::<Command>("commands");
}

/// Compares the counts of the damaged stream with counts made by hand.
#[test]
fn the_damaged_stream_is_accounted_for() {
    let listing = String::from_utf8(committed(&format!("v{VERSION}-damaged.jsonl"))).unwrap();
    let sums: serde_json::Value = serde_json::from_str(listing.lines().last().unwrap()).unwrap();
    let counts = &sums["counts"];
    // Decoded frames: 10, 11, 16 twice, 13, 21, 25, two of the next boot, and 24.
    assert_eq!(counts["frames"], 10);
    // Damaged frames: 12, 13 joined to 14, 15, and the part of 9. COBS or the CRC-32 detects each.
    let found = counts["stuffing"].as_u64().unwrap() + counts["checksum"].as_u64().unwrap();
    assert_eq!(found, 4);
    assert_eq!(
        (&counts["too_long"], &counts["too_short"]),
        (&1.into(), &1.into())
    );
    assert_eq!(
        (&counts["version"], &counts["header"]),
        (&1.into(), &0.into())
    );
    assert_eq!(
        (&counts["unknown_kind"], &counts["payload"]),
        (&2.into(), &1.into())
    );
    // Sixteen frames were produced, 10 to 25. Received: 10 11 13 16 17 19 20 21 24 25. Missing: 12 14 15
    // 18 22 23.
    let boot = &sums["boots"][0];
    assert_eq!(
        (&boot["produced"], &boot["received"]),
        (&16.into(), &10.into())
    );
    assert_eq!(
        (&boot["missing"], &boot["dropped_by_device"]),
        (&6.into(), &2.into())
    );
    assert_eq!(
        (&boot["lost_on_the_way"], &boot["duplicates"]),
        (&4.into(), &1.into())
    );
    let boot = &sums["boots"][1];
    assert_eq!(
        (&boot["produced"], &boot["received"]),
        (&2.into(), &2.into())
    );
}

#[test]
fn the_document_is_up_to_date() {
    let text = fs::read_to_string(document::path()).unwrap();
    let renewed = document::renewed(&text);
    // Reports a changed limit by its row: in the document, and in the code.
    let changed = text
        .lines()
        .zip(renewed.lines())
        .find(|(old, new)| old != new);
    assert!(
        renewed == text,
        "docs/protocol.md is out of date; {RENEW}\n{}",
        changed.map_or_else(String::new, |(old, new)| format!(
            "document: {old}\ncode:     {new}"
        ))
    );
}

/// Reads the example from the document, as a person would.
#[test]
fn the_worked_example_is_in_the_fixture_and_adds_up() {
    let text = fs::read_to_string(document::path()).unwrap();
    let (_, example) = text.split_once("### Example").unwrap();
    let bytes = |text: &str| -> Vec<u8> {
        text.split_whitespace()
            .map(|byte| u8::from_str_radix(byte, 16).unwrap())
            .collect()
    };
    let (introduction, rest) = example.split_once("```text\n").unwrap();
    let (coded, rest) = rest.split_once("```").unwrap();
    let coded = bytes(coded);
    let offset: usize = introduction
        .split_once("at offset ")
        .and_then(|(_, rest)| rest.split_once(' '))
        .and_then(|(number, _)| number.parse().ok())
        .unwrap();
    let fixture = committed(&format!("v{VERSION}-records.bin"));
    assert_eq!(fixture[offset..offset + coded.len()], coded[..]);

    let rows = rest.lines().skip_while(|line| !line.starts_with("|---"));
    let body: Vec<u8> = rows
        .skip(1)
        .take_while(|line| line.starts_with('|'))
        .flat_map(|line| bytes(line.split('`').nth(1).unwrap()))
        .collect();
    assert_eq!(reference::cobs(&body), coded);
}
