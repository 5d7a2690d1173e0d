//! Builds the image.

use std::path::PathBuf;

use anyhow::Result;

use crate::members::{FIRMWARE, FIRMWARE_TARGET};
use crate::process::{Invocation, Workspace};
use crate::setup::Need;

const PROFILE: &str = "firmware";

/// Builds the image and returns its path.
pub(crate) fn build(workspace: &Workspace) -> Result<PathBuf> {
    build_with(workspace, &[])
}

/// Builds the image with additional cargo arguments, and returns its path.
pub(super) fn build_with(workspace: &Workspace, further: &[String]) -> Result<PathBuf> {
    Need::Target(FIRMWARE_TARGET).provide(workspace)?;
    let mut arguments = vec![
        "build",
        "--locked",
        "--package",
        FIRMWARE,
        "--profile",
        PROFILE,
        "--target",
        FIRMWARE_TARGET,
        "--message-format",
        "json-render-diagnostics",
    ];
    arguments.extend(further.iter().map(String::as_str));
    workspace.build(&Invocation::cargo(&arguments))
}
