//! `palpate simulate --engine image` with what it shows of the image.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;

/// A press that is refused soon, with the block far from the sensor's limits.
const SCENARIO: &str = r#"
stack = "ultrasoft"
disturbances = "none"

[[press]]
name = "a touch"
load = "spring"
stiffness_N_per_m = 2e3
depth_m = 0.05e-3
"#;

fn simulate(folder: &Path, arguments: &[&str]) -> Output {
    let scenario = folder.join("scenario.toml");
    fs::write(&scenario, SCENARIO).unwrap();
    let image: PathBuf = palpate_board::firmware::build().unwrap_or_else(|error| panic!("{error}"));
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("simulate")
        .arg(scenario)
        .arg("--image")
        .arg(image)
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn the_log_has_its_lines_and_the_trace_its_signals() {
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("touch.vcd");
    let name = trace.to_string_lossy();
    let output = simulate(
        folder.path(),
        &["--engine", "image", "--log", "--trace", &name],
    );
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{told}");
    assert!(told.contains("log, a touch:\n"), "{told}");
    let line = told
        .lines()
        .find(|line| line.contains("converter up"))
        .unwrap_or_else(|| panic!("{told}"));
    let mut words = line.split_whitespace();
    let time_s: f64 = words.next().unwrap().parse().unwrap();
    assert!((0.01..0.2).contains(&time_s), "{line}");
    assert_eq!(words.next(), Some("info"));
    // What it says is read in the board's own tests.
    let dump = fs::read_to_string(&trace).unwrap();
    for signal in ["sda", "scl", "intb", "in1", "coil_current_a"] {
        assert!(dump.contains(&format!(" {signal} $end\n")), "{signal}");
    }
    assert!(dump.len() > 100_000, "{}", dump.len());
}

#[test]
fn what_only_an_image_has_is_refused_without_one() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [&["--log"][..], &["--trace", "x.vcd"]] {
        let output = simulate(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2));
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(told.contains("--engine image"), "{told}");
    }
}
