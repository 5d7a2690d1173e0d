//! What the procedure wants done.

use coil_hbridge::CurrentLine;
use palpate_model::units::{Hertz, Second};
use palpate_wire::Record;
use palpate_wire::code::RebootTarget;
use palpate_wire::command::CurrentCorrection;

use crate::link::Link;
use crate::storage::StorageOrder;
use crate::time::{Duration, Instant};

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
    /// A converter is to find the drive current of its sensors anew.
    SeekDrive {
        /// 0 the first, 1 the second.
        sensor: u8,
    },
    /// A record.
    Record {
        /// When what it reports happened.
        at: Instant,
        /// The link that it answers; nothing if it goes to all of them.
        to: Option<Link>,
        /// The record.
        record: Record,
    },
    /// Something for the storage. What writes or erases is only begun while the bridge is proven
    /// off.
    Storage(StorageOrder),
    /// The device is to start anew, as soon as its answer has been sent.
    Restart(RebootTarget),
    /// The LED is to flicker for so long.
    Locate(Duration),
}

/// The actions of one step, at most twelve.
pub type Actions = heapless::Vec<Action, MOST_ACTIONS>;

/// No step asks for more: a safe state, a current, a configuration; then a sample, a change of
/// state and its end (estimate, refusal or fault), a status, and two answers: to a command, and to
/// one that waited and is dropped.
pub(crate) const MOST_ACTIONS: usize = 12;
