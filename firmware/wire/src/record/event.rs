//! Records of events and states of the device.

use heapless::Vec;

use crate::Header;
use crate::code::{FaultCode, Location, Mode, Outcome, State};
use crate::decoder::FrameError;
use crate::message::Message;
use crate::validation::{Invalid, Problem};

structure! {
    /// The procedure entered another state, or was armed or disarmed.
    pub struct StateChange {
        /// Present state.
        state: State,
        /// Previous state; equals `state` if only `mode` or `armed` changed.
        previous: State,
        /// Present mode.
        mode: Mode,
        /// The coil may be driven.
        armed: bool,
        /// Number of the last started measurement; 0 if there was none.
        measurement: u32,
    }
}

structure! {
    /// A fault was raised or cleared.
    pub struct Fault {
        /// Code of the fault.
        code: FaultCode,
        /// Location of the fault.
        location: Location,
        /// True if the fault was raised, false if it was cleared.
        active: bool,
        /// Measured value; the code gives its meaning and unit.
        value: Option<f32> ["", -1e30, 1e30],
        /// Limit of the value; the code gives its meaning and unit.
        limit: Option<f32> ["", -1e30, 1e30],
    }
}

structure! {
    /// Counters and conditions. Every counter counts from the start of the device, is never reset, and
    /// wraps to 0 after 4294967295.
    pub struct Status {
        /// Conversions (scans) read from the first converter.
        conversions: u32 ["1"],
        /// Conversions (scans) of the first converter that were lost: overwritten before they were read.
        conversions_lost: u32 ["1"],
        /// Conversions that the first converter flagged.
        conversions_flagged: u32 ["1"],
        /// Conversions (scans) read from the second converter.
        second_conversions: u32 ["1"],
        /// Conversions (scans) of the second converter that were lost.
        second_conversions_lost: u32 ["1"],
        /// Conversions that the second converter flagged.
        second_conversions_flagged: u32 ["1"],
        /// Failed bus transfers.
        bus_errors: u32 ["1"],
        /// Recoveries of the bus or a converter.
        recoveries: u32 ["1"],
        /// Dropped log messages.
        logs_dropped: u32 ["1"],
        /// Command frames that arrived damaged.
        commands_damaged: u32 ["1"],
        /// Refused commands.
        commands_refused: u32 ["1"],
        /// Started measurements.
        measurements: u32 ["1"],
        /// Measurements that ended in a refusal.
        refusals: u32 ["1"],
        /// Temperature of the coil; absent without a thermometer.
        temperature_c: Option<f32> ["degC", -60, 250],
        /// Supply of the coil; absent if it is not measured.
        supply_v: Option<f32> ["V", 0, 100],
        /// Used share of the processor's time since the last status; absent if not measured.
        processor_load: Option<f32> ["1", 0, 1],
        /// Greatest stack depth; 0 if it is not measured.
        stack_bytes: u32 ["byte"],
    }
}

structure! {
    /// The coil and its circuit, as measured by the test.
    pub struct CoilTest {
        /// Resistance of coil, bridge, wires and supply together.
        resistance_ohm: f32 ["ohm", 0, 1000],
        /// Inductance of the coil.
        inductance_h: f32 ["H", 0, 1],
        /// Share of a bridge period that its dead time takes.
        lost: f32 ["1", 0, 1],
        /// Reading of the current measurement without current.
        zero_v: f32 ["V", 0, 5],
        /// Supply during the test.
        supply_v: f32 ["V", 0, 100],
        /// Current to which the bridge limited itself with its limit reduced; absent if that cannot be
        /// tested.
        limited_to_a: Option<f32> ["A", 0, 100],
    }
}

structure! {
    /// Measured currents, each the mean over a period of the bridge. The header's time is that of the
    /// first current in this part.
    pub struct CurrentTrace {
        /// Number of currents of the whole trace.
        total: u8 ["1", 1, 128],
        /// Index of the first current in this part.
        first: u8 ["", 0, 127],
        /// Interval between two currents.
        interval_s: f32 ["s", 0, 1],
        /// The currents of this part.
        currents_a: Vec<f32, 16> ["A", -100, 100],
    }
}

structure! {
    /// Result of a command. The fields after the outcome are present if they apply.
    pub struct Acknowledgement {
        /// Sequence number of the command's frame.
        command: u32,
        /// Kind of the command.
        kind: u8,
        /// Result of the command.
        outcome: Outcome,
        /// Index of the invalid field: in the command, from 0, or in the item if there is one.
        field: Option<u8>,
        /// Index of the item in the command's list.
        item: Option<u8> ["", 0, 127],
        /// Invalid value.
        value: Option<f32> ["", -1e38, 1e38],
        /// Lowest allowed value.
        low: Option<f32> ["", -1e38, 1e38],
        /// Highest allowed value.
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
