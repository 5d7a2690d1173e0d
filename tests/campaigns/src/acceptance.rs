//! `cargo campaign acceptance`: from an uncalibrated board to a calibrated reading, by the commands
//! that a user types.
//!
//! Each verb runs in its own process; the only data passed from one to the next are in the board's
//! flash.

use std::io::{self, Write};
use std::time::Instant;

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use palpate::board::image::{self, Program};
use palpate_cli::describe::stiffness;
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use serde::Deserialize;

use crate::tool::Tool;

/// Calibrate emulated boards that have no calibration, measure with each, and compare with the
/// truth
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Exit code 1 when an interval for a spring of 1.5 c_S does not cover the truth.")]
pub(crate) struct Arguments {
    /// Number of boards
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1_000))]
    boards: u64,
    /// Seed of the first board's sensor; the next boards have the next seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    image: image::Arguments,
}

/// Stiffness of the loads, in units of the sensing layer's nominal stiffness.
const LOADS: [f64; 4] = [0.5, 1.0, JUDGED, 3.0];
/// Load that decides the claim.
const JUDGED: f64 = 1.5;

/// Fields read from `palpate calibrate sensor --json`.
#[derive(Deserialize)]
struct Calibrated {
    stored: bool,
    configuration_crc: u32,
}

/// Fields read from `palpate measure --json`.
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
    let (image, _) = arguments.image.load(Program::Firmware)?;
    let tool = Tool::new(image)?;
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "seed",
        "time to calibrate",
        "load",
        "true",
        "measured",
        "95 % from",
        "to",
        "covered",
    ]);
    let (mut missed, mut covered, mut all) = (0, 0, 0);
    for board in 0..arguments.boards {
        let seed = arguments.seed.saturating_add(board);
        let board = tool.board(seed, &format!("board-{seed}.flash"));
        let began = Instant::now();
        let calibrated: Calibrated = tool.ask(&["calibrate", "sensor", "--yes"], &board)?;
        let calibration = format!("{:.0} s", began.elapsed().as_secs_f64());
        for load in LOADS {
            let measured: Measured = tool.ask(&["measure", "--load", &load.to_string()], &board)?;
            if !calibrated.stored || measured.configuration_crc != calibrated.configuration_crc {
                return Err(Failure::Refused(format!(
                    "seed {}: it does not measure with the calibration that was stored",
                    seed
                )));
            }
            let or_rigid = |n_per_m: Option<f64>| n_per_m.map_or("rigid".to_owned(), stiffness);
            let covers = measured.covers();
            missed += usize::from(load == JUDGED && !covers);
            covered += usize::from(covers);
            all += 1;
            table.add_row([
                seed.to_string(),
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
    writeln!(
        out,
        "{table}\n\n{BEGIN}\n{covered} of {all} intervals of {} boards cover the truth.\n{END}",
        arguments.boards
    )?;
    if missed > 0 {
        return Err(Failure::Refused(format!(
            "{missed} of {} intervals for {JUDGED} c_S do not cover the truth",
            arguments.boards
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_covers_the_truth_between_its_limits_and_above_an_open_one() {
        let covers = |lower_n_per_m: f64, upper_n_per_m: Option<f64>| {
            let line = serde_json::json!({
                "stiffness_n_per_m": upper_n_per_m.map(|upper_n_per_m| 0.5 * (lower_n_per_m + upper_n_per_m)),
                "lower_n_per_m": lower_n_per_m,
                "upper_n_per_m": upper_n_per_m,
                "true_n_per_m": 7900.0,
                "configuration_crc": 1,
            });
            serde_json::from_value::<Measured>(line).unwrap().covers()
        };
        assert!(covers(7300.0, Some(8400.0)));
        assert!(covers(7300.0, None));
        assert!(!covers(6300.0, Some(7800.0)));
        assert!(!covers(8000.0, Some(9100.0)));
        assert!(!covers(8000.0, None));
    }
}
