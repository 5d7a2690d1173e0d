//! A simulated instrument, calibrated on its own bench.

use std::fmt::Display;

use clap::Args;
use palpate_calibration::bench::{self, BenchPlan, ContactPlan};
use palpate_calibration::session::{Run, Session};
use palpate_calibration::{Calibration, Known, evaluate, evaluate_both};
use palpate_cli::failure::Failure;
use palpate_cli::quantity::within;
use palpate_sim::native;
use palpate_sim::parameters::{Parameters, draw};
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_wire::Command;
use palpate_wire::command::{Coil, Settings};

use crate::bench::NativeBench;

/// A plant and its calibration.
#[derive(Clone, Debug)]
pub struct CalibratedInstrument {
    /// The drawn sensor with its world.
    pub plant: Parameters,
    /// Enabled disturbances.
    pub switches: Switches,
    /// Calibration in use.
    pub calibration: Calibration,
    /// Train without a press, recorded on the bench.
    pub untouched: Run,
    /// The calibration from the bench, before any check.
    pub calibrated: Vec<Command>,
    /// Settings during the calibration.
    pub settings: Settings,
    /// Working depth: deformation of the sensing layer at rest, m.
    pub depth_m: f64,
}

/// Depths of all presses, relative to the working depth. Presses by hand vary as much.
const DEPTHS: [f64; 3] = [0.6, 1.0, 1.4];
/// Greatest deformation of the sensing layer at the peak current, m: that of the deepest press with
/// the shipped designs (soft-closed: 0.4 mm, times 1.4 for the depth, times 1.08 at the peak). At
/// 0.9 mm the layer is flat; its inductance rises ever more steeply towards that.
const REACH_M: f64 = 0.62e-3;
/// Springs of the bench, in units of the nominal c_S.
const SPRINGS: [f64; 6] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
/// Speed of all presses, m/s.
pub const SPEED_M_PER_S: f64 = 2e-3;
/// Time from the end of a press to the train on the bench, s. In use the current rises 0.15 to
/// 0.26 s after the end of a press (0.21 s in the mean of 40 presses of 0.2 to 5 c_S on eight
/// simulated sensors of the design `ultrasoft`); here the coil's test, 0.06 s, comes before the
/// rise. Both times must agree, since the layers creep: after a bench whose trains come 0.16 s
/// earlier, loads of 5 c_S are read 2.4 % softer, and those of c_S 0.8 %.
const REST_S: f64 = 0.15;
/// Greatest peak current, relative to the current that the supply drives through the warm coil.
const OF_SUPPLY: f64 = 0.95;
/// Resistance of the warm coil over that at rest: 50 K above a room that is [`WARMER_K`] warmer. If
/// the supply reached the peak only in the cold room, the rise would seem to change with the
/// temperature.
const WARM: f64 = 1.27;

/// Standard uncertainties of the temperature coefficients before their measurement, for uniform
/// distributions: -0.4 to 0.1 %/K for both springs (root of mean square 0.21 %), within 0.5 %/K for
/// the rise (sim-host/stacks/disturbances.toml).
const SPRINGS_PER_K: f64 = 0.002_1;
const RISE_PER_K: f64 = 0.002_9;
/// Temperature of the second bench above that of the first, K: as much as a warm plate can heat
/// sensor and board.
const WARMER_K: f64 = 20.0;
/// Tolerance of the bench's springs and of its load cell's gain, as in
/// sim-host/stacks/disturbances.toml.
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
        Self::on_bench(task, plant, switches)
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
        Self::twice_on_bench(task, plant, switches)
    }

    /// Calibrates a plant on its bench.
    pub fn on_bench(
        task: BenchTask,
        plant: Parameters,
        switches: Switches,
    ) -> Result<Self, Failure> {
        let session = task.session(&plant, switches, 0.0)?;
        Self::of_session(&session, task, plant, switches)
    }

    /// Calibrates a plant on its bench at two temperatures.
    pub fn twice_on_bench(
        task: BenchTask,
        plant: Parameters,
        switches: Switches,
    ) -> Result<Self, Failure> {
        let [first, second] = task.both_sessions(&plant, switches)?;
        let calibration = evaluate_both(&first, &second, &task.known).map_err(unusable)?;
        Self::with(calibration, &first, task, plant, switches)
    }

    /// Calibrates a plant from a recorded session.
    pub fn of_session(
        session: &Session,
        task: BenchTask,
        plant: Parameters,
        switches: Switches,
    ) -> Result<Self, Failure> {
        let calibration = evaluate(session, &task.known).map_err(unusable)?;
        Self::with(calibration, session, task, plant, switches)
    }

    /// Combines a plant with the calibration from its bench.
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

