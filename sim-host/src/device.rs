//! A running instrument on a simulated plant, on any kind of board.

use palpate_procedure::Instant;
use palpate_wire::{Command, Frame, Record};

use crate::Time;
use crate::world::World;

/// A record with its time.
pub type TimedRecord = (Instant, Record);

/// An instrument on a simulated plant: takes commands, sends records, and advances virtual time.
///
/// [`NativeBoard`](crate::native::NativeBoard) runs on this computer; an emulated board runs the
/// firmware image.
pub trait Device {
    /// Error that stops the device.
    type Error;

    /// Current virtual time.
    fn now(&self) -> Time;

    /// Sends a command. Its answer is among the records when this function returns.
    ///
    /// # Errors
    /// If the device cannot run on, or does not answer.
    fn send(&mut self, command: Command) -> Result<(), Self::Error>;

    /// Runs for a short time, to `end` at most; a step that cannot be divided may end after it.
    ///
    /// # Errors
    /// If the device cannot run on.
    fn advance(&mut self, end: Time) -> Result<(), Self::Error>;

    /// Records that have not been taken yet, each with its header.
    fn frames(&mut self) -> &mut Vec<Frame<Record>>;

    /// Calls `apply` with the world at the current time, to read or to change it.
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

    /// Runs until a record satisfies `found`, or until `end`; returns whether one did.
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
