//! Fitted line of the last train: 1/x against g. x is the deformation; g is the actuated layer's
//! compliance relative to the sensing layer. The line is zero at g = -(1 + kappa), which gives
//! kappa = c_S/c_L of the load.
//!
//! The points are the board's samples. The fit uses `f64` and the code of the calibration's bench,
//! so it is independent of the board's own fit, which `TrainLine` also contains.

mod law;

use law::{Law, Reading};
use palpate_calibration::{Fall, LinePoint, TrainFit};
use palpate_wire::code::{Contact, State};
use palpate_wire::record::{Estimate, Sample};
use palpate_wire::{Message, Record};
use serde::Serialize;

/// Number of kept samples of a train: 20 s at 1 kHz, twenty times the default train.
const KEPT: usize = 20_000;
/// Maximum number of points that are drawn; more would overlap.
const DRAWN: usize = 600;

/// A measured point with the value of the line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Compliance g: c_S/c_D(I) plus the effect of the attraction.
    pub compliance: f64,
    /// 1/x without the drift, 1/m; x is the deformation.
    pub inverse_per_m: f64,
    /// Value of the line, 1/m.
    pub line_per_m: f64,
    /// Time since the first ramp, s.
    #[serde(skip)]
    pub time_s: f64,
    /// Measured deformation less the deformation by the line, m.
    #[serde(skip)]
    pub residual_m: f64,
}

/// The line of a train.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrainLine {
    measurement: u32,
    /// Every n-th sample, in order of rising compliance.
    pub points: Vec<Point>,
    /// Number n: one sample in n is drawn.
    every: usize,
    /// c_S/c_L by this fit.
    pub load_ratio: f64,
    /// c_S/c_L by the board's fit, and its standard error.
    board_load_ratio: f32,
    board_standard_error: f32,
}

/// Collects the samples of a train and fits its line.
#[derive(Debug, Default)]
pub struct Train {
    /// Latest records of the board's settings and calibration.
    parts: Vec<Record>,
    touched_s: Option<f64>,
    began_s: Option<f64>,
    readings: Vec<Reading>,
}

impl Train {
    /// Creates a train for a board with these settings and this calibration in force.
    pub fn with(parts: &[Record]) -> Self {
        let mut train = Self::default();
        for part in parts {
            train.take(0.0, part);
        }
        train
    }

    /// Processes a record with its time, s. An estimate returns the line of its train.
    pub fn take(&mut self, time_s: f64, record: &Record) -> Option<TrainLine> {
        match record {
            Record::Sample(sample) if sample.sensor == 0 => self.add(time_s, sample),
            // Records may arrive out of order, so this keeps all samples from the peak on and
            // selects those of the ramps by time.
            Record::State(change) if change.state == State::Peak => self.readings.clear(),
            Record::State(change) if change.state == State::Ramps => self.began_s = Some(time_s),
            Record::Estimate(estimate) => return self.line(estimate),
            Record::Settings(_) | Record::Springs(_) | Record::Attraction(_) => {
                self.parts.retain(|part| part.kind() != record.kind());
                self.parts.push(record.clone());
            }
            Record::StiffeningCurve(chunk) => {
                if chunk.first == 0 {
                    self.parts.retain(|part| part.kind() != record.kind());
                }
                self.parts.push(record.clone());
            }
            _ => {}
        }
        None
    }

    fn add(&mut self, time_s: f64, sample: &Sample) {
        if sample.contact == Contact::Began {
            self.touched_s = Some(time_s);
        }
        if self.readings.len() < KEPT {
            self.readings.extend(Reading::of(time_s, sample));
        }
    }

    /// Fits the line to the samples on the falls of the current.
    fn line(&self, estimate: &Estimate) -> Option<TrainLine> {
        let law = Law::of(&self.parts)?;
        let (touched_s, began_s) = (self.touched_s?, self.began_s?);
        let fall = Fall::of(law.settings());
        let at = |of: &Reading| (of.time_s, of.current_a);
        let ramps = self.readings.iter().filter(|of| of.time_s >= began_s);
        let ramps: Vec<_> = ramps.copied().collect();
        let falls = ramps.windows(3).filter_map(|near| match near {
            [before, this, after]
                if fall.between(at(before), at(this)) && fall.between(at(this), at(after)) =>
            {
                let time_s = this.time_s - began_s;
                let tau_s = began_s - touched_s;
                let compliance = law.compliance(this);
                Some(LinePoint::new(
                    time_s,
                    tau_s,
                    this.deformation_m,
                    compliance,
                ))
            }
            _ => None,
        });
        let falls: Vec<_> = falls.collect();
        let fit = TrainFit::of(&falls).ok()?;
        let every = falls.len().div_ceil(DRAWN).max(1);
        let points = falls.iter().step_by(every).map(|of| {
            let drifted = fit.drifted(of);
            let line_per_m = fit.inverse_per_m(of.compliance);
            Point {
                compliance: of.compliance,
                inverse_per_m: drifted / of.deformation_m,
                line_per_m,
                time_s: of.time_s,
                residual_m: of.deformation_m - drifted / line_per_m,
            }
        });
        let mut points: Vec<_> = points.collect();
        points.sort_by(|a, b| a.compliance.total_cmp(&b.compliance));
        Some(TrainLine {
            measurement: estimate.measurement,
            points,
            every,
            load_ratio: fit.kappa,
            board_load_ratio: estimate.load_ratio,
            board_standard_error: estimate.load_ratio_standard_error,
        })
    }
}

