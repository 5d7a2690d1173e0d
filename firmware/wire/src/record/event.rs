//! Records of events and states of the device.

use heapless::Vec;

use crate::Header;
use crate::code::{FaultCode, Location, Mode, Outcome, State};
use crate::decoder::FrameError;
use crate::message::Message;
use crate::validation::{Invalid, Problem};

structure! {
    /// The procedure went to another state, or was armed or disarmed.
    pub struct StateChange {
        /// The state now.
        state: State,
        /// The state before; the same if only `mode` or `armed` changed.
        previous: State,
        /// The mode now.
        mode: Mode,
        /// Whether the coil may be driven.
        armed: bool,
        /// Number of the last measurement that began; 0 if none has.
        measurement: u32,
    }
}

structure! {
    /// A fault began or ended.
    pub struct Fault {
        /// Which one.
        code: FaultCode,
        /// Where.
        location: Location,
        /// It stands; false when it was cleared.
        active: bool,
        /// What was found; the code says what it is and its unit.
        value: Option<f32> ["", -1e30, 1e30],
        /// What is allowed; the code says what it is and its unit.
        limit: Option<f32> ["", -1e30, 1e30],
    }
}

structure! {
    /// Counters and conditions. Every counter counts from the start of the device, is never set
    /// back, and goes on from 0 after 4294967295.
    pub struct Status {
        /// Conversions (scans) read from the first converter.
        conversions: u32 ["1"],
        /// Conversions (scans) of it that were lost: overwritten before they were read.
        conversions_lost: u32 ["1"],
        /// Conversions that it flagged.
        conversions_flagged: u32 ["1"],
        /// The same for the second converter: read.
        second_conversions: u32 ["1"],
        /// Lost.
        second_conversions_lost: u32 ["1"],
        /// Flagged.
        second_conversions_flagged: u32 ["1"],
        /// Transfers on the bus that failed.
        bus_errors: u32 ["1"],
        /// Recoveries of the bus or a converter.
        recoveries: u32 ["1"],
        /// Log messages that were dropped.
        logs_dropped: u32 ["1"],
        /// Command frames that arrived damaged.
        commands_damaged: u32 ["1"],
        /// Commands that were refused.
        commands_refused: u32 ["1"],
        /// Measurements that began.
        measurements: u32 ["1"],
        /// Measurements that ended in a refusal.
        refusals: u32 ["1"],
        /// Temperature of the coil; absent without a thermometer.
        temperature_c: Option<f32> ["degC", -60, 250],
        /// Supply of the coil; absent if it is not measured.
        supply_v: Option<f32> ["V", 0, 100],
        /// Part of the processor's time in use since the last status; absent if not measured.
        processor_load: Option<f32> ["1", 0, 1],
        /// Greatest depth of the stack; 0 if it is not measured.
        stack_bytes: u32 ["byte"],
    }
}

structure! {
    /// The coil and its circuit, as the test found them.
    pub struct CoilTest {
        /// Resistance of coil, bridge, wires and supply together.
        resistance_ohm: f32 ["ohm", 0, 1000],
        /// Inductance of the coil.
        inductance_h: f32 ["H", 0, 1],
        /// Part of a period of the bridge that its dead time takes.
        lost: f32 ["1", 0, 1],
        /// Reading of the current measurement without current.
        zero_v: f32 ["V", 0, 5],
        /// Supply during the test.
        supply_v: f32 ["V", 0, 100],
        /// Current to which the bridge limited itself, its limit reduced; absent where that cannot
        /// be tested.
        limited_to_a: Option<f32> ["A", 0, 100],
    }
}

structure! {
    /// Measured currents, each the mean over a period of the bridge. The header's time is the one
    /// of this part's first.
    pub struct CurrentTrace {
        /// Currents in all.
        total: u8 ["1", 1, 128],
        /// Index of this part's first current.
        first: u8 ["", 0, 127],
        /// From one to the next.
        interval_s: f32 ["s", 0, 1],
        /// The currents of this part.
        currents_a: Vec<f32, 16> ["A", -100, 100],
    }
}

structure! {
    /// What became of the command. The fields after the outcome are present as far as they apply.
    pub struct Acknowledgement {
        /// Sequence number of the command's frame.
        command: u32,
        /// Kind of the command.
        kind: u8,
        /// What became of it.
        outcome: Outcome,
        /// Index of the field that was not accepted: in the command, from 0, or in the item if
        /// there is one.
        field: Option<u8>,
        /// Index of the item in the command's list.
        item: Option<u8> ["", 0, 127],
        /// Value found.
        value: Option<f32> ["", -1e38, 1e38],
        /// Least value allowed.
        low: Option<f32> ["", -1e38, 1e38],
        /// Greatest value allowed.
        high: Option<f32> ["", -1e38, 1e38],
    }
}

impl Acknowledgement {
    /// Creates an answer without numbers.
    pub const fn new(command: &Header, kind: u8, outcome: Outcome) -> Self {
        Self {
            command: command.sequence,
            kind,
            outcome,
            field: None,
            item: None,
            value: None,
            low: None,
            high: None,
        }
    }

    /// Creates the answer to a valid command that has started.
    pub fn accepted<M: Message>(command: &Header, message: &M) -> Self {
        Self::new(command, message.kind(), Outcome::Accepted)
    }

    /// Creates the answer to a command with an invalid field.
    pub const fn invalid(command: &Header, kind: u8, invalid: &Invalid) -> Self {
        let (outcome, value, low, high) = match invalid.problem {
            Problem::NotFinite => (Outcome::NotFinite, None, None, None),
            Problem::OutOfRange { value, low, high } => {
                (Outcome::OutOfRange, Some(value), Some(low), Some(high))
            }
            Problem::UnknownCode { number } => {
                (Outcome::UnknownCode, Some(number as f32), None, None)
            }
            Problem::NotIncreasing { value, previous } => {
                (Outcome::NotIncreasing, Some(value), Some(previous), None)
            }
            Problem::Inconsistent { .. } => (Outcome::Inconsistent, None, None, None),
        };
        Self {
            command: command.sequence,
            kind,
            outcome,
            field: Some(invalid.field),
            item: invalid.item,
            value,
            low,
            high,
        }
    }

    /// Creates the answer to a whole frame that could not be decoded; `None` if its header was
    /// unreadable, so that the device cannot answer.
    pub const fn not_understood(error: &FrameError) -> Option<Self> {
        match error {
            FrameError::UnknownKind { header, kind } => {
                Some(Self::new(header, *kind, Outcome::UnknownCommand))
            }
            FrameError::Payload { header, kind, .. } => {
                Some(Self::new(header, *kind, Outcome::Malformed))
            }
            _ => None,
        }
    }
}
