//! The emulated board for the verbs: with the firmware's image, a sensor and a USB cable.
//!
//! Its flash is kept in a file, so stored settings survive the end of a command.

mod board;
mod flash_file;
mod pace;
mod touch;

use std::env;
use std::path::{Path, PathBuf};

use clap::Args;
use flash_file::FlashFile;
use palpate_cli::failure::Failure;
use palpate_emulator::Image;
use palpate_sim::parameters::{Parameters, central, draw};
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::world::World;
use touch::{Touch, untouched};

use crate::board::image::{self, Program};

pub(crate) use board::PluggedBoard;
pub(crate) use pace::Pace;

/// Which emulated board.
#[derive(Args)]
// Skipped: the group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Arguments {
    /// The sensor of the emulated board: paper, soft-closed, ultrasoft, or a stack file. For a real
    /// board: the stack that its coil's data are taken from
    #[arg(long, value_name = "STACK")]
    stack: Option<String>,
    /// Which sensor of the stack the emulated board has
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where the emulated board's flash is kept, instead of the user's folder for such files
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
    #[command(flatten)]
    image: image::Arguments,
}

/// Default sensor design.
const USUAL: &str = "ultrasoft";

/// Image, sensor and flash of an emulated board.
pub(crate) struct Model {
    pub(crate) image: Image,
    /// File of the image.
    pub(crate) image_file: PathBuf,
    pub(crate) stack: Stack,
    pub(crate) plant: Parameters,
    /// File of the flash.
    pub(crate) flash: PathBuf,
}

impl Model {
    /// Connects a board of this model. With `press`, a spring of this multiple of the sensing
    /// layer's stiffness is pressed repeatedly.
    pub(crate) fn plug(&self, press: Option<f64>) -> Result<PluggedBoard, Failure> {
        let (world, touch) = surroundings(&self.stack, &self.plant, press)?;
        let mut board = self.plug_in(world)?;
        board.set_touch(touch);
        Ok(board)
    }

    /// Connects a board of this model in a world.
    pub(crate) fn plug_in(&self, world: World) -> Result<PluggedBoard, Failure> {
        let flash = FlashFile::open(&self.flash)?;
        PluggedBoard::new(self.image.clone(), world, self.plant.seed, flash)
    }
}

/// Creates the world of a board, with the repeated press.
fn surroundings(
    stack: &Stack,
    plant: &Parameters,
    press: Option<f64>,
) -> Result<(World, Option<Touch>), Failure> {
    let touch = press.map(|ratio| Touch::of(stack, plant, ratio));
    let touch = touch.transpose()?;
    let world = touch.map_or_else(|| untouched(plant), |touch| touch.world(plant))?;
    Ok((world, touch))
}

fn disturbances() -> Result<Disturbances, Failure> {
    Ok(Disturbances::builtin().map_err(LoadError::from)?)
}

impl Arguments {
    /// Removes a board from a bench: powers it on again in the world of [`Model::plug`] with this
    /// `press`.
    ///
    /// # Errors
    /// If the world cannot be created, or the storage cannot be read.
    pub(crate) fn plug_anew(
        &self,
        board: &mut PluggedBoard,
        press: Option<f64>,
    ) -> Result<(), Failure> {
        let (stack, plant) = self.stack_and_plant()?;
        let (world, touch) = surroundings(&stack, &plant, press)?;
        board.power_on_in(world)?;
        board.set_touch(touch);
        Ok(())
    }

    /// Returns the named sensor design, with the parameters in the middle of its ranges, for a real
    /// sensor. `None` if no design is named.
    pub(crate) fn expected(&self) -> Result<Option<(Stack, Parameters)>, Failure> {
        if self.stack.is_none() {
            return Ok(None);
        }
        let stack = self.stack()?;
        let plant = central(&stack, &disturbances()?);
        Ok(Some((stack, plant)))
    }

    /// Returns the sensor design, and the emulated board's sensor, which is drawn from it.
    pub(crate) fn stack_and_plant(&self) -> Result<(Stack, Parameters), Failure> {
        let stack = self.stack()?;
        let plant = draw(&stack, &disturbances()?, self.seed);
        Ok((stack, plant))
    }

    fn stack(&self) -> Result<Stack, Failure> {
        let name = self.stack.as_deref().unwrap_or(USUAL);
        Ok(Stack::named(name, Path::new(""))?)
    }

    /// Loads image and sensor.
    pub(crate) fn load(&self) -> Result<Model, Failure> {
        let (stack, plant) = self.stack_and_plant()?;
        let (image_file, image) = self.image.load(Program::Firmware)?;
        Ok(Model {
            image,
            image_file,
            plant,
            stack,
            flash: self.flash(),
        })
    }

    /// Fails if an argument is given that applies to the emulated board only.
    pub(crate) fn none_for_a_real_board(&self) -> Result<(), Failure> {
        if self.state.is_some() {
            return Err(Failure::Argument(
                "--state names the file of the emulated board's flash: add --board emulated".into(),
            ));
        }
        self.image.none_without("--board emulated")
    }

    fn flash(&self) -> PathBuf {
        self.state.clone().unwrap_or_else(|| {
            let stack = self.stack.as_deref().unwrap_or(USUAL);
            let stem = Path::new(stack).file_stem().unwrap_or_default();
            let name = format!("emulated-{}-{}.flash", stem.to_string_lossy(), self.seed);
            state_folder().join(name)
        })
    }
}

/// Folder for program state (the XDG base directory specification; on Windows the folder for local
/// data).
pub(crate) fn state_folder() -> PathBuf {
    let named = ["XDG_STATE_HOME", "LOCALAPPDATA"].into_iter();
    let mut named = named.filter_map(env::var_os).map(PathBuf::from);
    let usual = || env::home_dir().map(|home| home.join(".local/state"));
    let folder = named.find(|path| path.is_absolute()).or_else(usual);
    folder.unwrap_or_else(env::temp_dir).join("palpate")
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Named {
        #[command(flatten)]
        emulated: Arguments,
    }

    #[test]
    fn of_a_real_sensor_the_middle_of_its_stack_is_expected() {
        let of = |arguments: &[&str]| {
            let named = Named::parse_from([&["palpate"], arguments].concat());
            named.emulated.expected().unwrap()
        };
        assert!(of(&["--seed", "3"]).is_none());
        for seed in ["1", "3"] {
            let (stack, sensor) = of(&["--stack", "ultrasoft", "--seed", seed]).unwrap();
            let spring_n_per_m = stack.sensing_spring_n_per_m.centre();
            assert_eq!(sensor.sensing.spring_n_per_m, spring_n_per_m);
            let spring_n_per_m = stack.actuated_spring_n_per_m.centre();
            assert_eq!(sensor.actuated.spring_n_per_m, spring_n_per_m);
        }
    }
}
