//! Runs `palpate` as child processes in a temporary folder.

use std::env;
use std::fs;
use std::path::PathBuf;
use std::process::{self, Command};

use palpate_cli::failure::Failure;
use serde::de::DeserializeOwned;

/// Argument with which a campaign runs the tool in its own process.
pub(crate) const TOOL: &str = "palpate";

/// Runs verbs of the tool as a user would.
pub(crate) struct Tool {
    folder: PathBuf,
    /// Firmware of the emulated boards.
    image: PathBuf,
}

impl Tool {
    /// A tool with the firmware of emulated boards, in a new temporary folder.
    pub(crate) fn new(image: PathBuf) -> Result<Self, Failure> {
        let folder = env::temp_dir().join(format!("palpate-{}", process::id()));
        fs::create_dir(&folder)?;
        // The processes may run outside of the workspace.
        let image = fs::canonicalize(image)?;
        Ok(Self { folder, image })
    }

    /// Path of a file in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Path of a file in the folder, as text.
    pub(crate) fn name(&self, name: &str) -> String {
        self.path(name).to_string_lossy().into_owned()
    }

    /// Path of the emulated boards' firmware, as text.
    pub(crate) fn image(&self) -> String {
        self.image.to_string_lossy().into_owned()
    }

    /// Arguments for the emulated board of a seed; its flash is a file in the folder.
    pub(crate) fn board(&self, seed: u64, flash: &str) -> Vec<String> {
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

    /// Runs a verb on a board, which must succeed, and reads the last printed line.
    pub(crate) fn ask<T: DeserializeOwned>(
        &self,
        arguments: &[&str],
        board: &[String],
    ) -> Result<T, Failure> {
        let text = printed(command(arguments)?.args(board).arg("--json"))?;
        Ok(serde_json::from_str(
            text.lines().last().unwrap_or_default(),
        )?)
    }
}

impl Drop for Tool {
    fn drop(&mut self) {
        // A folder that cannot be removed stays among the temporary files.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Command that runs a verb of the tool in a process of its own.
pub(crate) fn command(arguments: &[&str]) -> Result<Command, Failure> {
    let mut command = Command::new(env::current_exe()?);
    command.arg(TOOL).args(arguments);
    Ok(command)
}

/// Runs a program, which must succeed, and returns what it prints.
pub(crate) fn printed(command: &mut Command) -> Result<String, Failure> {
    let output = command
        .output()
        .map_err(|error| Failure::Refused(format!("{command:?} cannot be started: {error}")))?;
    if !output.status.success() {
        let reason = String::from_utf8_lossy(&output.stderr);
        return Err(Failure::Refused(format!("{command:?}: {}", reason.trim())));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
