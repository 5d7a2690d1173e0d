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
pub(crate) mod checks;
mod claim;
mod commands;
mod crosstalk;
mod curve;
#[cfg(feature = "emulator")]
mod found;
mod least_squares;
#[cfg(feature = "emulator")]
mod report;
mod samples;
#[cfg(feature = "emulator")]
pub(crate) mod sensor;
mod travel;
#[cfg(feature = "emulator")]
pub(crate) mod verb;

use std::fmt;

use bench::Pressed;
pub(crate) use bench::Session;
use palpate_wire::Command;
use palpate_wire::command::{Coil, Settings};

#[cfg(any(feature = "live", feature = "recording"))]
pub(crate) use actuated::LinePoint;
pub(crate) use actuated::{Actuated, FallSample, TrainFit};
use commands::Findings;
pub(crate) use crosstalk::Crosstalk;
use curve::PressCurve;

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
    /// Gain of the load cell, relative, uniform; nothing without one: then springs and the stage's travel
    /// have to give the force.
    pub(crate) load_cell_gain: Option<f64>,
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
    /// What it was found from, to be drawn.
    pub(crate) basis: Basis,
}

/// What a calibration was found from.
#[derive(Clone, Debug)]
pub(crate) struct Basis {
    /// In the presses upon the block the relative change of inductance, and by how much the load cell shows
    /// more than the curve, N. Empty without a load cell.
    pub(crate) presses: Vec<(f64, f64)>,
    /// The curve that stands for them.
    pub(crate) curve: Vec<(f64, f64)>,
    /// Of every train c_S/c_L as pressed, and by how much the train by itself misses it.
    pub(crate) trains: Vec<(f64, f64)>,
    /// Of every spring what is written on it and what stage and force say, N/m; nothing without a scale.
    pub(crate) springs: Vec<(f64, f64)>,
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
    /// What has to rise with the press does not.
    NotRising(&'static str),
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
            Self::NotRising(curve) => write!(
                f,
                "{curve} does not rise all along the presses upon the block: did the block slip, or a gauge \
                 fail?"
            ),
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
    let deepest_press = samples::SampleRun::new(&session.deepest_press, &known.settings)?;
    let Pressing {
        force,
        crosstalk,
        fit,
        open,
    } = match known.load_cell_gain {
        Some(gain) => with_load_cell(session, &runs, &deepest_press, gain, known)?,
        None => by_springs(&runs, &deepest_press, known)?,
    };
    let uncertainty = claim::uncertainty(&fit, open, known)?;
    let least_press_m = WITHIN * fit.problem.shallowest_m();
    let actuated = fit.actuated.clone();
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
    let trains = fit.problem.misses(&actuated)?;
    Ok(Calibration {
        commands: findings.commands(),
        sensing_n_per_m: known.sensing_n_per_m,
        actuated,
        uncertainty,
        crosstalk,
        basis: Basis {
            presses: beside(&force, &runs, &deepest_press),
            curve: force.points(),
            trains,
            springs: travel::springs_n_per_m(&runs, &deepest_press, known).unwrap_or_default(),
        },
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
    open: claim::Bench,
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
        bare => (curve::frame(bare)?, 0.0),
    };
    let force = PressCurve::of_force(runs, deepest)?;
    let crosstalk = Crosstalk::fit(runs, &force, known)?;
    let fit = actuated::fit(runs, &force, crosstalk, frame_m_per_n, known)?;
    Ok(Pressing {
        force,
        crosstalk,
        fit,
        open: claim::Bench {
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
        open: claim::Bench {
            force: uncertainty,
            frame_m_per_n: travel::FRAME_M_PER_N / 3_f64.sqrt(),
        },
    })
}

/// A press may be shallower than the shallowest train by a twentieth, what creep and drift do to one.
const WITHIN: f64 = 0.95;
