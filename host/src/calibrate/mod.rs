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
pub(crate) mod bench;
mod claim;
mod commands;
mod crosstalk;
mod curve;
mod least_squares;
mod samples;
#[cfg(feature = "emulator")]
pub(crate) mod sensor;
#[cfg(feature = "emulator")]
pub(crate) mod verb;

use std::fmt;

pub(crate) use bench::Session;
use palpate_wire::Command;
use palpate_wire::command::{Coil, Settings};

#[cfg(feature = "live")]
pub(crate) use actuated::LinePoint;
pub(crate) use actuated::{Actuated, FallSample, TrainFit};
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
    /// A train led the sensing layer beyond its curve: greatest relative changes of inductance in the
    /// trains, and in the presses upon the block.
    BeyondPresses {
        /// In the trains.
        train: f64,
        /// In the presses.
        press: f64,
    },
    /// The actuated layer's stiffening does not show.
    StiffensTooLittle(Signal),
    /// It shows, but the trains are not those of three springs in series.
    Contradiction {
        /// What shows of the stiffening.
        signal: Signal,
        /// c_S/c_D0 as the trains have it.
        ratio: f64,
    },
}

/// What the current does to the sensing layer's deformation under the hardest load, relative to the
/// deformation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Signal {
    /// Change at the peak current.
    pub(crate) change: f64,
    /// Standard deviation of a sample about it.
    pub(crate) scatter: f64,
}

impl Signal {
    /// Change over scatter below which a failed evaluation is put down to the signal: the stack
    /// `paper` has 0.7 at most, `ultrasoft` with a rise of 0.3 to 3 % less than none, since the
    /// attraction outweighs the stiffening.
    const CLEAR: f64 = 10.0;

    fn is_clear(&self) -> bool {
        self.change >= Self::CLEAR * self.scatter
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the peak current changes the sensing layer's deformation by {:+.3} % (stiffening adds, the \
             attraction of the actuated layer's halves takes away), and samples scatter by {:.3} %",
            self.change * 100.0,
            self.scatter * 100.0
        )
    }
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(part) => write!(f, "the calibration has no {part}"),
            Self::Undetermined(quantity) => {
                write!(f, "the calibration's runs do not determine {quantity}")
            }
            Self::BeyondPresses { train, press } => write!(
                f,
                "a train led the sensing layer beyond its curve: the inductance rose by {:.1} %, and by \
                 {:.1} % in the deepest press upon the block. It is pressed flat: press less deep \
                 (press_depth_of_sensing_layer_m of the stack)",
                train * 100.0,
                press * 100.0
            ),
            Self::StiffensTooLittle(signal) => write!(
                f,
                "the actuated layer stiffens too little to be seen: on the block {signal}. It takes a \
                 stronger field, a softer elastomer, or a softer actuated layer than the sensing one"
            ),
            Self::Contradiction { signal, ratio } => write!(
                f,
                "the trains contradict each other: on the block {signal}, so that the stiffening is \
                 there, but c_S/c_D0 comes out as {ratio:.3}. Are the springs those that are written \
                 down, do some differ from the sensor's own, and did nothing slip?"
            ),
        }
    }
}

impl std::error::Error for Unusable {}

/// Evaluates a session.
pub(crate) fn evaluate(session: &Session, known: &Known) -> Result<Calibration, Unusable> {
    let runs: Vec<samples::SampleRun> = session
        .runs
        .iter()
        .map(|run| samples::SampleRun::new(run, &known.settings))
        .collect::<Result<_, _>>()?;
    let frame_m_per_n = curve::frame(&session.bare)?;
    let deepest_press = samples::SampleRun::new(&session.deepest_press, &known.settings)?;
    let force = ForceCurve::fit(&runs, &deepest_press)?;
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
