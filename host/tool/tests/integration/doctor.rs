//! `palpate doctor`: every defect that the emulated board or a port can have.

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Output;
use std::thread::{JoinHandle, spawn};

use palpate_wire::code::{Board, Chip, ResetCause};
use palpate_wire::record::Hello;
use palpate_wire::{MINOR_VERSION, Message, Record, SCHEMA_HASH, Sequencer, crc32, encode};
use serde_json::Value;

use crate::serve::Server;
use crate::settings::{REST_HZ, calibration, lines};
use crate::support::{emulated, palpate};

fn report(output: &Output) -> Value {
    let stderr = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {stderr}"))
}

/// Names of the findings; checks the exit code against them.
fn names(output: &Output) -> Vec<String> {
    let findings = report(output)["findings"].clone();
    let findings = findings.as_array().unwrap();
    let expected = i32::from(!findings.is_empty());
    assert_eq!(output.status.code(), Some(expected), "{findings:?}");
    for finding in findings {
        for field in ["cause", "action"] {
            assert!(!finding[field].as_str().unwrap().is_empty(), "{finding}");
        }
    }
    let names = findings.iter().map(|of| of["finding"].as_str().unwrap());
    names.map(str::to_owned).collect()
}

/// Stores a calibration in the emulated board of a folder.
fn calibrate(folder: &Path) {
    fs::write(folder.join("board.jsonl"), lines(&calibration())).unwrap();
    let imported = emulated(&["settings", "import", "board.jsonl", "--store"], folder);
    let stderr = String::from_utf8_lossy(&imported.stderr);
    assert!(imported.status.success(), "{stderr}");
}

/// Flips a bit of the stored calibration, in the frequency of the untouched sensor.
fn upset(flash: &Path) {
    let mut contents = fs::read(flash).unwrap();
    let frequency = REST_HZ.to_le_bytes();
    let at = contents
        .windows(frequency.len())
        .position(|window| window == frequency);
    contents[at.expect("the frequency is stored")] ^= 1;
    fs::write(flash, contents).unwrap();
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_bare_board_is_not_calibrated_and_a_calibrated_one_is_sound() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let bare = emulated(&["doctor", "--json"], folder);
    assert_eq!(names(&bare), ["not_calibrated"]);
    calibrate(folder);
    let sound = emulated(&["doctor", "--json"], folder);
    assert_eq!(names(&sound), [""; 0], "{}", report(&sound));
    let said = emulated(&["doctor"], folder);
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("nothing is wrong"), "{said}");
}

/// The second channel has no sensor, so the watchdog ends its conversions early.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_sensor_that_does_not_oscillate_is_the_fault_that_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let set = ["settings", "set", "channels=2", "rate_hz=300", "--store"];
    assert!(emulated(&set, folder).status.success());
    // The fault began before the tool connected. After clearing, it comes again.
    let found = emulated(&["doctor", "--json"], folder);
    assert_eq!(names(&found), ["earlier_fault", "not_calibrated"]);
    let cleared = emulated(&["doctor", "--clear", "--json"], folder);
    assert_eq!(names(&cleared), ["fault", "not_calibrated"]);
    assert_eq!(report(&cleared)["cleared"], "sensor_not_oscillating");
    let cause = report(&cleared)["findings"][0]["cause"].to_string();
    assert!(cause.contains("sensor_not_oscillating"), "{cause}");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn damaged_settings_are_found_and_the_fault_of_the_start_is_named_by_clearing_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    calibrate(folder);
    let flash = folder.join("board.flash");
    upset(&flash);
    // The board reports a fault only once, when it begins: here before the port exists.
    let damaged = emulated(&["doctor", "--json"], folder);
    let found = names(&damaged);
    assert_eq!(
        found,
        ["earlier_fault", "storage_damaged", "not_calibrated"]
    );
    let cleared = emulated(&["doctor", "--json", "--clear"], folder);
    assert_eq!(report(&cleared)["cleared"], "storage_damaged");
    assert_eq!(names(&cleared), ["storage_damaged", "not_calibrated"]);
    // Follows the remedy that the findings state: the board is then sound.
    calibrate(folder);
    assert_eq!(names(&emulated(&["doctor", "--json"], folder)), [""; 0]);
}

#[test]
fn a_port_that_another_program_uses_is_busy() {
    let server = Server::start(&[]);
    let _first = TcpStream::connect(&server.address).unwrap();
    let board = format!("tcp:{}", server.address);
    let folder = tempfile::tempdir().unwrap();
    let output = palpate(&["doctor", "--json", "--board", &board], folder.path());
    assert_eq!(names(&output), ["busy"]);
    // Other verbs report a busy port too.
    let output = palpate(&["settings", "get", "--board", &board], folder.path());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("another program is connected"), "{said}");
}

