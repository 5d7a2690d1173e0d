//! Recordings of measurements, replayed.

use std::collections::BTreeMap;
use std::fs;

use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use palpate_cli::failure::Failure;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_simulate::instrument::{CalibratedInstrument, default_settings};
use palpate_wire::Command;
use palpate_wire::code::Drift;
use palpate_wire::command::Settings;
use serde::Deserialize;
use serde_json::Value;

use super::part::Part;
use crate::tool::{self, Tool};

/// Stack of the boards: the default of emulated boards.
const STACK: &str = "ultrasoft";
/// Stiffness of the loads in turn, in units of the sensing layer's.
const LOADS: [&str; 5] = ["0.3", "0.7", "1.3", "2.5", "5"];
/// Settings of the boards in turn: conversions per second, and the fitted drift.
const SETTINGS: [(f32, Drift); 4] = [
    (1_000.0, Drift::Logarithmic),
    (500.0, Drift::Linear),
    (800.0, Drift::Exponential),
    (1_000.0, Drift::SawTooth),
];
/// The emulated board is pressed after 3 s for 5 s, released for 8 s, and pressed again.
const SECONDS: &str = "19";

/// Fields read from `palpate replay --json`.
#[derive(Deserialize)]
struct Replayed {
    kinds: BTreeMap<String, Count>,
    first_difference: Option<Value>,
}

#[derive(Clone, Copy, Default, Deserialize)]
struct Count {
    replayed: u64,
    identical: u64,
    passed_over: u64,
}

pub(super) fn run(tool: &Tool, boards: u64, seed: u64) -> Result<Part, Failure> {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "seed",
        "rate",
        "drift",
        "load",
        "samples",
        "estimates",
        "curve",
        "refusals",
    ]);
    let mut sums: BTreeMap<String, Count> = BTreeMap::new();
    let mut differing = 0;
    let stack = Stack::builtin(STACK).map_err(LoadError::from)?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let calibrated = |seed| {
        let usual = default_settings();
        CalibratedInstrument::calibrated(&stack, &disturbances, seed, Switches::all(), &usual)
    };
    // One drawn sensor in fifty has a supply that cannot drive the peak current.
    let instruments = (seed..).filter_map(|seed| Some((seed, calibrated(seed).ok()?)));
    let instruments = instruments.take(boards.try_into().unwrap_or(usize::MAX));
    let loads = LOADS.iter().cycle();
    for (((seed, instrument), load), (rate_hz, drift)) in
        instruments.zip(loads).zip(SETTINGS.into_iter().cycle())
    {
        let settings = |settings: &Settings| Settings {
            rate_hz,
            drift,
            ..settings.clone()
        };
        let replayed = replayed(tool, (seed, &instrument), load, settings)?;
        differing += u64::from(replayed.first_difference.is_some());
        let cell = |kind: &str| {
            let Count {
                replayed,
                identical,
                ..
            } = replayed.kinds.get(kind).copied().unwrap_or_default();
            format!("{identical} of {replayed}")
        };
        table.add_row([
            seed.to_string(),
            format!("{rate_hz} Hz"),
            drift.to_string(),
            format!("{load} c_S"),
            cell("sample"),
            cell("estimate"),
            cell("load_point"),
            cell("refusal"),
        ]);
        for (kind, count) in replayed.kinds {
            let sum = sums.entry(kind).or_default();
            sum.replayed += count.replayed;
            sum.identical += count.identical;
            sum.passed_over += count.passed_over;
        }
    }
    let sum = |kind: &str| sums.get(kind).copied().unwrap_or_default();
    let (samples, estimates) = (sum("sample"), sum("estimate"));
    let is_empty = estimates.replayed == 0;
    let text = format!(
        "{} of {} samples and {} of {} estimates are replayed to the bit.",
        samples.identical, samples.replayed, estimates.identical, estimates.replayed,
    );
    println!(
        "{table}\n\n{} samples and {} estimates were passed over, for reasons that `palpate replay` names.\n",
        samples.passed_over, estimates.passed_over,
    );
    Ok(Part {
        text,
        failed: (differing > 0 || is_empty)
            .then(|| format!("{differing} replays differ from what the boards sent")),
    })
}

/// Records measurements of a load with a calibrated board, and replays them.
fn replayed(
    tool: &Tool,
    (seed, instrument): (u64, &CalibratedInstrument),
    load: &str,
    settings: impl Fn(&Settings) -> Settings,
) -> Result<Replayed, Failure> {
    let lines = instrument.calibration.commands.iter().map(|command| {
        let command = match command {
            Command::SetSettings(of) => Command::SetSettings(settings(of)),
            other => other.clone(),
        };
        Ok(serde_json::to_string(&command)? + "\n")
    });
    let lines: Result<String, Failure> = lines.collect();
    let calibration = tool.name(&format!("board-{seed}.jsonl"));
    fs::write(&calibration, lines?)?;
    let board = tool.board(seed, &format!("board-{seed}.flash"));
    let import = ["settings", "import", &calibration, "--store"];
    let _: Value = tool.ask(&import, &board)?;
    let file = tool.name(&format!("replayed-{seed}.mcap"));
    let record = ["record", &file, "--arm", "--load", load, "--for", SECONDS];
    let _: Value = tool.ask(&record, &board)?;
    // A difference is exit code 1, and the result is still printed.
    let output = tool::command(&["replay", &file, "--json"])?.output()?;
    Ok(serde_json::from_slice(&output.stdout)?)
}
