//! `palpate doctor`: each thing that can be wrong, as far as the emulated board or a port can have it.

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output};
use std::thread::{JoinHandle, spawn};

use palpate_emulator::firmware;
use palpate_wire::crc32;
use serde_json::Value;

use crate::serve::Server;
use crate::settings::{calibration, lines};

fn palpate(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn emulated(arguments: &[&str], folder: &Path) -> Output {
    let image = firmware::build().unwrap_or_else(|error| panic!("{error}"));
    let image = image.to_str().unwrap();
    let board = [
        "--board",
        "emulated",
        "--state",
        "board.flash",
        "--image",
        image,
    ];
    palpate(&[arguments, &board].concat(), folder)
}

fn report(output: &Output) -> Value {
    let stderr = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {stderr}"))
}

/// Names of what was found; the exit code is held against them.
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

/// Changes a bit of what is stored: in the frequency of the calibration above.
fn upset(flash: &Path) {
    let mut contents = fs::read(flash).unwrap();
    let frequency = 3_061_234.567f64.to_le_bytes();
    let at = contents
        .windows(frequency.len())
        .position(|window| window == frequency);
    contents[at.expect("the frequency is stored")] ^= 1;
    fs::write(flash, contents).unwrap();
}

#[test]
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

#[test]
fn damaged_settings_are_found_and_the_fault_of_the_start_is_named_by_clearing_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    calibrate(folder);
    let flash = folder.join("board.flash");
    upset(&flash);
    // The board reports a fault when it begins: here, before its port is there.
    let damaged = emulated(&["doctor", "--json"], folder);
    let found = names(&damaged);
    assert_eq!(
        found,
        ["earlier_fault", "storage_damaged", "not_calibrated"]
    );
    let cleared = emulated(&["doctor", "--json", "--clear"], folder);
    assert_eq!(report(&cleared)["cleared"], "storage_damaged");
    assert_eq!(names(&cleared), ["storage_damaged", "not_calibrated"]);
    // What the findings say to do puts it right.
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
    // Every verb says so.
    let output = palpate(&["settings", "get", "--board", &board], folder.path());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("another program is connected"), "{said}");
}

/// A port at which something says the same again and again, until who connected goes away.
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
fn what_is_no_board_is_told_from_one_that_is_silent() {
    let other = found_at(b"MicroPython v1.22 on Pico\r\n>>> ");
    assert_eq!(other["finding"], "other_firmware");
    let cause = other["cause"].as_str().unwrap();
    assert!(cause.contains("MicroPython v1.22"), "{cause}");
    let silent = found_at(b"");
    assert_eq!(silent["finding"], "silent");
}

#[test]
fn a_board_of_another_version_is_named_with_its_version() {
    // Nothing in it is zero, so that COBS is one block.
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
