//! Information about a sensor from the trains of its bench. Each train counts as one measurement of
//! its load.
//!
//! The trains determine five quantities and the error of each spring
//! (docs/decisions/0082-adjustment.md). The formulas are those of [`line`](super::line),
//! implemented separately: they share no code with the calibration that they predict.

use palpate_wire::command::Settings;

use super::causes::{Cause, QUANTITIES};
use super::chip::Conversions;
use super::information::Information;
use super::line::TrainLine;
use super::sensor::PlannedSensor;

/// Standard deviation of the kappa of a train on a load of c_S, relative to W, by the creep and memory
/// that remain after the fit of the drifts; it grows with W^2. On 31 simulated sensors of the design
/// `ultrasoft` trains without noise and vibration scatter by 0.15 % of W on that load
/// (docs/decisions/0082-adjustment.md).
pub(super) const CREEP: f64 = 0.0015;
/// Prior standard deviation of c_D0, stiffening and attraction, in the units of this module. It is
/// wide, since the calibration uses no prior knowledge of these quantities.
const PRIOR_DEVIATION: f64 = 1.0;
/// Prior standard deviations of the cross-talk and of its growth, relative to the cross-talk: the
/// train without contact determines the cross-talk, the load cell its growth
/// (docs/decisions/0082-adjustment.md).
const OF_CROSSTALK: [f64; 2] = [0.1, 0.3];
/// Cross-talk, relative to the working depth, below which it is negligible.
const LEAST_CROSSTALK: f64 = 1e-4;
/// Smallest effect of the current on the deformation on the block for which the calibration finds
/// the stiffening, in units of the scatter of a sample (`Signal` of `palpate-calibration`).
const CLEAR: f64 = 10.0;

/// A train of the bench: derivatives of its kappa with respect to quantities and springs, and its
/// variances by [`Cause::OF_TRAIN`].
struct BenchTrain {
    row: Vec<f64>,
    variances: [f64; 3],
}

/// A sensor on its bench, evaluated.
pub struct PlannedBench<'s> {
    pub(super) sensor: &'s PlannedSensor,
    pub(super) settings: Settings,
    pub(super) conversions: Conversions,
    /// Lines of the trains, one for each depth.
    pub(super) lines: Vec<TrainLine>,
    trains: Vec<BenchTrain>,
    /// Prior variances of the unknowns: those of the quantities, then those of the springs.
    pub(super) prior_variances: Vec<f64>,
    pub(super) information: Information,
}

/// Reasons why a bench has no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unplannable {
    /// The falls of a train have too few conversions for a line.
    TooFewConversions,
    /// The stiffening is below the bench's scatter.
    StiffensTooLittle,
}

impl<'s> PlannedBench<'s> {
    /// Evaluates the bench of a sensor, with these settings and conversions.
    pub fn new(
        sensor: &'s PlannedSensor,
        settings: &Settings,
        conversions: Conversions,
    ) -> Result<Self, Unplannable> {
        let springs = sensor
            .bench_loads
            .iter()
            .filter(|kappa| **kappa > 0.0)
            .count();
        let unknowns = QUANTITIES + springs;
        let (mut lines, mut trains) = (Vec::new(), Vec::new());
        for depth in &sensor.bench_depths {
            let line = TrainLine::new(sensor, settings, &conversions, depth * sensor.depth_m)
                .ok_or(Unplannable::TooFewConversions)?;
            for (load, kappa) in sensor.bench_loads.iter().enumerate() {
                let mut row = vec![0.0; unknowns];
                row.splice(..QUANTITIES, slopes(sensor, &line, *kappa));
                // The first load is the block, whose kappa has no error.
                if let Some(entry) = load
                    .checked_sub(1)
                    .and_then(|spring| row.get_mut(QUANTITIES + spring))
                {
                    *entry = *kappa;
                }
                trains.push(BenchTrain {
                    row,
                    variances: of_train(sensor, &line, *kappa),
                });
            }
            lines.push(line);
        }
        let mut bench = Self {
            sensor,
            settings: settings.clone(),
            conversions,
            lines,
            trains,
            prior_variances: prior_variances(sensor, settings, springs),
            information: Information::new(unknowns),
        };
        if !bench.is_clear() {
            return Err(Unplannable::StiffensTooLittle);
        }
        bench.information = bench.informed(None);
        Ok(bench)
    }

