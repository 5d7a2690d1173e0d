//! The user's tool, for campaigns that run it several times.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use crate::process::{Invocation, Workspace};

/// Builds the tool and returns its path.
pub(crate) fn build(workspace: &Workspace) -> Result<PathBuf> {
    let build = Invocation::cargo(&["build", "--release", "-p", "palpate"]);
    workspace.run(&build)?;
    let metadata = workspace.output(&Invocation::cargo(&[
        "metadata",
        "--no-deps",
        "--format-version",
        "1",
    ]))?;
    let metadata: Value = serde_json::from_str(&metadata)?;
    let target = metadata["target_directory"]
        .as_str()
        .context("cargo metadata names no target directory")?;
    Ok(Path::new(target).join("release/palpate"))
}
