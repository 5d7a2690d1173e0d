//! `palpate completions` and `palpate man`: files for an installation.

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, Command};
use clap_complete::Shell;
use palpate_cli::failure::Failure;

/// Name of the program in a shell.
const NAME: &str = "palpate";

/// Print the script by which a shell completes this program's arguments
#[derive(Args)]
#[command(after_help = "\
Example:
  palpate completions bash > ~/.local/share/bash-completion/completions/palpate")]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Write the manual pages into a folder
#[derive(Args)]
#[command(after_help = "\
A page for each verb: palpate.1, palpate-settings-set.1.

Example:
  palpate man ~/.local/share/man/man1")]
pub(crate) struct Manual {
    /// The folder, which is made if it does not exist
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Prints the completion script for a shell.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn completions(arguments: &Completions, mut program: Command) -> Result<(), Failure> {
    // Written to memory first, since the generator panics on a write error.
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut program, NAME, &mut script);
    Ok(io::stdout().lock().write_all(&script)?)
}

/// Writes a manual page for each verb.
///
/// # Errors
/// If the folder cannot be created, or its files cannot be written.
pub(crate) fn manual(arguments: &Manual, program: Command) -> Result<(), Failure> {
    let folder = &arguments.folder;
    let written = fs::create_dir_all(folder);
    written
        .and_then(|()| clap_mangen::generate_to(program, folder))
        .map_err(|reason| Failure::Unwritable {
            file: folder.clone(),
            argument: "FOLDER",
            reason,
        })
}
