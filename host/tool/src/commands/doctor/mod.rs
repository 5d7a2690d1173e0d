//! `palpate doctor`: finds defects of a board and of its connection.

mod examination;
mod findings;
mod lines;
mod measured;
#[cfg(test)]
mod tests;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use examination::Examination;
use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use palpate_cli::notice;
use palpate_cli::quantity::within;
use palpate_wire::Command;
use palpate_wire::code::{FaultCode, Outcome};
use palpate_wire::command::ClearFault;
use serde::Serialize;

use crate::board::configuration;
use crate::board::link::{self, Link};
use crate::commands::acceptance::{self, Line, Promise, ReportFile, Verdict};
use measured::Measured;

/// Find out what is wrong with a board, or with the way to it
///
/// Connects, listens for two seconds, disarms the board, and asks for its storage and calibration. It sets and
/// stores nothing. With --expect it also arms the board, tests its coil, holds a current and waits for drift, and
/// compares what the board measures with its design.
#[derive(Args)]
#[command(after_help = "\
Prints each finding with its cause and what to do. Exit code 0 if nothing is wrong, 1 otherwise.

A board reports a fault when it begins. Of one that began earlier only its presence is known; --clear \
names it: it clears the fault, and reports whether it recurs.

--expect compares, line by line: coil (resistance, inductance), bridge, current, supply, frequency of the untouched \
sensor, noise and drift. The coil gets up to 6 A for a tenth of a second and 3 A for a quarter of one. If the board \
has no data of its coil it gets the design's, which it does not store. The quality factor of the tank is measured by \
`palpate bring-up`.

Examples:
  palpate doctor
  palpate doctor --board emulated --json
  palpate doctor --board emulated --expect ultrasoft --for 1 --report report.md")]
pub(crate) struct Arguments {
    #[command(flatten)]
    link: link::Arguments,
    /// Clear the active fault, and report whether it recurs
    #[arg(long)]
    clear: bool,
    /// Compare with this design: paper, soft-closed, ultrasoft, or a stack file (`palpate field stack` makes one)
    #[arg(long, value_name = "STACK")]
    expect: Option<String>,
    /// Frequency of the untouched sensor, MHz; without it, that of the reference coil with 330 pF
    #[arg(long, value_name = "MHZ", requires = "expect", value_parser = within(0.01, 10.0, "MHz"))]
    frequency: Option<f64>,
    /// Time over which drift is measured, s
    #[arg(long = "for", value_name = "SECONDS", default_value_t = 600.0, value_parser = within(0.1, 1e5, "s"))]
    seconds: f64,
    /// Write a report to send in: Markdown, or JSON if the name ends in .json
    #[arg(long, value_name = "FILE", requires = "expect")]
    report: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// JSON output.
#[derive(Serialize)]
struct Report {
    /// Location of the board; absent if no board was reached.
    board: Option<String>,
    /// The cleared fault.
    cleared: Option<FaultCode>,
    findings: Vec<Finding>,
    /// Comparison with the design; absent without one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lines: Vec<Line>,
}

impl Report {
    const fn of(board: Option<String>, findings: Vec<Finding>) -> Self {
        Self {
            board,
            cleared: None,
            findings,
            lines: Vec::new(),
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = ReportFile::named(arguments.report.as_ref())?;
    let frequency_hz = arguments.frequency.map(|mhz| 1e6 * mhz);
    let promise = arguments.expect.as_ref();
    let promise = promise
        .map(|name| Promise::of(name, frequency_hz))
        .transpose()?;
    let report = report(arguments, promise.as_ref(), file.as_ref())?;
    print(&report, arguments.json)?;
    if let Some(file) = file {
        notice::say(format_args!("report: {}", file.path().display()));
    }
    let off = report
        .lines
        .iter()
        .filter(|line| line.verdict != Verdict::AsExpected)
        .count();
    match (report.findings.len(), off) {
        (0, 0) => Ok(()),
        (1, 0) => Err(Failure::Refused("1 finding".to_owned())),
        (several, 0) => Err(Failure::Refused(format!("{several} findings"))),
        (findings, off) => Err(Failure::Refused(format!(
            "{off} lines are not as expected; {findings} findings"
        ))),
    }
}

fn report(
    arguments: &Arguments,
    promise: Option<&Promise>,
    file: Option<&ReportFile>,
) -> Result<Report, Failure> {
    let mut link = match arguments.link.open() {
        Ok(link) => link,
        Err(Failure::Unconnected(finding)) => return Ok(Report::of(None, vec![finding])),
        Err(other) => return Err(other),
    };
    let board = Some(link.name().to_owned());
    let (cleared, examination) = match examined(&mut link, arguments.clear) {
        Ok(examined) => examined,
        Err(failure) => return Ok(Report::of(board, vec![Finding::of(failure)])),
    };
    let mut report = Report {
        cleared,
        ..Report::of(board, findings::of(&examination))
    };
    if let Some(promise) = promise {
        let settings = configuration::settings(&mut link)?;
        let measured = Measured::of(&mut link, promise, &settings, arguments.seconds)?;
        report.lines = lines::of(&measured, promise);
        if let Some(file) = file {
            file.write(&acceptance::Report::new(
                ("palpate doctor", arguments.link.is_simulated(&link)),
                [
                    serde_json::to_value(&examination.hello)?,
                    serde_json::to_value(&settings)?,
                ],
                promise.stack.file(),
                (&report.lines, &report.findings),
            ))?;
        }
    }
    Ok(report)
}

/// Examines a board. Returns the cleared fault, and the examination after that.
fn examined(link: &mut Link, clears: bool) -> Result<(Option<FaultCode>, Examination), Failure> {
    let examination = Examination::of(link)?;
    if !clears || !examination.is_faulted() {
        return Ok((None, examination));
    }
    let cleared = clear(link)?;
    Ok((cleared, Examination::of(link)?))
}

/// Clears the active fault and returns it; `None` if it cannot be cleared.
fn clear(link: &mut Link) -> Result<Option<FaultCode>, Failure> {
    for &code in FaultCode::ALL {
        let (_, outcome) = link.ask(&Command::ClearFault(ClearFault { code }))?;
        if outcome == Outcome::Accepted {
            // Drops the records of the fault.
            link.take();
            return Ok(Some(code));
        }
    }
    Ok(None)
}

fn print(report: &Report, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(report)?)?);
    }
    if let Some(code) = report.cleared {
        writeln!(out, "{code} was active and has been cleared.")?;
    }
    for finding in &report.findings {
        writeln!(out, "{}", finding.finding)?;
        writeln!(out, "  Cause:  {}.", finding.cause.trim_end_matches('.'))?;
        writeln!(out, "  Action: {}.", finding.action.trim_end_matches('.'))?;
    }
    if !report.lines.is_empty() {
        writeln!(out, "{}", acceptance::table(&report.lines))?;
    }
    if report.findings.is_empty()
        && (report.lines.iter()).all(|line| line.verdict == Verdict::AsExpected)
    {
        let board = report.board.as_deref().unwrap_or_default();
        writeln!(out, "{board}: nothing is wrong.")?;
    }
    Ok(())
}
