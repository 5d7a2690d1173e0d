//! `palpate acceptance`: from nothing to a calibrated reading, as a user types it.
//!
//! Each verb runs in a process of its own; what one hands to the next is the board's flash alone.

use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{self, Command};
use std::time::Instant;

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::evidence::{BEGIN, END};
use crate::failure::Failure;
use crate::results::stiffness;

/// Calibrate emulated boards that were never calibrated, measure with each, and compare with the truth
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Exit code 1 when an interval for a spring of 1.5 c_S does not cover the truth.")]
pub(crate) struct Arguments {
    /// How many boards
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1_000))]
    boards: u64,
    /// The first board's sensor; the following have the following seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// What is pressed, in units of the sensing layer's nominal stiffness.
const LOADS: [f64; 4] = [0.5, 1.0, JUDGED, 3.0];
/// The one that decides.
const JUDGED: f64 = 1.5;

/// What is read of `palpate calibrate sensor --json`.
#[derive(Deserialize)]
struct Calibrated {
    stored: bool,
    configuration_crc: u32,
}

/// What is read of `palpate measure --json`.
#[derive(Deserialize)]
struct Measured {
    stiffness_n_per_m: Option<f64>,
    lower_n_per_m: f64,
    upper_n_per_m: Option<f64>,
    true_n_per_m: f64,
    configuration_crc: u32,
}

impl Measured {
    fn covers(&self) -> bool {
        let upper_n_per_m = self.upper_n_per_m.unwrap_or(f64::INFINITY);
        (self.lower_n_per_m..=upper_n_per_m).contains(&self.true_n_per_m)
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "seed",
        "calibration",
        "load",
        "true",
        "measured",
        "95 % from",
        "to",
        "covered",
    ]);
    let mut missed = 0;
    for board in 0..arguments.boards {
        let board = Board::new(arguments.seed.saturating_add(board))?;
        let began = Instant::now();
        let calibrated: Calibrated = board.ask(&["calibrate", "sensor", "--yes"])?;
        let calibration = format!("{:.0} s", began.elapsed().as_secs_f64());
        for load in LOADS {
            let measured: Measured = board.ask(&["measure", "--load", &load.to_string()])?;
            if !calibrated.stored || measured.configuration_crc != calibrated.configuration_crc {
                return Err(Failure::Refused(format!(
                    "seed {}: it does not measure with the calibration that was stored",
                    board.seed
                )));
            }
            let or_rigid = |n_per_m: Option<f64>| n_per_m.map_or("rigid".to_owned(), stiffness);
            let covers = measured.covers();
            missed += usize::from(load == JUDGED && !covers);
            table.add_row([
                board.seed.to_string(),
                calibration.clone(),
                format!("{load} c_S"),
                stiffness(measured.true_n_per_m),
                or_rigid(measured.stiffness_n_per_m),
                stiffness(measured.lower_n_per_m),
                or_rigid(measured.upper_n_per_m),
                if covers { "yes" } else { "no" }.to_owned(),
            ]);
        }
    }
    let mut out = io::stdout().lock();
    writeln!(out, "{BEGIN}\n{table}\n{END}")?;
    if missed > 0 {
        return Err(Failure::Refused(format!(
            "{missed} of {} intervals for {JUDGED} c_S do not cover the truth",
            arguments.boards
        )));
    }
    Ok(())
}

/// An emulated board with a flash of its own, in a folder that goes with it.
struct Board {
    seed: u64,
    folder: PathBuf,
}

impl Board {
    fn new(seed: u64) -> Result<Self, Failure> {
        let name = format!("palpate-acceptance-{}-{seed}", process::id());
        let folder = env::temp_dir().join(name);
        fs::create_dir(&folder)?;
        Ok(Self { seed, folder })
    }

    /// Runs a verb in a process of its own, and reads the last line that it prints.
    fn ask<T: DeserializeOwned>(&self, verb: &[&str]) -> Result<T, Failure> {
        let output = Command::new(env::current_exe()?)
            .args(verb)
            .args(["--board", "emulated", "--seed", &self.seed.to_string()])
            .args([Path::new("--state"), &self.folder.join("board.flash")])
            .arg("--json")
            .output()?;
        if !output.status.success() {
            let reason = String::from_utf8_lossy(&output.stderr);
            let verb = verb.join(" ");
            return Err(Failure::Refused(format!(
                "seed {}: palpate {verb}: {}",
                self.seed,
                reason.trim()
            )));
        }
        let text = String::from_utf8_lossy(&output.stdout);
        Ok(serde_json::from_str(
            text.lines().last().unwrap_or_default(),
        )?)
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        // What cannot be removed lies among the temporary files.
        let _ = fs::remove_dir_all(&self.folder);
    }
}
