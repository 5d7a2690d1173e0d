//! Measurements of a board since the start of the tool.

use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

use palpate_cli::describe;
use palpate_cli::describe::limited_by;
use palpate_cli::modulus::{DeclaredTip, Evaluated};
use palpate_wire::Record;
use palpate_wire::record::UncertaintyBudget;
use serde::Serialize;

use crate::commands::watch::known::MeasurementResult;

/// Number of kept measurements: an hour at one every 7 s.
const KEPT: usize = 500;

/// A measurement with its result.
#[derive(Debug, Serialize)]
struct Measurement {
    /// Arrival of the result, ms since 1970.
    time_ms: u64,
    /// Number since the start of the board.
    number: u32,
    outcome: MeasurementResult,
    /// Modulus, or why there is none; absent if no tip is declared.
    modulus: Option<Evaluated>,
    /// What the page shows of it.
    modulus_text: Vec<String>,
    /// Largest cause of the interval and how to reduce it, if the board reported it.
    limited_by: Option<String>,
    /// Relaxation of the object in words, if the press was held.
    relaxation: Option<String>,
}

impl Measurement {
    /// Converts a record that ends a measurement.
    fn of(record: &Record) -> Option<Self> {
        let (number, outcome) = match record {
            Record::Estimate(estimate) => {
                let outcome = MeasurementResult::Estimate(Box::new(estimate.clone()));
                (estimate.measurement, outcome)
            }
            Record::Refusal(refusal) => (
                refusal.measurement,
                MeasurementResult::Refusal(describe::refusal(refusal)),
            ),
            _ => return None,
        };
        Some(Self {
            time_ms: now_ms(),
            number,
            outcome,
            modulus: None,
            modulus_text: Vec::new(),
            limited_by: None,
            relaxation: None,
        })
    }
}

/// The last measurements, the oldest first.
#[derive(Debug, Default, Serialize)]
#[serde(transparent)]
pub(super) struct Measurements {
    ended: VecDeque<Measurement>,
    /// Uncertainty budget of the next measurement.
    #[serde(skip)]
    budget: Option<UncertaintyBudget>,
    #[serde(skip)]
    declared: DeclaredTip,
}

impl Measurements {
    /// Forgets the tip of a board that has restarted.
    pub(super) fn forget_tip(&mut self) {
        self.declared = DeclaredTip::default();
    }

    /// Adds a record. Returns whether it ends a measurement or adds to the last one.
    pub(super) fn take(&mut self, record: &Record) -> bool {
        self.declared.take(record);
        if let Record::UncertaintyBudget(budget) = record {
            self.budget = Some(budget.clone());
        }
        if let (Record::Relaxation(relaxation), Some(last)) = (record, self.ended.back_mut()) {
            last.relaxation = Some(describe::relaxation(relaxation));
            return true;
        }
        let Some(mut measurement) = Measurement::of(record) else {
            return false;
        };
        if let Record::Estimate(estimate) = record {
            measurement.modulus = self.declared.evaluate(estimate);
            let lines = measurement.modulus.iter().flat_map(Evaluated::lines);
            measurement.modulus_text = lines.collect();
        }
        measurement.limited_by = self.budget.take().as_ref().map(limited_by);
        if self.ended.len() == KEPT {
            self.ended.pop_front();
        }
        self.ended.push_back(measurement);
        true
    }
}

/// Present time, ms since 1970.
pub(super) fn now_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.as_millis() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::watch::tests::fixture;

    #[test]
    fn a_declared_tip_adds_a_modulus() {
        let mut measurements = Measurements::default();
        measurements.take(&fixture("estimate"));
        measurements.take(&fixture("tip"));
        measurements.take(&fixture("estimate"));
        measurements.forget_tip();
        measurements.take(&fixture("estimate"));
        let texts = measurements.ended.iter().map(|of| of.modulus_text.len());
        assert_eq!(texts.collect::<Vec<_>>(), [0, 2, 0]);
    }

    #[test]
    fn a_refusal_stands_beside_the_estimate_before_it() {
        let mut measurements = Measurements::default();
        assert!(!measurements.take(&fixture("uncertainty_budget")));
        assert!(!measurements.take(&fixture("relaxation")));
        assert!(measurements.take(&fixture("estimate")));
        assert!(measurements.take(&fixture("refusal")));
        assert!(!measurements.take(&fixture("hello")));
        let listed = serde_json::to_value(&measurements).unwrap();
        assert_eq!(listed[0]["number"], 1);
        assert_eq!(
            listed[0]["outcome"]["estimate"]["stiffness_n_per_m"],
            6010.0
        );
        let limited_by = listed[0]["limited_by"].as_str().unwrap();
        assert!(limited_by.contains("+4.9 K"), "{limited_by}");
        assert!(listed[1]["limited_by"].is_null(), "{listed}");
        assert!(listed[0]["relaxation"].is_null(), "{listed}");
        assert!(listed[1]["outcome"]["refusal"].is_string(), "{listed}");
        for _ in 0..KEPT {
            measurements.take(&fixture("refusal"));
        }
        assert_eq!(measurements.ended.len(), KEPT);
    }
}
