//! Which program runs the simulated instrument.

#[cfg(feature = "emulator")]
mod emulated;
#[cfg(not(feature = "emulator"))]
mod without_emulator;

use palpate_cli::failure::Failure;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::world::World;

use crate::instrument::CalibratedInstrument;
use crate::press::{Press, PressOutcome, press_on};

#[cfg(feature = "emulator")]
pub(crate) use emulated::Arguments;
#[cfg(all(test, feature = "emulator"))]
pub(crate) use emulated::OnBoard;
#[cfg(not(feature = "emulator"))]
pub(crate) use without_emulator::Arguments;

/// What runs the instrument.
pub(crate) trait Engine {
    /// Presses an object upon the instrument in this world.
    fn press(
        &self,
        world: World,
        instrument: &CalibratedInstrument,
        how: &Press,
    ) -> Result<PressOutcome, Failure>;
}

/// Driver and procedure on this computer.
pub(crate) struct Native;

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
