//! A world shared between a simulated converter and the code that advances it.

use core::cell::{BorrowError, Ref, RefCell, RefMut};
use std::rc::Rc;

use ldc161x_sim::{Sensors, Window};

use super::World;

/// Channel of the sensing coil.
const SENSING_CHANNEL: usize = 0;

/// A handle of a [`World`]. Clones share the world: one goes into an [`ldc161x_sim::Chip`] as its
/// sensors, another stays with the code that advances time and sets the current.
///
/// A converter on a bus may be ahead of the world's clock by the length of a transfer. The world
/// then answers as if no input changed until that time; the next input still takes effect from its
/// own time on.
#[derive(Clone, Debug)]
pub struct SharedWorld(Rc<RefCell<World>>);

impl SharedWorld {
    /// Shares a world.
    #[must_use]
    pub fn new(world: World) -> Self {
        Self(Rc::new(RefCell::new(world)))
    }

    /// Borrows the world, to read.
    ///
    /// # Panics
    /// If it is borrowed for changes elsewhere.
    #[must_use]
    pub fn borrow(&self) -> Ref<'_, World> {
        self.0.borrow()
    }

    /// Borrows the world, to change it.
    ///
    /// # Panics
    /// If it is borrowed elsewhere.
    #[must_use]
    pub fn borrow_mut(&self) -> RefMut<'_, World> {
        self.0.borrow_mut()
    }

    fn frequency(&self, time_s: f64) -> Result<Option<f64>, BorrowError> {
        if let Some(frequency_hz) = self.0.try_borrow()?.frequency_hz(time_s) {
            return Ok(Some(frequency_hz));
        }
        let Ok(mut world) = self.0.try_borrow_mut() else {
            return Ok(None);
        };
        Ok(world.frequency_ahead_hz(time_s))
    }

    fn losses(&self, channel: usize, time_s: f64) -> (f64, f64) {
        let frequency_hz = self.frequency_hz(channel, time_s);
        match self.0.try_borrow() {
            Ok(world) if frequency_hz > 0.0 => world.losses(frequency_hz),
            _ => (1.0, 1.0),
        }
    }
}

/// The sensing coil is on channel 0; the other channels have none. While a caller has a mutable
/// borrow of the world, the coil does not oscillate.
impl Sensors for SharedWorld {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        if channel != SENSING_CHANNEL {
            return 0.0;
        }
        self.frequency(time_s).ok().flatten().unwrap_or(0.0)
    }

    fn parallel_resistance_ohm(&self, channel: usize, time_s: f64) -> f64 {
        self.losses(channel, time_s).1
    }

    fn quality_factor(&self, channel: usize, time_s: f64) -> f64 {
        self.losses(channel, time_s).0
    }

    fn pulled_cycles(&self, channel: usize, window: &Window) -> f64 {
        match self.0.try_borrow_mut() {
            Ok(mut world) if channel == SENSING_CHANNEL => world.pulled_cycles(window),
            _ => 0.0,
        }
    }
}
