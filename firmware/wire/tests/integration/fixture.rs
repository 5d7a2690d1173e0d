//! The committed fixture, and the document generated from the code.

use std::fmt::Debug;
use std::fs;

use crate::support::document;
use crate::support::fixture::{commands, committed, files, records};
use palpate_wire::{Decoder, Frame, FrameError, Message, VERSION};
use serde_json::json;

const RENEW: &str = "cargo run -p palpate-wire --example generate";

#[test]
fn the_committed_files_are_what_the_code_makes() {
    for (name, content) in files() {
        assert!(committed(&name) == content, "{name} differs; {RENEW}");
    }
}

#[test]
fn the_committed_bytes_decode_to_their_listing() {
    fn check<M: Message + PartialEq + Debug>(what: &str, listed: Vec<Frame<M>>) {
        let bytes = committed(&format!("v{VERSION}-{what}.bin"));
        let mut decoder = Decoder::<M, 256>::new();
        let decoded: Result<Vec<_>, FrameError> = decoder.frames(&bytes).collect();
        assert_eq!(decoded, Ok(listed), "{what}");
    }
    check("records", records());
    check("commands", commands());
}

/// Compares the counts of the damaged stream with counts made by hand.
#[test]
fn the_damaged_stream_is_accounted_for() {
    let listing = String::from_utf8(committed(&format!("v{VERSION}-damaged.jsonl"))).unwrap();
    let sums: serde_json::Value = serde_json::from_str(listing.lines().last().unwrap()).unwrap();
    // Decoded frames: 10, 11, 16 twice, 13, 21, 25, two of the next boot, and 24. Damaged frames: 12, 13
    // joined to 14, 15, and the part of 9. COBS or the CRC-32 detects each.
    let mut counts = sums["counts"].clone();
    let found = ["stuffing", "checksum"].map(|one| counts[one].take().as_u64().unwrap());
    assert_eq!(found.iter().sum::<u64>(), 4);
    let expected = json!({
        "frames": 10, "stuffing": null, "too_long": 1, "too_short": 1, "checksum": null,
        "version": 1, "header": 0, "unknown_kind": 2, "payload": 1,
    });
    assert_eq!(counts, expected);
    // Sixteen frames were produced, 10 to 25. Received: 10 11 13 16 17 19 20 21 24 25. Missing: 12 14 15
    // 18 22 23.
    let before = json!({
        "boot_id": 0x1234_5678, "before_first": 10, "produced": 16, "received": 10, "missing": 6,
        "dropped_by_device": 2, "lost_on_the_way": 4, "duplicates": 1, "stale": 0,
    });
    let after = json!({
        "boot_id": 0x9ABC_DEF0_u32, "before_first": 0, "produced": 2, "received": 2, "missing": 0,
        "dropped_by_device": 0, "lost_on_the_way": 0, "duplicates": 0, "stale": 0,
    });
    assert_eq!(sums["boots"], json!([before, after]));
}

#[test]
fn the_document_is_up_to_date() {
    let text = fs::read_to_string(document::path()).unwrap();
    let renewed = document::renewed(&text);
    // Reports the first changed row, as it is in the document and in the code.
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
