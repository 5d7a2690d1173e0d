//! `palpate measure`: stiffness of an object pressed onto a board's sensor.

use std::io::{self, Write};
use std::time::Duration;

use clap::Args;
use palpate_cli::describe;
use palpate_cli::describe::stiffness;
use palpate_cli::describe::{budget_of, limited_by};
use palpate_cli::failure::Failure;
use palpate_cli::modulus::{DeclaredTip, Evaluated};
use palpate_cli::notice;
use palpate_cli::quantity;
use palpate_wire::code::{Part, State};
use palpate_wire::command::{ContactTolerance, GetCalibration};
use palpate_wire::record::{Estimate, Relaxation};
use palpate_wire::{Command, Record};
use serde::Serialize;

use crate::board::configuration::{self, declared_tip};
use crate::board::link::{self, Link, Run};

/// Measure the stiffness of what is pressed upon a board's sensor
///
/// Arms the board, waits for a contact, and drives one train of ramps. The board has to be calibrated:
/// `palpate calibrate sensor`.
#[derive(Args)]
#[command(after_help = "\
Lift off first: the board learns what the untouched sensor reads for half a second. Then press, and \
hold still for about a second.

With --json, a line for each measurement. Exit code 1 if the board refuses one; the reason is printed. \
Of a recording, the measurements in it are printed.

Examples:
  palpate measure
  palpate measure --board emulated --load 1.5
  palpate measure --board press.mcap")]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) link: link::Arguments,
    /// What the emulated board presses: a spring of this multiple of the sensing layer's nominal
    /// stiffness
    #[arg(long, value_name = "RATIO", value_parser = quantity::load, allow_negative_numbers = true)]
    load: Option<f64>,
    /// How many measurements
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    times: u32,
    /// Timeout for a contact, s
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = quantity::duration, allow_negative_numbers = true)]
    pub(crate) wait: Duration,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Duration of the part of a recording that is read at once.
const PLAYED: Duration = Duration::from_millis(10);
/// Default load of the emulated board, in units of the sensing layer's stiffness.
const USUAL_LOAD: f64 = 1.0;
/// Longest wait for baseline and coil test, s.
const ARMING_S: f64 = 5.0;
/// Longest wait for a result, s: settling of the press, coil test, train.
const RESULT_S: f64 = 90.0;
/// Longest wait for the relaxation record after a result, s. The board sends this record after 0.2 s
/// if the object is still pressed.
const RELAXATION_S: f64 = 0.4;

/// A line of the JSON output.
#[derive(Serialize)]
pub(crate) struct MeasurementLine {
    simulated: bool,
    measurement: u32,
    /// Absent for a load that cannot be distinguished from a rigid one.
    stiffness_n_per_m: Option<f32>,
    lower_n_per_m: f32,
    /// Absent for an interval without an upper end.
    upper_n_per_m: Option<f32>,
    force_n: f32,
    total_displacement_m: f32,
    temperature_c: Option<f32>,
    configuration_crc: u32,
    /// Modulus of the object with its hardness, or why there is none; absent if no tip is declared.
    #[serde(flatten)]
    modulus: Option<Evaluated>,
    /// Contacts for which the interval holds; zeros for the centred, flat contact of the bench.
    contact_within_m: f32,
    contact_tilt_rad: f32,
    /// Contacts for which the interval holds, in words.
    #[serde(skip)]
    contact: String,
    /// Largest cause of the interval, and how to reduce it.
    #[serde(skip_serializing_if = "Option::is_none")]
    limited_by: Option<String>,
    /// Relaxation of the object while the press was held.
    #[serde(skip_serializing_if = "Option::is_none")]
    relaxation: Option<Relaxation>,
    /// True stiffness of a simulated load with its support.
    #[serde(skip_serializing_if = "Option::is_none")]
    true_n_per_m: Option<f64>,
}

impl Arguments {
    /// Connects; the emulated board presses a load.
    pub(crate) fn open(&self) -> Result<Link, Failure> {
        let load = self.load.or(self.usual_load());
        self.link.open_pressed(Run::AsFastAsItCan, load)
    }

