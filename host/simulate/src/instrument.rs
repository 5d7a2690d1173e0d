//! A simulated instrument, calibrated on its own bench.

use std::fmt::Display;

use palpate_calibration::bench::{self, BenchPlan};
use palpate_calibration::session::{Run, Session};
use palpate_calibration::{Calibration, Known, evaluate, evaluate_both};
use palpate_cli::failure::Failure;
use palpate_sim::native;
use palpate_sim::parameters::{Parameters, draw};
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_wire::Command;
use palpate_wire::command::{Coil, Settings};

use crate::bench::NativeBench;

/// A plant and the calibration that it was given.
#[derive(Clone, Debug)]
pub struct CalibratedInstrument {
    /// The drawn sensor with its world.
    pub plant: Parameters,
    /// Which disturbances are on.
    pub switches: Switches,
    /// The calibration that it uses.
    pub calibration: Calibration,
    /// The bench's train without a press.
    pub untouched: Run,
    /// The calibration as the bench gave it, before any check.
    pub calibrated: Vec<Command>,
    /// The settings that it was calibrated with.
    pub settings: Settings,
    /// How deep the sensing layer is pressed at rest, m.
    pub depth_m: f64,
}

/// Depths to which everything is pressed, in units of the working depth: what users' hands vary.
const DEPTHS: [f64; 3] = [0.6, 1.0, 1.4];
/// How deep the sensing layer may be pressed at the peak current, m: as deep as the deepest press of
/// the shipped stacks goes (soft-closed: 0.4 mm, 1.4 times, 1.08 times as deep at the peak). It is
/// flat at 0.9 mm, and its inductance rises ever more steeply before.
const REACH_M: f64 = 0.62e-3;
/// Springs of the bench, in units of the nominal c_S.
const SPRINGS: [f64; 6] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
/// How fast objects are pressed, on the bench as later, m/s.
pub const SPEED_M_PER_S: f64 = 2e-3;
/// From the end of the press to the train on the bench, s. A press in use is found steady, and the current rises,
/// 0.15 to 0.26 s after its end, 0.21 s in the mean of 40 presses of 0.2 to 5 c_S on eight simulated sensors of the
/// stack `ultrasoft`; here the coil's test, 0.06 s, comes before the rise. The layers creep, so that it has to be the
/// same: from a bench whose trains come 0.16 s earlier, loads of 5 c_S are read 2.4 % softer, and those of c_S 0.8 %.
const REST_S: f64 = 0.15;
/// Share of what the supply can push through the warm coil that the peak may take.
const OF_SUPPLY: f64 = 0.95;
/// The coil when warm, as a multiple of its resistance at rest: 50 K above it.
const WARM: f64 = 1.2;

/// What the coefficients of temperature may be, as standard uncertainties: uniform within
/// -0.4 to 0.1 %/K for both springs (root of mean square 0.21 %), within 0.5 %/K for the rise
/// (sim-host/stacks/disturbances.toml).
const SPRINGS_PER_K: f64 = 0.002_1;
const RISE_PER_K: f64 = 0.002_9;
/// By how much warmer the bench is the second time, K: what sensor and board can be warmed by on a warm plate.
const WARMER_K: f64 = 20.0;
/// Tolerance of the bench's springs and gain of its load cell, by the same file.
const SPRING_TOLERANCE: f64 = 0.01;
const LOAD_CELL_GAIN: f64 = 0.001;

impl CalibratedInstrument {
    /// Draws a plant and calibrates it.
    pub fn calibrated(
        stack: &Stack,
        disturbances: &Disturbances,
        seed: u64,
        switches: Switches,
        settings: &Settings,
    ) -> Result<Self, Failure> {
        let plant = draw(stack, disturbances, seed);
        Self::of_plant(plant, stack, switches, settings)
    }

    /// Calibrates a plant of this stack on its bench.
    pub fn of_plant(
        plant: Parameters,
        stack: &Stack,
        switches: Switches,
        settings: &Settings,
    ) -> Result<Self, Failure> {
        let task = BenchTask::of(&plant, stack, switches, settings);
        let session = task.session(&plant, switches, 0.0)?;
        Self::of_session(&session, task, plant, switches)
    }

