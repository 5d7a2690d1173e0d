//! Text of the evidence: a row of the overview for each campaign, and a page of details for some.

use anyhow::{Result, bail};

use super::provenance::Origin;

/// Marker at the end of the line before a campaign's result. The line may begin with anything,
/// since the test harness prints a test's name without ending its line.
pub(crate) const BEGIN: &str = "<!-- evidence:begin -->";

/// Marker that is the line after a campaign's result.
pub(crate) const END: &str = "<!-- evidence:end -->";

/// A campaign's result and its origin.
#[derive(Debug)]
pub(super) struct Record {
    /// Name of the campaign.
    pub(super) name: &'static str,
    /// Claim that the result shows.
    pub(super) claim: &'static str,
    /// The command of the run, with its seed.
    pub(super) command: String,
    /// Sources, day and compiler of the run.
    pub(super) origin: Origin,
    /// Duration of the run and its build, s.
    pub(super) seconds: u64,
    /// The result in one or two sentences.
    pub(super) figure: String,
    /// Details behind the figure, as Markdown; empty where the figure is enough.
    pub(super) details: String,
}

impl Record {
    /// Command, commit, and the rest of the result's origin.
    fn provenance(&self) -> [String; 3] {
        let Origin {
            commit,
            date,
            toolchain,
        } = &self.origin;
        let version = toolchain.split(" (").next().unwrap_or_default();
        [
            format!("`{}`", self.command),
            commit.clone(),
            format!("{date}, {version}, {} s", self.seconds),
        ]
    }

    /// The result's row of the overview.
    pub(super) fn row(&self) -> String {
        let name = if self.details.is_empty() {
            self.name.to_owned()
        } else {
            format!("[{name}]({name}.md)", name = self.name)
        };
        let [command, commit, origin] = self.provenance();
        let (claim, figure) = (self.claim, self.figure.replace('|', "\\|"));
        format!("| {name}: {claim} | {figure} | {command} at {commit}, {origin} |")
    }

    /// The page with the result's details.
    pub(super) fn page(&self) -> String {
        let Self {
            name,
            claim,
            details,
            ..
        } = self;
        format!(
            "# Evidence: {name}\n\n{claim}\nFigure, command and date: [Evidence](README.md). Written by `cargo xtask evidence`.\n\n{details}\n"
        )
    }
}

/// The overview with this row in place of the campaign's previous one, or at the end.
pub(super) fn with_row(overview: &str, name: &str, row: &str) -> String {
    let mut lines: Vec<&str> = overview.lines().collect();
    match lines.iter().position(|line| is_row_of(line, name)) {
        Some(at) => lines[at] = row,
        None => lines.push(row),
    }
    lines.join("\n") + "\n"
}

/// The commit in a campaign's row; `None` where no result was kept.
pub(super) fn commit<'o>(overview: &'o str, name: &str) -> Option<&'o str> {
    let row = overview.lines().find(|line| is_row_of(line, name))?;
    let (_, origin) = row.rsplit_once("` at ")?;
    let (commit, _) = origin.split_once(", ")?;
    Some(commit.strip_suffix(" (dirty)").unwrap_or(commit))
}

fn is_row_of(line: &str, name: &str) -> bool {
    let start = [format!("| {name}: "), format!("| [{name}](")];
    start.iter().any(|start| line.starts_with(start))
}

/// Text between the two markers of a campaign's output: its first paragraph, the figure, on one
/// line, and the details.
pub(super) fn result(printed: &str) -> Result<(String, String)> {
    let Some((_, rest)) = split_once_at_line_end(printed, BEGIN) else {
        bail!("the line `{BEGIN}` is missing");
    };
    let Some((result, after)) = split_once_at_line_end(rest, END) else {
        bail!("the line `{END}` is missing after `{BEGIN}`");
    };
    if result.contains(BEGIN) || after.contains(BEGIN) {
        bail!("`{BEGIN}` stands there twice; a campaign has one result");
    }
    let result = result.trim();
    let (figure, details) = result.split_once("\n\n").unwrap_or((result, ""));
    if figure.is_empty() || figure.starts_with(['|', '#', '-']) {
        bail!("no sentence follows `{BEGIN}`");
    }
    Ok((figure.replace('\n', " "), details.trim().to_owned()))
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

    #[track_caller]
    fn is_result(printed: &str, figure: &str, details: &str) {
        let expected = (figure.to_owned(), details.to_owned());
        assert_eq!(result(printed).unwrap(), expected);
    }

    #[test]
    fn the_result_is_what_stands_between_the_markers() {
        let printed = format!("noise\n{BEGIN}\n3 of\n3.\n\n## A\n\ntext\n{END}\nnoise\n");
        is_result(&printed, "3 of 3.", "## A\n\ntext");
    }

    #[test]
    fn the_begin_marker_may_follow_the_harness_on_its_line() {
        let printed = format!("test long_run ... {BEGIN}\ntext\n{END}\nok\n");
        is_result(&printed, "text", "");
    }

    #[test]
    fn a_marker_quoted_within_a_line_is_none() {
        let printed = format!("prints {BEGIN} first\n{BEGIN}\ntext\n{END}\n");
        is_result(&printed, "text", "");
    }

    #[test]
    fn a_broken_result_is_an_error_that_says_what_is_broken() {
        for (printed, cause) in [
            ("text\n".to_owned(), "begin -->` is missing"),
            (format!("{BEGIN}\ntext\n"), "end -->` is missing"),
            (format!("{END}\n{BEGIN}\ntext\n"), "end -->` is missing"),
            (format!("{BEGIN}\n \n{END}\n"), "no sentence"),
            (
                format!("{BEGIN}\n## Result\n\ntext\n{END}\n"),
                "no sentence",
            ),
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
    fn a_row_states_where_the_result_comes_from_and_the_page_refers_to_it() {
        let mut record = Record {
            name: "trial",
            claim: "A trial.",
            command: "cargo run -- --seed 7".to_owned(),
            origin: Origin {
                commit: "0123abcd (dirty)".to_owned(),
                date: "2026-02-03".to_owned(),
                toolchain: "rustc 1.95.0 (0123 2026-01-02)".to_owned(),
            },
            seconds: 61,
            figure: "3 of |x|.".to_owned(),
            details: "text".to_owned(),
        };
        let row = "| [trial](trial.md): A trial. | 3 of \\|x\\|. | `cargo run -- --seed 7` at 0123abcd (dirty), \
                   2026-02-03, rustc 1.95.0, 61 s |";
        assert_eq!(record.row(), row);
        let page = record.page();
        assert!(page.starts_with(
            "# Evidence: trial\n\nA trial.\nFigure, command and date: [Evidence](README.md)."
        ));
        assert!(page.ends_with("\n\ntext\n"));
        // A row replaces the previous row of its campaign, whatever page the previous one named.
        let overview = with_row("# Evidence\n\n| trials: a | b | c |\n", "trial", row);
        record.details.clear();
        let overview = with_row(&overview, "trial", &record.row());
        assert_eq!(overview.lines().count(), 4);
        assert!(overview.ends_with(&format!("\n{}\n", record.row())));
        assert!(record.row().starts_with("| trial: A trial. |"));
        assert_eq!(commit(&overview, "trial"), Some("0123abcd"));
        assert_eq!(commit(&overview, "tri"), None);
    }
}
