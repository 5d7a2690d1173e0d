//! The tool itself, in processes of its own, in a folder that goes with this.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, Command, Output};

use palpate_wire::Record;
use palpate_wire::record::Sample;
use serde::de::DeserializeOwned;

use crate::failure::Failure;
use crate::recording::{Contents, Entry, Reader};

pub(super) struct Tool {
    folder: PathBuf,
    /// The firmware of the emulated boards.
    image: PathBuf,
}

/// What is in a file that was written by another process.
#[derive(Default)]
pub(super) struct Found {
    pub(super) contents: Contents,
    pub(super) samples: u64,
    /// Scans that the samples say are missing before them.
    pub(super) missed: u64,
    /// Arrival of the last record, ns since 1970.
    pub(super) last_ns: Option<u64>,
}

impl Found {
    /// Records that are missing between the first and the last.
    pub(super) fn missing(&self) -> u64 {
        self.contents.boots().iter().map(|boot| boot.missing).sum()
    }

    fn sample(&mut self, sample: &Sample) {
        self.samples += 1;
        // What goes before the first one is no loss of this recording.
        if self.samples > 1 {
            self.missed += u64::from(sample.missed);
        }
    }
}

impl Tool {
    pub(super) fn new(image: PathBuf) -> Result<Self, Failure> {
        let folder = env::temp_dir().join(format!("palpate-recordings-{}", process::id()));
        fs::create_dir(&folder)?;
        // The processes run elsewhere than in the workspace, too.
        let image = fs::canonicalize(image)?;
        Ok(Self { folder, image })
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The same as text.
    pub(super) fn name(&self, name: &str) -> String {
        self.path(name).to_string_lossy().into_owned()
    }

    /// The firmware of the emulated boards, a file.
    pub(super) fn image(&self) -> String {
        self.image.to_string_lossy().into_owned()
    }

    /// The emulated board of a seed, as arguments; its flash is a file of the folder.
    pub(super) fn board(&self, seed: u64, flash: &str) -> Vec<String> {
        let named = [
            ("--board", "emulated".to_owned()),
            ("--seed", seed.to_string()),
        ];
        let files = [("--state", self.name(flash)), ("--image", self.image())];
        let pairs = named.into_iter().chain(files);
        pairs
            .flat_map(|(name, value)| [name.to_owned(), value])
            .collect()
    }

    /// A verb.
    pub(super) fn command(&self, arguments: &[&str]) -> Result<Command, Failure> {
        let mut command = Command::new(env::current_exe()?);
        command.args(arguments);
        Ok(command)
    }

    /// Runs a verb on a board, which has to succeed, and reads the last line that it prints.
    pub(super) fn ask<T: DeserializeOwned>(
        &self,
        arguments: &[&str],
        board: &[String],
    ) -> Result<T, Failure> {
        let output = self
            .command(arguments)?
            .args(board)
            .arg("--json")
            .output()?;
        if !output.status.success() {
            return Err(failed(arguments, &output));
        }
        let text = String::from_utf8_lossy(&output.stdout);
        Ok(serde_json::from_str(
            text.lines().last().unwrap_or_default(),
        )?)
    }
}

impl Drop for Tool {
    fn drop(&mut self) {
        // What cannot be removed lies among the temporary files.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

fn failed(arguments: &[&str], output: &Output) -> Failure {
    let reason = String::from_utf8_lossy(&output.stderr);
    let verb = arguments.join(" ");
    Failure::Refused(format!("palpate {verb}: {}", reason.trim()))
}

/// Reads a file as far as it goes.
pub(super) fn read(file: &Path) -> Result<Found, Failure> {
    let mut found = Found::default();
    for entry in &mut Reader::open(file)? {
        found.contents.enter(&entry);
        if let Entry::Frame(recorded) = &entry {
            found.last_ns = Some(recorded.host_ns);
            if let Record::Sample(sample) = &recorded.frame.message {
                found.sample(sample);
            }
        }
    }
    Ok(found)
}
