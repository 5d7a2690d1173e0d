//! `palpate calibrate`.

use clap::{Args, Subcommand};
use palpate_cli::failure::Failure;

use crate::commands::coil;

/// Calibrate a board against references
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Sensor(super::sensor::Arguments),
    Current(coil::calibrate::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.what {
        What::Sensor(arguments) => super::sensor::run(arguments),
        What::Current(arguments) => coil::calibrate::run(arguments),
    }
}
