//! Origin of a result: its sources, its day and its compiler.

use anyhow::{Context, Result};

use crate::process::{Invocation, Workspace};

/// Circumstances of a run that its output does not show.
#[derive(Debug)]
pub(super) struct Origin {
    /// The commit, marked if the sources differed from it.
    pub(super) commit: String,
    /// The day, in UTC.
    pub(super) date: String,
    /// The compiler.
    pub(super) toolchain: String,
}

impl Origin {
    /// Circumstances of a run that is about to start. Changes in the folder `results`, which
    /// campaigns write, do not count as changes of the sources.
    pub(super) fn read(workspace: &Workspace, results: &str) -> Result<Self> {
        let git = |arguments: &[&str]| {
            workspace
                .output(&Invocation::new("git", arguments))
                .context("evidence names the commit it stands for; run it in a clone with a commit")
        };
        let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
        let exclude = format!(":(exclude){results}");
        let changes = git(&["status", "--porcelain", "--", ".", &exclude])?;
        let mark = if changes.is_empty() { "" } else { " (dirty)" };
        let date = workspace.output(&Invocation::new("date", &["-u", "+%Y-%m-%d"]))?;
        Ok(Self {
            commit: format!("{}{mark}", commit.trim()),
            date: date.trim().to_owned(),
            toolchain: workspace.compiler()?,
        })
    }
}
