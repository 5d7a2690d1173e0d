//! Actions that the procedure requests.

use coil_hbridge::CurrentLine;
use palpate_model::units::{Hertz, Second};
use palpate_wire::Record;
use palpate_wire::code::RebootTarget;
use palpate_wire::command::CurrentCorrection;

use crate::link::Link;
use crate::storage::StorageOrder;
use crate::time::{Duration, Instant};

/// One action. The actions of a step must be carried out in order.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Switch the bridge off, before anything else.
    SafeState,
    /// Let the coil's current follow a straight line over time, whose start time is on the clock of
    /// [`Instant`].
    Current(CurrentLine),
    /// Test bridge, coil and current measurement; [`Event::CoilTested`](crate::Event::CoilTested) or a
    /// fault follows.
    TestCoil,
    /// Start a trace of the measured current.
    TraceCurrent {
        /// Interval between two values.
        interval: Second,
    },
    /// Apply a calibration of the current measurement.
    CorrectCurrent(CurrentCorrection),
    /// Configure the converters.
    ConfigureSensors {
        /// Active channels: bit n for channel n.
        channels: u8,
        /// Scans per second.
        rate: Hertz,
    },
    /// Let a converter find the drive current of its sensors again.
    SeekDrive {
        /// 0 for the first converter, 1 for the second.
        sensor: u8,
    },
    /// Send a record.
    Record {
        /// Time of the reported event.
        at: Instant,
        /// Link that receives the answer; `None` for all links.
        to: Option<Link>,
        /// Content of the record.
        record: Record,
    },
    /// Pass an order to the storage. An order that writes or erases may start only while the bridge is
    /// proven off.
    Storage(StorageOrder),
    /// Restart the device as soon as the answer to the restart command has been sent.
    Restart(RebootTarget),
    /// Let the LED flicker for this time.
    Locate(Duration),
}

/// Actions of one step, at most twelve.
pub type Actions = heapless::Vec<Action, MOST_ACTIONS>;

/// Maximum number of actions of a step. A step may contain safe state, current and configuration; a
/// sample, a change of state, its result (estimate, refusal or fault) and a status; an answer to a
/// command, and one to a waiting command that is dropped.
pub(crate) const MOST_ACTIONS: usize = 12;
