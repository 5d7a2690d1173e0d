//! The three lists of faults: the protocol's codes, the pages in docs/faults.md, and what the tests
//! raise.

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use palpate_wire::code::FaultCode;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page() -> String {
    fs::read_to_string(root().join("docs/faults.md")).expect("the page of the faults")
}

/// Where a fault is raised by what causes it, not by being told of it: file and test.
const RAISED: &[(FaultCode, &str, &str)] = {
    use FaultCode::*;
    const IMAGE: &str = "sim-host/board/tests/faults.rs";
    const CURRENT: &str = "sim-host/board/tests/current.rs";
    const WRONG: &str = "an_absent_converter_and_a_wrong_one_are_reported";
    const DIRECTED: &str = "firmware/procedure/tests/directed.rs";
    const FAULTS: &str = "firmware/procedure/tests/faults.rs";
    const GUARDS: &str = "sim-host/tests/coil_guards.rs";
    const SELF_TEST: &str = "the_self_test_tells_what_is_wrong";
    &[
        (SensorSilent, FAULTS, "silence_is_a_fault_and_ends_with_it"),
        (CoilTooHot, FAULTS, "the_coil_gets_hotter_than_was_forecast"),
        (
            TooMuchEnergy,
            FAULTS,
            "more_energy_went_into_the_coil_than_was_forecast",
        ),
        (SensorAbsent, IMAGE, WRONG),
        (SensorIdentity, IMAGE, WRONG),
        (BusDataStuck, IMAGE, "sda_held_low_at_some_bits_is_survived"),
        (
            BusClockStuck,
            IMAGE,
            "scl_held_for_a_while_is_survived_and_for_ever_is_reported",
        ),
        (
            HardFault,
            IMAGE,
            "a_fault_anywhere_switches_the_bridge_off_within_a_millisecond",
        ),
        (
            Watchdog,
            IMAGE,
            "an_endless_loop_anywhere_switches_the_bridge_off_within_60_ms",
        ),
        (
            CurrentUnwanted,
            CURRENT,
            "a_current_that_flows_with_the_bridge_off_is_told",
        ),
        (
            Bridge,
            GUARDS,
            "a_fault_of_the_bridge_ends_the_drive_in_its_period",
        ),
        (
            OverCurrent,
            GUARDS,
            "the_first_sample_above_the_limit_ends_the_drive_by_itself",
        ),
        (
            CurrentMissing,
            GUARDS,
            "a_lost_measurement_and_an_open_coil_are_found_in_time_and_not_at_once",
        ),
        (
            SupplyLow,
            GUARDS,
            "the_supply_ends_the_drive_beyond_its_limits_and_not_within",
        ),
        (
            SupplyHigh,
            GUARDS,
            "the_supply_ends_the_drive_beyond_its_limits_and_not_within",
        ),
        (
            Overrun,
            GUARDS,
            "nobody_looking_ends_the_drive_in_twenty_milliseconds_and_not_before",
        ),
        (CoilOpen, GUARDS, SELF_TEST),
        (CoilShort, GUARDS, SELF_TEST),
        (CoilUnknown, GUARDS, SELF_TEST),
        (CurrentSense, GUARDS, SELF_TEST),
        (NoHardwareLimit, GUARDS, SELF_TEST),
        (
            CurrentAstray,
            GUARDS,
            "a_current_that_is_not_reached_is_found_in_time_and_not_before",
        ),
        (OnTime, DIRECTED, "it_is_on_for_too_long"),
        (HostSilent, DIRECTED, "the_host_falls_silent"),
        (
            CrashStreak,
            DIRECTED,
            "five_crashes_in_a_row_lock_the_outputs_and_it_still_talks",
        ),
    ]
};

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

/// That any code stops and latches whoever tells it is `any_fault_stops_any_state`; this is about
/// causes. What is not in the table is raised by the firmware from hardware: each of them is named
/// in a file of the firmware.
#[test]
fn every_code_is_raised_by_a_test_or_by_the_firmware() {
    let firmware: String = sources(&root().join("firmware/src"));
    for code in FaultCode::ALL {
        let raised = RAISED.iter().find(|(of, ..)| of == code);
        match raised {
            Some((_, file, test)) => {
                let text = fs::read_to_string(root().join(file)).expect("a file of tests");
                assert!(
                    text.contains(&format!("fn {test}(")),
                    "{code}: {file} {test}"
                );
            }
            None => {
                let named = format!("FaultCode::{code:?}");
                let unused = UNUSED.contains(code);
                assert_eq!(firmware.contains(&named), !unused, "{code}");
            }
        }
    }
}

/// Codes of the protocol that nothing raises yet: flags of the converter are data, not faults; there
/// is no storage; a thermometer may be absent.
const UNUSED: &[FaultCode] = &[
    FaultCode::SensorAmplitude,
    FaultCode::SensorNotOscillating,
    FaultCode::SensorOverRange,
    FaultCode::Thermometer,
    FaultCode::ConfigurationDamaged,
    FaultCode::Storage,
];

fn sources(folder: &Path) -> String {
    let mut text = String::new();
    for entry in fs::read_dir(folder).expect("a folder of the firmware") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            text += &sources(&path);
        } else {
            text += &fs::read_to_string(&path).expect("a source");
        }
    }
    text
}
