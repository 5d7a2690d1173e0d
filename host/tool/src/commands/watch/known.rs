//! State of a board from its records.

use palpate_cli::describe;
use palpate_cli::describe::limited_by;
use palpate_cli::modulus::{DeclaredTip, Evaluated};
use palpate_wire::code::{Contact, FaultCode, State};
use palpate_wire::record::{Estimate, Hello, Refusal, Sample, Status, Touch, UncertaintyBudget};
use palpate_wire::{Frame, Record};
use serde::Serialize;

use super::history::History;
use crate::board::link::Link;

/// The shown state.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Known {
    /// Location of the board.
    pub(crate) board: String,
    /// Identity of the board; absent before it has arrived.
    pub(crate) hello: Option<Hello>,
    /// Boot to which this state belongs.
    #[serde(skip)]
    pub(crate) boot_id: Option<u32>,
    /// Board time, s.
    pub(crate) time_s: f64,
    pub(crate) state: Option<State>,
    pub(crate) armed: bool,
    /// The last sample of each converter.
    pub(crate) samples: [Option<Sample>; 2],
    /// Last touch of an array of coils; absent without an array.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) touch: Option<Touch>,
    pub(crate) status: Option<Status>,
    /// Last result with its time, s.
    pub(crate) result: Option<(f64, MeasurementResult)>,
    /// Modulus of the last result, or why there is none; absent if no tip is declared.
    pub(crate) modulus: Option<Evaluated>,
    #[serde(skip)]
    declared: DeclaredTip,
    /// Largest cause of the last interval and how to reduce it, if the board reported it.
    pub(crate) limited_by: Option<String>,
    /// Relaxation of the last result's object, in words, if the press was held.
    pub(crate) relaxation: Option<String>,
    #[serde(skip)]
    budget: Option<UncertaintyBudget>,
    pub(crate) faults: Vec<FaultCode>,
    /// Received and missing records of this boot.
    pub(crate) received: u64,
    pub(crate) missing: u64,
    /// Number of damaged frames.
    pub(crate) damaged: u32,
    /// Reason why the board is gone.
    pub(crate) gone: Option<String>,
    /// Deformation of the first channel, m.
    #[serde(skip)]
    pub(crate) deformation: History,
}

/// Result of a measurement.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum MeasurementResult {
    Estimate(Box<Estimate>),
    /// Refusal with its reason.
    Refusal(String),
}

impl Known {
    pub(crate) fn of(board: &str) -> Self {
        Self {
            board: board.to_owned(),
            ..Self::default()
        }
    }

    /// Marks the board as gone.
    pub(crate) fn lost(&mut self, reason: &str) {
        self.gone = Some(reason.to_owned());
    }

    /// Updates the counts of the link.
    pub(crate) fn take_link(&mut self, link: &Link) {
        self.hello = link.hello().cloned();
        self.damaged = link.unreadable();
        if let Some(tally) = link.account().current() {
            self.received = tally.received();
            self.missing = tally.missing();
        }
    }

    /// Processes a record. Returns whether a contact began. A restart of the board clears the
    /// earlier state.
    pub(crate) fn take(&mut self, frame: &Frame<Record>) -> bool {
        let boot_id = frame.header.boot_id;
        if self.boot_id.is_some_and(|known| known != boot_id) {
            *self = Self::of(&self.board);
        }
        self.boot_id = Some(boot_id);
        self.time_s = frame.header.time_us as f64 * 1e-6;
        self.gone = None;
        let mut touches = false;
        self.declared.take(&frame.message);
        match &frame.message {
            Record::Hello(hello) => self.hello = Some(hello.clone()),
            Record::Sample(sample) => {
                let first = sample.channels.first();
                if let Some(deformation_m) = first.and_then(|of| of.deformation_m) {
                    self.deformation.push(self.time_s, deformation_m.into());
                }
                if let Some(place) = self.samples.get_mut(usize::from(sample.sensor)) {
                    *place = Some(sample.clone());
                }
            }
            Record::State(change) => {
                touches = change.state == State::Contact && self.state != Some(State::Contact);
                self.state = Some(change.state);
                self.armed = change.armed;
            }
            Record::Touch(touch) => self.touch = Some(touch.clone()),
            Record::Status(status) => self.status = Some(status.clone()),
            Record::UncertaintyBudget(budget) => self.budget = Some(budget.clone()),
            Record::Estimate(estimate) => {
                self.ended(MeasurementResult::Estimate(Box::new(estimate.clone())));
            }
            Record::Refusal(refusal) => self.refused(refusal),
            Record::Relaxation(relaxation) => {
                self.relaxation = Some(describe::relaxation(relaxation));
            }
            Record::Fault(fault) => {
                self.faults.retain(|code| *code != fault.code);
                if fault.active {
                    self.faults.push(fault.code);
                }
            }
            _ => {}
        }
        touches
    }

    fn refused(&mut self, refusal: &Refusal) {
        self.ended(MeasurementResult::Refusal(describe::refusal(refusal)));
    }

    fn ended(&mut self, outcome: MeasurementResult) {
        self.modulus = match &outcome {
            MeasurementResult::Estimate(estimate) => self.declared.evaluate(estimate),
            MeasurementResult::Refusal(_) => None,
        };
        self.result = Some((self.time_s, outcome));
        self.limited_by = self.budget.take().as_ref().map(limited_by);
        self.relaxation = None;
    }

    /// Contact state, if known.
    pub(crate) fn contact(&self) -> Option<Contact> {
        let [first, _] = &self.samples;
        first.as_ref().map(|sample| sample.contact)
    }
}
