//! The two lists of faults: the protocol's codes, and the entries of docs/faults.md.
//! sim-host/emulator/tests/integration/every_fault.rs shows on the image that each cause raises its
//! code.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use palpate_wire::code::FaultCode;

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/faults.md");
    fs::read_to_string(path).expect("the page of the faults")
}

#[test]
fn every_code_has_its_entry_and_every_entry_its_code() {
    let page = page();
    let entries: BTreeMap<u8, &str> = page
        .lines()
        .filter_map(|line| line.strip_prefix("## ")?.split_once(": `"))
        .map(|(number, name)| {
            let number = number.parse().expect("a number before the name");
            (number, name.trim_end_matches('`'))
        })
        .collect();
    let codes: BTreeMap<u8, String> = FaultCode::ALL
        .iter()
        .map(|code| (code.number(), code.to_string()))
        .collect();
    assert!(codes.len() >= 20);
    let entries: BTreeMap<u8, String> = entries
        .into_iter()
        .map(|(number, name)| (number, name.to_owned()))
        .collect();
    assert_eq!(entries, codes);
}

#[test]
fn every_entry_says_what_to_do_and_what_clears_it() {
    for entry in page().split("\n## ").skip(1) {
        let name = entry.lines().next().unwrap_or_default();
        for part in ["**What to do:**", "**Cleared by:**"] {
            assert!(entry.contains(part), "{name}: {part}");
        }
    }
}
