//! `palpate stack`: sensor designs as files.

use std::io::{self, Write};
use std::path::Path;

use clap::{Args, Subcommand};
use palpate_cli::failure::Failure;
use palpate_sim::stack::Stack;

/// Print a kind of sensor as a file, to make one of your own
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Show(Show),
}

/// Print the file of a stack, with meaning, unit and range of every key
#[derive(Args)]
#[command(after_help = "\
Edit the file and name it where a verb asks for a stack: `palpate plan mine.toml`. Every key is needed; what is \
missing or out of range is refused with its line. `palpate field stack` makes the file of a design of the magnetic \
layer.

Examples:
  palpate stack show ultrasoft > mine.toml
  palpate plan mine.toml")]
struct Show {
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(value_name = "STACK")]
    stack: String,
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Verb::Show(show) = &arguments.verb;
    let stack = Stack::named(&show.stack, Path::new(""))?;
    Ok(write!(io::stdout().lock(), "{}", stack.file())?)
}
