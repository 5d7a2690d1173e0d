//! Records as lines of JSON: one format in docs/protocol.md, `palpate decode` and `palpate simulate
//! --records`.

use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use palpate_wire::{Frame, Message, Record, encode};
use serde::Deserialize;

/// All forms of a line in docs/protocol.md.
#[derive(Debug)]
enum RecordLine {
    Frame(Box<Frame<Record>>),
    Damaged(Damaged),
    Press(Press),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Damaged {
    error: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Press {
    press: String,
}

fn line(text: &str) -> RecordLine {
    let frame = serde_json::from_str(text).map(|frame| RecordLine::Frame(Box::new(frame)));
    let damaged = || serde_json::from_str(text).map(RecordLine::Damaged);
    let press = || serde_json::from_str(text).map(RecordLine::Press);
    frame
        .or_else(|_| damaged())
        .or_else(|_| press())
        .unwrap_or_else(|_| panic!("no line of docs/protocol.md: {text}"))
}

fn decode(bytes: &[u8]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("decode")
        .write_stdin(bytes)
        .output()
        .unwrap()
}

/// Encodes the frames of these lines as a board does.
fn sent<'l>(lines: impl IntoIterator<Item = &'l str>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for text in lines {
        if let RecordLine::Frame(frame) = line(text) {
            let mut buffer = [0; Record::MAX_FRAME];
            bytes.extend(encode(&frame.header, &frame.message, &mut buffer).unwrap());
        }
    }
    bytes
}

/// Examples in the document.
fn documented() -> Vec<String> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/protocol.md");
    let text = fs::read_to_string(file).unwrap();
    let (_, section) = text.split_once("\n## Text form\n").unwrap();
    let section = section.split("\n## ").next().unwrap();
    let examples = section.split("```").skip(1).step_by(2);
    let lines = examples.flat_map(|block| block.lines().skip(1));
    lines.map(str::to_owned).collect()
}

fn of_frames(lines: &[String]) -> Vec<&str> {
    let lines = lines.iter().map(String::as_str);
    lines
        .filter(|text| matches!(line(text), RecordLine::Frame(_)))
        .collect()
}

#[test]
fn the_documents_examples_are_what_decode_prints() {
    let examples = documented();
    let frames = of_frames(&examples);
    assert!(frames.len() >= 2, "{examples:?}");
    let output = decode(&sent(frames.iter().copied()));
    assert!(output.status.success());
    let printed = String::from_utf8(output.stdout).unwrap();
    assert_eq!(printed.lines().collect::<Vec<_>>(), frames);
    let damaged = examples
        .iter()
        .any(|text| matches!(line(text), RecordLine::Damaged(_)));
    let press = examples
        .iter()
        .any(|text| matches!(line(text), RecordLine::Press(_)));
    assert!(damaged && press, "{examples:?}");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn simulate_writes_what_decode_prints_of_the_same_frames() {
    let folder = tempfile::tempdir().unwrap();
    let [scenario, file] = ["s.toml", "r.jsonl"].map(|name| folder.path().join(name));
    let touch = "stack = \"ultrasoft\"\ndisturbances = \"none\"\n\n[[press]]\nname = \"a touch\"\n\
                 load = \"spring\"\nstiffness_N_per_m = 2e3\ndepth_m = 0.05e-3\n";
    fs::write(&scenario, touch).unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("simulate")
        .arg(scenario)
        .arg("--records")
        .arg(&file)
        .output()
        .unwrap();
    assert!(run.status.success());
    let written = fs::read_to_string(file).unwrap();
    let written: Vec<String> = written.lines().map(str::to_owned).collect();
    let RecordLine::Press(Press { press }) = line(&written[0]) else {
        panic!("{}", written[0]);
    };
    assert_eq!(press, "a touch");
    let frames = of_frames(&written);
    assert_eq!(frames.len(), written.len() - 1);
    let output = decode(&sent(frames.iter().copied()));
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(frames.len() > 500, "{}", frames.len());
    assert_eq!(printed.lines().count(), frames.len());
    for (printed, written) in printed.lines().zip(&frames) {
        assert_eq!(printed, *written);
    }
    // The frames are numbered from 0, as on a board.
    for (number, text) in (0..).zip(&frames) {
        let RecordLine::Frame(frame) = line(text) else {
            panic!("{text}");
        };
        assert_eq!(frame.header.sequence, number);
    }
}

#[test]
fn the_fixture_is_decoded_to_its_listing() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/wire/fixture");
    let output = decode(&fs::read(folder.join("v2-records.bin")).unwrap());
    let printed = String::from_utf8(output.stdout).unwrap();
    let listing = fs::read_to_string(folder.join("v2-records.jsonl")).unwrap();
    assert_eq!(printed.lines().count(), listing.lines().count());
    for (printed, listed) in printed.lines().zip(listing.lines()) {
        // A line of the listing has offset and length before the text of the frame.
        let (_, rest) = listed.split_once("\"header\"").unwrap();
        assert_eq!(printed, format!("{{\"header\"{rest}"));
    }
}

#[test]
fn what_has_no_frame_is_a_failure() {
    let noise: Vec<u8> = (0..4096_u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    let text = "this is no stream of frames\n".repeat(10).into_bytes();
    for (bytes, seen) in [(noise, 4096), (text, 280), (Vec::new(), 0)] {
        let output = decode(&bytes);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{message}");
        let found = format!("no frame found in {seen} bytes");
        assert!(message.contains(&found), "{message}");
        let lines = String::from_utf8(output.stdout).unwrap();
        assert!(
            lines
                .lines()
                .all(|text| matches!(line(text), RecordLine::Damaged(_)))
        );
    }
}

#[test]
fn frames_among_garbage_are_found() {
    let records = include_bytes!("../../../../firmware/wire/fixture/v2-records.bin");
    let mut bytes = b"switched on in the middle of a frame\0".to_vec();
    bytes.extend(records);
    let output = decode(&bytes);
    assert!(output.status.success());
    let lines = String::from_utf8(output.stdout).unwrap();
    let mut lines = lines.lines().map(line);
    assert!(lines.clone().count() > 2);
    let Some(RecordLine::Damaged(Damaged { error })) = lines.next() else {
        panic!("the garbage is not there");
    };
    assert!(!error.is_empty());
    assert!(lines.all(|of| matches!(of, RecordLine::Frame(_))));
}
