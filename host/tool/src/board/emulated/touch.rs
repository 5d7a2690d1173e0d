//! Repeated presses on the emulated board's sensor.

use palpate_cli::failure::Failure;
use palpate_sim::Time;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::parameters::{ParameterError, Parameters};
use palpate_sim::stack::Stack;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Holder, Setup, World};
use palpate_simulate::instrument::SPEED_M_PER_S;

/// Distance of the lifted object from the sensor, m.
const CLEARANCE_M: f64 = 0.5e-3;
/// Initial time without contact, longer than the baseline.
const UNTOUCHED: Time = Time::from_ms(3_000);
/// Time for which the object is lifted between two presses. The elastomer creeps back: of a
/// deformation of 350 µm, 9 µm are left after 3 s, and the board ends a contact below `release_m`,
/// 5 µm by default.
const LIFTED: Time = Time::from_ms(8_000);
/// Pressed time: settling, train and result.
const PRESSED: Time = Time::from_ms(5_000);

/// An object that is pressed repeatedly.
#[derive(Clone, Copy)]
pub(crate) struct Touch {
    load: Load,
    /// Target deformation of the sensing layer, m.
    depth_m: f64,
    is_down: bool,
    due: Time,
}

impl Touch {
    /// Creates a spring of a multiple of the sensing layer's nominal stiffness.
    pub(super) fn of(stack: &Stack, plant: &Parameters, ratio: f64) -> Result<Self, Failure> {
        if !(ratio.is_finite() && ratio > 0.0) {
            return Err(Failure::Argument(format!(
                "a spring of {ratio} times the sensing layer's stiffness: it takes a positive number"
            )));
        }
        let n_per_m = ratio * stack.sensing_spring_n_per_m.centre();
        Ok(Self {
            load: Load::Spring { n_per_m },
            depth_m: plant.press.depth_m,
            is_down: false,
            due: UNTOUCHED,
        })
    }

    /// Creates a world with the object above the sensor.
    pub(super) fn world(&self, plant: &Parameters) -> Result<World, ParameterError> {
        world(plant, self.load)
    }

    /// Lowers or lifts the object when due.
    pub(super) fn follow(&mut self, world: &mut World) {
        if world.now() < self.due {
            return;
        }
        self.is_down = !self.is_down;
        let (position_m, lasts) = if self.is_down {
            (world.press_for_depth_m(self.depth_m), PRESSED)
        } else {
            (-CLEARANCE_M, LIFTED)
        };
        world.move_press(position_m, SPEED_M_PER_S);
        self.due = world.now() + lasts;
    }
}

/// Creates a world without contact.
pub(super) fn untouched(plant: &Parameters) -> Result<World, ParameterError> {
    world(plant, Load::Rigid)
}

fn world(plant: &Parameters, load: Load) -> Result<World, ParameterError> {
    let setup = Setup {
        load,
        holder: Holder::Stand,
        profile: Profile::at(-CLEARANCE_M),
        ..Setup::default()
    };
    World::new(plant, Switches::all(), setup)
}
