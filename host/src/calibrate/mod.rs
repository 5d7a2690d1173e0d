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
mod crosstalk;
mod curve;
mod least_squares;
mod samples;

use std::fmt;

use palpate_sim::bench::Session;
use palpate_wire::Command;
use palpate_wire::code::Stream;
use palpate_wire::command;
use palpate_wire::command::{
    Attraction, Coil, DeformationCurve, DeformationKnot, KNOTS_PER_CHUNK, Settings, Springs,
    StiffeningCurve, StiffeningKnot, Tank, TemperatureEffect,
};

pub(crate) use actuated::{Actuated, Line, Sample};
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
    let actuated = fit.actuated;
    Ok(Calibration {
        commands: commands(
            session,
            known,
            &runs,
            &force,
            &crosstalk,
            &actuated,
            &uncertainty,
        ),
        sensing_n_per_m: known.sensing_n_per_m,
        actuated,
        uncertainty,
        crosstalk,
    })
}

/// Knots of a curve: as many as the protocol carries.
const KNOTS: usize = command::MAX_KNOTS as usize;

fn commands(
    session: &Session,
    known: &Known,
    runs: &[samples::Run],
    force: &ForceCurve,
    crosstalk: &Crosstalk,
    actuated: &Actuated,
    uncertainty: &claim::Uncertainty,
) -> Vec<Command> {
    let settings = Settings {
        stream: Stream::Samples,
        ..known.settings.clone()
    };
    let mut commands = vec![
        Command::SetSettings(settings),
        Command::SetTank(Tank {
            sensor: 0,
            channel: 0,
            capacitance_f: known.capacitance_f as f32,
            rest_frequency_hz: runs.first().map_or(0.0, |run| run.rest_hz),
        }),
    ];
    commands.extend(deformation_curve(force, known.sensing_n_per_m));
    commands.extend([
        Command::SetCrosstalk(command::Crosstalk {
            sensor: 0,
            channel: 0,
            apparent_m_per_a2: crosstalk.untouched_m_per_a2 as f32,
            growth_per_m: crosstalk.growth_per_m as f32,
            uncertainty: 0.0,
        }),
        Command::SetSprings(Springs {
            sensing_n_per_m: known.sensing_n_per_m as f32,
            sensing_uncertainty: uncertainty.constant as f32,
            actuated_n_per_m: (known.sensing_n_per_m / actuated.ratio) as f32,
            actuated_uncertainty: 0.0,
            force_scale_uncertainty: uncertainty.scale as f32,
            zero_uncertainty_m: 0.0,
        }),
    ]);
    commands.extend(stiffening_curve(known, actuated));
    commands.extend([
        Command::SetCoil(known.coil.clone()),
        Command::SetAttraction(Attraction {
            attraction_n_per_a2: actuated.attraction_n_per_a2 as f32,
            uncertainty: 0.0,
        }),
        Command::SetTemperatureEffect(TemperatureEffect {
            calibrated_at_c: session.temperature_c as f32,
            springs_uncertainty_per_k: known.springs_per_k as f32,
            rise_uncertainty_per_k: known.rise_per_k as f32,
        }),
    ]);
    commands
}

fn deformation_curve(force: &ForceCurve, sensing_n_per_m: f64) -> Vec<Command> {
    let knots: Vec<_> = (0..KNOTS)
        .map(|place| {
            let change = force.greatest_change * place as f64 / (KNOTS - 1) as f64;
            DeformationKnot {
                inductance_change: change as f32,
                deformation_m: (force.at(change) / sensing_n_per_m) as f32,
            }
        })
        .collect();
    let chunks = knots.chunks(KNOTS_PER_CHUNK).enumerate();
    chunks
        .map(|(place, knots)| {
            Command::SetDeformationCurve(DeformationCurve {
                sensor: 0,
                channel: 0,
                total: KNOTS as u8,
                first: (place * KNOTS_PER_CHUNK) as u8,
                knots: knots.iter().cloned().collect(),
            })
        })
        .collect()
}

fn stiffening_curve(known: &Known, actuated: &Actuated) -> Vec<Command> {
    // A little beyond the peak, so that noise of the current does not leave the curve.
    let last_a = 1.03 * f64::from(known.settings.peak_current_a);
    // Near zero current noise may turn the rise back, by less than anything that is measured with
    // it; the protocol takes a curve that rises everywhere.
    let least = actuated.rise(last_a) * 1e-6;
    let mut below = -least;
    let knots: Vec<_> = (0..KNOTS)
        .map(|place| {
            let current_a = last_a * place as f64 / (KNOTS - 1) as f64;
            below = actuated.rise(current_a).max(below + least);
            StiffeningKnot {
                current_a: current_a as f32,
                rise: below as f32,
            }
        })
        .collect();
    let chunks = knots.chunks(KNOTS_PER_CHUNK).enumerate();
    chunks
        .map(|(place, knots)| {
            Command::SetStiffeningCurve(StiffeningCurve {
                total: KNOTS as u8,
                first: (place * KNOTS_PER_CHUNK) as u8,
                rise_uncertainty: 0.0,
                knots: knots.iter().cloned().collect(),
            })
        })
        .collect()
}
