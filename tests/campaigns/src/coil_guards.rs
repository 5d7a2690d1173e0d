//! The full campaign of random sequences for the coil's driver; see `system_tests::coil`.

use std::fmt::Write;
use std::process::ExitCode;
use std::thread;

use crate::evidence::conclude;
use clap::Args;
use coil_hbridge::Fault;
use system_tests::coil::{Summary, campaign};

/// Run random sequences of orders, settings, faults and clocks, and check the truth against every
/// limit
#[derive(Args)]
pub(crate) struct Arguments {
    /// Number of sequences
    #[arg(long, default_value_t = 100_000)]
    sequences: u64,
    /// Seed of the first sequence; the next sequences have the next seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(&Arguments { sequences, seed }: &Arguments) -> ExitCode {
    let half = sequences / 2;
    let other = thread::spawn(move || campaign(seed + half, sequences - half));
    let mut summary = campaign(seed, half);
    match other.join() {
        Ok(rest) => summary.merge(rest),
        Err(_) => return conclude("A sequence panicked.", false),
    }
    conclude(&describe(&summary), summary.defects.is_empty())
}

fn describe(summary: &Summary) -> String {
    let faults = Fault::ALL.iter().zip(summary.faults);
    let faults: Vec<_> = faults
        .map(|(fault, count)| format!("{fault:?} {count}"))
        .collect();
    let mut text = format!(
        "{} sequences, {} orders executed and {} refused: {} limits exceeded.\n\n\
         | | |\n|---|---|\n\
         | greatest current in a sound circuit (limit 12 A) | {:.2} A |\n\
         | greatest current of all, in dead shorts behind a hardware limit of 15 A | {:.1} A |\n\
         | greatest part of the allowed energy | {:.0} % |\n\
         | greatest error of the copper's predicted temperature | {:.2} K |\n\
         | greatest rise of the copper | {:.0} K |\n\n\
         Faults latched: {}.\n",
        summary.sequences,
        summary.begun,
        summary.refused,
        summary.defects.len(),
        summary.greatest_a,
        summary.peak_a,
        100.0 * summary.energy,
        summary.error_k,
        summary.rise_k,
        faults.join(", "),
    );
    for (seed, what) in summary.defects.iter().take(20) {
        let _ = writeln!(text, "\nSeed {seed}: {what}");
    }
    text
}
