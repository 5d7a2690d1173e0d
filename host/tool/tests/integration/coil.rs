//! `palpate coil` and `palpate calibrate current`, as their users call them.

use std::cell::Cell;
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use palpate_emulator::{
    BridgeCircuit, COMMANDS, EmulatedBoard, Image, LOGS, Options, RECORDS, Still, Time,
};
use serde_json::Value;

use crate::support::{emulated, image, json, palpate};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_coil_is_found_and_its_current_follows() {
    let folder = tempfile::tempdir().unwrap();
    for to in ["8", "-3"] {
        let found = json(&emulated(&["coil", "--to", to, "--json"], folder.path()));
        assert_eq!(found["within_limits"], true, "{found}");
        assert_eq!(found["step"]["to_a"], to.parse::<f64>().unwrap());
        // The design ultrasoft has 40 uH, and about 0.5 ohm with bridge and supply.
        let inductance_h = number(&found["test"]["inductance_h"]);
        assert!((inductance_h / 40e-6 - 1.0).abs() < 0.08, "{inductance_h}");
        let ohm = number(&found["test"]["resistance_ohm"]);
        assert!((0.35..0.65).contains(&ohm), "{ohm}");
    }
    for name in ["step.svg", "ramp.svg"] {
        let text = fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(
            text.starts_with("<svg") && text.contains("</svg>"),
            "{name}"
        );
    }
    let table = emulated(&["coil"], folder.path());
    let text = String::from_utf8_lossy(&table.stdout).into_owned();
    assert!(
        text.contains("simulated coil") && text.contains("overshoot"),
        "{text}"
    );
}

#[test]
fn what_cannot_be_driven_is_refused_with_what_can() {
    let folder = tempfile::tempdir().unwrap();
    let output = emulated(&["coil", "--to", "40"], folder.path());
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(stderr.contains("allowed are 1 to"), "{stderr}");
    let nowhere = palpate(&["coil", "--board", "probe:localhost:1"], folder.path());
    assert_eq!(nowhere.status.code(), Some(2));
    let unreachable_board = palpate(
        &["coil", "--board", "probe:127.0.0.1:1,127.0.0.1:1"],
        folder.path(),
    );
    assert_eq!(unreachable_board.status.code(), Some(1));
    let stderr = String::from_utf8_lossy(&unreachable_board.stderr).into_owned();
    assert!(stderr.contains("bring-up.md"), "{stderr}");
}

/// Limit of the error after the calibration: 0.3 % of 10 A.
const ABSOLUTE_A: f64 = 0.03;
/// Amplitude of the calibration's sweep about a current, A.
const SWEPT_A: f64 = 0.06;
/// Gain error of the current amplifier on the board with a meter.
const GAIN_ERROR: f64 = 0.08;

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_calibration_makes_the_current_absolute() {
    let folder = tempfile::tempdir().unwrap();
    // A current of 6 A takes a third of the energy of 10 A, and so a third of the cooling time.
    let arguments = ["calibrate", "current", "--greatest", "6", "--json"];
    let found = json(&emulated(&arguments, folder.path()));
    let before_a = number(&found["worst_before_a"]);
    let after_a = number(&found["worst_after_a"]);
    println!("{before_a:.3} A, then {after_a:.3} A");
    assert!(
        before_a < 0.2 && after_a < ABSOLUTE_A,
        "{before_a} {after_a}"
    );
    assert!(after_a < before_a);
    // The output file is a command for `palpate encode`.
    let command = fs::read_to_string(folder.path().join("current.jsonl")).unwrap();
    let mut encode = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["encode", "--boot", "7"])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    encode
        .stdin
        .take()
        .unwrap()
        .write_all(command.as_bytes())
        .unwrap();
    let frames = encode.wait_with_output().unwrap();
    assert!(frames.status.success() && frames.stdout.len() > 70);
}

/// A probe's server with two ports.
struct Served {
    records: String,
    commands: String,
    server: JoinHandle<()>,
}

impl Served {
    /// Runs a verb on the board.
    fn palpate(&self, arguments: &[&str], folder: &Path) -> Output {
        let board = format!("probe:{},{}", self.records, self.commands);
        let index = ["--board", &board, "--stack", "ultrasoft"];
        palpate(&[arguments, &index].concat(), folder)
    }
}

