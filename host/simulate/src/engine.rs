//! Which program runs the simulated instrument.

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::progress::Progress;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::world::World;

use crate::instrument::CalibratedInstrument;
use crate::press::{Press, PressOutcome, press_on};

/// What runs the instrument.
pub trait Engine {
    /// Presses an object upon the instrument in this world.
    fn press(
        &self,
        world: World,
        instrument: &CalibratedInstrument,
        how: &Press,
    ) -> Result<PressOutcome, Failure>;

    /// A bar for so many steps.
    fn progress(&self, steps: usize) -> Progress {
        Progress::new(steps)
    }
}

/// The choice of an engine on the command line.
pub trait EngineChoice: Args {
    /// The engine, ready to press.
    ///
    /// # Errors
    /// If arguments do not go together, or its image cannot be had.
    fn engine(&self) -> Result<Box<dyn Engine>, Failure>;
}

// No choice, where there is one engine alone.
#[derive(Args)]
#[group(skip)]
#[allow(missing_docs, reason = "clap would show it as the verb's help")]
pub struct NativeOnly {}

impl EngineChoice for NativeOnly {
    fn engine(&self) -> Result<Box<dyn Engine>, Failure> {
        Ok(Box::new(Native))
    }
}

/// Driver and procedure on this computer.
pub struct Native;

impl Engine for Native {
    fn press(
        &self,
        world: World,
        instrument: &CalibratedInstrument,
        how: &Press,
    ) -> Result<PressOutcome, Failure> {
        let hardware = Wiring::new(world);
        press_on(&mut NativeBoard::new(&hardware), instrument, how).map_err(Failure::refused)
    }
}
