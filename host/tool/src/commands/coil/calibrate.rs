//! `palpate calibrate current`: calibration of the current measurement against a reference.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Process, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::progress::Progress;
use palpate_wire::command::{CurrentCorrection, DriveCoil, MAX_POINTS};
use palpate_wire::{Command, Message, Record};
use serde::Serialize;

use super::{allowed_a, armed, open};
use crate::board::configuration;
use crate::board::link::{self, Link};

/// Calibrate the measurement of the coil's current against a reference
///
/// Drives 25 currents of both signs, compares what the board measures with what the reference says,
/// sends the board a correction, and checks currents in between. The correction is lost with the
/// board's power: the file has it as a command for `palpate encode`.
#[derive(Args)]
#[command(after_help = "\
The reference is a program that prints the coil's current in ampere when it is run, for example by a \
bench meter at a shunt in series with the coil. While it runs the current swings over 0.12 A in 80 ms: \
let it average over a tenth of a second or more. It may take a second; the coil \
rests afterwards.

Examples:
  palpate calibrate current --stack mine.toml --reference ./read-meter    # needs a board
  palpate calibrate current --board emulated
  palpate encode --boot 305419896 < current.jsonl > commands.bin")]
pub(crate) struct Arguments {
    #[command(flatten)]
    link: link::Arguments,
    /// The program that reads the reference. The emulated board's is its true current
    #[arg(long, value_name = "PROGRAM")]
    reference: Option<PathBuf>,
    /// Greatest current, A. Otherwise the greatest that supply and settings allow
    #[arg(long, value_name = "A")]
    greatest: Option<f64>,
    /// Where the command that sets the correction is written
    #[arg(long, value_name = "FILE.jsonl", default_value = "current.jsonl")]
    output: PathBuf,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Number of currents on either side of zero, and of checks between them.
const STEPS: i32 = 12;
const CHECKS: i32 = 6;
/// Amplitude of the sweep about a current, A. It makes the effect of a wide code of the converter
/// (eight codes, 52 mA) as small as in use. A meter that averages over a tenth of a second, not
/// over whole sweeps, is then off by 6 mA at most.
const ABOUT_A: f64 = 0.06;
/// Duration of the sweep in one direction, and time before it in which the current settles, s.
const SWEEP_S: f64 = link::KEEP_ALIVE_S;
const SETTLE_S: f64 = 0.01;
/// Time at both ends of a sweep that is not evaluated, s: one conversion of 1 ms, so that all
/// evaluated conversions lie within the sweep.
const EDGE_S: f64 = 1e-3;
/// Power at which the coil can be driven continuously, W, with a margin: the paper states 3 A
/// continuously in 0.39 ohm.
const CONTINUOUS_W: f64 = 3.0;
/// Greatest energy of one reading, J: together with the heat left from earlier readings it stays
/// within the 60 J that the firmware allows.
const MOST_J: f64 = 40.0;
/// Longest time that a reference may take for a reading, s.
const PATIENCE_S: f64 = 5.0;

/// Setpoint, measured and true current.
#[derive(Clone, Copy, Debug, Serialize)]
struct Pair {
    wanted_a: f64,
    reported_a: f64,
    true_a: f64,
}

impl Pair {
    /// Deviation of the true current from the setpoint, A.
    fn off_a(&self) -> f64 {
        self.true_a - self.wanted_a
    }
}

#[derive(Serialize)]
struct CurrentCalibration<'f> {
    simulated: bool,
    before: &'f [Pair],
    after: &'f [Pair],
    worst_before_a: f64,
    worst_after_a: f64,
    correction: &'f CurrentCorrection,
}

