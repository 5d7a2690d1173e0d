//! `palpate bring-up`: settle on a first board the behaviour about which sources disagree.

mod converter;
mod link;
mod tests;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use converter::Converter;
use ldc161x_sim::{Settings, Switches};
use link::Link;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_cli::output::OutputFile;
use palpate_cli::progress::Progress;
use palpate_emulator::{EmulatedBoard, Options, Still};
use serde::Serialize;
use tests::{Tank, Tests};

use crate::board::image::{self, Program};
use crate::board::switches;
use crate::commands::acceptance::{self, Line, Promise, ReportFile, Verdict};

/// Settle on a board what sources disagree about in the converter, and write it as settings
///
/// Runs the tests of docs/bring-up.md, with the image bring_up on the board, and writes what they
/// find as the switches of the simulated converter.
#[derive(Args)]
#[command(after_help = "\
A board is reached through the server of its debug probe, at channel 0 of its RTT; \
docs/bring-up.md has the command for OpenOCD. Leave its sensor untouched, and its coil without supply.

--expect compares frequency and quality factor of the tank with a design: a wrong capacitor, a bad joint or metal near \
the coil shows there. `palpate doctor --expect` compares everything else, with the usual image.

`palpate chip --switches FILE.toml` runs the driver against a converter with these switches.

Examples:
  palpate bring-up --connect localhost:9090    # needs a probe
  palpate bring-up --emulated --settings found.toml
  palpate bring-up --emulated --expect ultrasoft --report tank.md
  palpate bring-up --emulated --switches found.toml")]
pub(crate) struct Arguments {
    /// The probe's server, as HOST:PORT
    #[arg(
        long,
        value_name = "HOST:PORT",
        required_unless_present = "emulated",
        conflicts_with = "emulated"
    )]
    connect: Option<String>,
    /// The emulated board instead
    #[arg(long)]
    emulated: bool,
    #[command(flatten)]
    image: image::Arguments,
    /// Switches of the emulated board's converter, instead of the defaults
    #[arg(long, value_name = "FILE.toml", requires = "emulated")]
    switches: Option<PathBuf>,
    /// On a real board, ask the user to interrupt the converter's supply, and find which registers
    /// that changes
    #[arg(long, requires = "connect")]
    dip: bool,
    /// Where the switches that were found are written
    #[arg(long, value_name = "FILE.toml", default_value = "bring-up.toml")]
    settings: PathBuf,
    /// Compare the tank with this design: paper, soft-closed, ultrasoft, or a stack file
    #[arg(long, value_name = "STACK")]
    expect: Option<String>,
    /// Write a report to send in: Markdown, or JSON if the name ends in .json
    #[arg(long, value_name = "FILE", requires = "expect")]
    report: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A line of the JSON output.
#[derive(Serialize)]
struct TestLine<'t> {
    simulated: bool,
    test: &'t str,
    found: &'t str,
}

/// Number of tests, for the progress bar.
const TESTS: usize = 17;
/// Frequencies of the emulated sensors at rest, Hz.
const SENSORS_HZ: [f64; 4] = [3.1e6, 3.2e6, 3.3e6, 3.4e6];

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let settings = OutputFile::new("--settings", &arguments.settings)?;
    let report = ReportFile::named(arguments.report.as_ref())?;
    let promise = arguments
        .expect
        .as_ref()
        .map(|name| Promise::of(name, None))
        .transpose()?;
    let link = match &arguments.connect {
        Some(address) => {
            arguments.image.none_without("--emulated")?;
            Link::connect(address)?
        }
        None => emulated(arguments)?,
    };
    let mut tests = Tests::new(Converter(link));
    let progress = Progress::new(TESTS);
    let ended = tests.run(arguments.dip, || progress.step());
    progress.finish();
    if ended.is_err() {
        // The results before the failure help to find its cause.
        print(arguments, &tests)?;
    }
    ended?;
    let text = switches::document(tests.switches)?;
    print(arguments, &tests)?;
    settings.write(text)?;
    notice::say(format_args!("switches: {}", settings.path().display()));
    let Some(promise) = promise else {
        return Ok(());
    };
    let lines = lines(&tests.tank, &promise);
    show(arguments.json, &lines)?;
    if let Some(file) = report {
        file.write(&acceptance::Report::new(
            ("palpate bring-up", arguments.emulated),
            [found(&tests), serde_json::to_value(tests.switches)?],
            promise.stack.file(),
            (&lines, &[]),
        ))?;
        notice::say(format_args!("report: {}", file.path().display()));
    }
    if lines.iter().all(|line| line.verdict == Verdict::AsExpected) {
        return Ok(());
    }
    Err(Failure::Refused("the tank is not the design's".to_owned()))
}

/// The tank against the design.
fn lines(tank: &Tank, promise: &Promise) -> Vec<Line> {
    let capacitor = tank.frequency_hz.map_or_else(
        || "Check the sensor's plug and the tank's joints: it does not oscillate".to_owned(),
        |hz| promise.capacitor(hz),
    );
    let quality = tank
        .parallel_ohm
        .map(|[least, greatest]| (least * greatest).sqrt() / promise.impedance_ohm());
    vec![
        Line::new(
            "frequency of the untouched sensor",
            "Hz",
            tank.frequency_hz,
            promise.frequency_hz(),
            capacitor,
        ),
        Line::new(
            "quality factor of the tank",
            "",
            quality,
            promise.quality(),
            "Low: a bad joint, metal near the coil without the copper plane, or a capacitor that is not C0G. High or none: \
             check the capacitor's value, and that the coil is the design's",
        ),
    ]
}

/// What the tests found, for the report.
fn found(tests: &Tests) -> serde_json::Value {
    let found = tests
        .findings
        .iter()
        .map(|of| (of.test.to_owned(), of.found.clone().into()));
    serde_json::Value::Object(found.collect())
}

fn show(json: bool, lines: &[Line]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        for line in lines {
            writeln!(out, "{}", serde_json::to_string(line)?)?;
        }
        return Ok(());
    }
    writeln!(out, "{}", acceptance::table(lines))?;
    Ok(())
}

fn emulated(arguments: &Arguments) -> Result<Link, Failure> {
    let switches = match &arguments.switches {
        Some(file) => switches::read(file)?,
        None => Switches::default(),
    };
    let (_, image) = arguments.image.load(Program::BringUp)?;
    let settings = Settings {
        switches,
        ..Settings::default()
    };
    let plant = Still::new(SENSORS_HZ);
    let board = EmulatedBoard::new(&image, plant, settings, Options::default());
    Ok(Link::Emulated(Box::new(board)))
}

fn print(arguments: &Arguments, tests: &Tests) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if arguments.json {
        for finding in &tests.findings {
            let line = TestLine {
                simulated: arguments.emulated,
                test: finding.test,
                found: &finding.found,
            };
            writeln!(out, "{}", serde_json::to_string(&line)?)?;
        }
        return Ok(());
    }
    let mut table = Table::new();
    table.load_style(NOTHING);
    for finding in &tests.findings {
        table.add_row([finding.test, &finding.found]);
    }
    if arguments.emulated {
        writeln!(out, "simulated converter on the emulated board")?;
    }
    Ok(writeln!(out, "{table}")?)
}
