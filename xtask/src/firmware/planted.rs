//! Images with a planted defect, to test the tests.
//!
//! All are built from one copy of the workspace, in which each defect is planted in turn. Separate
//! folders do not work: cargo treats packages with the same path in two workspaces as the same
//! package, and compares only the files' times.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::image::{build, build_with};
use crate::planted;
use crate::process::Workspace;

/// List of the defects.
pub(crate) const DEFECTS: &str = "firmware/planted-defects.toml";
/// Folder of the copy, its build and the images, in the workspace.
const FOLDER: &str = "target/planted";

/// Builds the image with a defect, and returns its path. An image that is newer than the list and
/// the image without a defect is reused.
pub(crate) fn image(workspace: &Workspace, defect: &str) -> Result<PathBuf> {
    let list = workspace.root().join(DEFECTS);
    let mut patches = planted::list(workspace, DEFECTS)?;
    patches.retain(|patch| patch.name == defect);
    if patches.is_empty() {
        bail!("{DEFECTS} has no defect {defect}");
    }
    let folder = workspace.root().join(FOLDER);
    fs::create_dir_all(&folder).with_context(|| format!("{FOLDER} could not be created"))?;
    // Tests request several images at the same time. The lock is released when the file is closed.
    let lock = File::create(folder.join("lock")).context("the lock could not be created")?;
    lock.lock().context("the copy could not be locked")?;
    let kept = folder.join(format!("{defect}.elf"));
    let sound = build(workspace)?;
    if is_newer(&kept, &sound) && is_newer(&kept, &list) {
        return Ok(kept);
    }
    let source = folder.join("source");
    planted::copy(workspace, &patches, &source)?;
    let build_folder = folder.join("build").to_string_lossy().into_owned();
    let elsewhere = ["--target-dir".to_owned(), build_folder];
    let image = build_with(&workspace.copied_to(source), &elsewhere)?;
    fs::copy(&image, &kept).with_context(|| format!("{} cannot be written", kept.display()))?;
    Ok(kept)
}

fn is_newer(file: &Path, than: &Path) -> bool {
    let changed = |path: &Path| fs::metadata(path).and_then(|data| data.modified());
    matches!((changed(file), changed(than)), (Ok(file), Ok(than)) if file > than)
}
