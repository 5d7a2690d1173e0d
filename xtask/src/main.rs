//! The developers' gate: `cargo xtask <verb>`.
//!
//! `cargo xtask help` lists the verbs; a new check is one [`steps::Step`] in [`gate`].

mod arguments;
mod book;
mod deps;
mod evidence;
mod firmware;
mod fuzz;
mod gate;
mod hardware;
mod hygiene;
mod members;
mod metadata;
#[cfg(test)]
mod one_build;
mod package_files;
mod panic_free;
mod planted;
mod process;
mod python;
mod python_package;
mod release;
mod repository;
mod ros;
mod setup;
mod steps;

use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

use arguments::{Arguments, Verb};
use process::Workspace;

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nerror: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the requested verb.
fn run(arguments: Arguments) -> Result<()> {
    let workspace = Workspace::find(arguments.toolchain)?;
    match arguments.verb {
        Verb::Test => steps::run_all(&workspace, &gate::test_steps()),
        Verb::Ci { skip_tests, only } => {
            steps::run_all(&workspace, &gate::ci_steps(skip_tests, &only)?)
        }
        Verb::Evidence { name: None } => {
            evidence::list();
            Ok(())
        }
        Verb::Evidence { name: Some(name) } => evidence::collect(&workspace, &name),
        Verb::Firmware { planted: None } => firmware::make(&workspace),
        Verb::Firmware {
            planted: Some(defect),
        } => firmware::make_planted(&workspace, &defect),
        Verb::PlantedDefects => planted::run_campaign(&workspace),
        Verb::Flash => firmware::flash(&workspace),
        Verb::Fuzz { seconds, seed } => {
            setup::Need::Nightly.provide(&workspace)?;
            setup::Need::Tool(&setup::CARGO_FUZZ).provide(&workspace)?;
            fuzz::run(&workspace, seconds, seed)
        }
        Verb::Release => release::make(&workspace),
        Verb::Setup { release } => setup::install_everything(&workspace, release),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Arguments::command().debug_assert();
    }
}
