//! The text of an evidence file.

use anyhow::{Context, Result, bail};

use super::provenance::Origin;

/// Ends the line before a campaign's result. The line may begin with anything, since the test
/// harness prints a test's name without ending its line.
pub(crate) const BEGIN: &str = "<!-- evidence:begin -->";

/// Is the line after a campaign's result.
pub(crate) const END: &str = "<!-- evidence:end -->";

/// Where a result comes from.
#[derive(Debug)]
pub(super) struct Record<'a> {
    /// Name of the campaign.
    pub(super) name: &'a str,
    /// The verb that writes it.
    pub(super) verb: String,
    /// What it shows.
    pub(super) purpose: &'a str,
    /// The command that was run.
    pub(super) command: String,
    /// The seed, where the command has one.
    pub(super) seed: Option<String>,
    /// The sources, the day and the compiler.
    pub(super) origin: Origin,
    /// The paths of the code that decides the result.
    pub(super) rests_on: &'a [&'a str],
    /// How long it took, building included.
    pub(super) seconds: u64,
}

impl Record<'_> {
    /// The file: heading, origin, result.
    pub(super) fn render(&self, result: &str) -> String {
        let seed = self.seed.as_deref().unwrap_or("none");
        let rests_on: Vec<_> = self.rests_on.iter().map(|it| format!("`{it}`")).collect();
        format!(
            "# Evidence: {name}\n\n\
             {purpose}\n\n\
             Written by `cargo xtask {verb}`; not edited by hand.\n\n\
             | | |\n\
             |---|---|\n\
             | Command | `{command}` |\n\
             | Commit | {commit} |\n\
             | Rests on | {rests_on} |\n\
             | Seed | {seed} |\n\
             | Date | {date} (UTC) |\n\
             | Toolchain | {toolchain} |\n\
             | Duration | {seconds} s, building included |\n\n\
             {result}\n",
            name = self.name,
            verb = self.verb,
            purpose = self.purpose,
            command = self.command,
            commit = self.origin.commit,
            rests_on = rests_on.join(", "),
            date = self.origin.date,
            toolchain = self.origin.toolchain,
            seconds = self.seconds,
        )
    }
}

/// The commit and the paths that a page names in its heading's table.
pub(super) fn origin(page: &str) -> Result<(&str, Vec<&str>)> {
    let commit = cell(page, "Commit")?;
    let commit = commit.strip_suffix(" (dirty)").unwrap_or(commit);
    let paths = cell(page, "Rests on")?.split(", ");
    Ok((commit, paths.map(|path| path.trim_matches('`')).collect()))
}

/// What stands beside a label in the table.
fn cell<'p>(page: &'p str, label: &str) -> Result<&'p str> {
    let start = format!("| {label} | ");
    page.lines()
        .find_map(|line| line.strip_prefix(&start)?.strip_suffix(" |"))
        .with_context(|| format!("the table has no row `{label}`"))
}

/// The result between the two markers of a campaign's output.
pub(super) fn result(printed: &str) -> Result<&str> {
    let Some((_, rest)) = split_once_at_line_end(printed, BEGIN) else {
        bail!("the line `{BEGIN}` is missing");
    };
    let Some((result, after)) = split_once_at_line_end(rest, END) else {
        bail!("the line `{END}` is missing after `{BEGIN}`");
    };
    if result.contains(BEGIN) || after.contains(BEGIN) {
        bail!("`{BEGIN}` stands there twice; a campaign has one result");
    }
    if result.trim().is_empty() {
        bail!("nothing stands between `{BEGIN}` and `{END}`");
    }
    Ok(result.trim())
}

/// Splits a text around the first marker that ends its line.
fn split_once_at_line_end<'a>(text: &'a str, marker: &str) -> Option<(&'a str, &'a str)> {
    text.match_indices(marker).find_map(|(at, _)| {
        let rest = &text[at + marker.len()..];
        let rest = rest.strip_prefix('\r').unwrap_or(rest);
        let after = if rest.is_empty() {
            Some(rest)
        } else {
            rest.strip_prefix('\n')
        };
        after.map(|after| (&text[..at], after))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_result_is_what_stands_between_the_markers() {
        let printed = format!("noise\n{BEGIN}\n## A\n\ntext\n{END}\nnoise\n");
        assert_eq!(result(&printed).unwrap(), "## A\n\ntext");
    }

    #[test]
    fn the_begin_marker_may_follow_the_harness_on_its_line() {
        let printed = format!("test long_run ... {BEGIN}\ntext\n{END}\nok\n");
        assert_eq!(result(&printed).unwrap(), "text");
    }

    #[test]
    fn a_marker_quoted_within_a_line_is_none() {
        let printed = format!("prints {BEGIN} first\n{BEGIN}\ntext\n{END}\n");
        assert_eq!(result(&printed).unwrap(), "text");
    }

    #[test]
    fn a_broken_result_is_an_error_that_says_what_is_broken() {
        for (printed, cause) in [
            ("text\n".to_owned(), "begin -->` is missing"),
            (format!("{BEGIN}\ntext\n"), "end -->` is missing"),
            (format!("{END}\n{BEGIN}\ntext\n"), "end -->` is missing"),
            (format!("{BEGIN}\n \n{END}\n"), "nothing stands"),
            (
                format!("{BEGIN}\na\n{END}\n{BEGIN}\nb\n{END}\n"),
                "stands there twice",
            ),
        ] {
            let message = result(&printed).unwrap_err().to_string();
            assert!(message.contains(cause), "{message}");
        }
    }

    #[test]
    fn the_file_states_where_its_result_comes_from() {
        let record = Record {
            name: "trial",
            verb: "evidence trial".to_owned(),
            purpose: "A trial.",
            command: "cargo run -- --seed 7".to_owned(),
            seed: Some("7".to_owned()),
            origin: Origin {
                commit: "0123abcd (dirty)".to_owned(),
                date: "2026-02-03".to_owned(),
                toolchain: "rustc 1.95.0".to_owned(),
            },
            rests_on: &["model/src", "tests"],
            seconds: 61,
        };
        let text = record.render("## Result");
        for line in [
            "# Evidence: trial",
            "| Command | `cargo run -- --seed 7` |",
            "| Commit | 0123abcd (dirty) |",
            "| Rests on | `model/src`, `tests` |",
            "| Seed | 7 |",
            "| Date | 2026-02-03 (UTC) |",
            "| Toolchain | rustc 1.95.0 |",
            "| Duration | 61 s, building included |",
            "## Result",
        ] {
            assert!(text.lines().any(|l| l == line), "no line `{line}`");
        }
        let (commit, paths) = origin(&text).unwrap();
        assert_eq!((commit, paths), ("0123abcd", vec!["model/src", "tests"]));
    }
}
