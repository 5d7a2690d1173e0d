//! Verbs of the desk that need no board: `palpate devices` and `faults`.

use std::process::{Command, Output};

use serde_json::Value;

fn palpate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn the_boards_are_one_list_though_there_may_be_none() {
    let output = palpate(&["devices", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let list: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(list.is_array(), "{list}");
}

#[test]
fn a_fault_is_explained_by_number_and_by_name() {
    let by_number = palpate(&["faults", "12"]);
    let by_name = palpate(&["faults", "sensor_not_oscillating"]);
    assert_eq!(by_number.stdout, by_name.stdout);
    let text = String::from_utf8(by_number.stdout).unwrap();
    assert!(
        text.contains("12") && text.contains("Check coil and capacitor"),
        "{text}"
    );
    let all = palpate(&["faults", "--json"]);
    let lines = String::from_utf8(all.stdout).unwrap();
    let known = palpate_wire::code::FaultCode::ALL.len();
    assert_eq!(lines.lines().count(), known);
    for line in lines.lines() {
        let value: Value = serde_json::from_str(line).unwrap();
        assert!(!value["meaning"].as_str().unwrap().is_empty(), "{line}");
    }
    let unknown = palpate(&["faults", "tiredness"]);
    assert_eq!(unknown.status.code(), Some(2));
}
