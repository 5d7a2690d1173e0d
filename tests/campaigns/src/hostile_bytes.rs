//! The full campaign of hostile bytes; see `system_tests::hostile`.

use std::fmt::Write;
use std::process::ExitCode;
use std::thread;

use crate::evidence::conclude;
use clap::Args;
use system_tests::hostile::{Summary, campaign};

/// Distance of the first seeds of two threads: more scripts than either plays.
const APART: u64 = 1 << 32;

/// Send random and hostile bytes over both links of the native board, and check its promises
#[derive(Args)]
pub(crate) struct Arguments {
    /// Number of frames and other runs of bytes
    #[arg(long, default_value_t = 1_000_000)]
    frames: u64,
    /// Seed of the first script; the next scripts have the next seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(&Arguments { frames, seed }: &Arguments) -> ExitCode {
    let half = frames / 2;
    let other = thread::spawn(move || campaign(seed + APART, frames - half));
    let mut summary = campaign(seed, half);
    match other.join() {
        Ok(rest) => summary.merge(rest),
        Err(_) => return conclude("A script panicked.", false),
    }
    conclude(&describe(&summary), summary.defects.is_empty())
}

fn describe(summary: &Summary) -> String {
    let answers: u64 = summary.outcomes.values().sum();
    let mut text = format!(
        "## Result\n\n\
         | | |\n|---|---|\n\
         | scripts | {} |\n\
         | frames and other runs of bytes | {} |\n\
         | bytes | {} |\n\
         | frames that arrived damaged or could not be understood | {} |\n\
         | answers, each the only one to its command and on its link | {answers} |\n\
         | new starts | {} |\n\
         | promises that were not kept | {} |\n\
         | greatest current (limit 12 A) | {:.2} A |\n\
         | greatest heat in a script of up to half a minute (limit 60 J and 3.5 W) | {:.1} J |\n\
         | hottest copper | {:.1} degrees Celsius |\n",
        summary.scripts,
        summary.frames,
        summary.bytes,
        summary.refused,
        summary.restarts,
        summary.defects.len(),
        summary.greatest_a,
        summary.heat_j,
        summary.copper_c,
    );
    text += "\n## States\n\nHow often the board was looked at in each.\n\n| state | armed | times |\n|---|---|---|\n";
    for ((state, is_armed), times) in &summary.states {
        let armed = if *is_armed { "yes" } else { "no" };
        let _ = writeln!(text, "| {state} | {armed} | {times} |");
    }
    text += "\n## Reports\n\n| report | times |\n|---|---|\n";
    for (report, times) in &summary.reports {
        let _ = writeln!(text, "| {report} | {times} |");
    }
    text += "\n## Answers\n\n| outcome | times |\n|---|---|\n";
    for (outcome, times) in &summary.outcomes {
        let _ = writeln!(text, "| {outcome} | {times} |");
    }
    for (seed, what) in summary.defects.iter().take(20) {
        let _ = writeln!(text, "\nSeed {seed}: {what}");
    }
    text
}
