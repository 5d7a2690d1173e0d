//! Evaluation of a train: 1/x against the actuated layer's compliance is a straight line.
//!
//! It uses `f64` and the calibration's own code, so the charts are independent of the instrument's
//! arithmetic.

use palpate_calibration::{Fall, FallSample, TrainFit};
use palpate_sim::current::effective_current_a;
use palpate_wire::Record;
use palpate_wire::code::{Contact, State};

use crate::instrument::CalibratedInstrument;
use crate::results::Measured;

/// A sample on the falls, as a point of the line of 1/x.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Time since the start of the train, s.
    pub(super) time_s: f64,
    /// c_S/c_D(I), with the attraction as a compliance.
    pub(super) compliance: f64,
    /// 1/x without the drift, 1/m.
    pub(super) inverse_per_m: f64,
    /// Measured deformation x less the one that the fitted line of 1/x gives, m.
    pub(super) residual_m: f64,
}

/// The points of a train with the fitted line.
#[derive(Clone, Debug)]
pub(super) struct Evaluation {
    pub(super) points: Vec<Point>,
    pub(super) line: TrainFit,
}

/// A reading with all needed quantities.
struct EvaluatedReading {
    time_s: f64,
    deformation_m: f64,
    current_a: f64,
}

impl Evaluation {
    /// Evaluates a train; `None` if it is missing or too short.
    pub(super) fn of(instrument: &CalibratedInstrument, measured: &Measured) -> Option<Self> {
        measured.verdict.estimate()?;
        let touched_s = touched_s(measured)?;
        // The coil's test drives a current before the train.
        let began_s = ramps_s(measured)?;
        let mut readings = readings(measured);
        readings.retain(|reading| reading.time_s >= began_s);
        let fall = Fall::of(&instrument.settings);
        let at = |reading: &EvaluatedReading| (reading.time_s, reading.current_a);
        let samples: Vec<FallSample> = readings
            .windows(3)
            .filter_map(|near| match near {
                [before, reading, after]
                    if fall.between(at(before), at(reading))
                        && fall.between(at(reading), at(after)) =>
                {
                    Some(FallSample {
                        time_s: reading.time_s - began_s,
                        deformation_m: reading.deformation_m,
                        current_a: reading.current_a,
                    })
                }
                _ => None,
            })
            .collect();
        let calibration = &instrument.calibration;
        let sensing_n_per_m = calibration.sensing_n_per_m;
        let line = calibration
            .actuated
            .line(&samples, sensing_n_per_m, began_s - touched_s)
            .ok()?;
        let point = |sample: &FallSample| {
            let compliance = calibration.actuated.compliance(sample, sensing_n_per_m);
            let drifted = line.drifted(sample.time_s);
            Point {
                time_s: sample.time_s,
                compliance,
                inverse_per_m: drifted / sample.deformation_m,
                residual_m: sample.deformation_m - drifted / line.inverse_per_m(compliance),
            }
        };
        Some(Self {
            points: samples.iter().map(point).collect(),
            line,
        })
    }
}

fn readings(measured: &Measured) -> Vec<EvaluatedReading> {
    let records = measured.pressed.records();
    records
        .filter_map(|(time_s, record)| match record {
            Record::Sample(sample) => {
                let deformation_m = sample.channels.first()?.deformation_m?;
                Some(EvaluatedReading {
                    time_s,
                    deformation_m: deformation_m.into(),
                    current_a: effective_current_a(
                        sample.current_a?.into(),
                        sample.ripple_a.unwrap_or(0.0).into(),
                    ),
                })
            }
            _ => None,
        })
        .collect()
}

/// Start of the train's ramps, s.
fn ramps_s(measured: &Measured) -> Option<f64> {
    let mut records = measured.pressed.records();
    records.find_map(|(time_s, record)| match record {
        Record::State(change) if change.state == State::Ramps => Some(time_s),
        _ => None,
    })
}

fn touched_s(measured: &Measured) -> Option<f64> {
    let mut records = measured.pressed.records();
    records.find_map(|(time_s, record)| match record {
        Record::Sample(sample) if sample.contact == Contact::Began => Some(time_s),
        _ => None,
    })
}