    fn usual_load(&self) -> Option<f64> {
        self.link.is_emulated().then_some(USUAL_LOAD)
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let usual = arguments.usual_load();
    let mut link = arguments.open()?;
    if link.is_recording() {
        return measured_before(arguments, &mut link);
    }
    let armed = ArmedBoard::arm(&mut link, &arguments.link)?;
    for _ in 0..arguments.times {
        if usual.is_none() {
            notice::say("Press the object upon the sensor, and hold still.");
        }
        let line = armed.measure(&mut link, arguments.wait)?;
        print(&line, arguments.json)?;
    }
    link.send_accepted(&Command::Disarm)?;
    Ok(())
}

/// An armed board, with the part of its configuration that belongs to a result.
pub(crate) struct ArmedBoard {
    simulated: bool,
    configuration_crc: u32,
    declared: DeclaredTip,
    tolerance: Option<ContactTolerance>,
}

impl ArmedBoard {
    /// Reads the configuration, arms the board, and waits until it watches for a contact.
    pub(crate) fn arm(link: &mut Link, reached: &link::Arguments) -> Result<Self, Failure> {
        let board = Self {
            simulated: reached.is_simulated(link),
            configuration_crc: link.hello().map_or(0, |hello| hello.configuration_crc),
            declared: declared_tip(link)?,
            tolerance: contact_tolerance(link)?,
        };
        arm(link)?;
        Ok(board)
    }

