//! Verbs that need no board: `palpate devices`, `faults`, `completions` and `man`.

use std::fs;
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

#[test]
fn the_script_for_every_shell_names_the_verbs() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let output = palpate(&["completions", shell]);
        let script = String::from_utf8(output.stdout).unwrap();
        for word in ["settings", "serve-emulated", "json"] {
            assert!(script.contains(word), "{shell}: no {word}");
        }
    }
    assert_eq!(palpate(&["completions", "tcsh"]).status.code(), Some(2));
}

#[test]
fn every_verb_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("man/man1");
    let output = palpate(&["man", pages.to_str().unwrap()]);
    assert!(output.status.success(), "{output:?}");
    let set = fs::read_to_string(pages.join("palpate-settings-set.1")).unwrap();
    assert!(set.contains(".TH") && set.contains("NAME=VALUE"), "{set}");
    assert!(set.contains("drift=linear"), "{set}");
    for name in ["palpate", "palpate-doctor", "palpate-calibrate-sensor"] {
        let page = pages.join(name).with_extension("1");
        assert!(page.is_file(), "{name}");
    }
    // A hidden verb has no manual page.
    assert!(!pages.join("palpate-misfit.1").exists());

    let file = folder.path().join("file");
    fs::write(&file, "no folder").unwrap();
    let refused = palpate(&["man", file.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(2));
}
