//! A calibration that ends early leaves the previous configuration in force and stored.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use super::serve::Server;
use crate::support::{emulated, image, palpate};

/// Writes the program of a gauge or a stage.
fn script(folder: &Path, name: &str, lines: &str) -> String {
    let path = folder.join(name);
    fs::write(&path, lines).unwrap();
    format!("sh {}", path.display())
}

/// Starts a calibration on a served board.
fn calibrate(server: &Server, folder: &Path, force: &str) -> Child {
    let stage = script(folder, "stage", "while read command; do echo ok; done\n");
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["calibrate", "sensor", "--yes", "--board"])
        .arg(format!("tcp:{}", server.address))
        .args(["--stack", "ultrasoft", "--springs", "600,1200,3000,6000"])
        .args(["--stage", &stage, "--force", force])
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Returns the error of a refused calibration.
fn refused(child: Child) -> String {
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    message
}

/// Returns the configuration in force after a restart, which is the stored one.
fn configuration(folder: &Path, name: &str) -> String {
    let exported = emulated(&["settings", "export", name], folder);
    let message = String::from_utf8_lossy(&exported.stderr);
    assert!(exported.status.success(), "{message}");
    fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_calibration_that_ends_early_leaves_the_one_before_in_force_and_stored() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let set = ["settings", "set", "rate_hz=400", "--store"];
    assert!(emulated(&set, folder).status.success());
    let before = configuration(folder, "before.jsonl");
    let flash = folder.join("board.flash");
    let server = Server::start(&["--state", flash.to_str().unwrap()]);

    let ends = script(folder, "ends", "echo 0; sleep 1\n");
    let message = refused(calibrate(&server, folder, &ends));
    assert!(message.contains("--force has ended"), "{message}");
    let units = script(folder, "units", "echo 1,5 N; sleep 60\n");
    let message = refused(calibrate(&server, folder, &units));
    assert!(message.contains("prints \"1,5 N\""), "{message}");
    // The previous configuration is in force even without a restart.
    let board = format!("tcp:{}", server.address);
    let export = ["settings", "export", "between.jsonl", "--board", &board];
    let exported = palpate(&export, folder);
    assert!(exported.status.success());
    let between = fs::read_to_string(folder.join("between.jsonl")).unwrap();
    assert_eq!(between, before);

    let zero = script(folder, "zero", "while sleep 0.05; do echo 0; done\n");
    let child = calibrate(&server, folder, &zero);
    sleep(Duration::from_secs(3));
    drop(server);
    let message = refused(child);
    assert!(message.contains("cannot be reached"), "{message}");
    assert_eq!(configuration(folder, "after.jsonl"), before);
}

/// A stack file has no data of a coil's heat: those of the board, which its owner has set, guard the coil.
#[test]
fn a_calibration_keeps_the_data_of_its_coil_that_a_board_has() {
    const COIL: &str = "{\"set_coil\":{\"resistance_ohm\":0.41,\"copper_capacity_j_per_k\":1.5,\
        \"pad_capacity_j_per_k\":30.0,\"copper_to_pad_k_per_w\":0.75,\"pad_to_ambient_k_per_w\":16.0,\
        \"current_uncertainty\":0.0}}";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("coil.jsonl"), COIL).unwrap();
    let import = ["settings", "import", "coil.jsonl", "--store"];
    assert!(emulated(&import, folder).status.success());
    let before = configuration(folder, "before.jsonl");
    let flash = folder.join("board.flash");
    let server = Server::start(&["--state", flash.to_str().unwrap()]);
    let zero = script(folder, "zero", "while sleep 0.05; do echo 0; done\n");
    let mut child = calibrate(&server, folder, &zero);
    let messages = BufReader::new(child.stderr.take().unwrap());
    let mut messages = messages.lines().map_while(Result::ok);
    assert!(messages.any(|line| line.contains("stay in force")));
    // Its configuration follows at once; its first press lasts for four seconds.
    sleep(Duration::from_secs(2));
    // Killed, it cannot put the stored configuration in force again.
    child.kill().unwrap();
    child.wait().unwrap();
    let board = format!("tcp:{}", server.address);
    let export = ["settings", "export", "during.jsonl", "--board", &board];
    assert!(palpate(&export, folder).status.success());
    let during = fs::read_to_string(folder.join("during.jsonl")).unwrap();
    assert_ne!(during, before, "no run has begun");
    assert!(during.lines().any(|line| line == COIL), "{during}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_in_a_calibration_leaves_the_one_before_stored() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let set = ["settings", "set", "rate_hz=400", "--store"];
    assert!(emulated(&set, folder).status.success());
    let before = configuration(folder, "before.jsonl");
    let child = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["calibrate", "sensor", "--yes", "--board", "emulated"])
        .args(["--state", "board.flash", "--image"])
        .arg(image())
        .current_dir(folder)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_secs(3));
    let number = child.id().to_string();
    let asked = Command::new("kill").args(["-INT", &number]).status();
    assert!(asked.unwrap().success());
    let message = refused(child);
    assert!(message.contains("interrupted by Ctrl-C"), "{message}");
    assert_eq!(configuration(folder, "after.jsonl"), before);
}

#[test]
fn a_real_bench_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let board = ["calibrate", "sensor", "--yes", "--board", "tcp:127.0.0.1:1"];
    for (more, part) in [
        (&[][..], "--no-load-cell"),
        (&["--no-load-cell"][..], "name its stack with --stack"),
        (
            &["--no-load-cell", "--stack", "ultrasoft"][..],
            "at least 4 springs",
        ),
        (
            &[
                "--no-load-cell",
                "--stack",
                "ultrasoft",
                "--springs",
                "600,700,800,900",
            ][..],
            "5 times as stiff",
        ),
        (&["--no-load-cell", "--springs", "0.6"][..], "N/m"),
    ] {
        let output = palpate(&[&board, more].concat(), folder.path());
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(part), "{message}");
    }
}
