//! An instrument under way on a simulated plant, whatever runs it.

use palpate_procedure::Instant;
use palpate_wire::{Command, Frame, Record};

use crate::Time;
use crate::native::TimedRecord;
use crate::world::World;

/// An instrument that takes commands and sends records, on a plant whose time it drives.
///
/// [`NativeBoard`](crate::native::NativeBoard) is one on this computer; an emulated board that
/// runs the firmware's image is another.
pub trait Device {
    /// Why it cannot run on.
    type Error;

    /// The present.
    fn now(&self) -> Time;

    /// Sends a command; its answer is among the records when this returns.
    ///
    /// # Errors
    /// If the device cannot run on, or does not answer.
    fn send(&mut self, command: Command) -> Result<(), Self::Error>;

    /// Runs a little, to `end` at most, or beyond it by what cannot be divided.
    ///
    /// # Errors
    /// If the device cannot run on.
    fn advance(&mut self, end: Time) -> Result<(), Self::Error>;

    /// The records that were not taken yet, each with its header.
    fn frames(&mut self) -> &mut Vec<Frame<Record>>;

    /// Looks at the world, or changes it, now.
    fn with_world<T>(&mut self, apply: impl FnOnce(&mut World) -> T) -> T;

    /// Takes the frames since the last call.
    fn take_frames(&mut self) -> Vec<Frame<Record>> {
        core::mem::take(self.frames())
    }

    /// Takes the records since the last call.
    fn take_records(&mut self) -> Vec<TimedRecord> {
        let frames = self.take_frames().into_iter();
        let timed =
            |frame: Frame<Record>| (Instant::from_ticks(frame.header.time_us), frame.message);
        frames.map(timed).collect()
    }

    /// Runs until `end`.
    ///
    /// # Errors
    /// If the device cannot run on.
    fn run_until(&mut self, end: Time) -> Result<(), Self::Error> {
        while self.now() < end {
            self.advance(end)?;
        }
        Ok(())
    }

    /// Runs until a record has come that satisfies `found`, or until `end`; returns whether it has.
    ///
    /// # Errors
    /// If the device cannot run on.
    fn run_to(&mut self, end: Time, found: impl Fn(&Record) -> bool) -> Result<bool, Self::Error> {
        let mut seen = self.frames().len();
        while self.now() < end {
            self.advance(end)?;
            let new = self.frames().get(seen..).unwrap_or_default();
            if new.iter().any(|frame| found(&frame.message)) {
                return Ok(true);
            }
            seen = self.frames().len();
        }
        Ok(false)
    }
}