#[cfg(test)]
mod tests {
    use palpate_wire::record::{Conversion, StateChange};

    use super::*;

    fn sample(deformation_m: f64, current_a: f64, contact: Contact) -> Record {
        let conversion = Conversion {
            channel: 0,
            offset_us: 0,
            word: 0,
            frequency_hz: 3e6,
            sigma_hz: 1.0,
            deformation_m: Some(deformation_m as f32),
            deformation_sigma_m: Some(1e-7),
            extrapolated: false,
        };
        Record::Sample(Sample {
            sensor: 0,
            missed: 0,
            gap: false,
            channels: [conversion].into_iter().collect(),
            contact,
            force_n: None,
            force_sigma_n: None,
            current_a: Some(current_a as f32),
            ripple_a: None,
        })
    }

    fn state(state: State) -> Record {
        Record::State(StateChange {
            state,
            previous: State::Settling,
            mode: palpate_wire::code::Mode::Stiffness,
            armed: true,
            measurement: 1,
        })
    }

    fn estimate() -> Record {
        let lines = include_str!("../../../../firmware/wire/fixture/v2-records.jsonl").lines();
        let mut records = lines.filter_map(|line| {
            let line: serde_json::Value = serde_json::from_str(line).ok()?;
            serde_json::from_value(line.get("message")?.clone()).ok()
        });
        records
            .find(|record| matches!(record, Record::Estimate(_)))
            .unwrap()
    }

    #[test]
    fn the_line_finds_the_load_of_a_made_train() {
        const LOAD_RATIO: f64 = 0.7;
        let parts = Law::made_parts();
        let law = Law::of(&parts).unwrap();
        let mut train = Train::with(&parts);
        train.take(0.0, &sample(1e-6, 0.0, Contact::Began));
        train.take(0.5, &state(State::Peak));
        train.take(0.5, &state(State::Ramps));
        let (peak_a, end_a) = (law.settings().peak_current_a, law.settings().end_current_a);
        let period = (1e3 * law.settings().ramp_s) as u32;
        for ms in 0..8 * period {
            let part = f64::from(ms % period) / f64::from(period);
            let current_a = f64::from(peak_a) + part * f64::from(end_a - peak_a);
            let mut reading = Reading {
                time_s: 0.5 + 1e-3 * f64::from(ms),
                deformation_m: 300e-6,
                current_a,
            };
            // Solves x (1 + kappa + g) = x_0 by iteration, since g depends slightly on x.
            for _ in 0..9 {
                let level = 1.0 + LOAD_RATIO + law.compliance(&reading);
                reading.deformation_m = 1e-3 / level;
            }
            let record = sample(reading.deformation_m, current_a, Contact::Held);
            assert_eq!(train.take(reading.time_s, &record), None);
        }
        let line = train.take(9.0, &estimate()).unwrap();
        assert!(
            (line.load_ratio - LOAD_RATIO).abs() < 1e-3,
            "{}",
            line.load_ratio
        );
        assert!(line.points.len() > 300 && line.points.len() <= DRAWN);
        for point in &line.points {
            let off = (point.inverse_per_m / point.line_per_m - 1.0).abs();
            assert!(off < 1e-5, "{point:?}");
        }
    }

    #[test]
    fn without_a_calibration_there_is_no_line_and_what_is_kept_is_bounded() {
        let mut train = Train::default();
        for ms in 0..2 * KEPT {
            train.take(1e-3 * ms as f64, &sample(1e-6, 0.0, Contact::Held));
        }
        assert_eq!(train.readings.len(), KEPT);
        assert_eq!(train.take(99.0, &estimate()), None);
    }
}
