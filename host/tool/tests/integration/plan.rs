//! `palpate plan` as its users call it.

use assert_cmd::Command;
use serde_json::Value;

fn palpate(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("plan")
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_plan_is_three_tables() {
    let output = palpate(&["ultrasoft", "--load-from", "0.2", "--load-to", "5"]);
    assert!(output.status.success());
    insta::assert_snapshot!(String::from_utf8(output.stdout).unwrap());
}

#[test]
fn a_plan_is_json_with_a_chart_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let chart = folder.path().join("plan.svg");
    let chart = chart.to_str().unwrap();
    let output = palpate(&["ultrasoft", "--depth", "0.3", "--json", "--plot", chart]);
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((plan["depth_m"].as_f64().unwrap() / 0.09e-3 - 1.0).abs() < 1e-6);
    let load = &plan["loads"][3];
    assert_eq!(load["ratio"], 1.0);
    assert_eq!(load["refusal"], "pressed_too_little");
    let causes = load["causes_ln"].as_object().unwrap().values();
    let sum: f64 = causes.map(|part| part.as_f64().unwrap().powi(2)).sum();
    let whole = load["standard_error_ln"].as_f64().unwrap();
    assert!((sum.sqrt() / whole - 1.0).abs() < 1e-9);
    assert_eq!(plan["trains"][0]["change"], "default");
    assert_eq!(plan["trains"][0]["peak_A"], 10.0);
    assert!(std::fs::read_to_string(chart).unwrap().starts_with("<svg"));
}

#[test]
fn what_cannot_be_is_refused_with_what_is_allowed() {
    for (arguments, code, part) in [
        (&["paper"][..], 1, "stiffens too little"),
        (&["ultrasoft", "--contact", "0.5"], 1, "contact_time"),
        (&["nosuch"], 2, "ultrasoft"),
        (&["ultrasoft", "--depth", "9"], 2, "0.1 to 2"),
        (
            &["ultrasoft", "--load-from", "5", "--load-to", "1"],
            2,
            "--load-to 1",
        ),
    ] {
        let output = palpate(arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn what_is_taken_from_another_stack_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let show = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["stack", "show", "ultrasoft"])
        .output();
    let text = String::from_utf8(show.unwrap().stdout).unwrap();
    let other = text.replace(
        "stiffening_at_peak = { nominal = 0.1,",
        "stiffening_at_peak = { nominal = 0.2,",
    );
    assert_ne!(text, other);
    // A file from `stack show` is the same design, so nothing in its plan is assumed.
    for (text, is_assumed) in [(&text, false), (&other, true)] {
        std::fs::write(&file, text).unwrap();
        let file = file.to_str().unwrap();
        let said = String::from_utf8(palpate(&[file]).stdout).unwrap();
        assert_eq!(
            said.contains("for this one they are assumed"),
            is_assumed,
            "{said}"
        );
        let plan: Value = serde_json::from_slice(&palpate(&[file, "--json"]).stdout).unwrap();
        let expected: &[&str] = if is_assumed { &["creep", "model"] } else { &[] };
        assert_eq!(plan["assumed_causes"], serde_json::json!(expected));
    }
}
