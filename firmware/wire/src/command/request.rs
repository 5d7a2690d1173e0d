//! Commands with a few fields.

use crate::code::{FaultCode, Part, RebootTarget};

structure! {
    /// Identifies the fault to be cleared.
    pub struct ClearFault {
        /// The fault that the user has seen.
        code: FaultCode,
    }
}

structure! {
    /// Selects a part of the calibration.
    pub struct GetCalibration {
        /// The part.
        part: Part,
        /// Converter: 0 first, 1 second. Used for `tank`, `deformation_curve` and `crosstalk`.
        sensor: u8 ["", 0, 1],
        /// Channel. Used for these three parts only.
        channel: u8 ["", 0, 3],
    }
}

structure! {
    /// A straight line of the coil's current, starting at the present current.
    pub struct DriveCoil {
        /// Final current; the sign is the polarity.
        to_a: f32 ["A", -20, 20],
        /// Duration of the line.
        over_s: f32 ["s", 0, 10],
        /// Interval between two values of a trace, which has 128 values, starts at once and is sent as
        /// `current_trace`; the device rounds it to whole periods of its bridge, at least one. 0 records
        /// none.
        trace_interval_s: f32 ["s", 0, 0.01],
    }
}

structure! {
    /// Selects the target of a restart.
    pub struct Reboot {
        /// Target of the restart.
        target: RebootTarget,
    }
}

structure! {
    /// Identifies this board.
    pub struct Locate {
        /// Time for which the LED flickers; 0 ends it.
        duration_s: f32 ["s", 0, 60],
    }
}
