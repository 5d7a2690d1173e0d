//! `palpate image-cost`: what the firmware's image costs of processor, flash and memory.

mod parts;
mod phases;
mod tables;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_board::{Image, Sources, firmware};

use crate::failure::Failure;

/// Run the firmware's image on the emulated board, untouched, calibrated and in the train of ramps,
/// and tell where its time goes
#[derive(Args)]
#[command(after_help = "\
Prints Markdown: processor load and cycles per sample by part of the firmware, handlers of interrupts
with their longest run and the jitter of their start, latency of the converter's interrupt, sizes, and
the speed of the emulation. Cycles of floating point and of copying count as their caller's.

Without --image it builds the repository's own image first.

Example:
  palpate image-cost --functions 40")]
pub(crate) struct Arguments {
    /// An image with debug information, instead of the repository's own
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Which sensor of the stack is pressed
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// List so many of the costliest functions of every phase as well
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    functions: usize,
}

/// Comments that `cargo xtask evidence` looks for around what it keeps.
const BEGIN: &str = "<!-- evidence:begin -->";
const END: &str = "<!-- evidence:end -->";

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let refused = |error: &dyn std::fmt::Display| Failure::Refused(error.to_string());
    let file = match &arguments.image {
        Some(file) => file.clone(),
        None => firmware::build().map_err(|error| refused(&error))?,
    };
    let image = Image::load(&file).map_err(|error| refused(&error))?;
    let sources = Sources::load(&file).map_err(|error| refused(&error))?;
    let shared = parts::shared(&sources);
    let measured = phases::measure(&image, &shared, arguments.seed)?;
    let mut out = io::stdout().lock();
    writeln!(out, "{BEGIN}")?;
    tables::write(&mut out, &measured, &image, &sources, arguments.functions)?;
    Ok(writeln!(out, "{END}")?)
}