/// Sources of the true current.
enum Reference<'r> {
    Program(&'r Path),
    /// The emulated circuit.
    Truth,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = OutputFile::new("--output", &arguments.output)?;
    let mut link = open(&arguments.link)?;
    let settings = configuration::settings(&mut link)?;
    // Resets the correction in force, which would be measured too.
    link.send_accepted(&Command::SetCurrentCorrection(correction_of(&[
        [-1.0, -1.0],
        [1.0, 1.0],
    ])))?;
    let test = armed(&mut link)?;
    let allowed_a = allowed_a(&settings, &test);
    let greatest_a = match arguments.greatest {
        None => allowed_a,
        Some(greatest_a) if (2.0..=allowed_a).contains(&greatest_a) => greatest_a,
        Some(greatest_a) => {
            return Err(Failure::Argument(format!(
                "--greatest {greatest_a}: allowed are 2 to {allowed_a:.1} A"
            )));
        }
    };
    let mut bench = CurrentBench {
        link,
        reference: match &arguments.reference {
            Some(program) if !arguments.link.is_emulated() => Reference::Program(program),
            _ => Reference::Truth,
        },
        ohm: test.resistance_ohm.into(),
    };
    let progress = Progress::new((2 * STEPS + 1 + 2 * CHECKS) as usize);
    progress.say("measuring");
    let step_a = (greatest_a - ABOUT_A) / f64::from(STEPS);
    let before = bench.pairs(
        (-STEPS..=STEPS).map(|step| step_a * f64::from(step)),
        &progress,
    )?;
    bench.link.send_accepted(&Command::Disarm)?;
    let pairs: Vec<[f64; 2]> = before
        .iter()
        .map(|pair| [pair.reported_a, pair.true_a])
        .collect();
    check(&pairs)?;
    let correction = correction_of(&pairs);
    let command = Command::SetCurrentCorrection(correction.clone());
    command.validate().map_err(|invalid| {
        let invalid = invalid.named(command.payload());
        Failure::Refused(format!(
            "the board would refuse this correction ({invalid}): are the reference's unit and \
             sign right, and the amplifier's 0.125 V/A?"
        ))
    })?;
    bench.link.send_accepted(&command)?;
    progress.say("checking");
    armed(&mut bench.link)?;
    let between = |check: i32| {
        let size_a = step_a * (2.0 * f64::from(check.abs()) - 0.5);
        size_a * f64::from(check.signum())
    };
    let checks = (-CHECKS..=CHECKS).filter(|check| *check != 0).map(between);
    let after = bench.pairs(checks, &progress)?;
    bench.link.send_accepted(&Command::Disarm)?;
    progress.finish();
    let written = file.write(format!("{}\n", serde_json::to_string(&command)?));
    let found = CurrentCalibration {
        simulated: arguments.link.is_emulated(),
        worst_before_a: worst_a(&before),
        worst_after_a: worst_a(&after),
        before: &before,
        after: &after,
        correction: &correction,
    };
    if arguments.json {
        writeln!(io::stdout(), "{}", serde_json::to_string(&found)?)?;
        return written;
    }
    print(&found)?;
    written?;
    let path = file.path().display();
    Ok(writeln!(io::stdout(), "The correction is in {path}")?)
}

fn worst_a(pairs: &[Pair]) -> f64 {
    pairs
        .iter()
        .map(|pair| pair.off_a().abs())
        .fold(0.0, f64::max)
}

/// Checks that the readings rise with the current.
fn check(pairs: &[[f64; 2]]) -> Result<(), Failure> {
    let rises = pairs.windows(2).all(|of| match of {
        [[low, low_of], [high, high_of]] => high > low && high_of > low_of,
        _ => false,
    });
    if rises {
        return Ok(());
    }
    Err(Failure::Refused(
        "measurement and reference do not increase together: is the reference's sign right, and does \
         it read this coil's current?"
            .to_owned(),
    ))
}

/// Computes a correction from pairs of measured and true current in rising order: linear between
/// them, proportional beyond the outermost.
fn correction_of(pairs: &[[f64; 2]]) -> CurrentCorrection {
    let ends = [pairs.first(), pairs.last()].into_iter().flatten();
    let greatest_a = ends
        .map(|[reported_a, _]| reported_a.abs())
        .fold(0.0, f64::max);
    let changes = (0..MAX_POINTS).map(|index| {
        let part = 2.0 * index as f64 / (MAX_POINTS - 1) as f64 - 1.0;
        change_a(pairs, part * greatest_a) as f32
    });
    CurrentCorrection {
        greatest_a: greatest_a as f32,
        changes_a: changes.collect(),
    }
}

fn change_a(pairs: &[[f64; 2]], reported_a: f64) -> f64 {
    let inside = pairs.windows(2).find_map(|of| match of {
        &[[low, low_of], [high, high_of]] if (low..=high).contains(&reported_a) => {
            let part = (reported_a - low) / (high - low);
            Some((low_of - low) * (1.0 - part) + (high_of - high) * part)
        }
        _ => None,
    });
    let nearest = if reported_a < 0.0 {
        pairs.first()
    } else {
        pairs.last()
    };
    inside.unwrap_or_else(|| nearest.map_or(0.0, |[end_a, of]| (of - end_a) * reported_a / end_a))
}