    /// Draws a plant and calibrates it on its bench at two temperatures.
    pub fn at_two_temperatures(
        stack: &Stack,
        disturbances: &Disturbances,
        seed: u64,
        switches: Switches,
        settings: &Settings,
    ) -> Result<Self, Failure> {
        let plant = draw(stack, disturbances, seed);
        let task = BenchTask::of(&plant, stack, switches, settings);
        let [first, second] = task.both_sessions(&plant, switches)?;
        let calibration = evaluate_both(&first, &second, &task.known).map_err(unusable)?;
        Self::with(calibration, &first, task, plant, switches)
    }

    /// The same from a session that was written down before.
    pub fn of_session(
        session: &Session,
        task: BenchTask,
        plant: Parameters,
        switches: Switches,
    ) -> Result<Self, Failure> {
        let calibration = evaluate(session, &task.known).map_err(unusable)?;
        Self::with(calibration, session, task, plant, switches)
    }

    /// A plant with the calibration that was made of its bench.
    pub fn with(
        calibration: Calibration,
        session: &Session,
        task: BenchTask,
        plant: Parameters,
        switches: Switches,
    ) -> Result<Self, Failure> {
        let untouched = session.untouched();
        let untouched = untouched.ok_or_else(|| unusable("no train without contact"))?;
        Ok(Self {
            plant,
            switches,
            calibrated: calibration.commands.clone(),
            calibration,
            untouched: untouched.clone(),
            settings: task.plan.settings,
            depth_m: task.plan.depth_m,
        })
    }
}

fn unusable(error: impl Display) -> Failure {
    Failure::Refused(format!("calibration: {error}"))
}

/// What is to be done on the bench of a plant, and what is known of it beforehand.
#[derive(Clone)]
pub struct BenchTask {
    /// What is pressed, how deep and how fast.
    pub plan: BenchPlan,
    /// What is known of sensor and bench beforehand.
    pub known: Known,
    /// The coil's temperature, degrees Celsius, where a board has measured it.
    pub temperature_c: Option<f64>,
}

impl BenchTask {
    /// What is written down on the simulated bench of a plant, so many kelvin above the temperature of
    /// calibration.
    pub fn session(
        &self,
        plant: &Parameters,
        switches: Switches,
        warmer_k: f64,
    ) -> Result<Session, Failure> {
        let mut bench = NativeBench::new(plant, switches, warmer_k);
        bench::hold(&mut bench, &self.plan, &self.known, &mut |_, _| {}).map_err(unusable)
    }

    /// The same at both temperatures, that of calibration first.
    pub fn both_sessions(
        &self,
        plant: &Parameters,
        switches: Switches,
    ) -> Result<[Session; 2], Failure> {
        let first = self.session(plant, switches, 0.0)?;
        Ok([first, self.session(plant, switches, WARMER_K)?])
    }

    /// The bench of a plant of this stack.
    pub fn of(plant: &Parameters, stack: &Stack, switches: Switches, settings: &Settings) -> Self {
        let effective = plant.effective(&switches);
        let settings = Settings {
            peak_current_a: affordable_peak_a(&effective) as f32,
            ..settings.clone()
        };
        let coil = coil(&effective);
        let sensing_n_per_m = stack.sensing_spring_n_per_m.centre();
        let depth_m = plant.press.depth_m.min(greatest_depth_m(stack));
        let plan = BenchPlan {
            settings: settings.clone(),
            coil: coil.clone(),
            depth_m,
            depths: DEPTHS.to_vec(),
            springs_n_per_m: SPRINGS.map(|ratio| ratio * sensing_n_per_m).to_vec(),
            speed_m_per_s: SPEED_M_PER_S,
            rest_s: REST_S,
        };
        let known = Known {
            settings: settings.clone(),
            coil,
            sensing_n_per_m,
            actuated_n_per_m: stack.actuated_spring_n_per_m.centre(),
            capacitance_f: plant.tank.capacitance_f,
            spring_tolerance: if switches.spring_tolerance {
                SPRING_TOLERANCE
            } else {
                0.0
            },
            load_cell_gain: Some(if switches.load_cell_gain {
                LOAD_CELL_GAIN
            } else {
                0.0
            }),
            springs_per_k: if switches.spring_temperature {
                SPRINGS_PER_K
            } else {
                0.0
            },
            rise_per_k: if switches.stiffening_temperature {
                RISE_PER_K
            } else {
                0.0
            },
        };
        Self {
            plan,
            known,
            temperature_c: None,
        }
    }

