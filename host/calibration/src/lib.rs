//! Evaluation of the data recorded on the bench into a calibration.
//!
//! All arithmetic is `f64` and shares no function with the instrument's own.
//!
//! 1. `curve`: load cell and coil during quick presses onto a block give the force against the
//!    relative change of inductance; deformation is force over a nominal c_S. Only ratios of
//!    deformations enter a stiffness (eq. (2) is homogeneous in them), so the nominal value sets
//!    only the scale of the deformation.
//! 2. `crosstalk`: the train without contact gives the current's effect on the reading.
//! 3. `actuated`: the trains on block and springs, all together, give c_D0, the rise over the
//!    current, attraction, and growth of the cross-talk, by least squares.
//! 4. `adjustment`: adjusts five of these quantities to the load that each train gives by itself.
//! 5. `claim`: the uncertainty from the trains' scatter and the springs' tolerance.
//!
//! [`evaluate_both`] takes sessions of the same bench at two temperatures and determines the
//! temperature coefficients of springs and rise.
//!
//! Later, in use, [`check_untouched`] corrects a calibration by a train without a press, and
//! [`check`] by one press onto a known spring.

mod actuated;
mod adjustment;
pub mod bench;
mod check;
pub mod checks;
mod claim;
mod commands;
mod crosstalk;
mod curve;
mod fall;
pub mod least_squares;
mod line;
#[cfg(test)]
mod made;
mod samples;
mod scatter;
pub mod session;
mod temperature;
mod terms;
mod travel;
mod untouched;
mod unusable;

use palpate_wire::Command;
use palpate_wire::command::{Coil, Settings};

pub use actuated::Actuated;
use adjustment::{Adjusted, Layer};
pub use check::{Checked, KnownPress, MOST_DEVIATION, Unchecked, check};
pub use claim::{LOADS, Parts, Uncertainty};
use commands::Findings;
pub use crosstalk::Crosstalk;
use curve::PressCurve;
pub use curve::frame;
pub use fall::Fall;
pub use line::{FallSample, LinePoint, TrainFit};
pub use scatter::train_scatter;
use session::{Pressed, Session};
pub use temperature::{Coefficient, Coefficients, LEAST_DIFFERENCE_K, MOST_PER_K, evaluate_both};
pub use travel::{SpringDeviation, spring_deviations};
pub use untouched::{MOST_CHANGE, OnTheBench, Untouched, check_untouched};
pub use unusable::{Signal, Unusable};

/// Data known before the evaluation.
#[derive(Clone, Debug)]
pub struct Known {
    /// Settings of the instrument, including the train.
    pub settings: Settings,
    /// The coil's data.
    pub coil: Coil,
    /// Nominal c_S, N/m, which sets the scale of the deformation.
    pub sensing_n_per_m: f64,
    /// Nominal c_D0, N/m, from which the search starts.
    pub actuated_n_per_m: f64,
    /// Capacitance of the tank, F.
    pub capacitance_f: f64,
    /// Tolerance of the springs, relative, uniform.
    pub spring_tolerance: f64,
    /// Tolerance of the load cell's gain, relative, uniform; `None` without a load cell: then
    /// springs and the stage's travel determine the force.
    pub load_cell_gain: Option<f64>,
    /// Relative standard uncertainty of both springs together, per kelvin.
    pub springs_per_k: f64,
    /// Relative standard uncertainty of the rise, per kelvin.
    pub rise_per_k: f64,
}

/// A calibration, as figures and as the commands that set it.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Commands in the order of sending.
    pub commands: Vec<Command>,
    /// c_S of the evaluation, N/m.
    pub sensing_n_per_m: f64,
    /// The actuated layer.
    pub actuated: Actuated,
    /// Ratio of a relative error of the stiffening to one of the signal, at the mean depth.
    pub stiffening_of_signal: f64,
    /// Remaining uncertainty.
    pub uncertainty: Uncertainty,
    /// Cross-talk of the coil's current.
    pub crosstalk: Crosstalk,
    /// Temperature coefficients of springs and rise; `Some` after sessions at two temperatures.
    pub coefficients: Option<Coefficients>,
    /// Data behind the calibration, for charts.
    pub basis: Basis,
    /// Force against the relative change of inductance, F(y).
    pub(crate) force: PressCurve,
}

/// Data behind a calibration.
#[derive(Clone, Debug)]
pub struct Basis {
    /// Relative change of inductance in the presses onto the block, with the deviation of the load
    /// cell from the curve, N. Empty without a load cell.
    pub presses: Vec<(f64, f64)>,
    /// The curve fitted to these presses.
    pub curve: Vec<(f64, f64)>,
    /// Nominal c_S/c_L of every train, with the deviation of the train's own line.
    pub trains: Vec<(f64, f64)>,
    /// Nominal stiffness of every spring, with the stiffness from stage and force, N/m. Empty
    /// without a scale.
    pub springs: Vec<(f64, f64)>,
}