/// A board with a reference.
struct CurrentBench<'r> {
    link: Link,
    reference: Reference<'r>,
    ohm: f64,
}

impl CurrentBench<'_> {
    fn pairs(
        &mut self,
        wanted: impl Iterator<Item = f64>,
        progress: &Progress,
    ) -> Result<Vec<Pair>, Failure> {
        let mut pairs = Vec::new();
        for wanted_a in wanted {
            pairs.push(self.pair(wanted_a)?);
            progress.step();
        }
        Ok(pairs)
    }

    /// Drives one current, reads it from board and reference, then lets the coil lose that heat.
    fn pair(&mut self, wanted_a: f64) -> Result<Pair, Failure> {
        let power_w = self.ohm * (wanted_a.abs() + ABOUT_A).powi(2);
        let patience_s = PATIENCE_S.min(MOST_J / power_w.max(1e-3));
        self.drive(wanted_a - ABOUT_A, SETTLE_S / 2.0)?;
        self.link.pass(SETTLE_S)?;
        self.link.take_records();
        let (begin_s, end_s, true_a) = match self.reference {
            Reference::Truth => self.against_truth(wanted_a)?,
            Reference::Program(program) => self.against_program(program, wanted_a, patience_s)?,
        };
        let records = self.link.take_records();
        let within = records.iter().filter_map(|(at_s, record)| match record {
            Record::Sample(sample) => {
                let inside = *at_s > begin_s + EDGE_S && *at_s < end_s - EDGE_S;
                sample.current_a.filter(|_| inside).map(f64::from)
            }
            _ => None,
        });
        let currents: Vec<f64> = within.collect();
        if currents.len() < 10 {
            return Err(Failure::Refused(
                "the board reports too few samples of its current: set its stream to samples, and \
                 its rate to 1 kHz"
                    .to_owned(),
            ));
        }
        self.link.send_accepted(&Command::Abort)?;
        let took_s = end_s - begin_s + SETTLE_S;
        self.link.pass(power_w * took_s / CONTINUOUS_W)?;
        Ok(Pair {
            wanted_a,
            reported_a: currents.iter().sum::<f64>() / currents.len() as f64,
            true_a,
        })
    }

    fn drive(&mut self, to_a: f64, over_s: f64) -> Result<f64, Failure> {
        self.link.send_accepted(&Command::DriveCoil(DriveCoil {
            to_a: to_a as f32,
            over_s: over_s as f32,
            trace_interval_s: 0.0,
        }))
    }

    /// Sweeps once to and fro about the current. Returns start and end by the device's time, s.
    fn sweep(&mut self, about_a: f64) -> Result<[f64; 2], Failure> {
        let begin_s = self.drive(about_a + ABOUT_A, SWEEP_S)?;
        self.link.pass(SWEEP_S)?;
        let turn_s = self.drive(about_a - ABOUT_A, SWEEP_S)?;
        self.link.pass(SWEEP_S)?;
        Ok([begin_s, 2.0 * turn_s - begin_s])
    }

    fn against_truth(&mut self, wanted_a: f64) -> Result<(f64, f64, f64), Failure> {
        let before = truth(&mut self.link);
        let [begin_s, end_s] = self.sweep(wanted_a)?;
        let after = truth(&mut self.link);
        let (Some(before), Some(after)) = (before, after) else {
            return Err(Failure::Argument("a board needs --reference".to_owned()));
        };
        let mean = |of: fn(Truth) -> f64| of(after) - of(before);
        let true_a = mean(|of| of.charge_a_s) / mean(|of| of.time_s);
        Ok((begin_s, end_s, true_a))
    }

    /// Sweeps until the reference's program ends.
    fn against_program(
        &mut self,
        program: &Path,
        wanted_a: f64,
        patience_s: f64,
    ) -> Result<(f64, f64, f64), Failure> {
        let mut process = start(program)?;
        let begin = Instant::now();
        let mut span: Option<[f64; 2]> = None;
        loop {
            let [begin_s, end_s] = self.sweep(wanted_a)?;
            let first_s = span.map_or(begin_s, |[first_s, _]| first_s);
            span = Some([first_s, end_s]);
            if process.try_wait()?.is_some() {
                let true_a = reading(process, program)?;
                return Ok((first_s, end_s, true_a));
            }
            if begin.elapsed() > Duration::from_secs_f64(patience_s) {
                let _ = process.kill();
                let _ = process.wait();
                return Err(Failure::Refused(format!(
                    "{} takes longer than the {patience_s:.1} s for which the coil may have {:.1} A: \
                     let it average for less, or calibrate to a smaller current with --greatest",
                    program.display(),
                    wanted_a.abs()
                )));
            }
        }
    }
}

