//! The report of an acceptance: a file to keep and to send in.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use comfy_table::Table;
use comfy_table::presets::NOTHING;
use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use palpate_cli::output::OutputFile;
use palpate_wire::{MINOR_VERSION, SCHEMA_HASH, VERSION};
use serde::Serialize;
use serde_json::Value;

use super::{Line, Verdict, engineering};
use crate::recording::date;

/// A file for a report: JSON if its name ends so, else Markdown.
pub(crate) struct ReportFile(OutputFile);

impl ReportFile {
    /// Checks that the file can be written.
    pub(crate) fn named(path: Option<&PathBuf>) -> Result<Option<Self>, Failure> {
        Ok(OutputFile::optional("--report", path)?.map(Self))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn write(&self, report: &Report) -> Result<(), Failure> {
        let ending = self.path().extension();
        if ending.is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            return self.0.write(serde_json::to_vec_pretty(report)?);
        }
        self.0.write(report.markdown()?)
    }
}

/// All that a reader needs who has neither board nor design.
#[derive(Serialize)]
pub(crate) struct Report {
    /// Command that made the report.
    command: &'static str,
    tool: &'static str,
    protocol: String,
    written_at: String,
    /// The data are simulated.
    simulated: bool,
    /// Identity of the board as it sent it; absent without one.
    board: Value,
    /// Settings of the board, or of the measurement.
    settings: Value,
    /// The design as a stack file.
    design: String,
    lines: Vec<Line>,
    findings: Vec<Finding>,
}

impl Report {
    pub(crate) fn new(
        (command, simulated): (&'static str, bool),
        [board, settings]: [Value; 2],
        design: String,
        (lines, findings): (&[Line], &[Finding]),
    ) -> Self {
        Self {
            command,
            tool: concat!("palpate ", env!("CARGO_PKG_VERSION")),
            protocol: format!("{VERSION}.{MINOR_VERSION}, schema {SCHEMA_HASH:08x}"),
            written_at: date::text(date::now_ns()),
            simulated,
            board,
            settings,
            design,
            lines: lines.to_vec(),
            findings: findings.to_vec(),
        }
    }

    fn markdown(&self) -> Result<String, Failure> {
        let mut text = format!(
            "# Report of `{}`\n\n{}{}, protocol {}, {}\n",
            self.command,
            if self.simulated {
                "**Simulated board.** "
            } else {
                ""
            },
            self.tool,
            self.protocol,
            self.written_at
        );
        text.push_str(
            "\n| quantity | measured | expected | verdict | because |\n|---|---|---|---|---|\n",
        );
        for line in &self.lines {
            let [quantity, measured, expected, verdict] = cells(line);
            let _ = writeln!(
                text,
                "| {quantity} | {measured} | {expected} | {verdict} | {} |",
                line.because
            );
        }
        text.push_str("\n## What to do\n\n");
        let actions = actions(&self.lines);
        for (quantity, action) in &actions {
            let _ = writeln!(text, "- {quantity}: {action}.");
        }
        for finding in &self.findings {
            let _ = writeln!(
                text,
                "- {}: {}.",
                finding.finding,
                finding.to_string().trim_end_matches('.')
            );
        }
        if actions.is_empty() && self.findings.is_empty() {
            text.push_str("Nothing.\n");
        }
        for (title, value) in [("Board", &self.board), ("Settings", &self.settings)] {
            let value = serde_json::to_string_pretty(value)?;
            let _ = write!(text, "\n## {title}\n\n```json\n{value}\n```\n");
        }
        let _ = write!(
            text,
            "\n## Design\n\n```toml\n{}\n```\n",
            self.design.trim_end()
        );
        Ok(text)
    }
}

/// Cells of a line: quantity, measured, expected, verdict.
fn cells(line: &Line) -> [String; 4] {
    let show = |value| engineering(value, line.unit);
    let [least, greatest] = line.expected;
    let expected = match (least, greatest) {
        (least, greatest) if least == greatest => show(least),
        (least, greatest) if least == -greatest => format!("within {}", show(greatest)),
        (0.0, greatest) => format!("{} at most", show(greatest)),
        (least, greatest) => format!("{} to {}", show(least), show(greatest)),
    };
    [
        line.quantity.clone(),
        line.measured.map_or_else(|| "-".to_owned(), show),
        expected,
        line.verdict.text().to_owned(),
    ]
}

/// The lines as a table, and what to do below it.
pub(crate) fn table(lines: &[Line]) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING);
    for line in lines {
        table.add_row(cells(line));
    }
    let mut text = table.to_string();
    for (quantity, action) in actions(lines) {
        let _ = write!(text, "\n{quantity}: {action}.");
    }
    text
}

/// Quantity and action of each line that asks for one; those that are off come first.
fn actions(lines: &[Line]) -> Vec<(&str, &str)> {
    let mut of: Vec<&Line> = lines.iter().filter(|line| line.action.is_some()).collect();
    of.sort_by_key(|line| line.verdict == Verdict::NotMeasured);
    of.into_iter()
        .map(|line| {
            let action = line.action.as_deref().unwrap_or_default();
            (line.quantity.as_str(), action.trim_end_matches('.'))
        })
        .collect()
}
