//! The files of the repository, as git lists them.

use anyhow::{Context, Result, bail};

use crate::process::{Invocation, Workspace};

/// Files that git tracks or would add, by their paths from the root.
pub(crate) fn files(workspace: &Workspace) -> Result<Vec<String>> {
    let list = Invocation::new(
        "git",
        &[
            "ls-files",
            "-z",
            "--cached",
            "--others",
            "--exclude-standard",
        ],
    );
    let names = workspace
        .output(&list)
        .context("the check reads git's list of files; run it in a clone")?;
    let files: Vec<_> = names
        .split_terminator('\0')
        .map(ToOwned::to_owned)
        .collect();
    if files.is_empty() {
        bail!("git lists no file, so there is nothing to check; run it in a clone");
    }
    Ok(files)
}
