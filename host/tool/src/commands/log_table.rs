//! `palpate log-table`: the table that decodes an image's log without the image.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;

use crate::board::log::Log;

/// Print the table by which an image's log is read
///
/// The firmware sends its log as numbers; the table has their texts. It belongs to one build of the image. A
/// release holds it.
#[derive(Args)]
#[command(after_help = "\
Example:
  palpate log-table palpate-pico.elf > palpate-pico.log.json")]
pub(crate) struct Arguments {
    /// The image's ELF file
    #[arg(value_name = "IMAGE.elf")]
    image: PathBuf,
}

/// Prints the table.
///
/// # Errors
/// If the file cannot be read, or has no table.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let table = Log::load(&arguments.image)?.table()?;
    Ok(writeln!(io::stdout().lock(), "{table}")?)
}