/// Integrals of the emulated board's current: charge, A s, and time, s.
#[derive(Clone, Copy, Debug)]
struct Truth {
    charge_a_s: f64,
    time_s: f64,
}

/// Reads the integrals; `None` for a real board.
fn truth(link: &mut Link) -> Option<Truth> {
    let board = link.emulated()?.instrument_mut().board_mut();
    let totals = board.circuit().totals();
    Some(Truth {
        charge_a_s: totals.charge_a_s,
        time_s: totals.time_s,
    })
}

fn start(program: &Path) -> Result<Child, Failure> {
    Process::new(program)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|error| {
            Failure::Argument(format!(
                "{}: {error}. Name a program that prints the reference's current.",
                program.display()
            ))
        })
}

/// Parses the number that a program has printed.
fn reading(process: Child, program: &Path) -> Result<f64, Failure> {
    let output = process.wait_with_output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let number = text.trim().parse::<f64>().ok().filter(|of| of.is_finite());
    match number {
        Some(number) if output.status.success() => Ok(number),
        _ => Err(Failure::Refused(format!(
            "{} ended with {} and printed {:?}: it has to print one number, the current in ampere",
            program.display(),
            output.status,
            text.trim()
        ))),
    }
}

fn print(found: &CurrentCalibration<'_>) -> Result<(), Failure> {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["setpoint, A", "measured, A", "reference, A", "off by, mA"]);
    let rows = [(found.before, "before"), (found.after, "corrected")];
    for (pairs, what) in rows {
        table.add_row([what, "", "", ""]);
        for pair in pairs {
            table.add_row([
                format!("{:.2}", pair.wanted_a),
                format!("{:.3}", pair.reported_a),
                format!("{:.3}", pair.true_a),
                format!("{:.0}", 1e3 * pair.off_a()),
            ]);
        }
    }
    for column in table.column_iter_mut() {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let mut out = io::stdout().lock();
    if found.simulated {
        writeln!(
            out,
            "simulated coil at the emulated board; the reference is its true current"
        )?;
    }
    writeln!(out, "{table}")?;
    writeln!(
        out,
        "Off by {:.0} mA at most before, {:.0} mA corrected.",
        1e3 * found.worst_before_a,
        1e3 * found.worst_after_a
    )?;
    Ok(writeln!(out, "The correction is active.")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_takes_gain_and_bow_away() {
        let reported = |true_a: f64| true_a * 1.01 + 0.05 * (true_a / 4.0).sin();
        let pairs: Vec<[f64; 2]> = (-12..=12)
            .map(|step| 0.8 * f64::from(step))
            .map(|true_a| [reported(true_a), true_a])
            .collect();
        let correction = correction_of(&pairs);
        assert_eq!(correction.validate(), Ok(()));
        for (measured_a, change_a) in correction.points() {
            let corrected_a = f64::from(measured_a + change_a);
            let error_a = reported(corrected_a) - f64::from(measured_a);
            assert!(error_a.abs() < 2e-3, "{measured_a}: {error_a}");
        }
        let none = correction_of(&[[-1.0, -1.0], [1.0, 1.0]]);
        assert!(none.changes_a.iter().all(|change_a| *change_a == 0.0));
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(check(&[[-1.0, -1.1], [0.0, 0.1], [1.0, 1.2]]).is_ok());
        assert!(check(&[[-1.0, 1.1], [0.0, 0.1], [1.0, -1.2]]).is_err());
        assert!(check(&[[-1.0, -1.0], [-1.0, 0.0]]).is_err());
        assert!(check(&[[f64::NAN, 0.0], [1.0, 1.0]]).is_err());
    }
}
