//! Data that a board reports about itself.

use palpate_cli::failure::Failure;
use palpate_wire::code::{Outcome, Part};
use palpate_wire::command::GetCalibration;
use palpate_wire::loss::Tally;
use palpate_wire::record::{Crash, Fault, Hello, Sample, Status, Storage};
use palpate_wire::{Command, Record};

use crate::board::link::Link;

/// Time for which the tool receives from the board, s: the sensor's self-test ends within it, and a
/// cleared fault comes again. Every automatic check of the firmware takes place within a second
/// (docs/faults.md).
pub(super) const LISTEN_S: f64 = 2.0;
/// Longest delay of records after the answer to their command, s.
const RECORDS_S: f64 = 0.2;

/// Parts of the calibration that a measurement of stiffness needs, in addition to a law or a curve
/// of the stiffening.
const NEEDED: [Part; 6] = [
    Part::Tank,
    Part::DeformationCurve,
    Part::Crosstalk,
    Part::Springs,
    Part::Coil,
    Part::Attraction,
];

/// Results of the examination of a board.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Examination {
    pub(super) hello: Hello,
    pub(super) status: Option<Status>,
    pub(super) storage: Option<Storage>,
    /// Crash that ended the last run, if reported.
    pub(super) crash: Option<Crash>,
    /// Faults that began and have not ended while the tool received.
    pub(super) faults: Vec<Fault>,
    /// Faults that began while the tool received, with their counts.
    pub(super) begun: Vec<(Fault, u32)>,
    /// Whether any fault is active, also one that began before the connection.
    pub(super) stands: bool,
    /// Needed parts of the calibration that are not set.
    pub(super) missing: Vec<Part>,
    /// Last sample of the first converter.
    pub(super) sample: Option<Sample>,
    pub(super) losses: Losses,
}

/// Lost frames on the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Losses {
    /// Frames produced but not received.
    pub(super) missing: u64,
    /// Missing frames that the board dropped.
    pub(super) dropped: u64,
    /// Frames received but damaged or not understood.
    pub(super) unreadable: u32,
}

impl Examination {
    /// Examines a board and disarms it.
    ///
    /// # Errors
    /// If the board is gone, or does not answer.
    pub(super) fn of(link: &mut Link) -> Result<Self, Failure> {
        // A frame that started before the port was opened is not lost.
        let before = link.unreadable();
        link.collect(LISTEN_S)?;
        let stands = does_a_fault_stand(link)?;
        let missing = missing_parts(link)?;
        link.ask(&Command::GetStorage)?;
        link.ask(&Command::Identify)?;
        link.collect(RECORDS_S)?;
        let tally = link.account().current();
        let losses = Losses {
            missing: tally.map_or(0, Tally::missing),
            dropped: tally.map_or(0, Tally::dropped_by_device),
            unreadable: link.unreadable().wrapping_sub(before),
        };
        let hello = link.hello().cloned();
        let hello = hello.ok_or_else(|| Failure::Lost("the board sends no `hello`".to_owned()))?;
        let mut found = Self {
            hello,
            status: None,
            storage: None,
            crash: None,
            faults: Vec::new(),
            begun: Vec::new(),
            stands,
            missing,
            sample: None,
            losses,
        };
        for (_, record) in link.take_records() {
            found.enter(record);
        }
        Ok(found)
    }

    /// Whether a fault is active.
    pub(super) const fn is_faulted(&self) -> bool {
        self.stands || !self.faults.is_empty()
    }

    /// Faults that have begun and ended, with their counts.
    pub(super) fn ended(&self) -> impl Iterator<Item = &(Fault, u32)> {
        let stands = |fault: &Fault| self.faults.iter().any(|of| is_same(of, fault));
        self.begun.iter().filter(move |(fault, _)| !stands(fault))
    }

    fn enter(&mut self, record: Record) {
        match record {
            Record::Status(status) => self.status = Some(status),
            Record::Storage(storage) => self.storage = Some(storage),
            Record::Crash(crash) => self.crash = Some(crash),
            Record::Sample(sample) if sample.sensor == 0 => self.sample = Some(sample),
            Record::Fault(fault) => {
                self.faults.retain(|of| !is_same(of, &fault));
                if fault.active {
                    match self.begun.iter_mut().find(|(of, _)| is_same(of, &fault)) {
                        Some((_, times)) => *times += 1,
                        None => self.begun.push((fault.clone(), 1)),
                    }
                    self.faults.push(fault);
                }
            }
            _ => {}
        }
    }
}

fn is_same(one: &Fault, other: &Fault) -> bool {
    (one.code, one.location) == (other.code, other.location)
}

/// Whether a fault is active. No command reports this, so a command that needs the coil is sent: it
/// is refused because of a fault, or else because the board is disarmed, and does nothing.
fn does_a_fault_stand(link: &mut Link) -> Result<bool, Failure> {
    // Disarms immediately before, since a program on another link may arm the board.
    link.send_accepted(&Command::Disarm)?;
    let (_, outcome) = link.ask(&Command::TestCoil)?;
    Ok(outcome == Outcome::Faulted)
}

/// Needed but unset parts of the calibration, for the first channel of the first converter.
fn missing_parts(link: &mut Link) -> Result<Vec<Part>, Failure> {
    let mut missing = Vec::new();
    for part in NEEDED {
        if !is_set(link, part)? {
            missing.push(part);
        }
    }
    if !is_set(link, Part::Stiffening)? && !is_set(link, Part::StiffeningCurve)? {
        missing.push(Part::StiffeningCurve);
    }
    Ok(missing)
}

pub(super) fn is_set(link: &mut Link, part: Part) -> Result<bool, Failure> {
    let question = GetCalibration {
        part,
        sensor: 0,
        channel: 0,
    };
    let (_, outcome) = link.ask(&Command::GetCalibration(question))?;
    Ok(outcome == Outcome::Accepted)
}
