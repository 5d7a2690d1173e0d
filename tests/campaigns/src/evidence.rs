//! Passes a campaign's result to `cargo xtask evidence`.

use std::process::ExitCode;

use palpate_cli::evidence::{BEGIN, END};

/// Prints `markdown` between the marker lines.
pub(crate) fn print(markdown: &str) {
    println!("{BEGIN}\n{}\n{END}", markdown.trim_end());
}

/// Prints `markdown` between the marker lines and turns the claim into an exit code.
pub(crate) fn conclude(markdown: &str, holds: bool) -> ExitCode {
    print(markdown);
    if holds {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
