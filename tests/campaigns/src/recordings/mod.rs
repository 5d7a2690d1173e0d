//! `cargo campaign recordings`: robustness of recordings, and the results of replays.
//!
//! All steps use the commands that a user types, each in its own process.

mod found;
mod full_disk;
mod kills;
mod long_runs;
mod part;
mod replays;

use std::io::{self, Write};
use std::time::Duration;

use clap::Args;
use palpate::board::image::{self, Program};
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_cli::quantity;

use crate::tool::Tool;

/// Record emulated boards for long, kill the recording, fill its disk, and replay
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Exit code 1 when a record is lost, a recording cannot be read, or a replay differs. \
The full disk is a small file system in memory, for which Linux is needed.")]
pub(crate) struct Arguments {
    /// Duration of the two long recordings, s
    #[arg(long, default_value = "600", value_parser = quantity::duration)]
    seconds: Duration,
    /// Number of killed recordings
    #[arg(long, default_value_t = 50)]
    kills: u32,
    /// Number of replayed recordings
    #[arg(long, default_value_t = 20)]
    replays: u64,
    /// Seed of the kill times, and of the first replayed board; the next boards have the next seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    image: image::Arguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (image, _) = arguments.image.load(Program::Firmware)?;
    let tool = Tool::new(image)?;
    let parts = [
        full_disk::run(&tool)?,
        kills::run(&tool, arguments.kills, arguments.seed)?,
        replays::run(&tool, arguments.replays, arguments.seed)?,
        long_runs::run(&tool, arguments.seconds.as_secs_f64())?,
    ];
    let mut out = io::stdout().lock();
    let texts = parts.each_ref().map(|part| part.text.as_str());
    writeln!(out, "{BEGIN}\n{}\n{END}", texts.join(" "))?;
    let failed: Vec<&str> = parts
        .iter()
        .filter_map(|part| part.failed.as_deref())
        .collect();
    if failed.is_empty() {
        return Ok(());
    }
    Err(Failure::Refused(failed.join("; ")))
}