/// Contacts for which a calibration is to hold.
#[derive(Args, Clone, Debug)]
pub struct ContactArguments {
    /// Measure on the bench what contacts beside the centre change, by four presses of the block at this
    /// distance: intervals then hold for contacts within it
    #[arg(long, value_name = "MM", default_value_t = 0.0, value_parser = within(0.0, 10.0, "mm"))]
    contact_within: f64,
    /// Measure on the bench what tilted contacts change, by two presses of the block tilted by this angle:
    /// intervals then hold for tilts up to it
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = within(0.0, 5.0, "degrees"))]
    contact_tilt: f64,
}

impl ContactArguments {
    /// The presses on the bench.
    pub fn plan(&self) -> ContactPlan {
        ContactPlan {
            within_m: 1e-3 * self.contact_within,
            tilt_rad: self.contact_tilt.to_radians(),
        }
    }

    /// The tolerance in words, for the end of a sentence; empty without one.
    pub fn words(&self) -> String {
        if self.plan() == ContactPlan::default() {
            return String::new();
        }
        format!(
            ", for contacts within {} mm of the centre and tilted by at most {} deg",
            self.contact_within, self.contact_tilt
        )
    }
}

/// Plan and prior data for the bench of a plant.
#[derive(Clone)]
pub struct BenchTask {
    /// Specimens, depths and speeds.
    pub plan: BenchPlan,
    /// Prior data of sensor and bench.
    pub known: Known,
    /// Temperature of the coil, degrees Celsius; `None` unless a board has measured it.
    pub temperature_c: Option<f64>,
}

impl BenchTask {
    /// Records a session on the simulated bench of a plant, at `warmer_k` kelvin above the
    /// temperature of the calibration.
    pub fn session(
        &self,
        plant: &Parameters,
        switches: Switches,
        warmer_k: f64,
    ) -> Result<Session, Failure> {
        let mut bench = NativeBench::new(plant, switches, warmer_k);
        bench::hold(&mut bench, &self.plan, &self.known, &mut |_, _| {}).map_err(unusable)
    }

    /// Records sessions at both temperatures, that of the calibration first.
    pub fn both_sessions(
        &self,
        plant: &Parameters,
        switches: Switches,
    ) -> Result<[Session; 2], Failure> {
        let first = self.session(plant, switches, 0.0)?;
        // The effect of the contact is that of the first session.
        let mut second = self.clone();
        second.plan.contact = ContactPlan::default();
        Ok([first, second.session(plant, switches, WARMER_K)?])
    }

    /// Creates the plan for a plant of this sensor design.
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
            contact: ContactPlan::default(),
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

    /// Creates the plan for a board with a known sensor design and a measured supply, V.
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

/// Resistance of a board's supply with its wires, ohm: the greatest that the simulation draws.
const SUPPLY_OHM: f64 = 0.3;

/// Greatest working depth at rest, m, by the design's nominal values. With it the deepest press
/// onto a rigid load stays within [`REACH_M`] at the peak current, where the stiffer actuated layer
/// leaves more of the deformation to the sensing layer.
fn greatest_depth_m(stack: &Stack) -> f64 {
    let ratio = stack.sensing_spring_n_per_m.centre() / stack.actuated_spring_n_per_m.centre();
    let at_peak = ratio / (1.0 + stack.stiffening_at_peak.centre());
    let deeper = (1.0 + ratio) / (1.0 + at_peak);
    let deepest = DEPTHS.into_iter().fold(1.0, f64::max);
    REACH_M / (deepest * deeper)
}

/// Greatest peak current, A, that the supply drives through the warm coil.
pub fn supply_limit_a(plant: &Parameters) -> f64 {
    OF_SUPPLY * plant.current.limit_a(WARM * plant.thermal.resistance_ohm)
}

/// Peak current, A: that of the sensor design, or less if the supply cannot drive it through the
/// warm coil. The supply's limit is rounded down to whole tenths of an ampere.
fn affordable_peak_a(plant: &Parameters) -> f64 {
    let affordable_a = supply_limit_a(plant);
    let tenths = (affordable_a * 10.0).floor() / 10.0;
    tenths.min(plant.current.peak_a)
}

/// Data of the coil as in a manufacturer's data sheet.
pub fn coil(plant: &Parameters) -> Coil {
    let thermal = &plant.thermal;
    Coil {
        resistance_ohm: thermal.resistance_ohm as f32,
        copper_capacity_j_per_k: thermal.copper_j_per_k as f32,
        pad_capacity_j_per_k: thermal.pad_j_per_k as f32,
        copper_to_pad_k_per_w: thermal.copper_to_pad_k_per_w as f32,
        pad_to_ambient_k_per_w: thermal.pad_to_ambient_k_per_w as f32,
        // The current is measured with the same gain as in the calibration, so the calibrated rise
        // already contains the error of the gain.
        current_uncertainty: 0.0,
    }
}

/// Initial settings of the instrument.
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
        // Exchanged sessions give the same coefficients, with the calibration of the warm sensor.
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
