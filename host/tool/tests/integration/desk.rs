//! From a board that was never calibrated to a measurement, as a user proceeds.

use std::fs;
use std::path::Path;
use std::process::Output;

use palpate_wire::Command as Set;
use palpate_wire::command::CurrentCorrection;
use serde_json::Value;

use crate::settings;
use crate::support::{CALIBRATION, emulated, json};

/// Runs a verb on the emulated board whose flash is in a folder.
fn on_board(folder: &Path, seed: &str, arguments: &[&str]) -> Output {
    emulated(&[arguments, &["--seed", seed, "--json"]].concat(), folder)
}

#[test]
fn a_board_that_was_never_calibrated_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    for stack in [&[][..], &["--stack", "soft-closed"]] {
        let measured = on_board(folder.path(), "7", &[&["measure"], stack].concat());
        let message = String::from_utf8(measured.stderr).unwrap();
        assert_eq!(measured.status.code(), Some(1), "{message}");
        assert!(message.contains("`palpate calibrate sensor`"), "{message}");
        assert!(!message.contains("--stack"), "{message}");
        assert!(measured.stdout.is_empty());
    }
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
    // A board calibrated at two temperatures, with a calibrated current.
    let mut before = settings::calibration();
    before.pop();
    before.push(Set::SetCurrentCorrection(CurrentCorrection {
        greatest_a: 12.0,
        changes_a: [0.0, 0.0, 0.0].into_iter().collect(),
    }));
    fs::write(folder.path().join("before.jsonl"), settings::lines(&before)).unwrap();
    json(&on_board(
        folder.path(),
        "7",
        &["settings", "import", "before.jsonl", "--store"],
    ));
    let arguments = [
        "calibrate",
        "sensor",
        "--yes",
        "--save-session",
        "session.json",
    ];
    let calibrated = on_board(folder.path(), "7", &arguments);
    let stored = json(&calibrated);
    assert_eq!(stored["stored"], true);
    // The calibration is new, so the cross-talk is unchanged and nothing is corrected.
    let untouched = on_board(
        folder.path(),
        "7",
        &["check", "--untouched", "session.json"],
    );
    let untouched = json(&untouched);
    assert_eq!(untouched["corrected"], false, "{untouched}");
    assert!(
        untouched["change"].as_f64().unwrap().abs() < 5e-3,
        "{untouched}"
    );
    assert_eq!(untouched["configuration_crc"], stored["configuration_crc"]);
    let measured = on_board(folder.path(), "7", &["measure", "--load", "1.5"]);
    let line = json(&measured);
    assert_eq!(line["configuration_crc"], stored["configuration_crc"]);
    let of = |name: &str| line[name].as_f64().unwrap();
    let truth = of("true_n_per_m");
    assert!(
        of("lower_n_per_m") <= truth && truth <= of("upper_n_per_m"),
        "{line}"
    );
    // The emulated board is pressed onto a spring of 9 N/mm; layers and stand of its sensor deviate
    // from their nominal values.
    assert!(
        (of("stiffness_n_per_m") / truth - 1.0).abs() < 0.15,
        "{line}"
    );
}

/// Greatest rise in the curve of a calibration.
fn greatest_rise(calibration: &Path) -> f64 {
    let text = fs::read_to_string(calibration).unwrap();
    let commands = text.lines().map(|line| serde_json::from_str(line).unwrap());
    let rises = commands.flat_map(|command: Value| {
        let knots = command["set_stiffening_curve"]["knots"].as_array().cloned();
        knots.unwrap_or_default()
    });
    let rises = rises.map(|knot| knot["rise"].as_f64().unwrap());
    rises.fold(0.0, f64::max)
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_check_by_a_known_spring_corrects_the_stiffening_or_refuses_the_calibration() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let on_board = |arguments: &[&str]| on_board(folder, "11", arguments);
    json(&on_board(&["settings", "import", CALIBRATION, "--store"]));
    let checked = json(&on_board(&["check", "--store"]));
    let of = |name: &str| checked[name].as_f64().unwrap();
    assert!(of("deviation").abs() < 3.0, "{checked}");
    let least = |name: &str| checked[name][2].as_f64().unwrap();
    assert!(
        least("uncertainty_after") < least("uncertainty_before"),
        "{checked}"
    );
    // The stored calibration is the reported one, with its previous number.
    json(&on_board(&["settings", "export", "after.jsonl"]));
    let after = greatest_rise(&folder.join("after.jsonl"));
    let change = after / greatest_rise(Path::new(CALIBRATION)) - 1.0;
    assert!(
        (change - of("rise_change")).abs() < 2e-3,
        "{change} {checked}"
    );
    // The stated stiffness is not that of the spring, so the check refuses.
    let refused = on_board(&["check", "--spring", "30000", "--store"]);
    let message = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(1), "{message}");
    assert!(
        message.contains("--spring 30000 N/m is 30.0 N/mm, and measured as ")
            && message.contains("standard errors too soft")
            && message.contains("calibrate again"),
        "{message}"
    );
    json(&on_board(&["settings", "export", "again.jsonl"]));
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    assert_eq!(read("again.jsonl"), read("after.jsonl"));
}

#[test]
fn a_check_of_a_board_that_was_never_calibrated_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let checked = on_board(folder.path(), "7", &["check"]);
    let message = String::from_utf8(checked.stderr).unwrap();
    assert_eq!(checked.status.code(), Some(1), "{message}");
    assert!(message.contains("calibrate"), "{message}");
}
