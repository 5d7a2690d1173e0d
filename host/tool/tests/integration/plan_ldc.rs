//! `palpate plan-ldc` as its users call it.

use assert_cmd::Command;
use serde_json::Value;

fn palpate(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("plan-ldc")
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_plan_is_explained() {
    let output = palpate(&[
        "--clock",
        "40M",
        "--sensor",
        "2.9M..3.8M",
        "--channels",
        "0-3",
        "--rate",
        "500",
    ]);
    assert!(output.status.success());
    insta::assert_snapshot!(String::from_utf8(output.stdout).unwrap());
}

#[test]
fn a_plan_is_json_too() {
    let output = palpate(&["--channels", "0", "--rate", "1000", "--json"]);
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    // The reference is 40 MHz halved: 999,058 ns at 20 MHz are 19,981 periods, or 1248 times 16.
    assert_eq!(
        plan["plan"]["configuration"]["channels"][0]["rcount"],
        1_248
    );
}

#[test]
fn a_refusal_names_limit_and_remedy() {
    let output = palpate(&["--sensor", "9M..11M"]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        message.contains("Limit: sensor 1 kHz to 10 MHz"),
        "{message}"
    );
    assert!(message.contains("Remedy:"), "{message}");
    let output = palpate(&["--sensor", "9M..11M", "--json"]);
    let refusal: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(refusal["refusal"]["limit"].is_string());
}

/// At 400 kHz reading three registers of a frame takes 142 bit times plus 10 us of the master,
/// reading two registers 95 bit times.
#[test]
fn a_rate_beyond_the_bus_is_refused_with_what_is_possible() {
    let refused = palpate(&["--rate", "4000"]);
    assert_eq!(refused.status.code(), Some(1));
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(
        message.contains("2734 frames a second are possible"),
        "{message}"
    );
    for (arguments, succeeds) in [
        (["--rate", "2734", "--release", "status"], true),
        (["--rate", "2735", "--release", "status"], false),
        (["--rate", "4000", "--release", "data"], true),
    ] {
        assert_eq!(
            palpate(&arguments).status.success(),
            succeeds,
            "{arguments:?}"
        );
    }
}

#[test]
fn a_conversion_holds_six_periods_of_the_slowest_sensor() {
    let output = palpate(&["--sensor", "1k..2k", "--json"]);
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rcount = &plan["plan"]["configuration"]["channels"][0]["rcount"];
    // 7500 times 16 periods at 20 MHz take the 6 ms that the conversion needs.
    assert_eq!(rcount.as_u64(), Some(7_500));
    let refused = palpate(&["--sensor", "1k..2k", "--rcount", "7499"]);
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(message.contains("the sensor needs 7500"), "{message}");
}

#[test]
fn bad_arguments_are_refused_with_what_is_allowed() {
    for (arguments, allowed) in [
        (["--clock", "fast"], "40000000"),
        (["--channels", "1-2"], "0-3"),
        (["--rate", "-1"], "whole number"),
        (["--rate", "often"], "bus"),
        (["--rcount", "8"], "9 to 65535"),
        (["--sensor", "nan"], "40000000"),
        (["--noise", "1"], "below 0.1"),
    ] {
        let output = palpate(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains(allowed), "{arguments:?}: {message}");
    }
}
