//! Replay of a recorded stream through the procedure.
//!
//! The replay feeds the recorded conversions, with the board's settings and calibration, to the
//! firmware's own procedure, and compares its results with the records that the board sent. Both
//! run the same code on the same numbers: they agree to the bit.
//!
//! A board's results depend on all conversions since it started to learn the baseline of the
//! untouched sensor. So a replay starts where the board starts to learn: after a release, after a
//! change of settings, after a train without a contact. Where records are missing it stops, and
//! waits for the next such start.
//!
//! The headers of a step's records give the time at which the board ran the step. A step whose only
//! record is the sample does not show this time, but then no result depends on it.

mod active_configuration;
mod run;

use std::collections::HashMap;

use palpate_procedure::Instant;
use palpate_wire::code::{Contact, Outcome, RefusalReason, State, StorageAction, Stream};
use palpate_wire::command::Settings;
use palpate_wire::record::{Acknowledgement, StateChange};
use palpate_wire::{Command, Frame, Message, Record, encode};

pub use active_configuration::ActiveConfiguration;
use run::{Run, is_computed};

/// Reason why a record of the board is not recomputed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Pause {
    /// The board started to learn the baseline before the recording started.
    BegunBefore,
    /// Records are missing.
    Missing,
    /// Settings and calibration are not in the recording, or have changed.
    Configuration,
    /// The board did not send every sample, due to `stream` or `decimation` in its settings.
    NotEverySample,
    /// The board reported a fault.
    Fault,
    /// The coil was driven for a purpose other than a measurement.
    Driven,
    /// The coil's heat or energy forbade a measurement. Both depend on everything since the board's
    /// start.
    Heat,
    /// The replay is in another state than the board. This counts as a difference.
    OutOfStep,
}

impl Pause {
    /// Meaning of the reason, as the end of a sentence.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::BegunBefore => "before the board measured the untouched sensor again",
            Self::Missing => "after missing records",
            Self::Configuration => "with settings or a calibration that are not in the recording",
            Self::NotEverySample => "where stream or decimation omit samples",
            Self::Fault => "after a fault",
            Self::Driven => "after the coil was driven by a command",
            Self::Heat => "after a refusal for the coil's heat or energy",
            Self::OutOfStep => "where replay and board diverged",
        }
    }
}

/// A record of the board beside the recomputed one.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Record that the board sent.
    pub frame: Frame<Record>,
    /// The recomputed record, or the reason why there is none.
    pub replayed: Result<Record, Pause>,
}

impl Compared {
    /// Whether both records are the same bytes; `None` without a recomputed one.
    pub fn is_identical(&self) -> Option<bool> {
        match &self.replayed {
            Ok(replayed) => Some(self.bytes(replayed) == self.bytes(&self.frame.message)),
            Err(Pause::OutOfStep) => Some(false),
            Err(_) => None,
        }
    }

    fn bytes(&self, record: &Record) -> Vec<u8> {
        let mut buffer = [0; Record::MAX_FRAME];
        // A record that was decoded, or made by the procedure, fits the buffer.
        encode(&self.frame.header, record, &mut buffer).map_or_else(|_| Vec::new(), <[u8]>::to_vec)
    }
}

/// Recomputes the records of boards, one by one.
#[derive(Debug, Default)]
pub struct Replay {
    active_configuration: HashMap<u32, ActiveConfiguration>,
    boot_id: Option<u32>,
    is_armed: bool,
    run: Option<Run>,
    pause: Option<Pause>,
    /// Sequence number of the next frame.
    next: u32,
    /// A sample, with the records of the steps up to the next sample.
    group: Vec<Frame<Record>>,
}

impl Replay {
    /// Sets the settings and calibration of one boot of a board.
    pub fn configure(&mut self, boot_id: u32, active_configuration: ActiveConfiguration) {
        self.active_configuration
            .insert(boot_id, active_configuration);
    }

    /// Takes the next record; returns the finished comparisons.
    pub fn take(&mut self, frame: &Frame<Record>) -> Vec<Compared> {
        let is_next_boot = self.boot_id != Some(frame.header.boot_id);
        let mut finished = Vec::new();
        if is_next_boot || matches!(frame.message, Record::Sample(_)) {
            finished = self.finish();
        }
        if is_next_boot {
            self.boot_id = Some(frame.header.boot_id);
            self.is_armed = false;
            self.next = frame.header.sequence;
            self.stop(Pause::BegunBefore);
        }
        self.group.push(frame.clone());
        finished
    }

    /// Finishes the records taken so far.
    pub fn finish(&mut self) -> Vec<Compared> {
        let group = std::mem::take(&mut self.group);
        let is_whole = self.is_whole(&group);
        if !is_whole {
            self.stop(Pause::Missing);
        }
        for frame in &group {
            self.interrupt(&frame.message);
        }
        if let Some(run) = &mut self.run {
            run.step(&group);
        }
        let compared = group.iter().filter_map(|frame| self.compared(frame));
        let compared: Vec<Compared> = compared.collect();
        self.follow(&group, is_whole);
        compared
    }

    /// Whether no record is missing up to the end of a group.
    fn is_whole(&mut self, group: &[Frame<Record>]) -> bool {
        let mut is_whole = true;
        for frame in group {
            is_whole &= frame.header.sequence == self.next;
            self.next = frame.header.sequence.wrapping_add(1);
        }
        is_whole
    }

    fn stop(&mut self, why: Pause) {
        self.run = None;
        self.pause = Some(why);
    }

