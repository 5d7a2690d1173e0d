//! Folders and files of a release.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// Creates an empty folder.
pub(super) fn new_folder(path: &Path) -> Result<PathBuf> {
    if path.exists() {
        fs::remove_dir_all(path)
            .with_context(|| format!("{} cannot be removed", path.display()))?;
    }
    fs::create_dir_all(path).with_context(|| format!("{} cannot be created", path.display()))?;
    Ok(path.to_path_buf())
}

pub(super) fn write(file: &Path, text: &str) -> Result<()> {
    fs::write(file, text).with_context(|| format!("{} cannot be written", file.display()))
}
