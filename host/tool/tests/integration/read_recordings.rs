//! Recordings from other programs: empty, foreign, compressed, joined, rewritten, with wrong times.

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::support::{json, palpate, recording, recording_of};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// A record of the MCAP file format: opcode, length, contents.
fn piece(opcode: u8, contents: &[u8]) -> Vec<u8> {
    let length = (contents.len() as u64).to_le_bytes();
    [&[opcode], &length[..], contents].concat()
}

fn text(text: &str) -> Vec<u8> {
    let length = (text.len() as u32).to_le_bytes();
    [&length[..], text.as_bytes()].concat()
}

/// A file with a compressed chunk.
fn compressed(by: &str) -> Vec<u8> {
    let header = piece(1, &[text("palpate"), text("a test")].concat());
    let chunk = [vec![0; 16], 9_u64.to_le_bytes().to_vec(), vec![0; 4]].concat();
    let chunk = [chunk, text(by), 4_u64.to_le_bytes().to_vec(), vec![1; 4]].concat();
    [MAGIC, &header, &piece(6, &chunk)].concat()
}

/// Writes a recording of another program.
fn foreign(file: &Path) {
    let file = std::io::BufWriter::new(fs::File::create(file).unwrap());
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = options.create(file).unwrap();
    let none = std::collections::BTreeMap::new();
    let header = mcap::records::MessageHeader {
        channel_id: writer.add_channel(0, "/camera", "json", &none).unwrap(),
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
}

/// All verbs that read a recording.
fn readers(file: &str) -> Vec<Vec<&str>> {
    vec![
        vec!["info", file],
        vec!["replay", file],
        vec!["report", file, "--html", "out.html"],
        vec!["export", file, "--csv", "tables"],
        vec!["watch", "--json", "--board", file],
        vec!["measure", "--board", file],
    ]
}

fn refused(output: &Output, verb: &[&str], parts: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{verb:?}: {said}");
    for part in parts {
        assert!(said.contains(part), "{verb:?}: {said}");
    }
    assert!(output.stdout.is_empty(), "{verb:?}");
}

#[test]
fn what_cannot_be_read_is_refused_by_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    write("nothing.mcap", b"");
    write("short.mcap", b"\x89MCA");
    write("foreign.mcap.partial", b"this is no recording at all");
    write("zstd.mcap", &compressed("zstd"));
    write("lz4.mcap", &compressed("lz4"));
    fs::create_dir(folder.join("folder.mcap")).unwrap();
    foreign(&folder.join("other.mcap"));
    for (file, parts) in [
        ("nothing.mcap", ["is empty", "name"]),
        ("short.mcap", ["not an MCAP file", "name"]),
        ("foreign.mcap.partial", ["not an MCAP file", "name"]),
        ("zstd.mcap", ["compressed by zstd", "mcap decompress"]),
        ("lz4.mcap", ["compressed by lz4", "mcap decompress"]),
        ("folder.mcap", ["folder.mcap: ", "Name a file"]),
        ("other.mcap", ["no records of palpate", "name"]),
        ("missing.mcap", ["missing.mcap: ", "Name a file"]),
    ] {
        for verb in readers(file) {
            refused(&palpate(&verb, folder), &verb, &parts);
        }
    }
}

#[test]
fn a_recording_without_a_record_is_shown_and_not_worked_on() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording_of(&folder.join("r.mcap"), &[]);
    assert!(palpate(&["info", "r.mcap"], folder).status.success());
    for verb in readers("r.mcap").into_iter().skip(1) {
        refused(
            &palpate(&verb, folder),
            &verb,
            &["there is no record in it"],
        );
    }
}

#[test]
fn a_replay_that_compares_nothing_is_no_success() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(&folder.join("r.mcap"));
    let output = palpate(&["replay", "r.mcap"], folder);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("r.mcap: nothing could be compared"), "{said}");
}

fn records(folder: &Path, file: &str) -> Value {
    json(&palpate(&["info", file, "--json"], folder))
}

#[test]
fn joined_recordings_are_read_to_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(&folder.join("one.mcap"));
    let one = fs::read(folder.join("one.mcap")).unwrap();
    fs::write(folder.join("both.mcap"), [&one[..], &one].concat()).unwrap();
    let once = records(folder, "one.mcap");
    let both = records(folder, "both.mcap");
    assert_eq!(both["damage"], Value::Null);
    for (kind, count) in once["records"].as_object().unwrap() {
        let twice = count.as_u64().map(|count| 2 * count);
        assert_eq!(both["records"][kind].as_u64(), twice, "{kind}");
    }
    // Bytes that follow a recording and are not a recording are reported.
    fs::write(
        folder.join("tail.mcap"),
        [&one[..], b"something else"].concat(),
    )
    .unwrap();
    let tail = records(folder, "tail.mcap");
    assert_eq!(tail["records"], once["records"]);
    assert!(
        tail["damage"].as_str().unwrap().contains("damaged"),
        "{tail}"
    );
}