/// Serves an emulated board behind a probe, in real time. The file `meter` contains its true
/// current, averaged over a tenth of a second.
fn serve(meter: Option<PathBuf>) -> Served {
    let image = Image::load(image()).unwrap();
    let [records, commands] = [0, 1].map(|_| TcpListener::bind("127.0.0.1:0").unwrap());
    let address = |of: &TcpListener| of.local_addr().unwrap().to_string();
    let addresses = [&records, &commands].map(address);
    let server = spawn(move || {
        let [mut records, mut commands] = [records, commands].map(|of| of.accept().unwrap().0);
        commands.set_nonblocking(true).unwrap();
        let plant = Still::new([3.1e6, 3.2e6, 3.3e6, 3.4e6]);
        let usual = Options::default();
        let options = Options {
            drive: BridgeCircuit {
                gain_error: if meter.is_some() { GAIN_ERROR } else { 0.0 },
                ..usual.drive
            },
            ..usual
        };
        let settings = ldc161x_sim::Settings::default();
        let mut board = EmulatedBoard::new(&image, plant, settings, options);
        board.run_for(Time::from_ms(100)).unwrap();
        while exchange(&mut board, &mut records, &mut commands) {
            if let Some(meter) = &meter {
                read_meter(&mut board, meter);
            }
        }
    });
    let [records, commands] = addresses;
    Served {
        records,
        commands,
        server,
    }
}

/// Runs ten milliseconds. Returns `false` when the client has gone.
fn exchange(
    board: &mut EmulatedBoard<Still>,
    records: &mut TcpStream,
    commands: &mut TcpStream,
) -> bool {
    let begin = Instant::now();
    let mut bytes = [0; 256];
    match commands.read(&mut bytes) {
        Ok(0) => return false,
        Ok(length) => assert_eq!(board.write_channel(COMMANDS, &bytes[..length]), length),
        Err(error) if error.kind() == ErrorKind::WouldBlock => {}
        Err(_) => return false,
    }
    board.run_for(Time::from_ms(10)).unwrap();
    let sent = records.write_all(&board.read_channel(RECORDS));
    let logged = commands.write_all(&board.read_channel(LOGS));
    sleep(Duration::from_millis(10).saturating_sub(begin.elapsed()));
    sent.is_ok() && logged.is_ok()
}

/// Writes the number of the reading, and the true mean since the previous one.
fn read_meter(board: &mut EmulatedBoard<Still>, meter: &Path) {
    thread_local! {
        static LAST: Cell<(u32, f64, f64)> = const { Cell::new((0, 0.0, 0.0)) };
    }
    let totals = board.circuit().totals();
    let (number, charge_a_s, time_s) = LAST.get();
    if totals.time_s - time_s >= 0.08 {
        LAST.set((number + 1, totals.charge_a_s, totals.time_s));
        let mean_a = (totals.charge_a_s - charge_a_s) / (totals.time_s - time_s);
        let written = meter.with_extension("new");
        fs::write(&written, format!("{number} {mean_a:.5}\n")).unwrap();
        fs::rename(&written, meter).unwrap();
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_board_behind_a_probe_is_tested_the_same_way() {
    let served = serve(None);
    let folder = tempfile::tempdir().unwrap();
    let found = json(&served.palpate(&["coil", "--to", "5", "--json"], folder.path()));
    assert_eq!(found["simulated"], false);
    assert_eq!(found["within_limits"], true, "{found}");
    served.server.join().unwrap();
}

/// Writes a program with these lines.
fn program(folder: &Path, lines: &str) -> PathBuf {
    let file = folder.join("read-meter");
    let text = format!("#!/bin/sh\n{lines}\n");
    fs::write(&file, text).unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
    file
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_board_behind_a_probe_is_calibrated_against_a_program() {
    let folder = tempfile::tempdir().unwrap();
    let meter = folder.path().join("meter");
    let served = serve(Some(meter.clone()));
    // Waits for the second new value of the meter, since the first is an average that includes the
    // time before.
    let lines = format!(
        "number() {{ cut -d' ' -f1 {0}; }}\nbegin=$(number)\n\
         while [ $(number) -lt $((begin + 2)) ]; do sleep 0.02; done\ncut -d' ' -f2 {0}",
        meter.display()
    );
    let reference = program(folder.path(), &lines);
    let found = json(&served.palpate(
        &[
            "calibrate",
            "current",
            "--greatest",
            "2",
            "--reference",
            reference.to_str().unwrap(),
            "--json",
        ],
        folder.path(),
    ));
    let [before_a, after_a] = ["worst_before_a", "worst_after_a"].map(|of| number(&found[of]));
    println!("{before_a:.3} A, then {after_a:.3} A");
    assert!(before_a > 0.8 * GAIN_ERROR * 2.0, "{before_a}");
    // Meter and board average over different 80 ms. How much of a sweep's ends the meter reads
    // depends on this machine, but no mean deviates by more than the sweep's amplitude.
    assert!(after_a < SWEPT_A, "{after_a}");
    served.server.join().unwrap();
}

#[test]
fn a_program_that_reads_no_current_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let served = serve(None);
    let reference = program(folder.path(), "echo overload");
    let output = served.palpate(
        &[
            "calibrate",
            "current",
            "--greatest",
            "2",
            "--reference",
            reference.to_str().unwrap(),
        ],
        folder.path(),
    );
    assert_eq!(output.status.code(), Some(1));
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        stderr.contains("overload") && stderr.contains("ampere"),
        "{stderr}"
    );
    assert!(!folder.path().join("current.jsonl").exists());
    served.server.join().unwrap();
}