impl Calibration {
    /// Adds a relative standard uncertainty of the rise for errors that have the signal's shape and
    /// show in no press: an error of the rise itself, and creep that ends before a train.
    pub fn allow_for_rise(&mut self, uncertainty: f32) {
        for command in &mut self.commands {
            if let Command::SetStiffeningCurve(chunk) = command {
                let of_signal = uncertainty * self.stiffening_of_signal as f32;
                chunk.rise_uncertainty = chunk.rise_uncertainty.hypot(of_signal);
            }
        }
    }
}

/// Evaluates a session.
///
/// # Errors
/// If a part of the session is missing, or it contradicts itself or the model of three springs.
pub fn evaluate(session: &Session, known: &Known) -> Result<Calibration, Unusable> {
    let (runs, deepest_press) = samples::of_session(session, known)?;
    let Pressing {
        force,
        crosstalk,
        fit,
        open,
    } = match known.load_cell_gain {
        Some(gain) => with_load_cell(session, &runs, &deepest_press, gain, known)?,
        None => by_springs(&runs, &deepest_press, known)?,
    };
    let adjusted = adjustment::adjust(&fit, crosstalk, known.spring_tolerance)?;
    let uncertainty = claim::uncertainty(&adjusted, open, known)?;
    let least_press_m = WITHIN * fit.problem.shallowest_m();
    let Adjusted { layer, misses, .. } = adjusted;
    let stiffening_of_signal = layer.stiffening_of_signal();
    let Layer {
        actuated,
        crosstalk,
        ..
    } = layer;
    let findings = Findings {
        known,
        temperature_c: session.temperature_c,
        rest_hz: runs.first().map_or(0.0, |run| run.rest_hz),
        force: &force,
        crosstalk: &crosstalk,
        actuated: &actuated,
        uncertainty: &uncertainty,
        stiffening_of_signal,
        least_press_m,
    };
    Ok(Calibration {
        commands: findings.commands(),
        sensing_n_per_m: known.sensing_n_per_m,
        actuated,
        stiffening_of_signal,
        uncertainty,
        crosstalk,
        basis: Basis {
            presses: beside(&force, &runs, &deepest_press),
            curve: force.points(),
            trains: misses,
            springs: travel::springs_n_per_m(&runs, &deepest_press, known).unwrap_or_default(),
        },
        coefficients: None,
        force,
    })
}

/// Deviations of the load cell from the curve, thinned for a chart.
fn beside(
    force: &PressCurve,
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
) -> Vec<(f64, f64)> {
    /// Number of points that fit on a chart.
    const POINTS: usize = 400;
    let presses = runs.iter().chain([deepest]);
    let presses = presses.filter(|run| run.pressed == Pressed::Block);
    let samples = presses.flat_map(|run| &run.press);
    let points: Vec<(f64, f64)> = samples
        .filter_map(|sample| Some((sample.change, sample.force_n? - force.at(sample.change))))
        .collect();
    let step = points.len().div_ceil(POINTS).max(1);
    points.into_iter().step_by(step).collect()
}

/// Results of the presses and trains.
struct Pressing {
    /// Force against the relative change of inductance, F(y).
    force: PressCurve,
    crosstalk: Crosstalk,
    fit: actuated::Fit,
    /// Uncertainty of the bench.
    open: claim::BenchScatter,
}

fn with_load_cell(
    session: &Session,
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
    gain: f64,
    known: &Known,
) -> Result<Pressing, Unusable> {
    // An unmeasured frame adds an uncertainty.
    let (frame_m_per_n, open_m_per_n) = match session.bare.as_slice() {
        [] => (0.0, travel::FRAME_M_PER_N / 3_f64.sqrt()),
        bare => (frame(bare)?, 0.0),
    };
    let force = PressCurve::of_force(runs, deepest)?;
    let crosstalk = Crosstalk::fit(runs, &force, known)?;
    let fit = actuated::fit(runs, &force, crosstalk, frame_m_per_n, known)?;
    Ok(Pressing {
        force,
        crosstalk,
        fit,
        open: claim::BenchScatter {
            force: gain / 3_f64.sqrt(),
            frame_m_per_n: open_m_per_n,
        },
    })
}

/// Evaluation without a load cell: springs and the stage's travel give the force, the trains
/// themselves the growth of the cross-talk. The frame's compliance stays unknown.
fn by_springs(
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
    known: &Known,
) -> Result<Pressing, Unusable> {
    let travel = travel::Travel::fit(runs, deepest)?;
    let (series_n_per_m, uncertainty) = travel.series_n_per_m(known.spring_tolerance)?;
    let force = travel.on_block.times(series_n_per_m);
    let crosstalk = Crosstalk::without_contact(runs, &force, known)?;
    let (fit, crosstalk) = actuated::fit_with_growth(runs, &force, crosstalk, known)?;
    Ok(Pressing {
        force,
        crosstalk,
        fit,
        open: claim::BenchScatter {
            force: uncertainty,
            frame_m_per_n: travel::FRAME_M_PER_N / 3_f64.sqrt(),
        },
    })
}

/// A press may be shallower than the shallowest train by a twentieth, the effect of creep and
/// drift.
const WITHIN: f64 = 0.95;
