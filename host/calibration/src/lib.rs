//! From what was written down on the bench to a calibration.
//!
//! All arithmetic is `f64` and shares no function with the instrument's own.
//!
//! 1. `curve`: the load cell and the coil during quick presses upon a block give force against
//!    relative change of inductance; deformation is force over a nominal c_S. Only ratios of
//!    deformations enter a stiffness (eq. (2) is homogeneous in them), so that the nominal value
//!    sets the scale of the deformation and of nothing else.
//! 2. `crosstalk`: the train without contact shows what the current adds to the reading.
//! 3. `actuated`: the trains on block and springs, all together, give c_D0, the rise over the
//!    current, attraction, and growth of the cross-talk, by least squares.
//! 4. `adjustment`: five quantities of that, adjusted to what each train by itself says of its load.
//! 5. `claim`: what the trains' scatter and the springs' tolerance leave open.
//!
//! [`evaluate_both`] takes the same bench at two temperatures, and finds by how much springs and rise change.
//!
//! Later, in use, [`check_untouched`] corrects a calibration by a train without a press, and [`check`] by one press upon
//! a spring that is known.

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

/// What is known beforehand.
#[derive(Clone, Debug)]
pub struct Known {
    /// Settings of the instrument, the train among them.
    pub settings: Settings,
    /// The coil's data.
    pub coil: Coil,
    /// Nominal c_S, which sets the scale of the deformation.
    pub sensing_n_per_m: f64,
    /// Nominal c_D0, from which the search starts.
    pub actuated_n_per_m: f64,
    /// Capacitance of the tank.
    pub capacitance_f: f64,
    /// Tolerance of the springs, relative, uniform.
    pub spring_tolerance: f64,
    /// Gain of the load cell, relative, uniform; nothing without one: then springs and the stage's travel
    /// have to give the force.
    pub load_cell_gain: Option<f64>,
    /// Relative standard uncertainty of both springs, alike, for every kelvin.
    pub springs_per_k: f64,
    /// The same of the rise.
    pub rise_per_k: f64,
}

/// A calibration, as figures and as the commands that set it.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// In the order in which they are sent.
    pub commands: Vec<Command>,
    /// c_S as used, N/m.
    pub sensing_n_per_m: f64,
    /// The actuated layer.
    pub actuated: Actuated,
    /// What an error of the stiffening is of one of the signal, at the mean depth.
    pub stiffening_of_signal: f64,
    /// What is left open.
    pub uncertainty: Uncertainty,
    /// What the coil's current adds to the reading.
    pub crosstalk: Crosstalk,
    /// How springs and rise change with the temperature, where the bench was at two.
    pub coefficients: Option<Coefficients>,
    /// What it was found from, to be drawn.
    pub basis: Basis,
    /// F(y).
    pub(crate) force: PressCurve,
}

/// What a calibration was found from.
#[derive(Clone, Debug)]
pub struct Basis {
    /// In the presses upon the block the relative change of inductance, and by how much the load cell shows
    /// more than the curve, N. Empty without a load cell.
    pub presses: Vec<(f64, f64)>,
    /// The curve that stands for them.
    pub curve: Vec<(f64, f64)>,
    /// Of every train c_S/c_L as pressed, and by how much the train by itself misses it.
    pub trains: Vec<(f64, f64)>,
    /// Of every spring what is written on it and what stage and force say, N/m; nothing without a scale.
    pub springs: Vec<(f64, f64)>,
}

impl Calibration {
    /// States a further relative standard uncertainty of the rise, for what has the shape of the signal and so
    /// is seen by no press: an error of the rise itself, and creep that is over before a train.
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
/// If a part of it is missing, or it contradicts itself or the three springs.
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

/// By how much the load cell shows more than the curve, at so many points as a chart can show.
fn beside(
    force: &PressCurve,
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
) -> Vec<(f64, f64)> {
    /// As many as a chart has room for.
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

/// What the presses and trains give.
struct Pressing {
    /// F(y).
    force: PressCurve,
    crosstalk: Crosstalk,
    fit: actuated::Fit,
    /// What is not known of the bench.
    open: claim::BenchScatter,
}

fn with_load_cell(
    session: &Session,
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
    gain: f64,
    known: &Known,
) -> Result<Pressing, Unusable> {
    // A bench whose frame was not measured leaves it open.
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

/// Without a load cell the springs and the stage's travel give the force, the trains themselves the
/// growth of the cross-talk, and nothing the frame.
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

/// A press may be shallower than the shallowest train by a twentieth, what creep and drift do to one.
const WITHIN: f64 = 0.95;
