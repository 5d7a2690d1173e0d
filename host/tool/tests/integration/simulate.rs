//! `palpate demo`, `simulate` and `campaign` as their users call them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use proptest::prelude::*;
use serde_json::Value;
use tempfile::TempDir;

fn palpate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .output()
        .unwrap()
}

fn lines(arguments: &[&str]) -> Vec<Value> {
    let output = palpate(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

fn written(text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scenario.toml");
    fs::write(&file, text).unwrap();
    (folder, file)
}

fn example() -> &'static Path {
    Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/examples/finger.toml"
    ))
}

fn is_within_half_a_percent(seed: &str) {
    let row = lines(&["demo", "--ideal", "--json", "--seed", seed]);
    assert_eq!(row.len(), 8);
    for line in &row[..7] {
        let truth = line["true_n_per_m"].as_f64().unwrap();
        let estimate = line["estimate"]["stiffness_n_per_m"].as_f64().unwrap();
        let error = estimate / truth - 1.0;
        assert!(error.abs() < 5e-3, "seed {seed}: {error} in {line}");
    }
    // The block is rigid: no upper end, or a stiffness far above all springs of the row.
    let block = &row[7]["estimate"];
    let lower = block["lower_n_per_m"].as_f64().unwrap();
    assert!(lower > 1e5, "seed {seed}: {block}");
}

