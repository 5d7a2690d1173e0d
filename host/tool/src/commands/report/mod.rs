//! `palpate report`: a recording as one page.

mod page;
mod story;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use serde_json::json;
use story::RecordingSummary;

/// Make a report of a recording
///
/// One HTML page: force and frequency over the whole recording, every measurement with its interval, and for
/// each of them deformation, current, and the line of its ramps.
#[derive(Args)]
#[command(after_help = "\
The page has everything in it, and needs no network. A recording that was cut off is read as far as it \
goes.

Example:
  palpate report press.mcap")]
pub(crate) struct Arguments {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The page. Otherwise beside the recording, with .html at its end
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let beside = || arguments.file.with_extension("html");
    let html = arguments.html.clone().unwrap_or_else(beside);
    let output = OutputFile::new("--html", &html)?.apart_from(&arguments.file)?;
    let recording = RecordingSummary::read(&arguments.file)?;
    output.write(page::page(&recording)?)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        let file = output.path().display().to_string();
        let line = json!({ "file": file, "measurements": recording.story.measurements.len() });
        return Ok(writeln!(out, "{line}")?);
    }
    Ok(writeln!(out, "Report: {}", output.path().display())?)
}
