//! Long recordings at the greatest load: one channel at 1 kHz, and four channels at 500 Hz.

use std::process::{Child, Stdio};

use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use palpate_cli::failure::Failure;
use serde::Deserialize;
use serde_json::Value;

use super::found;
use super::part::Part;
use crate::tool::{self, Tool};

/// Recordings: name and settings. The emulated board has one sensor: the other channels convert
/// nothing, but are sent all the same.
const RUNS: [(&str, &str, &str); 2] = [
    ("1 kHz, one channel", "rate_hz=1000", "channels=1"),
    ("500 Hz, four channels", "rate_hz=500", "channels=15"),
];
/// Seed of the board of both recordings.
const SEED: u64 = 1;

/// Fields read from `palpate record --json`.
#[derive(Deserialize)]
struct Recorded {
    records: u64,
    duration_s: f64,
    unreadable: u32,
    not_written: u64,
}

/// Runs both recordings at once, each for `seconds`.
pub(super) fn run(tool: &Tool, seconds: f64) -> Result<Part, Failure> {
    let mut children = Vec::new();
    for (place, (_, rate, channels)) in RUNS.into_iter().enumerate() {
        children.push(start(tool, place, [rate, channels], seconds)?);
    }
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "recording",
        "duration",
        "records",
        "samples",
        "records missing",
        "not written",
        "conversions missed",
        "file",
    ]);
    let (mut lost, mut all) = (0, 0);
    for (place, child) in children.into_iter().enumerate() {
        let output = child.wait_with_output()?;
        let recorded: Recorded = serde_json::from_slice(&output.stdout)?;
        let file = tool.path(&file(place));
        let found = found::read(&file)?;
        let missing = found.missing();
        all += recorded.records;
        lost += missing + recorded.not_written + u64::from(recorded.unreadable);
        lost += recorded.records.abs_diff(found.contents.frames());
        let megabytes = file.metadata()?.len() as f64 * 1e-6;
        table.add_row([
            RUNS.get(place).map_or("", |(name, _, _)| name).to_owned(),
            format!("{:.1} s", recorded.duration_s),
            recorded.records.to_string(),
            found.samples.to_string(),
            missing.to_string(),
            recorded.not_written.to_string(),
            found.missed.to_string(),
            format!("{megabytes:.0} MB"),
        ]);
    }
    println!("{table}\n");
    Ok(Part {
        text: format!(
            "{} recordings of {seconds:.0} s lack {lost} of {all} records.",
            RUNS.len()
        ),
        failed: (lost > 0).then(|| format!("{lost} records of the long recordings are lost")),
    })
}

fn file(place: usize) -> String {
    format!("long-{place}.mcap")
}

fn start(tool: &Tool, place: usize, settings: [&str; 2], seconds: f64) -> Result<Child, Failure> {
    let board = tool.board(SEED, &format!("long-{place}.flash"));
    let set = [&["settings", "set", "--store"], &settings[..]].concat();
    let _: Value = tool.ask(&set, &board)?;
    let (file, seconds) = (tool.name(&file(place)), seconds.to_string());
    let mut command = tool::command(&["record", &file, "--json", "--for", &seconds])?;
    Ok(command.args(&board).stdout(Stdio::piped()).spawn()?)
}
