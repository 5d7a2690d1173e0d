//! `palpate bring-up` on the emulated board: it finds every position of every switch of the
//! converter.

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::path::Path;

use assert_cmd::Command;
use ldc161x_sim::{
    ActiveWrite, BurstRead, ConfigReadback, Counter, Deglitch33, EarlyTermination, FlagRead,
    InterruptRelease, Overhead, Overwrite, RcountMinimum, Settings, ShadowLatch, SleepExit,
    StatusReporting, Switches, UnreadCleared,
};
use palpate_emulator::{EmulatedBoard, Image, Options, Still, Time, firmware};
use serde::{Deserialize, Serialize};

#[derive(Deserialize, Serialize)]
struct Document {
    switches: Switches,
}

/// All switches at their position `number`, or at the first where they have fewer positions.
fn positions(number: usize) -> Switches {
    macro_rules! position {
        ($kind:ident) => {
            *$kind::VARIANTS.get(number).unwrap_or(&$kind::VARIANTS[0])
        };
    }
    Switches {
        interrupt_release: position!(InterruptRelease),
        unread_cleared: position!(UnreadCleared),
        status_reporting: position!(StatusReporting),
        overhead: position!(Overhead),
        sleep_exit: position!(SleepExit),
        config_readback: position!(ConfigReadback),
        rcount_minimum: position!(RcountMinimum),
        active_write: position!(ActiveWrite),
        burst_read: position!(BurstRead),
        deglitch_33: position!(Deglitch33),
        counter: position!(Counter),
        flag_read: position!(FlagRead),
        shadow_latch: position!(ShadowLatch),
        overwrite: position!(Overwrite),
        early_termination: position!(EarlyTermination),
    }
}

fn bring_up(folder: &Path, switches: Switches) -> Switches {
    let (given, found) = (folder.join("given.toml"), folder.join("found.toml"));
    fs::write(&given, toml::to_string(&Document { switches }).unwrap()).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["bring-up", "--emulated", "--switches"])
        .arg(given)
        .arg("--settings")
        .arg(&found)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{stderr}\n{table}");
    println!("{table}");
    let text = fs::read_to_string(found).unwrap();
    toml::from_str::<Document>(&text).unwrap().switches
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn every_position_of_every_switch_is_found() {
    let folder = tempfile::tempdir().unwrap();
    for number in 0..4 {
        let switches = positions(number);
        assert_eq!(bring_up(folder.path(), switches), switches, "{number}");
    }
}

/// Serves a board behind a probe that polls its channels every 5 ms, as a probe's server does.
fn serve(listener: &TcpListener, image: &Image) {
    let (mut stream, _) = listener.accept().unwrap();
    stream.set_nonblocking(true).unwrap();
    let plant = Still::new([3.1e6, 3.2e6, 3.3e6, 3.4e6]);
    let mut board = EmulatedBoard::new(image, plant, Settings::default(), Options::default());
    // The board runs before the first request, as a board that was flashed long ago.
    board.run_for(Time::from_ms(100)).unwrap();
    loop {
        let mut bytes = [0; 64];
        match stream.read(&mut bytes) {
            Ok(0) => return,
            Ok(length) => assert_eq!(board.write_channel(0, &bytes[..length]), length),
            Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
        }
        board.run_for(Time::from_ms(5)).unwrap();
        stream.write_all(&board.read_channel(0)).unwrap();
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_slow_probe_makes_no_difference() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    // The image is built before the first request, since the first build takes minutes.
    let file = firmware::build_example("bring_up").unwrap_or_else(|error| panic!("{error}"));
    let image = Image::load(&file).unwrap();
    let server = std::thread::spawn(move || serve(&listener, &image));
    let folder = tempfile::tempdir().unwrap();
    let found = folder.path().join("found.toml");
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["bring-up", "--connect", &address, "--settings"])
        .arg(&found)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    server.join().unwrap();
    let text = fs::read_to_string(found).unwrap();
    let document: Document = toml::from_str(&text).unwrap();
    assert_eq!(document.switches, Switches::default());
}

#[test]
fn a_port_behind_which_is_something_else_is_refused() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut request = [0; 2];
        stream.read_exact(&mut request).unwrap();
        stream.write_all(b"\x05\x00soup").unwrap();
        request
    });
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["bring-up", "--connect", &address, "--settings"])
        .arg(folder.path().join("found.toml"))
        .output()
        .unwrap();
    assert_eq!(server.join().unwrap(), [1, b'?']);
    assert_eq!(output.status.code(), Some(1));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.contains("bring_up"), "{stderr}");
    assert!(!folder.path().join("found.toml").exists());
}
