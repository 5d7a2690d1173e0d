//! The sensor of the board, and a calibration that matches it.

use std::sync::LazyLock;

use ldc161x_sim::Time;
use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::parameters::{Parameters, central};
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_wire::Command;
use palpate_wire::command::{
    Attraction, Coil, Crosstalk, DeformationCurve, DeformationKnot, Settings, Springs, Stiffening,
};

/// Position of the press without contact, m.
const LIFTED_M: f64 = -0.1e-3;
/// Depths of the sensing layer on the curve, relative to the deepest.
const DEPTHS: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
/// Deepest deformation of the sensing layer, m.
const DEEPEST_M: f64 = 0.6e-3;
/// Stiffness of the object, N/m: that of a soft tissue.
const OBJECT_N_PER_M: f64 = 6e3;
/// Time for a press to settle.
const REST: Time = Time::from_ms(1_000);

/// A simulated sensor, with a calibration by its user.
pub(super) struct Sensor {
    plant: Parameters,
    /// Positions of the press, lifted and deepest, m.
    pub(super) travel_m: [f64; 2],
    /// Commands of a calibration that suffices for an estimate, with settings for a short train at
    /// every contact; in order of their numbers.
    pub(super) calibration: Vec<Command>,
}

/// The sensor of every script.
pub(super) static SENSOR: LazyLock<Option<Sensor>> = LazyLock::new(Sensor::new);

impl Sensor {
    /// A sensor; `None` if the built-in stack makes no plant.
    fn new() -> Option<Self> {
        let stack = Stack::builtin("ultrasoft").ok()?;
        let plant = central(&stack, &Disturbances::builtin().ok()?);
        let mut sensor = Self {
            plant,
            travel_m: [LIFTED_M, 0.0],
            calibration: Vec::new(),
        };
        let world = sensor.world()?;
        let deepest_m = world.press_for_depth_m(DEEPEST_M);
        sensor.travel_m = [LIFTED_M, deepest_m];
        let points = DEPTHS.map(|part| sensor.point(world.press_for_depth_m(part * DEEPEST_M)));
        let points: Option<Vec<[f64; 2]>> = points.into_iter().collect();
        sensor.calibration = sensor.commands(&points?);
        Some(sensor)
    }

    /// A world without contact.
    pub(super) fn world(&self) -> Option<World> {
        let setup = Setup {
            load: Load::Spring {
                n_per_m: OBJECT_N_PER_M,
            },
            profile: Profile::at(LIFTED_M),
            ..Setup::default()
        };
        World::new(&self.plant, Switches::all(), setup).ok()
    }

    /// Frequency, Hz, and deformation, m, at a position of the press.
    fn point(&self, press_m: f64) -> Option<[f64; 2]> {
        let mut world = self.world()?;
        world.move_press(press_m, 1.0);
        world.advance(REST);
        let frequency_hz = world.frequency_hz(world.now().as_secs_f64())?;
        Some([frequency_hz, world.truth().sensing_m])
    }

    fn commands(&self, points: &[[f64; 2]]) -> Vec<Command> {
        let rest_hz = points.first().map_or(1.0, |[rest_hz, _]| *rest_hz);
        let knot = |&[frequency_hz, deformation_m]: &[f64; 2]| DeformationKnot {
            inductance_change: ((rest_hz / frequency_hz).powi(2) - 1.0) as f32,
            deformation_m: deformation_m as f32,
        };
        let mut knots: Vec<DeformationKnot> = points.iter().map(knot).collect();
        knots.sort_by(|a, b| a.inductance_change.total_cmp(&b.inductance_change));
        let curve = DeformationCurve {
            sensor: 0,
            channel: 0,
            total: knots.len() as u8,
            first: 0,
            knots: knots.into_iter().collect(),
        };
        vec![
            Command::SetSettings(settings()),
            Command::SetDeformationCurve(curve),
            Command::SetCrosstalk(Crosstalk {
                sensor: 0,
                channel: 0,
                apparent_m_per_a2: 0.0,
                growth_per_m: 0.0,
                uncertainty: 0.0,
            }),
            Command::SetSprings(Springs {
                sensing_n_per_m: self.plant.sensing.spring_n_per_m as f32,
                sensing_uncertainty: 0.0,
                actuated_n_per_m: self.plant.actuated.spring_n_per_m as f32,
                actuated_uncertainty: 0.0,
                force_scale_uncertainty: 0.0,
                zero_uncertainty_m: 0.0,
                bend: 0.0,
            }),
            Command::SetStiffening(STIFFENING),
            Command::SetCoil(COIL),
            Command::SetAttraction(Attraction {
                attraction_n_per_a2: 0.0,
                uncertainty: 0.0,
            }),
        ]
    }
}

/// Settings with short trains, so that many fit into a script.
pub(super) fn settings() -> Settings {
    Settings {
        automatic: true,
        settling_s: 1.0,
        steady_m_per_s: 1e-3,
        rise_s: 5e-3,
        hold_s: 5e-3,
        ramps: 3,
        ramp_s: 30e-3,
        greatest_error: 10.0,
        ..DEFAULT_SETTINGS
    }
}

/// An arbitrary rise; its true value affects no promise.
const STIFFENING: Stiffening = Stiffening {
    peak_current_a: 10.0,
    rise_at_peak: 0.3,
    rise_uncertainty: 0.0,
    field_at_peak_t: 0.0,
    field_half_t: 1.0,
};

/// The paper's coil: 0.389 ohm, and the heat capacity of some grams of copper and rubber.
const COIL: Coil = Coil {
    resistance_ohm: 0.389,
    copper_capacity_j_per_k: 0.8,
    pad_capacity_j_per_k: 60.0,
    copper_to_pad_k_per_w: 0.5,
    pad_to_ambient_k_per_w: 8.0,
    current_uncertainty: 0.0,
};
