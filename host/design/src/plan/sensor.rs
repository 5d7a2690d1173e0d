//! The planned sensor: three springs in series with nominal values, and the data of bench and use.

use palpate_calibration::Known;
use palpate_sim::magnetorheological::MagnetorheologicalParameters;
use palpate_sim::parameters::{Parameters, central};
use palpate_sim::sensing_coil::tank::{SensingTank, TankState};
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_simulate::instrument::{BenchTask, default_settings};
use palpate_wire::command::Settings;

/// A sensor design with the bench for its calibration. Compliances are relative to that of the
/// sensing layer.
#[derive(Clone, Debug)]
pub struct PlannedSensor {
    /// Nominal values, in the middle of the random ranges.
    pub plant: Parameters,
    /// Known data of the bench.
    pub known: Known,
    /// Settings of the instrument, with the peak current that design and supply allow.
    pub settings: Settings,
    /// c_S/c_D0, with c_D0 the stiffness of the actuated layer without current.
    pub ratio: f64,
    /// Deformation of the sensing layer at the working depth, m.
    pub depth_m: f64,
    /// Loads of the bench, c_S/c_L, starting with the block.
    pub bench_loads: Vec<f64>,
    /// Depths of the bench, in units of the working depth.
    pub bench_depths: Vec<f64>,
    /// Amplitude of a stand's vibration, root mean square over stands, m.
    pub vibration_m: f64,
    /// Range of the vibration's frequency, Hz.
    pub vibration_hz: (f64, f64),
}

impl PlannedSensor {
    /// Creates the nominal sensor of a design.
    pub fn new(stack: &Stack, disturbances: &Disturbances) -> Self {
        Self::of(central(stack, disturbances), stack, disturbances)
    }

    /// Creates the planned sensor for drawn parameters.
    pub fn of(plant: Parameters, stack: &Stack, disturbances: &Disturbances) -> Self {
        let task = BenchTask::of(&plant, stack, Switches::all(), &default_settings());
        let sensing_n_per_m = plant.sensing.spring_n_per_m;
        let springs = task.plan.springs_n_per_m.iter();
        let springs = springs.map(|spring| sensing_n_per_m / spring);
        let press = &disturbances.press;
        let (least_m, most_m) = press.vibration_amplitude_m.range();
        // Mean square of an amplitude that is uniform within its range.
        let square = (least_m * least_m + least_m * most_m + most_m * most_m) / 3.0;
        Self {
            ratio: sensing_n_per_m / plant.actuated.spring_n_per_m,
            depth_m: task.plan.depth_m,
            bench_loads: core::iter::once(0.0).chain(springs).collect(),
            bench_depths: task.plan.depths,
            vibration_m: square.sqrt(),
            vibration_hz: press.vibration_hz.range(),
            known: task.known,
            settings: task.plan.settings,
            plant,
        }
    }

    fn law(&self) -> &MagnetorheologicalParameters {
        &self.plant.magnetorheological
    }

    /// Relative rise of the actuated layer's stiffness c_D at a current, A.
    pub fn rise(&self, current_a: f64) -> f64 {
        let relative = current_a / self.plant.current.peak_a;
        self.law().stiffening_at_peak * self.law().saturation(relative)
    }

    /// Stiffening h = c_S/c_D - c_S/c_D0 at a current, A; negative.
    pub fn stiffening(&self, current_a: f64) -> f64 {
        let rise = self.rise(current_a);
        -self.ratio * rise / (1.0 + rise)
    }

    /// Term that the attraction of the layer's halves adds to h, at a current, A, and a
    /// deformation, m.
    pub fn attraction(&self, current_a: f64, deformation_m: f64) -> f64 {
        let pull_n = self.plant.attraction.n_per_a2 * current_a * current_a;
        let ratio = self.ratio + self.stiffening(current_a);
        pull_n / self.plant.sensing.spring_n_per_m * ratio / deformation_m
    }

    /// Apparent displacement, m, that the field of the coil adds to the reading at a current, A,
    /// without a press.
    pub fn crosstalk_m(&self, current_a: f64) -> f64 {
        let relative = current_a / self.plant.current.peak_a;
        self.plant.crosstalk.at_peak_m * relative * relative
    }

    /// Whole compliance W = 1 + c_S/c_L + c_S/c_D0 for a load kappa = c_S/c_L.
    pub fn whole(&self, kappa: f64) -> f64 {
        1.0 + kappa + self.ratio
    }

    /// Change of the deformation per relative change of the frequency, m, at a deformation, m.
    pub fn metres_per_relative_frequency(&self, deformation_m: f64) -> f64 {
        metres_per_relative_frequency(&SensingTank::new(&self.plant.tank), deformation_m)
    }
}

/// Change of the deformation per relative change of a tank's frequency, m, at a deformation, m.
pub fn metres_per_relative_frequency(tank: &SensingTank, deformation_m: f64) -> f64 {
    let resonance = tank.resonance(&TankState {
        apparent_m: deformation_m,
        displacement_m: deformation_m,
        warmer_k: 0.0,
        ..TankState::default()
    });
    resonance.frequency_hz / (resonance.per_apparent + resonance.per_displacement).abs()
}
