//! `palpate doctor`: finds defects of a board and of its connection.

mod examination;
mod findings;

use std::io::{self, Write};

use clap::Args;
use examination::Examination;
use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use palpate_wire::Command;
use palpate_wire::code::{FaultCode, Outcome};
use palpate_wire::command::ClearFault;
use serde::Serialize;

use crate::board::link::{self, Link};

/// Find out what is wrong with a board, or with the way to it
///
/// Connects, listens for two seconds, disarms the board, and asks for its storage and calibration. It sets and
/// stores nothing.
#[derive(Args)]
#[command(after_help = "\
Prints each finding with its cause and what to do. Exit code 0 if nothing is wrong, 1 otherwise.

A board reports a fault when it begins. Of one that began earlier only its presence is known; --clear \
names it: it clears the fault, and reports whether it recurs.

Examples:
  palpate doctor
  palpate doctor --board emulated --json")]
pub(crate) struct Arguments {
    #[command(flatten)]
    link: link::Arguments,
    /// Clear the active fault, and report whether it recurs
    #[arg(long)]
    clear: bool,
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
}

impl Report {
    const fn of(board: Option<String>, findings: Vec<Finding>) -> Self {
        Self {
            board,
            cleared: None,
            findings,
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let report = report(arguments)?;
    print(&report, arguments.json)?;
    match report.findings.len() {
        0 => Ok(()),
        1 => Err(Failure::Refused("1 finding".to_owned())),
        several => Err(Failure::Refused(format!("{several} findings"))),
    }
}

fn report(arguments: &Arguments) -> Result<Report, Failure> {
    let mut link = match arguments.link.open() {
        Ok(link) => link,
        Err(Failure::Unconnected(finding)) => return Ok(Report::of(None, vec![finding])),
        Err(other) => return Err(other),
    };
    let board = Some(link.name().to_owned());
    Ok(match examined(&mut link, arguments.clear) {
        Ok((cleared, examination)) => Report {
            cleared,
            ..Report::of(board, findings::of(&examination))
        },
        Err(failure) => Report::of(board, vec![Finding::of(failure)]),
    })
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
    if report.findings.is_empty() {
        let board = report.board.as_deref().unwrap_or_default();
        writeln!(out, "{board}: nothing is wrong.")?;
    }
    Ok(())
}