    /// Pauses the replay at a record whose cause is not in the recording, such as a fault.
    fn interrupt(&mut self, record: &Record) {
        let why = match record {
            // The board estimates no touch, and follows no rest, while its storage is busy.
            Record::Storage(of) if of.action != StorageAction::Inspect => {
                if let Some(run) = &mut self.run {
                    run.set_knows_rest(false);
                }
                return;
            }
            Record::Fault(fault) if fault.active => Pause::Fault,
            Record::State(change) if is_driven(change) => Pause::Driven,
            Record::State(change) if is_set_anew(change) => Pause::Configuration,
            Record::Refusal(refusal)
                if matches!(
                    refusal.reason,
                    RefusalReason::CoilTooHot | RefusalReason::TooMuchEnergy
                ) =>
            {
                Pause::Heat
            }
            Record::Refusal(_) if self.run.as_ref().is_some_and(|run| !run.knows(record)) => {
                Pause::BegunBefore
            }
            Record::Settings(settings) if self.change(settings) => Pause::Configuration,
            Record::Acknowledgement(answer) if sets(answer).is_some() => Pause::Configuration,
            _ => return,
        };
        self.stop(why);
    }

    /// Takes settings; returns whether they differ from the previous ones.
    fn change(&mut self, settings: &Settings) -> bool {
        let boot_id = self.boot_id.unwrap_or_default();
        let Some(active_configuration) = self.active_configuration.get_mut(&boot_id) else {
            return false;
        };
        let is_other = active_configuration.settings != *settings;
        active_configuration.settings = settings.clone();
        is_other
    }

    fn compared(&mut self, frame: &Frame<Record>) -> Option<Compared> {
        if !is_computed(&frame.message) {
            return None;
        }
        let replayed = match &mut self.run {
            Some(run) if !run.knows(&frame.message) => Err(Pause::BegunBefore),
            Some(run) => run.take(&frame.message).ok_or(Pause::OutOfStep),
            None => Err(self.pause.unwrap_or(Pause::BegunBefore)),
        };
        Some(Compared {
            frame: frame.clone(),
            replayed,
        })
    }

    /// Follows the state of the board, and starts the run where the board starts to learn.
    fn follow(&mut self, group: &[Frame<Record>], is_whole: bool) {
        let mut states = group.iter().filter_map(|frame| match &frame.message {
            Record::State(change) => Some(change),
            _ => None,
        });
        if let Some(change) = states.next_back() {
            self.is_armed = change.armed;
            let is_out_of_step = |run: &Run| !run.is_in(change.state);
            if self.run.as_ref().is_some_and(is_out_of_step) {
                self.stop(Pause::OutOfStep);
            }
        }
        if self.run.is_none()
            && is_whole
            && let Some(last) = group.last()
            && group.iter().any(|frame| starts_learning(&frame.message))
        {
            self.begin(Instant::from_ticks(last.header.time_us));
            // Only a command lets the board learn the rest of an array.
            let is_answer = |frame: &Frame<Record>| is_anew(&frame.message);
            if let Some(run) = &mut self.run {
                run.set_knows_rest(group.iter().any(is_answer));
            }
        }
    }

    fn begin(&mut self, at: Instant) {
        let boot_id = self.boot_id.unwrap_or_default();
        let Some(active_configuration) = self.active_configuration.get(&boot_id) else {
            return self.stop(Pause::Configuration);
        };
        if active_configuration.settings.stream != Stream::Samples
            || active_configuration.settings.decimation > 1
        {
            return self.stop(Pause::NotEverySample);
        }
        self.run = Run::begin(boot_id, active_configuration, at, self.is_armed);
        self.pause = self.run.is_none().then_some(Pause::Configuration);
    }
}

/// Whether the board learns the baseline from the next conversion on, and uses no earlier
/// conversion.
fn starts_learning(record: &Record) -> bool {
    match record {
        Record::Sample(sample) => sample.sensor == 0 && sample.contact == Contact::Ended,
        Record::State(change) => {
            change.state == State::Baseline
                && matches!(
                    change.previous,
                    State::Settling | State::Peak | State::Ramps | State::Manual
                )
        }
        _ => is_anew(record),
    }
}

/// Whether a command was accepted after which the board learns anew.
fn is_anew(record: &Record) -> bool {
    match record {
        Record::Acknowledgement(answer) => sets(answer).is_some_and(|name| ANEW.contains(&name)),
        _ => false,
    }
}

/// Commands after which the board learns the baseline again.
const ANEW: [&str; 4] = [
    "set_settings",
    "set_deformation_curve",
    "set_crosstalk",
    "set_touch_array",
];

/// Name of the `set_` command that this answer accepts, if it does.
fn sets(answer: &Acknowledgement) -> Option<&'static str> {
    let mut kinds = Command::KINDS.iter();
    let kind = kinds.find(|kind| kind.number == answer.kind)?;
    let sets = answer.outcome == Outcome::Accepted && kind.name.starts_with("set_");
    sets.then_some(kind.name)
}

/// Whether the coil starts to be driven for a purpose other than a measurement.
fn is_driven(change: &StateChange) -> bool {
    match change.state {
        State::Manual => true,
        State::Peak => change.previous != State::Settling,
        _ => false,
    }
}

/// Whether a setting was changed, by any link: only this moves a board from watching to learning
/// the baseline.
fn is_set_anew(change: &StateChange) -> bool {
    (change.previous, change.state) == (State::Watching, State::Baseline)
}
