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
    let text = describe(&summary) + &describe_unprotected(&unprotected);
    conclude(&text, summary.defects.is_empty())
}

/// Benefit of reading twice: a figure, not a claim.
fn describe_unprotected(summary: &Summary) -> String {
    format!(
        "\n## The same faults with every word read once\n\n\
         Bytes that change on the wire unseen are then wrong readings called good: {} of {} trusted \
         readings in {} schedules, of which {} were plausible as ratios of counts.\n",
        summary.wrong, summary.trusted, summary.schedules, summary.wrong_but_plausible,
    )
}

fn describe(summary: &Summary) -> String {
    let mut text = format!(
        "## Result\n\n\
         | | |\n|---|---|\n\
         | schedules | {} |\n\
         | of them with a fault that never ends | {} |\n\
         | measuring, confirmed, at the end | {} |\n\
         | readings trusted, each compared with the chip's own record | {} |\n\
         | readings withdrawn because a later comparison of registers failed | {} |\n\
         | recoveries | {} |\n\
         | hangs, panics, hidden gaps, wrong readings called good, failures to recover | {} |\n",
        summary.schedules,
        summary.lasting,
        summary.measuring,
        summary.trusted,
        summary.withdrawn,
        summary.recoveries,
        summary.defects.len(),
    );
    text.push_str(
        "\nErrors that the driver reported, all documented:\n\n| error | times |\n|---|---|\n",
    );
    for (name, times) in &summary.errors {
        let _ = writeln!(text, "| {name} | {times} |");
    }
    for (seed, defect) in &summary.defects {
        let _ = writeln!(text, "\nDefect with seed {seed}: {defect}");
    }
    text
}
