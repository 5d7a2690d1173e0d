//! The choice of an engine where the tool is built without the emulator: there is one.

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::progress::Progress;

use super::{Engine, Native};

/// Which program runs the instrument
#[derive(Args)]
// Its group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Arguments {
    /// What runs the instrument: its crates on this computer. This tool is built without the
    /// emulated board: `cargo run --package palpate -- demo --engine image` builds it with
    #[arg(long, value_parser = ["native"], default_value = "native")]
    engine: String,
}

impl Arguments {
    /// The engine.
    pub(crate) fn engine(&self) -> Result<Box<dyn Engine>, Failure> {
        Ok(Box::new(Native))
    }

    /// A bar for the presses.
    pub(crate) fn progress(&self, steps: usize) -> Progress {
        Progress::new(steps)
    }
}
