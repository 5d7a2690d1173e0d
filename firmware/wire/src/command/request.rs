//! Commands with a few fields.

use crate::code::{FaultCode, Part, RebootTarget};

structure! {
    /// Which fault is to be cleared.
    pub struct ClearFault {
        /// The fault that the user has seen.
        code: FaultCode,
    }
}

structure! {
    /// Asks for a part of the calibration.
    pub struct GetCalibration {
        /// The part.
        part: Part,
        /// Converter: 0 first, 1 second. Counts for `tank`, `deformation_curve` and `crosstalk`.
        sensor: u8 ["", 0, 1],
        /// Channel. Counts for the same parts.
        channel: u8 ["", 0, 3],
    }
}

structure! {
    /// A straight line of the coil's current from where it is.
    pub struct DriveCoil {
        /// Where it goes; the sign is the polarity.
        to_a: f32 ["A", -20, 20],
        /// How long that takes.
        over_s: f32 ["s", 0, 10],
        /// From one measured current to the next of those that are recorded from now on, 128 in
        /// all, and sent as `current_trace`; the device rounds it to whole periods of its bridge,
        /// one at least. 0 records none.
        trace_interval_s: f32 ["s", 0, 0.01],
    }
}

structure! {
    /// How to start anew.
    pub struct Reboot {
        /// Into what.
        target: RebootTarget,
    }
}

structure! {
    /// Which board is this?
    pub struct Locate {
        /// How long the LED flickers; 0 ends it.
        duration_s: f32 ["s", 0, 60],
    }
}
