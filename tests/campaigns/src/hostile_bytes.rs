//! The full campaign of hostile bytes; see `system_tests::hostile`.

use std::fmt::Write;
use std::process::ExitCode;
use std::thread;

use crate::evidence::conclude;
use clap::Args;
use system_tests::hostile::{Summary, campaign};

/// Distance between the first seeds of two threads: more scripts than a thread plays.
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
    println!("{}", describe(&summary));
    conclude(&sentence(&summary), summary.defects.is_empty())
}

fn sentence(summary: &Summary) -> String {
    format!(
        "{} frames and other runs of bytes in {} scripts, {} answers: {} promises broken. At most {:.2} A (limit 12 A), and {:.1} J \
         in a script of up to half a minute (limit 60 J and 3.5 W).",
        summary.frames,
        summary.scripts,
        summary.outcomes.values().sum::<u64>(),
        summary.defects.len(),
        summary.greatest_a,
        summary.heat_j,
    )
}

fn describe(summary: &Summary) -> String {
    let mut text = format!(
        "{} bytes; {} frames arrived damaged or could not be understood; {} new starts; hottest copper {:.1} degrees Celsius.\n",
        summary.bytes, summary.refused, summary.restarts, summary.copper_c,
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
