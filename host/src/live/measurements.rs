//! The measurements of a board, as long as the tool runs.

use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

use palpate_wire::Record;
use serde::Serialize;

use crate::verdict::explain;
use crate::watch::known::Outcome;

/// Measurements that are kept: an hour of one every 7 s.
const KEPT: usize = 500;

/// A measurement and what it came to.
#[derive(Debug, Serialize)]
struct Measurement {
    /// When it came.
    time_ms: u64,
    /// Its number since the start of the board.
    number: u32,
    outcome: Outcome,
}

impl Measurement {
    /// What a record reports, if it ends a measurement.
    fn of(record: &Record) -> Option<Self> {
        let (number, outcome) = match record {
            Record::Estimate(estimate) => {
                let outcome = Outcome::Estimate(Box::new(estimate.clone()));
                (estimate.measurement, outcome)
            }
            Record::Refusal(refusal) => (refusal.measurement, Outcome::Refusal(explain(refusal))),
            _ => return None,
        };
        Some(Self {
            time_ms: now_ms(),
            number,
            outcome,
        })
    }
}

/// The last measurements, the oldest first.
#[derive(Debug, Default, Serialize)]
pub(super) struct Measurements(VecDeque<Measurement>);

impl Measurements {
    /// Takes a record; whether it ends a measurement.
    pub(super) fn take(&mut self, record: &Record) -> bool {
        let Some(measurement) = Measurement::of(record) else {
            return false;
        };
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(measurement);
        true
    }
}

/// Time since 1970, ms.
pub(super) fn now_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.as_millis() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::tests::fixture;

    #[test]
    fn a_refusal_stands_beside_the_estimate_before_it() {
        let mut measurements = Measurements::default();
        assert!(measurements.take(&fixture("estimate")));
        assert!(measurements.take(&fixture("refusal")));
        assert!(!measurements.take(&fixture("hello")));
        let listed = serde_json::to_value(&measurements).unwrap();
        assert_eq!(listed[0]["number"], 1);
        assert_eq!(
            listed[0]["outcome"]["estimate"]["stiffness_n_per_m"],
            6010.0
        );
        assert!(listed[1]["outcome"]["refusal"].is_string(), "{listed}");
        for _ in 0..KEPT {
            measurements.take(&fixture("refusal"));
        }
        assert_eq!(measurements.0.len(), KEPT);
    }
}
