//! File of switches: behaviour of a converter where sources disagree.

use std::path::Path;

use ldc161x_sim::Switches;
use palpate_cli::failure::Failure;
use palpate_cli::text;
use serde::{Deserialize, Serialize};

/// A file of switches.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Document {
    switches: Switches,
}

/// Reads a file of switches.
pub(crate) fn read(file: &Path) -> Result<Switches, Failure> {
    let text = text::of_file(file)?;
    let document: Document = toml::from_str(&text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        let before = text.get(..at).unwrap_or_default();
        Failure::Input {
            file: file.to_path_buf(),
            line: before.lines().count().max(1) as u64,
            problem: error.message().to_owned(),
            allowed: "the table [switches] as `palpate bring-up` writes it".to_owned(),
        }
    })?;
    Ok(document.switches)
}

/// Formats switches as the text of a file of switches.
pub(crate) fn document(switches: Switches) -> Result<String, Failure> {
    toml::to_string(&Document { switches })
        .map_err(|error| Failure::Refused(format!("the switches cannot be written: {error}")))
}
