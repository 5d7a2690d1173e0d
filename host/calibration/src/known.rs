//! Data of a sensor that are known before its calibration.

use palpate_wire::command::{Coil, Settings};

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
