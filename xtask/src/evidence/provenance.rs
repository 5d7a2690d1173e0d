//! Origin of a result: its sources, its day and its compiler.

use std::time::{SystemTime, UNIX_EPOCH};

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
        Ok(Self {
            commit: commit(workspace, results)?,
            date: today()?,
            toolchain: workspace.compiler()?,
        })
    }
}

/// The commit that is checked out, marked `(dirty)` if the sources differ from it.
fn commit(workspace: &Workspace, results: &str) -> Result<String> {
    let explain = "evidence names the commit it stands for; run it in a clone with a commit";
    let commit = workspace
        .output(&Invocation::new(
            "git",
            &["rev-parse", "--short=12", "HEAD"],
        ))
        .context(explain)?;
    let exclude = format!(":(exclude){results}");
    let changes = workspace
        .output(&Invocation::new(
            "git",
            &["status", "--porcelain", "--", ".", &exclude],
        ))
        .context(explain)?;
    Ok(describe(commit.trim(), changes.trim().is_empty()))
}

fn describe(commit: &str, clean: bool) -> String {
    if clean {
        commit.to_owned()
    } else {
        format!("{commit} (dirty)")
    }
}

/// Today's date in UTC, as year-month-day.
fn today() -> Result<String> {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .context("the clock of this machine is set before 1970; set it right")?;
    Ok(date(now.as_secs() / 86_400))
}

/// The date of a day counted from 1970-01-01.
fn date(mut day: u64) -> String {
    let mut year = 1970;
    while day >= days_of_year(year) {
        day -= days_of_year(year);
        year += 1;
    }
    let mut month = 1;
    while day >= days_of_month(year, month) {
        day -= days_of_month(year, month);
        month += 1;
    }
    format!("{year:04}-{month:02}-{:02}", day + 1)
}

fn is_leap(year: u64) -> bool {
    year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
}

fn days_of_year(year: u64) -> u64 {
    if is_leap(year) { 366 } else { 365 }
}

fn days_of_month(year: u64, month: u64) -> u64 {
    match month {
        2 if is_leap(year) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_become_dates() {
        for (day, text) in [
            (0, "1970-01-01"),
            (58, "1970-02-28"),
            (59, "1970-03-01"),
            (364, "1970-12-31"),
            (365, "1971-01-01"),
            (11_016, "2000-02-29"),
            (20_513, "2026-03-01"),
            (47_540, "2100-02-28"),
            (47_541, "2100-03-01"),
        ] {
            assert_eq!(date(day), text);
        }
    }

    #[test]
    fn changed_sources_are_marked() {
        assert_eq!(describe("0123", true), "0123");
        assert_eq!(describe("0123", false), "0123 (dirty)");
    }
}
