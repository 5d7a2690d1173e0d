//! Output files, and the remains of an interrupted run.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

/// Runs the tool in a folder outside of any checkout, where no image is available.
fn palpate(index: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .current_dir(index)
        .output()
        .unwrap()
}

const SCENARIO: &str = "stack = \"ultrasoft\"\ndisturbances = \"none\"\n\n[[press]]\nload = \"spring\"\n\
                        stiffness_N_per_m = 2e3\ndepth_m = 0.05e-3\n";

#[test]
fn what_cannot_be_written_is_refused_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let index = folder.path();
    fs::write(index.join("scenario.toml"), SCENARIO).unwrap();
    fs::write(index.join("file"), "no folder").unwrap();
    fs::create_dir(index.join("folder")).unwrap();
    let verbs: [&[&str]; 10] = [
        &["demo", "--report"],
        &["simulate", "scenario.toml", "--report"],
        &["simulate", "scenario.toml", "--records"],
        &["simulate", "scenario.toml", "--engine", "image", "--trace"],
        &["campaign", "--rows"],
        &["bring-up", "--emulated", "--settings"],
        &["calibrate", "current", "--board", "emulated", "--output"],
        &["field", "stack", "closed", "--mse", "soft", "--out"],
        &["coil", "--board", "emulated", "--plots"],
        &["field", "figures", "A", "--out"],
    ];
    for verb in verbs {
        // Verbs create their output folder, so only a file in its path makes it impossible.
        let names_folder = verb.contains(&"--plots") || verb.contains(&"figures");
        let wrong: &[&str] = if names_folder {
            &["file", "file/plots"]
        } else {
            &["missing/out", "folder", "file/out"]
        };
        for path in wrong {
            let output = palpate(index, &[verb, &[*path]].concat());
            let message = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{verb:?}: {message}");
            let named = format!("{} {path}: ", verb[verb.len() - 1]);
            assert!(message.contains(&named), "{verb:?}: {message}");
            assert!(message.contains("Name a file"), "{verb:?}: {message}");
            assert!(output.stdout.is_empty(), "{verb:?}");
        }
    }
    assert_eq!(fs::read_dir(index).unwrap().count(), 3);
}

/// A device that accepts nothing behaves like a full disk: the error occurs only when writing.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_full_disk_loses_neither_the_table_nor_the_name() {
    let folder = tempfile::tempdir().unwrap();
    let index = folder.path();
    fs::write(index.join("scenario.toml"), SCENARIO).unwrap();
    let output = palpate(
        index,
        &["simulate", "scenario.toml", "--report", "/dev/full"],
    );
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("--report /dev/full: "), "{message}");
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.contains("of 1 loads estimated"), "{table}");
}

fn started(index: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .current_dir(index)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Returns the output of a run that was killed after `lines` lines and could write no more.
fn interrupted_after(lines: usize, mut run: Child) -> String {
    let mut out = BufReader::new(run.stdout.take().unwrap());
    let mut text = String::new();
    for _ in 0..lines {
        assert!(out.read_line(&mut text).unwrap() > 0, "{text}");
    }
    run.kill().unwrap();
    out.read_to_string(&mut text).unwrap();
    assert!(
        !run.wait().unwrap().success(),
        "it went on to its end: {text}"
    );
    text
}

#[test]
fn an_interrupted_sweep_has_its_first_rows() {
    let folder = tempfile::tempdir().unwrap();
    let vary = "parameters.gap=3..7:400";
    let run = started(
        folder.path(),
        &["field", "sweep", "B1", "--accuracy", "1e-2", "--vary", vary],
    );
    let text = interrupted_after(6, run);
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    // The run was killed long before its end. With buffered output the pipe would have most rows.
    assert!((5..200).contains(&rows.len()), "{}", rows.len());
    for (index, row) in rows.iter().enumerate() {
        let gap: f64 = row[0].parse().unwrap();
        assert!(
            (gap - (3.0 + 4.0 * index as f64 / 399.0)).abs() < 1e-9,
            "{row:?}"
        );
    }
}

#[test]
fn an_interrupted_search_has_its_best_as_a_comment_of_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let run = started(
        folder.path(),
        &[
            "field",
            "optimise",
            "B1",
            "--goal",
            "homogeneity",
            "--vary",
            "parameters.gap=3..7",
            "--print",
        ],
    );
    let text = interrupted_after(2, run);
    for line in text.lines() {
        assert!(line.starts_with("# "), "{line}");
        assert!(line.contains("std/mean of |B|"), "{line}");
        assert!(line.contains(" parameters.gap="), "{line}");
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_interrupted_campaign_has_the_sensors_that_were_done() {
    let folder = tempfile::tempdir().unwrap();
    let older = folder.path().join("rows.csv");
    fs::write(&older, "older").unwrap();
    let arguments = ["campaign", "--plants", "1000", "--rows", "rows.csv"];
    let text = interrupted_after(1, started(folder.path(), &arguments));
    assert!(text.starts_with("seed 1: 5 of 5 "), "{text}");
    assert_eq!(fs::read_to_string(older).unwrap(), "older");
    let journal = folder.path().join("rows.csv.partial");
    // The next run keeps the rows that the interrupted one has written.
    let again = palpate(folder.path(), &arguments);
    let message = String::from_utf8(again.stderr).unwrap();
    assert_eq!(again.status.code(), Some(2), "{message}");
    assert!(message.contains("rows.csv.partial"), "{message}");
    let mut reader = csv::Reader::from_path(journal).unwrap();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert!(rows.len() >= 5, "{rows:?}");
    let heads = reader.headers().unwrap();
    let column = |name: &str| heads.iter().position(|head| head == name).unwrap();
    for row in &rows[..5] {
        assert_eq!(&row[column("seed")], "1");
        assert_eq!(&row[column("covered")], "true", "{row:?}");
    }
}
