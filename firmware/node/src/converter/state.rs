//! State that a converter's task and the instrument share.

use ldc161x::InterruptRelease;
use palpate_procedure::event::Failure;
use palpate_wire::code::Chip;

use crate::acquisition::{Sampled, Setpoint};
use crate::board::Clkin;

/// Maximum number of converters on a board.
pub const CONVERTERS: usize = 2;

/// State of one converter that its task and the instrument share.
#[derive(Clone, Copy, Debug, Default)]
pub struct ConverterState {
    /// Requested operation, and its generation, which changes with every new setpoint. `None` before the
    /// procedure has started.
    setpoint: Option<(Setpoint, u32)>,
    /// Chip that answers, once identified.
    pub(super) chip: Option<Chip>,
    /// Clock that the converter runs from; `None` while it is in shutdown.
    pub(super) clkin: Option<Clkin>,
    /// Access that releases INTB, once known.
    pub(super) release: Option<InterruptRelease>,
    /// Latched failure.
    pub(super) failure: Option<Failure>,
    /// Number of failed transfers since start-up.
    pub(super) transfer_errors: u32,
    /// Number of recoveries of bus or converter since start-up.
    pub(super) recoveries: u32,
}

impl ConverterState {
    /// State of a converter before its first identification.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            setpoint: None,
            chip: None,
            clkin: None,
            release: None,
            failure: None,
            transfer_errors: 0,
            recoveries: 0,
        }
    }

    /// Sets the requested operation. A converter that already has this setpoint continues undisturbed.
    pub fn set(&mut self, setpoint: Setpoint) {
        self.setpoint = match self.setpoint {
            Some((already, _)) if already == setpoint => return,
            Some((_, generation)) => Some((setpoint, generation.wrapping_add(1))),
            None => Some((setpoint, 1)),
        };
    }

    /// Lets the converter find the drive currents again for the attached sensors.
    pub const fn seek_drive(&mut self) {
        if let Some((_, generation)) = &mut self.setpoint {
            *generation = generation.wrapping_add(1);
        }
    }

    /// Returns the requested operation and its generation.
    #[must_use]
    pub const fn setpoint(&self) -> Option<(Setpoint, u32)> {
        self.setpoint
    }

    /// Returns whether a sample was converted with the active setpoint. A sample of an earlier setpoint
    /// may still be in a queue after a change: its clock and its channels differ, so no part may use it.
    #[must_use]
    pub fn is_current(&self, sampled: &Sampled) -> bool {
        self.setpoint
            .is_some_and(|(_, generation)| generation == sampled.generation)
    }

    /// Returns the chip that answers, once identified.
    #[must_use]
    pub const fn chip(&self) -> Option<Chip> {
        self.chip
    }

    /// Returns whether frames are read with STATUS: always, unless reading the data alone is known to
    /// release INTB.
    #[must_use]
    pub fn reads_status(&self) -> bool {
        self.release != Some(InterruptRelease::ByData)
    }

    /// Returns the latched failure.
    #[must_use]
    pub const fn failure(&self) -> Option<Failure> {
        self.failure
    }

    /// Returns the number of failed transfers and of recoveries since start-up; both wrap.
    #[must_use]
    pub const fn counts(&self) -> [u32; 2] {
        [self.transfer_errors, self.recoveries]
    }
}