    /// Measures at the next contact.
    pub(crate) fn measure(
        &self,
        link: &mut Link,
        wait: Duration,
    ) -> Result<MeasurementLine, Failure> {
        let estimate = measured(link, wait)?;
        let relaxation = link.wait_for(RELAXATION_S, "relaxation", |record| match record {
            Record::Relaxation(relaxation) => Some(relaxation.clone()),
            _ => None,
        });
        Ok(MeasurementLine {
            modulus: self.declared.evaluate(&estimate),
            limited_by: budget_of(records_of(link), estimate.measurement).map(limited_by),
            relaxation: relaxation.ok(),
            true_n_per_m: truth(link),
            ..MeasurementLine::of(
                &estimate,
                self.tolerance.as_ref(),
                (self.simulated, self.configuration_crc),
            )
        })
    }
}

/// Contacts for which the board's intervals hold; `None` if none are stated.
fn contact_tolerance(link: &mut Link) -> Result<Option<ContactTolerance>, Failure> {
    let question = GetCalibration {
        part: Part::Contact,
        sensor: 0,
        channel: 0,
    };
    let records = configuration::read_part(link, &question)?.into_iter();
    let mut tolerances = records.filter_map(|record| match record {
        Record::Contact(of) => Some(of),
        _ => None,
    });
    Ok(tolerances.next())
}

/// Arms the board, and waits until it watches for a contact.
pub(crate) fn arm(link: &mut Link) -> Result<(), Failure> {
    link.send_accepted(&Command::Disarm)?;
    link.send_accepted(&Command::Arm)?;
    let is_touched = link.wait_for(ARMING_S, "end of the coil's test", |record| match record {
        Record::State(change) => match change.state {
            State::Watching => Some(false),
            State::Contact => Some(true),
            _ => None,
        },
        _ => None,
    })?;
    if is_touched {
        notice::say("Something touches the sensor already. Lift it.");
    }
    Ok(())
}

impl MeasurementLine {
    fn of(
        estimate: &Estimate,
        contact: Option<&ContactTolerance>,
        (simulated, configuration_crc): (bool, u32),
    ) -> Self {
        Self {
            simulated,
            measurement: estimate.measurement,
            stiffness_n_per_m: estimate.stiffness_n_per_m,
            lower_n_per_m: estimate.lower_n_per_m,
            upper_n_per_m: estimate.upper_n_per_m,
            force_n: estimate.force_n,
            total_displacement_m: estimate.total_displacement_m,
            temperature_c: estimate.temperature_c,
            configuration_crc,
            modulus: None,
            contact_within_m: contact.map_or(0.0, |of| of.within_m),
            contact_tilt_rad: contact.map_or(0.0, |of| of.tilt_rad),
            contact: describe::contact(contact),
            limited_by: None,
            relaxation: None,
            true_n_per_m: None,
        }
    }
}

/// Tip and contact tolerance of the board since its last start, since a later start may lack them.
#[derive(Default)]
struct Stated {
    boot_id: Option<u32>,
    tip: DeclaredTip,
    tolerance: Option<ContactTolerance>,
}

impl Stated {
    fn take(&mut self, boot_id: u32, record: &Record) {
        if self.boot_id != Some(boot_id) {
            *self = Self {
                boot_id: Some(boot_id),
                ..Self::default()
            };
        }
        self.tip.take(record);
        if let Record::Contact(tolerance) = record {
            self.tolerance = Some(tolerance.clone());
        }
    }
}

/// Prints the measurements of a recording. A recorded refusal is printed, and does not make this
/// verb fail.
fn measured_before(arguments: &Arguments, link: &mut Link) -> Result<(), Failure> {
    let mut estimates = 0;
    let mut cause = None;
    let mut stated = Stated::default();
    // Printed when the next result begins, so that it has the last report of the relaxation.
    let mut last: Option<MeasurementLine> = None;
    while let Ok(()) = link.listen(PLAYED) {
        let configuration_crc = link.hello().map_or(0, |hello| hello.configuration_crc);
        let simulated = arguments.link.is_simulated(link);
        for arrival in link.take() {
            let record = arrival.frame.message;
            stated.take(arrival.frame.header.boot_id, &record);
            match record {
                Record::UncertaintyBudget(budget) => cause = Some(limited_by(&budget)),
                Record::Estimate(estimate) => {
                    estimates += 1;
                    let line = MeasurementLine {
                        modulus: stated.tip.evaluate(&estimate),
                        limited_by: cause.take(),
                        ..MeasurementLine::of(
                            &estimate,
                            stated.tolerance.as_ref(),
                            (simulated, configuration_crc),
                        )
                    };
                    if let Some(before) = last.replace(line) {
                        print(&before, arguments.json)?;
                    }
                }
                Record::Relaxation(relaxation) => {
                    if let Some(last) = &mut last {
                        last.relaxation = Some(relaxation);
                    }
                }
                Record::Refusal(refusal) => notice::say(describe::refusal(&refusal)),
                _ => {}
            }
        }
    }
    if let Some(last) = last {
        print(&last, arguments.json)?;
    }
    if estimates == 0 {
        return Err(Failure::Refused(format!(
            "{}: there is no estimate in it. `palpate record --arm` makes a recording with measurements",
            link.name()
        )));
    }
    Ok(())
}

/// Measures at the next contact.
pub(crate) fn measured(link: &mut Link, wait: Duration) -> Result<Estimate, Failure> {
    link.take();
    link.wait_for(
        wait.as_secs_f64(),
        "contact: nothing touches the sensor",
        |record| match record {
            Record::State(change) if change.state == State::Contact => Some(()),
            _ => None,
        },
    )?;
    link.take();
    // A board that measures at every contact has already started, and its answer says so.
    link.ask(&Command::Measure)?;
    let result = link.wait_for(RESULT_S, "result", |record| match record {
        Record::Estimate(estimate) => Some(Ok(estimate.clone())),
        Record::Refusal(refusal) => Some(Err(refusal.clone())),
        _ => None,
    })?;
    result.map_err(|refusal| {
        let cause = budget_of(records_of(link), refusal.measurement).map(limited_by);
        let cause = cause.map_or(String::new(), |text| format!(". {text}"));
        Failure::Refused(describe::refusal(&refusal) + &cause)
    })
}

fn records_of(link: &Link) -> impl Iterator<Item = &Record> {
    let arrivals = link.received().iter();
    arrivals.map(|arrival| &arrival.frame.message)
}

/// True stiffness of the simulated load with its support, N/m; `None` for a real or a rigid one.
pub(crate) fn truth(link: &mut Link) -> Option<f64> {
    let board = link.emulated()?;
    let true_n_per_m = board.world_mut().truth().load_spring_n_per_m;
    true_n_per_m.is_finite().then_some(true_n_per_m)
}

fn print(line: &MeasurementLine, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(line)?)?);
    }
    let of = |n_per_m: Option<f32>| n_per_m.map(f64::from).map_or("rigid".to_owned(), stiffness);
    let measured = of(line.stiffness_n_per_m);
    let (lower, upper) = (of(Some(line.lower_n_per_m)), of(line.upper_n_per_m));
    write!(
        out,
        "stiffness {measured}, 95 % between {lower} and {upper}, at {:.3} N",
        line.force_n
    )?;
    if let Some(true_n_per_m) = line.true_n_per_m {
        write!(out, "; simulated, truly {}", stiffness(true_n_per_m))?;
    }
    writeln!(out)?;
    writeln!(out, "  contact: {}", line.contact)?;
    if let Some(modulus) = &line.modulus {
        modulus
            .lines()
            .try_for_each(|text| writeln!(out, "  {text}"))?;
    }
    let relaxation = line.relaxation.as_ref().map(describe::relaxation);
    for sentence in line.limited_by.iter().chain(&relaxation) {
        writeln!(out, "  {sentence}")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::watch::tests::fixture;

    #[test]
    fn what_one_start_stated_is_not_assumed_of_the_next() {
        let mut stated = Stated::default();
        stated.take(1, &fixture("contact"));
        stated.take(1, &fixture("hello"));
        assert!(stated.tolerance.is_some());
        stated.take(2, &fixture("hello"));
        assert!(stated.tolerance.is_none());
    }
}
