//! A calibration: commands, figures, and the data they were found from.

use palpate_wire::Command;

use super::adjustment::{Changes, QUANTITIES};
use super::{Actuated, ContactEffect, Crosstalk, Uncertainty, curve::PressCurve};

/// A coefficient and its standard uncertainty, 1/K.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Relative change per kelvin.
    pub per_k: f64,
    /// Standard uncertainty of `per_k`.
    pub uncertainty_per_k: f64,
}

/// Temperature coefficients of springs and rise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Coefficient of the stiffness of both layers, which changes by one factor.
    pub springs: Coefficient,
    /// Coefficient of the rise.
    pub rise: Coefficient,
}

/// A calibration, as figures and as the commands that set it.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Commands in the order of sending.
    pub commands: Vec<Command>,
    /// Nominal c_S with which the session was evaluated, N/m.
    pub sensing_n_per_m: f64,
    /// The actuated layer.
    pub actuated: Actuated,
    /// Relative error of the signal per relative error of the stiffening, at the mean depth.
    pub stiffening_of_signal: f64,
    /// Uncertainty of a load that remains after the calibration.
    pub uncertainty: Uncertainty,
    /// Cross-talk of the coil's current.
    pub crosstalk: Crosstalk,
    /// Temperature coefficients of springs and rise; `Some` after sessions at two temperatures.
    pub coefficients: Option<Coefficients>,
    /// Contacts within a tolerance; `None` for the centred, flat contact alone.
    pub contact: Option<ContactEffect>,
    /// Data behind the calibration, for charts.
    pub basis: Basis,
    /// Force against the relative change of inductance, F(y).
    pub(crate) force: PressCurve,
    /// Covariance of the adjusted quantities if the springs were exact.
    pub(crate) covariance: [Changes; QUANTITIES],
    /// Mean deformation of all trains, m.
    pub(crate) depth_m: f64,
}

/// Data behind a calibration.
#[derive(Clone, Debug)]
pub struct Basis {
    /// Relative change of inductance in the presses onto the block, with the deviation of the load
    /// cell from the curve, N. Empty without a load cell.
    pub presses: Vec<(f64, f64)>,
    /// The curve fitted to these presses.
    pub curve: Vec<(f64, f64)>,
    /// For every train: nominal c_S/c_L, and deviation of the value by its own line.
    pub trains: Vec<(f64, f64)>,
    /// Nominal stiffness of every spring, with the stiffness from stage and force, N/m. Empty
    /// without a scale.
    pub springs: Vec<(f64, f64)>,
}

impl Calibration {
    /// Mean deformation of all trains, m.
    pub fn depth_m(&self) -> f64 {
        self.depth_m
    }

    /// Adds a relative standard uncertainty of the rise, for errors that have the signal's own
    /// shape and therefore show in no press: an error of the rise itself, and creep that ends
    /// before a train.
    pub fn allow_for_rise(&mut self, uncertainty: f32) {
        for command in &mut self.commands {
            if let Command::SetStiffeningCurve(chunk) = command {
                let of_signal = uncertainty * self.stiffening_of_signal as f32;
                chunk.rise_uncertainty = chunk.rise_uncertainty.hypot(of_signal);
            }
        }
    }
}
