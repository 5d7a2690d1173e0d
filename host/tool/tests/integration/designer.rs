//! From a design's field to a stack file, and to measurements with such a sensor.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

fn palpate(index: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .current_dir(index)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Presses springs on a sensor of this design with all disturbances. Each press must give an
/// estimate whose interval covers the truth.
fn measures(index: &Path, stack: &str, seed: u32, springs_n_per_m: &[f64]) {
    let mut scenario = format!("stack = \"{stack}\"\ndisturbances = \"all\"\n");
    for n_per_m in springs_n_per_m {
        scenario += &format!("[[press]]\nload = \"spring\"\nstiffness_N_per_m = {n_per_m:e}\n");
    }
    let file = format!("{stack}-{seed}-scenario.toml");
    fs::write(index.join(&file), scenario).unwrap();
    let row = palpate(
        index,
        &["simulate", &file, "--json", "--seed", &seed.to_string()],
    );
    assert_eq!(row.lines().count(), springs_n_per_m.len());
    for line in row.lines() {
        let press: Value = serde_json::from_str(line).unwrap();
        assert_eq!(press["within_claim"], true, "{stack}, seed {seed}: {line}");
        let estimate = &press["estimate"];
        let [value, error] = ["stiffness_n_per_m", "standard_error_n_per_m"]
            .map(|name| estimate[name].as_f64().unwrap());
        assert!(error < 0.15 * value, "{stack}, seed {seed}: {line}");
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_design_becomes_a_stack_that_calibrates_and_measures() {
    let folder = tempfile::tempdir().unwrap();
    let index = folder.path();
    let stack = [
        "field",
        "stack",
        "closed",
        "--mse",
        "ultrasoft",
        "--out",
        "closed.toml",
    ];
    palpate(index, &[&stack[..], &["--accuracy", "1e-2"]].concat());
    let text = fs::read_to_string(index.join("closed.toml")).unwrap();
    let rise = text
        .lines()
        .find(|line| line.starts_with("stiffening_at_peak"))
        .unwrap();
    assert!(rise.contains("nominal = 1.78"), "a rise of 178 %: {rise}");
    std::thread::scope(|scope| {
        for seed in [1, 2] {
            scope.spawn(move || measures(index, "closed.toml", seed, &[2.5e3, 12e3]));
        }
    });
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn rises_of_a_third_to_two_and_a_half_calibrate_and_measure() {
    let folder = tempfile::tempdir().unwrap();
    let index = folder.path();
    let ultrasoft = include_str!("../../../../sim-host/stacks/ultrasoft.toml");
    std::thread::scope(|scope| {
        for (rise, seed) in [("0.30", 3), ("1.00", 4), ("1.40", 5), ("2.50", 6)] {
            let stack = ultrasoft.replace("nominal = 0.10", &format!("nominal = {rise}"));
            assert_ne!(stack, ultrasoft);
            let name = format!("rise-{rise}.toml");
            fs::write(index.join(&name), stack).unwrap();
            scope.spawn(move || measures(index, &name, seed, &[3e3]));
        }
    });
}
