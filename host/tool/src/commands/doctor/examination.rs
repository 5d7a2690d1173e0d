//! What a board says of itself.

use palpate_cli::failure::Failure;
use palpate_wire::code::{Outcome, Part};
use palpate_wire::command::GetCalibration;
use palpate_wire::loss::Tally;
use palpate_wire::record::{Crash, Fault, Hello, Sample, Status, Storage};
use palpate_wire::{Command, Record};

use crate::board::link::Link;

/// How long is listened, s: the sensor's self-test is over, and a fault that was cleared has come again.
/// Every check of the firmware that runs by itself does so within a second (docs/faults.md).
pub(super) const LISTEN_S: f64 = 2.0;
/// How long records may take that follow their command's answer, s.
const RECORDS_S: f64 = 0.2;

/// What a measurement of stiffness needs; a law of stiffening or a curve of it besides.
const NEEDED: [Part; 6] = [
    Part::Tank,
    Part::DeformationCurve,
    Part::Crosstalk,
    Part::Springs,
    Part::Coil,
    Part::Attraction,
];

/// What was found out about a board.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Examination {
    pub(super) hello: Hello,
    pub(super) status: Option<Status>,
    pub(super) storage: Option<Storage>,
    /// What the last run ended with, if it was a crash that was reported.
    pub(super) crash: Option<Crash>,
    /// Faults that began and did not end.
    pub(super) faults: Vec<Fault>,
    /// Faults that began, each with how often.
    pub(super) begun: Vec<(Fault, u32)>,
    /// Whether any fault stands, also one that began before.
    pub(super) stands: bool,
    /// Parts of the calibration that a measurement needs and that are not set.
    pub(super) missing: Vec<Part>,
    /// The last sample of the first converter.
    pub(super) sample: Option<Sample>,
    pub(super) losses: Losses,
}

/// What was lost on the link, in frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Losses {
    /// Produced and not received.
    pub(super) missing: u64,
    /// Those of them that the board dropped.
    pub(super) dropped: u64,
    /// Received, and damaged or not understood.
    pub(super) unreadable: u32,
}

impl Examination {
    /// Examines a board, which is disarmed.
    ///
    /// # Errors
    /// If the board is gone, or does not answer.
    pub(super) fn of(link: &mut Link) -> Result<Self, Failure> {
        // A frame that had begun when the port was opened is no loss.
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
        let hello = hello.ok_or_else(|| Failure::Lost("the board says nothing".to_owned()))?;
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

    /// Whether a fault stands.
    pub(super) const fn is_faulted(&self) -> bool {
        self.stands || !self.faults.is_empty()
    }

    /// Faults that began and ended, each with how often it began.
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

/// Whether a fault stands. No command asks for it; one that needs the coil is refused because of a fault,
/// or else because the board is disarmed, and does nothing in either case.
fn does_a_fault_stand(link: &mut Link) -> Result<bool, Failure> {
    // Just before it: a program at another link may arm the board.
    link.must(&Command::Disarm)?;
    let (_, outcome) = link.ask(&Command::TestCoil)?;
    Ok(outcome == Outcome::Faulted)
}

/// Parts of the calibration that are needed and not set, of the first channel of the first converter.
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

fn is_set(link: &mut Link, part: Part) -> Result<bool, Failure> {
    let question = GetCalibration {
        part,
        sensor: 0,
        channel: 0,
    };
    let (_, outcome) = link.ask(&Command::GetCalibration(question))?;
    Ok(outcome == Outcome::Accepted)
}
