//! The program that runs the simulated instrument.

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::progress::Progress;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::world::{Setup, World};

use crate::instrument::CalibratedInstrument;
use crate::press::{Press, PressOutcome, press_on};

/// An engine that runs the instrument.
pub trait Engine {
    /// Presses an object onto the instrument in this world.
    fn press(
        &self,
        world: World,
        instrument: &CalibratedInstrument,
        how: &Press,
    ) -> Result<PressOutcome, Failure>;

    /// Creates a progress bar for `steps` steps.
    fn progress(&self, steps: usize) -> Progress {
        Progress::new(steps)
    }
}

/// Arguments that select an engine.
pub trait EngineChoice: Args {
    /// Returns the engine, ready to press.
    ///
    /// # Errors
    /// If arguments contradict each other, or the image is not available.
    fn engine(&self) -> Result<Box<dyn Engine>, Failure>;
}

// No arguments: there is only one engine.
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

/// Presses an object onto the instrument and waits for an estimate or refusal.
pub fn press(
    instrument: &CalibratedInstrument,
    how: &Press,
    engine: &dyn Engine,
) -> Result<PressOutcome, Failure> {
    let setup = Setup {
        load: how.load,
        contact: how.contact,
        holder: how.holder,
        profile: Profile::at(-how.clearance_m),
        ..Setup::default()
    };
    let world = World::new(&instrument.plant, instrument.switches, setup)?;
    engine.press(world, instrument, how)
}
