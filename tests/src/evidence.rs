//! How a campaign hands its result to `cargo xtask evidence`.

use std::process::ExitCode;

/// Prints `markdown` between the marker lines and turns the claim into an exit code.
pub fn conclude(markdown: &str, holds: bool) -> ExitCode {
    println!(
        "<!-- evidence:begin -->\n{}\n<!-- evidence:end -->",
        markdown.trim_end()
    );
    if holds {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
