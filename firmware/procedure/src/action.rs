//! What the procedure wants done.

use coil_hbridge::CurrentLine;
use palpate_model::units::{Hertz, Second};
use palpate_wire::Record;
use palpate_wire::command::CurrentCorrection;

use crate::time::Instant;

/// An action. Those of one step are to be carried out in their order.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Bridge off, before anything else.
    SafeState,
    /// The coil's current follows a line. It begins by the clock of [`Instant`].
    Current(CurrentLine),
    /// Bridge, coil and current measurement are to be tested;
    /// [`Event::CoilTested`](crate::Event::CoilTested) or a fault follows.
    TestCoil,
    /// The measured current is to be recorded from now on.
    TraceCurrent {
        /// From one to the next of what is kept.
        interval: Second,
    },
    /// The current measurement has been calibrated.
    CorrectCurrent(CurrentCorrection),
    /// Converters are to be configured anew.
    ConfigureSensors {
        /// Active channels: bit n for channel n.
        channels: u8,
        /// Scans per second.
        rate: Hertz,
    },
    /// A record for the PC.
    Record {
        /// When what it reports happened.
        at: Instant,
        /// The record.
        record: Record,
    },
}

/// The actions of one step, at most twelve.
pub type Actions = heapless::Vec<Action, MOST_ACTIONS>;

/// No step asks for more: a safe state, a current, a configuration; then a sample, a change of
/// state and its end (estimate, refusal or fault), a status, and two answers: to a command, and to
/// one that waited and is dropped.
pub(crate) const MOST_ACTIONS: usize = 12;
