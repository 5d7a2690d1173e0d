//! Samples and measurements for a report, collected from an instrument's records.

use palpate_wire::Record;
use palpate_wire::record::{Estimate, LoadPoint, Refusal, Relaxation, Sample, Touch};

use crate::describe::{limited_by, relaxation};
use crate::modulus::{DeclaredTip, Evaluated};
use crate::touch_map::Array;
use crate::train_line::{Train, TrainLine};

/// Time that the charts show before a measurement's result, s. For a short press it includes the
/// first contact.
const BEFORE_S: f64 = 3.0;
/// Time that the charts show after a measurement's result, s.
const AFTER_S: f64 = 0.5;

/// The shown parts of a recording, or of a simulated press.
#[derive(Debug, Default)]
pub struct Story {
    /// Samples of the first converter, each with its time, s.
    pub samples: Vec<(f64, Sample)>,
    /// Measurements in order of time.
    pub measurements: Vec<Measurement>,
    /// Touches of an array of coils, each with its time, s.
    pub touches: Vec<(f64, Touch)>,
    /// The array in force last.
    pub array: Option<Array>,
    train: Train,
    declared: DeclaredTip,
    /// Largest cause of the next result's interval.
    limited_by: Option<String>,
}

/// A measurement with its result.
#[derive(Debug)]
pub struct Measurement {
    /// Time of the result, s.
    pub at_s: f64,
    /// The result.
    pub result: Result<Estimate, Refusal>,
    /// Largest cause of the interval, if the board reported it.
    pub limited_by: Option<String>,
    /// Modulus of the object, or why there is none; `None` if no tip is declared.
    pub modulus: Option<Evaluated>,
    /// Last report of the object's relaxation, if the press was held.
    pub relaxation: Option<Relaxation>,
    /// The line of its ramps.
    pub line: Option<TrainLine>,
    /// Points of the load's curve.
    pub points: Vec<LoadPoint>,
}

impl Measurement {
    /// Modulus and hardness, what limits the result, and the object's relaxation.
    pub fn text(&self) -> Vec<String> {
        let modulus = self.modulus.iter().flat_map(Evaluated::lines);
        let relaxation = self.relaxation.as_ref().map(relaxation);
        modulus
            .chain(self.limited_by.clone())
            .chain(relaxation)
            .collect()
    }

    /// Whether a time, s, is within the measurement's shown range.
    pub fn shows(&self, time_s: f64) -> bool {
        (self.at_s - BEFORE_S..=self.at_s + AFTER_S).contains(&time_s)
    }
}

impl Story {
    /// Starts with a new instrument or a new boot; `in_force` has the settings and calibration in
    /// force.
    pub fn boot(&mut self, in_force: &[Record]) {
        self.train = Train::with(in_force);
        self.declared = DeclaredTip::with(in_force);
        let chunks = in_force.iter().filter_map(|record| match record {
            Record::TouchArray(chunk) => Some(chunk),
            _ => None,
        });
        self.array = Array::of_chunks(chunks).or(self.array.take());
    }

    /// Takes the next record with its time, s.
    pub fn take(&mut self, at_s: f64, record: Record) {
        let line = self.train.take(at_s, &record);
        self.declared.take(&record);
        match record {
            Record::Sample(sample) if sample.sensor == 0 => self.samples.push((at_s, sample)),
            Record::Touch(touch) => self.touches.push((at_s, touch)),
            Record::UncertaintyBudget(budget) => self.limited_by = Some(limited_by(&budget)),
            Record::Estimate(estimate) => self.ended(at_s, Ok(estimate), line),
            Record::Refusal(refusal) => self.ended(at_s, Err(refusal), None),
            Record::Relaxation(relaxation) => {
                if let Some(last) = self.measurements.last_mut() {
                    last.relaxation = Some(relaxation);
                }
            }
            Record::LoadPoint(point) => {
                if let Some(last) = self.measurements.last_mut() {
                    last.points.push(point);
                }
            }
            _ => {}
        }
    }

    fn ended(&mut self, at_s: f64, result: Result<Estimate, Refusal>, line: Option<TrainLine>) {
        let estimate = result.as_ref().ok();
        self.measurements.push(Measurement {
            at_s,
            modulus: estimate.and_then(|of| self.declared.evaluate(of)),
            result,
            limited_by: self.limited_by.take(),
            relaxation: None,
            line,
            points: Vec::new(),
        });
    }
}
