//! A recording of a measurement: replayed, played in place of a board, reported.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::{CALIBRATION, emulated, json, palpate, recording_with};

/// Runs a verb on the emulated board of seed 11.
fn on_board(folder: &Path, arguments: &[&str]) -> Value {
    json(&emulated(
        &[arguments, &["--seed", "11", "--json"]].concat(),
        folder,
    ))
}

#[test]
fn a_recorded_measurement_is_replayed_to_the_bit_played_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    on_board(folder, &["settings", "import", CALIBRATION, "--store"]);
    // The press begins after 3 s, and is measured 3 s later.
    let arguments = ["record", "r.mcap", "--arm", "--load", "1.3", "--for", "7"];
    on_board(folder, &arguments);

    let replayed = json(&palpate(&["replay", "r.mcap", "--json"], folder));
    assert_eq!(replayed["first_difference"], Value::Null, "{replayed}");
    let count = |kind: &str, of: &str| replayed["kinds"][kind][of].as_u64().unwrap_or(0);
    assert!(count("sample", "identical") > 6_500, "{replayed}");
    assert_eq!(count("estimate", "identical"), 1, "{replayed}");
    assert_eq!(count("uncertainty_budget", "identical"), 1, "{replayed}");
    assert_eq!(count("relaxation", "identical"), 2, "{replayed}");
    assert_eq!(count("load_point", "identical"), 8, "{replayed}");

    // Other programs write the metadata after the messages: the replay of such a file is the same.
    rewritten(&folder.join("r.mcap"), &folder.join("w.mcap"));
    let again = json(&palpate(&["replay", "w.mcap", "--json"], folder));
    assert_eq!(again["kinds"], replayed["kinds"], "{again}");
    assert_eq!(again["first_difference"], Value::Null, "{again}");

    let play = |verb: &[&str]| palpate(&[verb, &["--board", "r.mcap"]].concat(), folder);
    let fast = play(&["measure", "--json"]);
    let slower = play(&["measure", "--json", "--speed", "20"]);
    assert_eq!(json(&fast), json(&slower));
    assert!(json(&fast)["stiffness_n_per_m"].as_f64().unwrap() > 5e3);
    let limited_by = json(&fast)["limited_by"].to_string();
    assert!(limited_by.contains("of the interval is by"), "{limited_by}");
    let refused = play(&["settings", "set", "rate_hz=500"]);
    let said = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("takes no commands"), "{said}");

    let reported = json(&palpate(&["report", "r.mcap", "--json"], folder));
    assert_eq!(reported["measurements"], 1);
    let page = fs::read_to_string(folder.join("r.html")).unwrap();
    for part in [
        "95 % interval",
        "of the interval is by",
        "Frequency",
        "Line of all ramps",
        "Residuals of the line",
        "none is missing",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

/// Copies the messages of a recording, with all its metadata behind them.
fn rewritten(from: &Path, to: &Path) {
    let bytes = fs::read(from).unwrap();
    recording_with(to, |writer| {
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            writer.write(&message.unwrap()).unwrap();
        }
        let mut count = 0;
        for piece in mcap::read::LinearReader::new(&bytes).unwrap() {
            if let mcap::records::Record::Metadata(metadata) = piece.unwrap() {
                writer.write_metadata(&metadata).unwrap();
                count += 1;
            }
        }
        assert!(count > 1);
    });
}
