//! The full campaign of random fault schedules; see `system_tests::faults`.

use std::{fmt::Write, process::ExitCode, thread};

use clap::Args;
use system_tests::faults::{self, Integrity, Summary, campaign, run_with};

use crate::evidence::conclude;

/// Run random fault schedules and check every trusted reading against the truth.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Number of schedules
    #[arg(long, default_value_t = 100_000)]
    schedules: u64,
    /// Seed of the first schedule; the next schedules have the next seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(&Arguments { schedules, seed }: &Arguments) -> ExitCode {
    let half = schedules / 2;
    let other = thread::spawn(move || campaign(seed + half, schedules - half, faults::run));
    let mut summary = campaign(seed, half, faults::run);
    match other.join() {
        Ok(rest) => summary.merge(rest),
        Err(_) => return conclude("A schedule panicked.", false),
    }
    let unprotected = campaign(seed, schedules / 10, |seed| {
        run_with(Integrity::Unprotected, seed)
    });
    let text = describe(&summary, &unprotected);
    conclude(&text, summary.defects.is_empty())
}

/// Describes the results; the benefit of reading twice is a figure, not a claim.
fn describe(summary: &Summary, unprotected: &Summary) -> String {
    let errors = summary.errors.iter();
    let errors: Vec<_> = errors
        .map(|(name, times)| format!("{name} {times}"))
        .collect();
    let mut text = format!(
        "{} schedules, {} trusted readings, each compared with the chip's own record: {} hangs, panics, hidden gaps, wrong readings \
         called good and failures to recover.\n\n\
         {} schedules have a fault that never ends; {} end measuring, confirmed. {} readings were withdrawn because a later \
         comparison of registers failed; the driver recovered {} times.\n\n\
         Errors that the driver reported, all documented: {}.\n\n\
         The same faults with every word read once: bytes that change on the wire unseen are then wrong readings called good, {} of \
         {} trusted readings in {} schedules, of which {} were plausible as ratios of counts.\n",
        summary.schedules,
        summary.trusted,
        summary.defects.len(),
        summary.lasting,
        summary.measuring,
        summary.withdrawn,
        summary.recoveries,
        errors.join(", "),
        unprotected.wrong,
        unprotected.trusted,
        unprotected.schedules,
        unprotected.wrong_but_plausible,
    );
    for (seed, defect) in &summary.defects {
        let _ = writeln!(text, "\nDefect with seed {seed}: {defect}");
    }
    text
}