    /// Whether the current changes the deformation on the block by at least [`CLEAR`].
    fn is_clear(&self) -> bool {
        let sensor = self.sensor;
        let peak_a = f64::from(self.settings.peak_current_a);
        let signal = sensor.stiffening(peak_a) + sensor.attraction(peak_a, sensor.depth_m);
        let whole = sensor.whole(0.0);
        let noise_m =
            self.conversions.relative_sigma * sensor.metres_per_relative_frequency(sensor.depth_m);
        let shaken_m = sensor.vibration_m / 2_f64.sqrt() / whole;
        // `signal` is negative, since stiffening lowers the compliance; the deformation rises.
        -signal / whole >= CLEAR * noise_m.hypot(shaken_m) / sensor.depth_m
    }

    /// Information on the unknowns from bench and prior knowledge. The quantity `exact`, if any,
    /// counts as known exactly.
    pub(super) fn informed(&self, exact: Option<usize>) -> Information {
        /// Variance of a practically exact quantity.
        const EXACT: f64 = 1e-16;
        let mut information = Information::new(self.prior_variances.len());
        for train in &self.trains {
            information.read(&train.row, train.variances.iter().sum());
        }
        for (unknown, variance) in self.prior_variances.iter().enumerate() {
            let variance = if exact == Some(unknown) {
                EXACT
            } else {
                *variance
            };
            information.know(unknown, variance);
        }
        information
    }

    /// Variances of a press by cause, from the errors of the bench's trains and springs, propagated
    /// through the least squares of the calibration.
    pub(super) fn of_bench(&self, of_press: &[f64]) -> Option<[f64; Cause::ALL.len()]> {
        let gain = self.information.solve(of_press)?;
        let dot = |row: &[f64]| {
            row.iter()
                .zip(&gain)
                .map(|(one, other)| one * other)
                .sum::<f64>()
        };
        let mut causes = [0.0; Cause::ALL.len()];
        for train in &self.trains {
            let weight = dot(&train.row) / train.variances.iter().sum::<f64>();
            for (cause, variance) in Cause::OF_TRAIN.into_iter().zip(train.variances) {
                add(&mut causes, cause, weight * weight * variance);
            }
        }
        // The prior of a spring is its tolerance.
        for (unknown, (gain, variance)) in gain.iter().zip(&self.prior_variances).enumerate() {
            let cause = if unknown < QUANTITIES {
                Cause::Prior
            } else {
                Cause::Springs
            };
            add(&mut causes, cause, gain * gain / variance);
        }
        Some(causes)
    }
}

/// Derivatives of kappa of a line with respect to the quantities.
pub(super) fn slopes(sensor: &PlannedSensor, line: &TrainLine, kappa: f64) -> [f64; QUANTITIES] {
    let whole = sensor.whole(kappa);
    [
        -sensor.ratio,
        whole * line.of.stiffening,
        whole * line.of.attraction,
        whole * whole * line.of.crosstalk,
        whole * whole * line.of.growth,
    ]
}

/// Variances of kappa of one train, by [`Cause::OF_TRAIN`].
pub(super) fn of_train(sensor: &PlannedSensor, line: &TrainLine, kappa: f64) -> [f64; 3] {
    let square = sensor.whole(kappa).powi(2);
    [
        square * square * line.conversions,
        square * line.vibration,
        (square * CREEP / sensor.whole(1.0)).powi(2),
    ]
}

/// Prior variances of quantities and springs.
fn prior_variances(sensor: &PlannedSensor, settings: &Settings, springs: usize) -> Vec<f64> {
    let peak_a = f64::from(settings.peak_current_a);
    let crosstalk = (sensor.crosstalk_m(peak_a) / sensor.depth_m).max(LEAST_CROSSTALK);
    let free = [PRIOR_DEVIATION; QUANTITIES - OF_CROSSTALK.len()];
    let of_crosstalk = OF_CROSSTALK.map(|part| part * crosstalk);
    // Uniform within the tolerance; the lower limit keeps the matrix regular for exact springs.
    let tolerance = (sensor.known.spring_tolerance / 3_f64.sqrt()).max(1e-6);
    let springs = core::iter::repeat_n(tolerance, springs);
    let deviations = free.into_iter().chain(of_crosstalk).chain(springs);
    deviations.map(|deviation| deviation * deviation).collect()
}

pub(super) fn add(causes: &mut [f64; Cause::ALL.len()], cause: Cause, variance: f64) {
    let of = causes.iter_mut().zip(Cause::ALL);
    of.filter(|(_, of)| *of == cause)
        .for_each(|(sum, _)| *sum += variance);
}
