//! From what was written down on the bench to a calibration.
//!
//! All arithmetic is `f64` and shares no function with the instrument's own.
//!
//! 1. [`curve`]: the load cell and the coil during quick presses upon a block give force against
//!    relative change of inductance; deformation is force over a nominal c_S. Only ratios of
//!    deformations enter a stiffness (eq. (2) is homogeneous in them), so that the nominal value
//!    sets the scale of the deformation and of nothing else.
//! 2. [`crosstalk`]: the train without contact shows what the current adds to the reading.
//! 3. [`actuated`]: the trains on block and springs, all together, give c_D0, the rise over the
//!    current, attraction, and growth of the cross-talk, by linear least squares.
//! 4. [`claim`]: what noise and the springs' tolerance leave open.

mod actuated;
mod claim;
mod commands;
mod crosstalk;
mod curve;
mod least_squares;
mod samples;

use std::fmt;

use palpate_sim::bench::Session;
use palpate_wire::Command;
use palpate_wire::command::{Coil, Settings};

pub(crate) use actuated::{Actuated, Line, Sample};
use commands::Findings;
pub(crate) use crosstalk::Crosstalk;
use curve::ForceCurve;

/// What is known beforehand.
#[derive(Clone, Debug)]
pub(crate) struct Known {
    /// Settings of the instrument, the train among them.
    pub(crate) settings: Settings,
    /// The coil's data.
    pub(crate) coil: Coil,
    /// Nominal c_S, which sets the scale of the deformation.
    pub(crate) sensing_n_per_m: f64,
    /// Nominal c_D0, from which the search starts.
    pub(crate) actuated_n_per_m: f64,
    /// Capacitance of the tank.
    pub(crate) capacitance_f: f64,
    /// Tolerance of the springs, relative, uniform.
    pub(crate) spring_tolerance: f64,
    /// Gain of the load cell, relative, uniform.
    pub(crate) load_cell_gain: f64,
    /// Relative standard uncertainty of both springs, alike, for every kelvin.
    pub(crate) springs_per_k: f64,
    /// The same of the rise.
    pub(crate) rise_per_k: f64,
}

/// A calibration, as figures and as the commands that set it.
#[derive(Clone, Debug)]
pub(crate) struct Calibration {
    pub(crate) commands: Vec<Command>,
    /// c_S as used, N/m.
    pub(crate) sensing_n_per_m: f64,
    /// The actuated layer.
    pub(crate) actuated: Actuated,
    /// What is left open.
    pub(crate) uncertainty: claim::Uncertainty,
    /// What the coil's current adds to the reading.
    pub(crate) crosstalk: Crosstalk,
}

impl Calibration {
    /// States a relative standard uncertainty of the rise, for what has the shape of the signal and so
    /// is seen by no press: an error of the rise itself, and creep that is over before a train.
    pub(crate) fn allow_for_rise(&mut self, uncertainty: f32) {
        for command in &mut self.commands {
            if let Command::SetStiffeningCurve(chunk) = command {
                chunk.rise_uncertainty = uncertainty;
            }
        }
    }
}

/// Why the notes give no calibration.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Unusable {
    /// A part of the session is missing.
    Missing(&'static str),
    /// The notes contradict each other or do not determine a quantity.
    Undetermined(&'static str),
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(part) => write!(f, "the calibration has no {part}"),
            Self::Undetermined(quantity) => {
                write!(f, "the calibration's runs do not determine {quantity}")
            }
        }
    }
}

impl std::error::Error for Unusable {}

/// Evaluates a session.
pub(crate) fn evaluate(session: &Session, known: &Known) -> Result<Calibration, Unusable> {
    let runs: Vec<samples::Run> = session
        .runs
        .iter()
        .map(|run| samples::Run::new(run, &known.settings))
        .collect::<Result<_, _>>()?;
    let frame_m_per_n = curve::frame(&session.bare)?;
    let force = ForceCurve::fit(&runs)?;
    let crosstalk = Crosstalk::fit(&runs, &force, known)?;
    let fit = actuated::fit(&runs, &force, crosstalk, frame_m_per_n, known)?;
    let uncertainty = claim::uncertainty(&fit, known)?;
    let least_press_m = WITHIN * fit.problem.shallowest_m();
    let actuated = fit.actuated;
    let findings = Findings {
        known,
        temperature_c: session.temperature_c,
        rest_hz: runs.first().map_or(0.0, |run| run.rest_hz),
        force: &force,
        crosstalk: &crosstalk,
        actuated: &actuated,
        uncertainty: &uncertainty,
        least_press_m,
    };
    Ok(Calibration {
        commands: findings.commands(),
        sensing_n_per_m: known.sensing_n_per_m,
        actuated,
        uncertainty,
        crosstalk,
    })
}

/// A press may be shallower than the shallowest train by a twentieth, what creep and drift do to one.
const WITHIN: f64 = 0.95;
