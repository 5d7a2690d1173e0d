//! True state: for tests and for judging estimates, never for the instrument.

use ldc161x_sim::Time;

use super::plant::{Plant, PlantState};
use crate::mechanics::energy::Energy;
use crate::thermal::CALIBRATION_C;

/// True state of the world at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Virtual time.
    pub time: Time,
    /// Force F through the sensor, N.
    pub force_n: f64,
    /// Friction beside the sensing layer, N; the layer itself carries F less the friction.
    pub friction_n: f64,
    /// Pull of the actuating coils on the load, N; the load's spring carries F less this pull.
    pub pull_n: f64,
    /// Force in the actuated layer, N: F plus the attraction.
    pub actuated_force_n: f64,
    /// Attraction of the actuated layer's halves, N.
    pub attraction_n: f64,
    /// Displacement x_S of the sensing layer, m, with the gap under a tilted contact.
    pub sensing_m: f64,
    /// Displacement of the gap under a tilted contact, m.
    pub gap_m: f64,
    /// Apparent displacement of the sensing coil, m: x_S with the crosstalk of the actuating field.
    pub apparent_m: f64,
    /// Displacement x_D of the actuated layer, m.
    pub actuated_m: f64,
    /// Displacement x_L of the load with its creep, m, without its frame.
    pub load_m: f64,
    /// Creep in x_L, m.
    pub load_creep_m: f64,
    /// Displacement of the frame under the load, m.
    pub frame_m: f64,
    /// Distance between load and sensor, m; zero in contact.
    pub opening_m: f64,
    /// Displacement x_0 of the press, m, with its shaking.
    pub press_m: f64,
    /// Growth of the sensor since the calibration, m.
    pub growth_m: f64,
    /// Creep in x_S, m.
    pub sensing_creep_m: f64,
    /// Creep in x_D, m.
    pub actuated_creep_m: f64,
    /// Instant spring c_S, N/m.
    pub sensing_spring_n_per_m: f64,
    /// Instant spring c_D, N/m.
    pub actuated_spring_n_per_m: f64,
    /// Stiffening σ of the actuated layer: 0 without field, 1 at the peak.
    pub stiffening: f64,
    /// Tangent stiffness of the load's instant spring in series with its frame, N/m. Infinite for a
    /// rigid load on a rigid frame. For a load without memory this is the measurable c_L. For a
    /// load that relaxes, c_L is [`World::load_stiffness_n_per_m`](super::World).
    pub load_spring_n_per_m: f64,
    /// Mean current in the coils, without its ripple, A.
    pub current_a: f64,
    /// Resistance of the coils, ohm.
    pub coil_ohm: f64,
    /// Temperature of the copper, °C.
    pub copper_c: f64,
    /// Temperature of the pad, °C.
    pub pad_c: f64,
    /// Temperature of the surroundings, °C.
    pub ambient_c: f64,
    /// Heat put into the copper so far, J.
    pub heat_in_j: f64,
    /// Heat given to the surroundings so far, J.
    pub heat_out_j: f64,
    /// Mechanical work so far.
    pub energy: Energy,
}

impl Truth {
    pub(super) fn of(plant: &Plant, state: &PlantState) -> Self {
        let PlantState {
            chain, conditions, ..
        } = state;
        let load_creep_m = chain.load_creep_m.iter().sum();
        let load_m_per_n = plant.chain.load().compliance_m_per_n(chain.load_m);
        let thermal = &plant.parameters.thermal;
        Self {
            time: state.time,
            force_n: chain.force_n,
            friction_n: chain.friction.force_n,
            pull_n: chain.force_n - chain.load_force_n,
            actuated_force_n: chain.actuated_force_n,
            attraction_n: plant.chain.attraction_n(conditions, chain.actuated_m),
            sensing_m: chain.sensing_m,
            gap_m: chain.gap_m,
            apparent_m: plant.apparent_m(chain.sensing_m, state.effective_a),
            actuated_m: chain.actuated_m,
            load_m: chain.load_m + load_creep_m,
            load_creep_m,
            frame_m: plant.chain.frame_m_per_n() * chain.load_force_n,
            opening_m: chain.opening_m,
            press_m: conditions.press_m,
            growth_m: conditions.growth_m,
            sensing_creep_m: chain.sensing_creep_m.iter().sum(),
            actuated_creep_m: chain.actuated_creep_m.iter().sum(),
            sensing_spring_n_per_m: conditions.sensing_spring_n_per_m,
            actuated_spring_n_per_m: conditions.actuated_spring_n_per_m,
            stiffening: state.stiffening,
            load_spring_n_per_m: 1.0 / (load_m_per_n + plant.chain.frame_m_per_n()),
            current_a: state.current_a,
            coil_ohm: thermal.coil_resistance_ohm(&state.thermal),
            copper_c: CALIBRATION_C + state.thermal.copper_k,
            pad_c: CALIBRATION_C + state.thermal.pad_k,
            ambient_c: CALIBRATION_C + thermal.ambient_change_k,
            heat_in_j: state.thermal.heat_in_j,
            heat_out_j: state.thermal.heat_out_j,
            energy: state.energy,
        }
    }

    /// Sum of displacements less those of press and growth, m; zero except for rounding.
    #[must_use]
    pub fn displacement_imbalance_m(&self) -> f64 {
        let taken = self.load_m + self.frame_m + self.sensing_m + self.actuated_m;
        taken - self.press_m - self.growth_m - self.opening_m
    }

    /// Excess of the spring forces of sensing and actuated layer over the forces that balance
    /// requires, N; zero except for rounding.
    #[must_use]
    pub fn force_imbalance_n(&self) -> [f64; 2] {
        let sensing_n =
            self.sensing_spring_n_per_m * (self.sensing_m - self.gap_m - self.sensing_creep_m);
        let actuated_n = self.actuated_spring_n_per_m * (self.actuated_m - self.actuated_creep_m);
        [
            sensing_n - (self.force_n - self.friction_n),
            actuated_n - self.force_n - self.attraction_n,
        ]
    }
}
