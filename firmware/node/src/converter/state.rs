//! What a converter's task and the instrument share.

use ldc161x::InterruptRelease;
use palpate_procedure::event::Failure;
use palpate_wire::code::Chip;

use crate::acquisition::{Sampled, Setpoint};
use crate::board::Clkin;

/// Converters that a board may have.
pub const CONVERTERS: usize = 2;

/// What a converter's task and the instrument share of one converter.
#[derive(Clone, Copy, Debug, Default)]
pub struct ConverterState {
    /// How it is to be run, with a generation that changes whenever that does. Nothing before the
    /// procedure has begun.
    setpoint: Option<(Setpoint, u32)>,
    /// Which chip answers, once it was asked.
    pub(super) chip: Option<Chip>,
    /// The clock by which it runs; nothing while it is held in shutdown.
    pub(super) clkin: Option<Clkin>,
    /// What releases INTB, once it was asked.
    pub(super) release: Option<InterruptRelease>,
    /// What has failed, while it stands.
    pub(super) failure: Option<Failure>,
    /// Transfers that failed since the start.
    pub(super) transfer_errors: u32,
    /// Recoveries of bus or converter since the start.
    pub(super) recoveries: u32,
}

impl ConverterState {
    /// A converter before its first question.
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

    /// Sets how the converter is to be run. A converter that is run so already goes on undisturbed.
    pub fn set(&mut self, setpoint: Setpoint) {
        self.setpoint = match self.setpoint {
            Some((already, _)) if already == setpoint => return,
            Some((_, generation)) => Some((setpoint, generation.wrapping_add(1))),
            None => Some((setpoint, 1)),
        };
    }

    /// Lets the converter find the drive currents anew, for the sensors as they are now.
    pub const fn seek_drive(&mut self) {
        if let Some((_, generation)) = &mut self.setpoint {
            *generation = generation.wrapping_add(1);
        }
    }

    /// How it is to be run, with the generation of that.
    #[must_use]
    pub const fn setpoint(&self) -> Option<(Setpoint, u32)> {
        self.setpoint
    }

    /// Whether a sample was converted by the setpoint in force. One of an earlier setpoint may still
    /// be on its way when that changes: its clock and its channels are others, so that no part may use
    /// it.
    #[must_use]
    pub fn is_current(&self, sampled: &Sampled) -> bool {
        self.setpoint
            .is_some_and(|(_, generation)| generation == sampled.generation)
    }

    /// Which chip answers, once it was asked.
    #[must_use]
    pub const fn chip(&self) -> Option<Chip> {
        self.chip
    }

    /// Whether frames are read with STATUS: unless the converter said that it needs that not.
    #[must_use]
    pub fn reads_status(&self) -> bool {
        self.release != Some(InterruptRelease::ByData)
    }

    /// What has failed, while it stands.
    #[must_use]
    pub const fn failure(&self) -> Option<Failure> {
        self.failure
    }

    /// Transfers that failed, and recoveries, since the start; both wrap.
    #[must_use]
    pub const fn counts(&self) -> [u32; 2] {
        [self.transfer_errors, self.recoveries]
    }
}
