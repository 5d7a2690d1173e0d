//! `cargo campaign image-cost`: cost of the firmware image in processor time, flash and memory.

mod parts;
mod phases;
mod tables;

use std::io;

use clap::Args;
use palpate::board::image::{self, Program};
use palpate_cli::failure::Failure;
use palpate_emulator::Sources;

/// Run the firmware image on the emulated board, untouched, calibrated and in the train of ramps,
/// and show its processor time
#[derive(Args)]
#[command(after_help = "\
Prints Markdown: processor load and cycles per sample by part of the firmware, handlers of interrupts \
with their longest run and the jitter of their start, latency of the converter's interrupt, sizes, and \
the speed of the emulation. Cycles of floating point and of copying count as their caller's.

The image has to have its debug information, as `cargo xtask firmware` writes it.

Example:
  cargo campaign image-cost --functions 40")]
pub(crate) struct Arguments {
    #[command(flatten)]
    image: image::Arguments,
    /// Seed of the pressed sensor
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// List this many of the costliest functions of every phase as well
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    functions: usize,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (file, image) = arguments.image.load(Program::Firmware)?;
    let sources = Sources::load(&file)
        .map_err(|error| Failure::Argument(format!("{}: {error}", file.display())))?;
    let shared = parts::shared(&sources);
    let measured = phases::measure(&image, &shared, arguments.seed)?;
    let mut out = io::stdout().lock();
    tables::write(&mut out, &measured, &image, &sources, arguments.functions)
}
