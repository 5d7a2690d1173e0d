//! `palpate demo touch` and `palpate calibrate-touch` as their users call them.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{emulated, palpate, recording};

fn text(output: std::process::Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn touches_are_a_table_beside_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let shown = palpate(&["demo", "touch", "--plot", "touch.svg"], folder.path());
    insta::assert_snapshot!(text(shown));
    let map = fs::read_to_string(folder.path().join("touch.svg")).unwrap();
    assert!(map.starts_with("<svg"));
    assert!(map.matches("<ellipse").count() > 100);
}

/// A slide that is pressed by a pin, on four coils of one converter.
const FOUR: &str = "layout = \"three-around-one\"
[[touch]]
name = \"along x\"
indenter = \"pin\"
radius_m = 2e-3
x_m = -1e-3
y_m = 0.5e-3
to_x_m = 1e-3
depth_m = 0.25e-3
seconds = 0.4
";

/// A folder with the bench of four coils: design.toml and presses.csv.
fn bench() -> (TempDir, Vec<Value>) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("four.toml"), FOUR).unwrap();
    let arguments = [
        "demo",
        "touch",
        "--path",
        "four.toml",
        "--bench",
        ".",
        "--json",
    ];
    let lines = text(palpate(&arguments, folder.path()));
    let lines = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    let lines = lines.collect();
    (folder, lines)
}

#[test]
fn a_slide_of_a_file_is_found_along_its_path() {
    let (_folder, lines) = bench();
    let down: Vec<_> = lines.iter().filter(|line| line["down"] == true).collect();
    assert_eq!(down.len(), 32);
    let claimed: Vec<_> = down.iter().filter(|line| line["x_m"].is_number()).collect();
    assert!(claimed.len() > 24, "{}", claimed.len());
    for line in claimed {
        assert_eq!(line["simulated"], true);
        let [found, truth] = ["x_m", "true_x_m"].map(|key| line[key].as_f64().unwrap());
        assert!((found - truth).abs() < 0.5e-3, "{line}");
    }
}

/// Lines that set the array, of a configuration that the board exports after a new start.
fn exported(folder: &Path) -> String {
    text(emulated(&["settings", "export", "board.jsonl"], folder));
    let all = fs::read_to_string(folder.join("board.jsonl")).unwrap();
    let array = all.lines().filter(|line| line.contains("set_touch_array"));
    array.map(|line| format!("{line}\n")).collect()
}

#[test]
fn a_calibrated_array_is_stored_and_bad_presses_are_refused_by_name() {
    let (folder, _) = bench();
    let folder = folder.path();
    let calibrate = |table: &str, load: &[&str]| {
        let arguments = [&["calibrate-touch", "design.toml", table], load].concat();
        emulated(&arguments, folder)
    };
    let load = ["--out", "array.jsonl", "--load", "--store"];
    let said = text(calibrate("presses.csv", &load));
    assert!(
        said.contains("coil 3: ") && !said.contains("left out"),
        "{said}"
    );
    let array = fs::read_to_string(folder.join("array.jsonl")).unwrap();
    assert!(array.contains("set_touch_array"), "{array}");
    assert_eq!(exported(folder), array);

    // Ten tips in turn; the press in line 13 is number 12.
    let table = fs::read_to_string(folder.join("presses.csv")).unwrap();
    let with = |line: usize, column: usize, change: fn(f64) -> String| {
        let mut lines: Vec<_> = table.lines().map(str::to_owned).collect();
        let mut cells: Vec<_> = lines[line - 1].split(',').map(str::to_owned).collect();
        cells[column] = change(cells[column].parse().unwrap());
        lines[line - 1] = cells.join(",");
        fs::write(folder.join("bad.csv"), lines.join("\n")).unwrap();
    };
    with(13, 2, |force_n| (2.0 * force_n).to_string());
    let said = text(palpate(
        &["calibrate-touch", "design.toml", "bad.csv"],
        folder,
    ));
    assert!(said.contains("left out: press 12 at "), "{said}");
    assert!(said.contains("as if its force was 0."), "{said}");

    for (column, change, named) in [
        (
            2,
            (|of| format!("-{of}")) as fn(f64) -> String,
            "is not above zero",
        ),
        (5, |_| "high".to_owned(), "\"high\" is no number"),
    ] {
        with(13, column, change);
        let refused = calibrate("bad.csv", &load);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(
            said.contains("bad.csv, line 13") && said.contains(named),
            "{said}"
        );
    }
    let few: Vec<_> = table.lines().take(21).collect();
    fs::write(folder.join("few.csv"), few.join("\n")).unwrap();
    let refused = calibrate("few.csv", &load);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("25 presses"), "{said}");
    assert_eq!(exported(folder), array);
}

#[test]
fn a_report_of_a_recording_has_its_touches() {
    let folder = tempfile::tempdir().unwrap();
    recording(&folder.path().join("press.mcap"));
    text(palpate(&["report", "press.mcap"], folder.path()));
    let page = fs::read_to_string(folder.path().join("press.html")).unwrap();
    assert!(
        page.contains("Touches: place and force in 2 of 3 scans"),
        "{page}"
    );
    assert_eq!(page.matches("<ellipse").count(), 2);
}
