//! From a board that was never calibrated to a reading, as its users go.

use std::path::Path;
use std::process::Output;

use crate::support::{emulated, json};

/// Runs a verb on the emulated board whose flash is in a folder.
fn on_board(folder: &Path, seed: &str, arguments: &[&str]) -> Output {
    emulated(&[arguments, &["--seed", seed, "--json"]].concat(), folder)
}

#[test]
fn a_board_that_was_never_calibrated_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let measured = on_board(folder.path(), "7", &["measure"]);
    let message = String::from_utf8(measured.stderr).unwrap();
    assert_eq!(measured.status.code(), Some(1), "{message}");
    assert!(message.contains("calibrate it"), "{message}");
    assert!(measured.stdout.is_empty());
}

#[test]
fn where_a_question_cannot_be_asked_nothing_begins() {
    let folder = tempfile::tempdir().unwrap();
    let refused = on_board(folder.path(), "7", &["calibrate", "sensor"]);
    let message = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{message}");
    assert!(message.contains("--yes"), "{message}");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn what_one_command_calibrates_measures_in_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["calibrate", "sensor", "--yes"];
    let calibrated = on_board(folder.path(), "7", &arguments);
    let stored = json(&calibrated);
    assert_eq!(stored["stored"], true);
    let measured = on_board(folder.path(), "7", &["measure", "--load", "1.5"]);
    let line = json(&measured);
    assert_eq!(line["configuration_crc"], stored["configuration_crc"]);
    let of = |name: &str| line[name].as_f64().unwrap();
    let truth = of("true_n_per_m");
    assert!(
        of("lower_n_per_m") <= truth && truth <= of("upper_n_per_m"),
        "{line}"
    );
    // The press is a spring of 9 N/mm, give or take its sensor's layers and stand.
    assert!(
        (of("stiffness_n_per_m") / truth - 1.0).abs() < 0.15,
        "{line}"
    );
}