    /// The same for a board of which the stack is known and the supply was measured, V.
    pub fn of_board(
        plant: &Parameters,
        stack: &Stack,
        supply_v: Option<f64>,
        settings: &Settings,
    ) -> Self {
        let mut nominal = plant.clone();
        nominal.press.depth_m = stack.press_depth_of_sensing_layer_m.centre();
        nominal.current.supply_v = supply_v.unwrap_or(f64::INFINITY);
        nominal.current.supply_ohm = SUPPLY_OHM;
        Self::of(&nominal, stack, Switches::all(), settings)
    }
}

/// Resistance of a board's supply with its wires, ohm: the greatest of the simulated ones.
const SUPPLY_OHM: f64 = 0.3;

/// The greatest working depth at rest, m, from which the deepest press upon a rigid load stays
/// within [`REACH_M`] at the peak current, by the stack's nominal values: the actuated layer
/// stiffens and leaves more of the deformation to the sensing layer.
fn greatest_depth_m(stack: &Stack) -> f64 {
    let ratio = stack.sensing_spring_n_per_m.centre() / stack.actuated_spring_n_per_m.centre();
    let at_peak = ratio / (1.0 + stack.stiffening_at_peak.centre());
    let deeper = (1.0 + ratio) / (1.0 + at_peak);
    let deepest = DEPTHS.into_iter().fold(1.0, f64::max);
    REACH_M / (deepest * deeper)
}

/// The stack's peak current, or what the supply can drive through the warm coil, in whole tenths
/// of an ampere.
fn affordable_peak_a(plant: &Parameters) -> f64 {
    let warm_ohm = WARM * plant.thermal.resistance_ohm;
    let affordable_a = OF_SUPPLY * plant.current.limit_a(warm_ohm);
    let tenths = (affordable_a * 10.0).floor() / 10.0;
    tenths.min(plant.current.peak_a)
}

/// The coil's data as its maker gives them.
pub fn coil(plant: &Parameters) -> Coil {
    let thermal = &plant.thermal;
    Coil {
        resistance_ohm: thermal.resistance_ohm as f32,
        copper_capacity_j_per_k: thermal.copper_j_per_k as f32,
        pad_capacity_j_per_k: thermal.pad_j_per_k as f32,
        copper_to_pad_k_per_w: thermal.copper_to_pad_k_per_w as f32,
        pad_to_ambient_k_per_w: thermal.pad_to_ambient_k_per_w as f32,
        // The gain was the same at the calibration, so that the rise contains it.
        current_uncertainty: 0.0,
    }
}

/// Settings with which the instrument starts.
pub fn default_settings() -> Settings {
    native::default_settings()
}

#[cfg(test)]
mod tests {
    use palpate_calibration::Unusable;
    use palpate_calibration::session::Pressed;

    use super::*;

    #[test]
    #[ignore = "long: `cargo xtask ci` runs it"]
    fn two_temperatures_show_what_the_layers_were_drawn_with() {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let plant = draw(&stack, &Disturbances::builtin().unwrap(), 1);
        let task = BenchTask::of(&plant, &stack, Switches::all(), &default_settings());
        let session = |warmer_k| task.session(&plant, Switches::all(), warmer_k).unwrap();
        let (first, second) = (session(0.0), session(WARMER_K));
        let calibration = evaluate_both(&first, &second, &task.known).unwrap();
        let found = calibration.coefficients.unwrap();
        for (found, drawn) in [
            (found.springs, plant.sensing.spring_per_kelvin),
            (found.rise, plant.magnetorheological.stiffening_per_kelvin),
        ] {
            let deviation = (found.per_k - drawn) / found.uncertainty_per_k;
            assert!(deviation.abs() < 3.0, "{found:?} {drawn}");
            assert!(drawn.abs() > 3.0 * found.uncertainty_per_k, "{drawn}");
        }
        // The other way round the same, of the warm sensor.
        let warm = evaluate_both(&second, &first, &task.known).unwrap();
        let again = warm.coefficients.unwrap().springs.per_k;
        assert!((again - found.springs.per_k).abs() < 1e-5, "{again}");

        let mut near = second.clone();
        near.temperature_c = first.temperature_c + 3.0;
        let refused = evaluate_both(&first, &near, &task.known).unwrap_err();
        assert_eq!(refused, Unusable::SameTemperature { difference_k: 3.0 });
        let mut other = second.clone();
        let mut runs = other.runs.iter_mut();
        let spring = runs.find(|run| matches!(run.pressed, Pressed::Spring { .. }));
        spring.unwrap().pressed = Pressed::Spring { n_per_m: 700.0 };
        let refused = evaluate_both(&first, &other, &task.known).unwrap_err();
        assert_eq!(refused, Unusable::OtherSpecimens);
    }
}
