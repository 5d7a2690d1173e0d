//! What is known of a board from what it has said.

use palpate_cli::describe;
use palpate_cli::describe::limited_by;
use palpate_wire::code::{Contact, FaultCode, State};
use palpate_wire::record::{Estimate, Hello, Refusal, Sample, Status, UncertaintyBudget};
use palpate_wire::{Frame, Record};
use serde::Serialize;

use super::history::History;
use crate::board::link::Link;

/// Everything that is shown.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Known {
    /// Where the board is.
    pub(crate) board: String,
    /// What it is; absent before it has said so.
    pub(crate) hello: Option<Hello>,
    /// Which of its runs all this is of.
    #[serde(skip)]
    pub(crate) boot_id: Option<u32>,
    /// Its time, s.
    pub(crate) time_s: f64,
    pub(crate) state: Option<State>,
    pub(crate) armed: bool,
    /// The last sample of each converter.
    pub(crate) samples: [Option<Sample>; 2],
    pub(crate) status: Option<Status>,
    /// The last result, and when, s.
    pub(crate) result: Option<(f64, MeasurementResult)>,
    /// The greatest cause of its interval, and what would narrow it, where the board said that.
    pub(crate) limited_by: Option<String>,
    #[serde(skip)]
    budget: Option<UncertaintyBudget>,
    pub(crate) faults: Vec<FaultCode>,
    /// Records that were received and that are missing, of this run of the board.
    pub(crate) received: u64,
    pub(crate) missing: u64,
    /// Frames that came damaged.
    pub(crate) damaged: u32,
    /// Why the board is not there.
    pub(crate) gone: Option<String>,
    /// Deformation of the first channel, m.
    #[serde(skip)]
    pub(crate) deformation: History,
}

/// What a measurement came to.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum MeasurementResult {
    Estimate(Box<Estimate>),
    /// Refused, with the reason.
    Refusal(String),
}

impl Known {
    pub(crate) fn of(board: &str) -> Self {
        Self {
            board: board.to_owned(),
            ..Self::default()
        }
    }

    /// The board is gone.
    pub(crate) fn lost(&mut self, reason: &str) {
        self.gone = Some(reason.to_owned());
    }

    /// What the link has counted.
    pub(crate) fn take_link(&mut self, link: &Link) {
        self.hello = link.hello().cloned();
        self.damaged = link.unreadable();
        if let Some(tally) = link.account().current() {
            self.received = tally.received();
            self.missing = tally.missing();
        }
    }

    /// Takes a record; whether something has just touched. What a board said before it started anew holds
    /// no longer.
    pub(crate) fn take(&mut self, frame: &Frame<Record>) -> bool {
        let boot_id = frame.header.boot_id;
        if self.boot_id.is_some_and(|known| known != boot_id) {
            *self = Self::of(&self.board);
        }
        self.boot_id = Some(boot_id);
        self.time_s = frame.header.time_us as f64 * 1e-6;
        self.gone = None;
        let mut touches = false;
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
            Record::Status(status) => self.status = Some(status.clone()),
            Record::UncertaintyBudget(budget) => self.budget = Some(budget.clone()),
            Record::Estimate(estimate) => {
                self.ended(MeasurementResult::Estimate(Box::new(estimate.clone())));
            }
            Record::Refusal(refusal) => self.refused(refusal),
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
        self.result = Some((self.time_s, outcome));
        self.limited_by = self.budget.take().as_ref().map(limited_by);
    }

    /// Whether something touches, if that is known.
    pub(crate) fn contact(&self) -> Option<Contact> {
        let [first, _] = &self.samples;
        first.as_ref().map(|sample| sample.contact)
    }
}