/// Checks that the book's table lists all findings of a board or a port, and no others.
#[test]
fn every_finding_stands_in_the_book_and_has_a_test() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let book = fs::read_to_string(package.join("../../docs/desk.md")).unwrap();
    let (_, tables) = book.split_once("## What is wrong").unwrap();
    let (tables, _) = tables.split_once("### Settings that are refused").unwrap();
    let rows = tables.lines().filter_map(|line| line.strip_prefix("| `"));
    let rows: Vec<_> = rows.map(|row| row.split_once("` |").unwrap().0).collect();
    let of_host = package.join("..");
    let source = ["cli/src", "tool/src"].map(|folder| source(&of_host.join(folder)));
    let source = source.concat();
    for row in &rows {
        assert!(source.contains(&format!("\"{row}\"")), "{row}");
    }
    let made = source.split("Finding::new(").skip(1);
    let names = made.filter_map(|after| after.trim_start().strip_prefix('"'));
    for name in names.map(|rest| rest.split('"').next().unwrap()) {
        assert!(rows.contains(&name), "{name}");
    }
    assert!(rows.len() > 25, "{rows:?}");
    let own = fs::read_to_string(package.join("tests/integration/doctor.rs")).unwrap();
    let units = ["cli/src", "tool/src"].map(|folder| unit_tests(&of_host.join(folder)));
    let tests = own + &units.concat();
    for row in &rows {
        assert!(tests.contains(&format!("\"{row}\"")), "no test names {row}");
    }
}

/// Unit tests of all sources in a folder.
fn unit_tests(folder: &Path) -> String {
    let paths = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let texts = paths.map(|path| match path.is_dir() {
        true => unit_tests(&path),
        false => {
            let text = fs::read_to_string(path).unwrap();
            let tests = text.split_once("#[cfg(test)]\nmod tests {");
            tests.map_or_else(String::new, |(_, tests)| tests.to_owned())
        }
    });
    texts.collect()
}

/// All sources in a folder, concatenated.
fn source(folder: &Path) -> String {
    let paths = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let texts = paths.map(|path| match path.is_dir() {
        true => source(&path),
        false => fs::read_to_string(path).unwrap(),
    });
    texts.collect()
}

/// A port that gives every request the same answer until the connection ends.
fn port(says: &'static [u8]) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    let thread = spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut question = [0; 256];
        while matches!(stream.read(&mut question), Ok(1..)) {
            if stream.write_all(says).is_err() {
                return;
            }
        }
    });
    (address, thread)
}

fn found_at(says: &'static [u8]) -> Value {
    let (board, thread) = port(says);
    let folder = tempfile::tempdir().unwrap();
    let output = palpate(&["doctor", "--json", "--board", &board], folder.path());
    thread.join().unwrap();
    assert_eq!(names(&output).len(), 1);
    report(&output)["findings"][0].clone()
}

#[test]
fn another_firmware_and_a_silent_port_are_different_findings() {
    let other = found_at(b"MicroPython v1.22 on Pico\r\n>>> ");
    assert_eq!(other["finding"], "other_firmware");
    let cause = other["cause"].as_str().unwrap();
    assert!(cause.contains("MicroPython v1.22"), "{cause}");
    let silent = found_at(b"");
    assert_eq!(silent["finding"], "silent");
}

#[test]
fn a_board_of_another_version_is_named_with_its_version() {
    // The body contains no zero, so COBS is one block.
    let body = (1..=255)
        .map(|filler| [9, 1, filler, filler])
        .find(|body| !crc32(body).to_le_bytes().contains(&0))
        .unwrap();
    let frame = [&[0, 9], &body[..], &crc32(&body).to_le_bytes(), &[0]].concat();
    let found = found_at(frame.leak());
    assert_eq!(found["finding"], "other_version");
    let cause = found["cause"].as_str().unwrap();
    assert!(cause.contains("version 9"), "{cause}");
}

#[test]
fn a_board_that_goes_away_meanwhile_is_a_finding() {
    let hello = Record::Hello(Hello {
        minor_version: MINOR_VERSION,
        schema_hash: SCHEMA_HASH,
        firmware_major: 0,
        firmware_minor: 1,
        firmware_patch: 0,
        commit: 0,
        dirty: false,
        simulated: true,
        board: Board::Pico,
        unit: 1,
        reset_cause: ResetCause::PowerOn,
        chip: Chip::Ldc161x,
        second_chip: Chip::Absent,
        configuration_crc: 0,
    });
    let mut buffer = [0; Record::MAX_FRAME];
    let header = Sequencer::new(7).stamp(0);
    let frame = encode(&header, &hello, &mut buffer).unwrap().to_vec();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let board = format!("tcp:{}", listener.local_addr().unwrap());
    let thread = spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let _ = stream.read(&mut [0; 256]).unwrap();
        stream.write_all(&frame).unwrap();
    });
    let folder = tempfile::tempdir().unwrap();
    let output = palpate(&["doctor", "--json", "--board", &board], folder.path());
    thread.join().unwrap();
    assert_eq!(names(&output), ["gone"]);
}

#[test]
fn a_port_that_is_not_there_is_a_finding() {
    let folder = tempfile::tempdir().unwrap();
    let output = palpate(
        &["doctor", "--json", "--board", "no-such-port"],
        folder.path(),
    );
    assert_eq!(names(&output), ["no_such_port"]);
}

#[test]
fn an_address_at_which_nothing_listens_is_unreachable() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let board = format!("tcp:{}", listener.local_addr().unwrap());
    drop(listener);
    let folder = tempfile::tempdir().unwrap();
    let output = palpate(&["doctor", "--json", "--board", &board], folder.path());
    assert_eq!(names(&output), ["unreachable"]);
    let text = palpate(&["doctor", "--board", &board], folder.path());
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains("Action: Start `palpate serve-emulated`"),
        "{text}"
    );
}