/// One of eight intervals of 95 % may miss the truth; no estimate deviates by more than four of its
/// standard errors.
fn is_within_its_claim(seed: &str) {
    let row = lines(&["demo", "--json", "--seed", seed]);
    let within = row.iter().filter(|line| line["within_claim"] == true);
    assert!(
        within.count() >= 7 && row.len() == 8,
        "seed {seed}: {row:?}"
    );
    for line in &row {
        assert_eq!(line["simulated"], true);
        let number = |value: &Value| value.as_f64();
        let truth = number(&line["true_n_per_m"]).unwrap();
        let estimate = &line["estimate"];
        if let (Some(value), Some(error)) = (
            number(&estimate["stiffness_n_per_m"]),
            number(&estimate["standard_error_n_per_m"]),
        ) {
            assert!((value - truth).abs() < 4.0 * error, "seed {seed}: {line}");
        }
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn undisturbed_every_estimate_is_within_half_a_percent() {
    is_within_half_a_percent("1");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn disturbed_every_estimate_is_within_its_claim() {
    is_within_its_claim("1");
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn with_other_seeds_every_estimate_is_as_good() {
    is_within_half_a_percent("2");
    let seeds = ["2", "3", "4", "5", "6"];
    let rows = seeds.map(|seed| lines(&["demo", "--json", "--seed", seed]));
    let estimates: Vec<&Value> = rows
        .iter()
        .flatten()
        .filter(|line| line["estimate"].is_object())
        .collect();
    assert!(estimates.len() >= 36, "{} of 40", estimates.len());
    let held = estimates.iter().filter(|line| line["within_claim"] == true);
    // By chance fewer than 34 of 40 intervals of 95 % cover in one of three hundred cases.
    let missed = estimates.len() - held.count();
    assert!(missed <= 6, "{missed} of {} miss", estimates.len());
    for line in estimates {
        let of = |name: &str| line["estimate"][name].as_f64();
        let (ratio, error) = ("load_ratio", "load_ratio_standard_error");
        let known = of("stiffness_n_per_m").zip(line["true_n_per_m"].as_f64());
        let Some((stiffness, truth)) = known else {
            continue;
        };
        let off = of(ratio).unwrap() * (stiffness / truth - 1.0) / of(error).unwrap();
        assert!(off.abs() < 4.0, "{off} standard errors: {line}");
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_sensor_that_cannot_measure_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report.html");
    let report = report.to_str().unwrap();
    let output = palpate(&["demo", "--stack", "paper", "--report", report]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        message.contains("stiffens too little to be measured"),
        "{message}"
    );
}

#[test]
fn the_report_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("report.html");
    let output = palpate(&["demo", "--report", file.to_str().unwrap()]);
    assert!(output.status.success());
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(
        table.contains("8 of 8 within their own 95 % interval"),
        "{table}"
    );
    let page = fs::read_to_string(file).unwrap();
    // The chart of claims for all loads, and five charts for each load.
    assert_eq!(page.matches("<svg").count(), 1 + 8 * 5);
    for link in ["http:", "https:", "<script", "<link", "url("] {
        let namespaces = page.replace("http://www.w3.org/", "");
        assert!(!namespaces.contains(link), "{link}");
    }
    for text in [
        "deformation, µm",
        "current, A",
        "residual of x, nm",
        "force, N",
    ] {
        assert!(page.contains(text), "{text}");
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn the_same_seed_gives_the_same_bytes() {
    let disturbed = with("disturbances = \"none\"", "disturbances = \"all\"");
    let (_folder, file) = written(&disturbed);
    gives_the_same_bytes(&file);
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn of_several_loads_the_same_seed_gives_the_same_bytes() {
    gives_the_same_bytes(example());
}

fn gives_the_same_bytes(scenario: &Path) {
    let scenario = scenario.to_str().unwrap();
    let run = || {
        let folder = tempfile::tempdir().unwrap();
        let (report, records) = (folder.path().join("r.html"), folder.path().join("r.jsonl"));
        let output = palpate(&[
            "simulate",
            scenario,
            "--seed",
            "7",
            "--json",
            "--report",
            report.to_str().unwrap(),
            "--records",
            records.to_str().unwrap(),
        ]);
        assert!(output.status.success());
        (
            output.stdout,
            fs::read(report).unwrap(),
            fs::read(records).unwrap(),
        )
    };
    // Runs the command once, then twice at the same time on two cores.
    let first = run();
    let (here, there) = std::thread::scope(|scope| {
        let there = scope.spawn(run);
        (run(), there.join().unwrap())
    });
    assert!(first == here && here == there);
    let other = palpate(&["simulate", scenario, "--seed", "8", "--json"]);
    assert_ne!(first.0, other.stdout);
}

#[test]
fn the_example_runs_and_its_records_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("records.jsonl");
    let example = example().to_str().unwrap();
    let row = lines(&[
        "simulate",
        example,
        "--json",
        "--records",
        file.to_str().unwrap(),
    ]);
    let names: Vec<&str> = row
        .iter()
        .map(|line| line["load"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "a finger's tip",
            "a spring, by hand",
            "a spring, gently",
            "block"
        ]
    );
    let records = fs::read_to_string(file).unwrap();
    let samples = records
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .filter(|line| line["message"]["sample"].is_object());
    assert!(samples.count() > 8_000);
}

/// A valid scenario with one line replaced.
fn with(line: &str, instead: &str) -> String {
    let sound = "stack = \"ultrasoft\"\ndisturbances = \"none\"\n\n[[press]]\nload = \"spring\"\n\
                 stiffness_N_per_m = 3e3\ndepth_m = 0.2e-3\n";
    assert!(sound.contains(line));
    sound.replace(line, instead)
}

#[test]
fn bad_scenarios_are_refused_with_file_line_and_what_is_allowed() {
    let stiffness = "stiffness_N_per_m = 3e3";
    for (text, line, parts) in [
        (
            with(stiffness, "stiffness_N_per_mm = 3"),
            6,
            ["stiffness_N_per_mm", "unknown key"],
        ),
        (
            with(stiffness, "stiffness_N_per_m = -3e3"),
            6,
            ["-3000 is out of range", "1 to 1e10 N/m"],
        ),
        (
            with(stiffness, "stiffness_N_per_m = nan"),
            6,
            ["NaN is out of range", "1 to 1e10 N/m"],
        ),
        (
            with(stiffness, "stiffness_N_per_m = \"3 N/mm\""),
            6,
            ["is the text", "1 to 1e10 N/m"],
        ),
        (with(stiffness, ""), 4, ["missing", "1 to 1e10 N/m"]),
        (
            with("depth_m = 0.2e-3", "depth_m = 0.2"),
            7,
            ["0.2 is out of range", "m"],
        ),
        (
            with("depth_m = 0.2e-3", "depth_mm = 0.2"),
            7,
            ["depth_mm", "unknown key"],
        ),
        (
            with("load = \"spring\"", "load = \"rigid\""),
            6,
            ["stiffness_N_per_m", "nothing, with load"],
        ),
        (
            with("load = \"spring\"", "load = \"sponge\""),
            5,
            ["is \"sponge\"", "hardening"],
        ),
        (
            with("disturbances = \"none\"", "disturbances = \"some\""),
            2,
            ["is \"some\"", "all"],
        ),
        (
            with(
                "disturbances = \"none\"",
                "disturbances = \"none\"\nexcept = [\"crep\"]",
            ),
            3,
            ["there is no disturbance \"crep\"", "creep"],
        ),
        (
            with("\n[[press]]", "\n[press]"),
            4,
            ["is a table", "[[press]]"],
        ),
        (with("[[press]]", "[[press"), 4, ["", ""]),
    ] {
        let (_folder, file) = written(&text);
        let output = palpate(&["simulate", file.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{text}");
        let message = String::from_utf8(output.stderr).unwrap();
        let index = format!("{}:{line}:", file.display());
        for part in parts.into_iter().chain([index.as_str()]) {
            assert!(message.contains(part), "{part:?} in {message:?} of\n{text}");
        }
    }
    // The scenario names a sensor design that does not exist.
    let (_folder, file) = written(&with("ultrasoft", "mine.toml"));
    let output = palpate(&["simulate", file.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("mine.toml")
    );
}

#[test]
fn a_stack_file_beside_the_scenario_is_found() {
    let (folder, file) = written(&with("ultrasoft", "mine.toml"));
    let stack = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../sim-host/stacks/ultrasoft.toml"
    );
    fs::copy(stack, folder.path().join("mine.toml")).unwrap();
    let row = lines(&["simulate", file.to_str().unwrap(), "--json"]);
    assert_eq!(row.len(), 1);
    assert!(row[0]["estimate"].is_object());
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_campaign_counts_in_every_world() {
    let sensors = ["campaign", "--plants", "3", "--seed", "40"];
    let worlds = [
        "--world",
        "calibrated,stiffening-weaker",
        "--loads",
        "1,block",
    ];
    let output = palpate(&[&sensors[..], &worlds[..]].concat());
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let rows: Vec<&str> = text
        .lines()
        .filter(|line| line.contains("| 1 c_S "))
        .collect();
    let [calibrated, weaker] = rows[..] else {
        panic!("{text}");
    };
    let holds = |row: &str| {
        let cells: Vec<String> = row.split('|').map(|cell| cell.trim().to_owned()).collect();
        cells[3..6].to_vec()
    };
    assert_eq!(holds(calibrated), ["3", "0", "100.0 %"], "{calibrated}");
    // The sensor cannot detect this error, but each interval that misses the truth counts as a
    // miss.
    assert_eq!(holds(weaker), ["3", "0", "0.0 %"], "{weaker}");

    let output = palpate(&[&sensors[..], &worlds[..], &["--json"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let results: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(results[1]["world"], "stiffening-weaker");
    let bins = results[0]["bins"].as_array().unwrap();
    assert_eq!(bins[0]["ratio"], 1.0);
    assert!(bins[1]["ratio"].is_null());
    assert_eq!(results[0]["overall"]["accepted"], 6);
    assert_eq!(bins[0]["coverage95"], 1.0);
    assert!(bins[0]["rms_ln"].as_f64().unwrap() < 0.1);
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_campaign_without_an_estimate_is_no_success() {
    let output = palpate(&["campaign", "--plants", "1", "--stack", "paper"]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("no press gave an estimate"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    /// Arbitrary text instead of a scenario: exit code 2 with a message, or a run, but never a
    /// panic.
    #[test]
    fn random_text_is_refused(text in "(stack|press|load|depth_m|=|\"|\\[|\\]|[a-z0-9.\\- \n]){0,60}") {
        let (_folder, file) = written(&text);
        let output = palpate(&["simulate", file.to_str().unwrap()]);
        prop_assert_eq!(output.status.code(), Some(2));
        prop_assert!(!output.stderr.is_empty());
    }
}
