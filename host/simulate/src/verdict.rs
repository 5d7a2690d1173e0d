//! The instrument's result of a press, compared with the truth.

use palpate_cli::describe;
use palpate_wire::Record;
use palpate_wire::record::{Estimate, Fault, Refusal};

use crate::press::PressOutcome;

/// Result of a press.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// An estimate with its interval.
    Estimate(Box<Estimate>),
    /// A refusal with its reason.
    Refusal(Refusal),
    /// A fault that ended the measurement.
    Fault(Fault),
    /// No result within the time given.
    Silence,
}

impl Verdict {
    /// Returns the first result of a press.
    pub fn of(pressed: &PressOutcome) -> Self {
        Self::of_records(pressed.records().map(|(_, record)| record))
    }

    /// Returns the first result in the records.
    pub fn of_records<'r>(records: impl Iterator<Item = &'r Record>) -> Self {
        let mut results = records.filter_map(|record| match record {
            Record::Estimate(estimate) => Some(Self::Estimate(Box::new(estimate.clone()))),
            Record::Refusal(refusal) => Some(Self::Refusal(refusal.clone())),
            Record::Fault(fault) => Some(Self::Fault(fault.clone())),
            _ => None,
        });
        results.next().unwrap_or(Self::Silence)
    }

    /// Returns the estimate, if any.
    pub fn estimate(&self) -> Option<&Estimate> {
        match self {
            Self::Estimate(estimate) => Some(estimate),
            _ => None,
        }
    }

    /// Whether the claimed interval contains the truth; `None` without an estimate.
    pub fn holds(&self, true_n_per_m: f64) -> Option<bool> {
        let estimate = self.estimate()?;
        let lower = f64::from(estimate.lower_n_per_m) <= true_n_per_m;
        let upper = estimate
            .upper_n_per_m
            .is_none_or(|upper| f64::from(upper) >= true_n_per_m);
        Some(lower && upper)
    }

    /// Reason for a missing estimate; `None` with one.
    pub fn reason(&self) -> Option<String> {
        match self {
            Self::Estimate(_) => None,
            Self::Refusal(refusal) => Some(describe::refusal(refusal)),
            Self::Fault(fault) => Some(format!(
                "fault: {}",
                describe::first_sentence(fault.code.meaning())
            )),
            Self::Silence => Some("no result within half a minute".to_owned()),
        }
    }
}
