//! Records from the device.

use crate::Message;
use crate::command::{
    Attraction, CalibrationIdentity, Coil, ContactTolerance, Creep, Crosstalk, CurrentCorrection,
    DeformationCurve, Settings, Springs, Stiffening, StiffeningCurve, Tank,
    TemperatureCoefficients, TemperatureEffect, Tip, TouchArray,
};
use crate::decoder::Decoder;
use crate::frame::MAX_HEADER;
use crate::message::messages;

mod event;
mod hello;
mod measurement;
mod sample;
mod storage;
mod touch;

pub use event::{Acknowledgement, CoilTest, CurrentTrace, Fault, StateChange, Status};
pub use hello::{Crash, Hello};
pub use measurement::{Estimate, LoadPoint, Refusal, Relaxation, UncertaintyBudget};
pub use sample::{Conversion, Raw, Sample};
pub use storage::Storage;
pub use touch::Touch;

// A new record: docs/first-change.md.
messages! {
    /// A record from the device to the PC.
    pub enum Record {
        bare {}
        with payload {
            /// Identity of the device: the first record after a start, and the answer to `identify`.
            Hello(Hello) = 0x01 "hello",
            /// Cause of the last crash: after the `hello` of a start that follows a panic or a hard
            /// fault.
            Crash(Crash) = 0x02 "crash",
            /// An evaluated sample.
            Sample(Sample) = 0x03 "sample",
            /// Packed conversions without evaluation.
            Raw(Raw) = 0x04 "raw",
            /// A change of state.
            State(StateChange) = 0x05 "state",
            /// Result of a measurement.
            Estimate(Estimate) = 0x06 "estimate",
            /// Point of the load curve of a result; the points follow their estimate.
            LoadPoint(LoadPoint) = 0x07 "load_point",
            /// A measurement without a result.
            Refusal(Refusal) = 0x08 "refusal",
            /// A fault.
            Fault(Fault) = 0x09 "fault",
            /// At the interval `status_period_s` of the settings, after `identify`, and when a touch or a measurement begins.
            Status(Status) = 0x0A "status",
            /// Answer to every whole command frame.
            Acknowledgement(Acknowledgement) = 0x0B "acknowledgement",
            /// Result of a coil test: once after each test, which `test_coil` and `arm` start.
            CoilTest(CoilTest) = 0x0C "coil_test",
            /// Part of a current trace: after a `drive_coil` that requests it, when the last current has
            /// been recorded.
            CurrentTrace(CurrentTrace) = 0x0D "current_trace",
            /// State of the storage and of the active configuration: after a start, after a `store`,
            /// `load` or `erase` has ended, and as the answer to `get_storage`.
            Storage(Storage) = 0x0E "storage",
            /// Contributions to an interval: before an estimate, or before the refusal of one that is
            /// too uncertain.
            UncertaintyBudget(UncertaintyBudget) = 0x0F "uncertainty_budget",
            /// Active settings: answer to `get_settings`.
            Settings(Settings) = 0x10 "settings",
            /// Calibration of a resonator: answer to `get_calibration`.
            Tank(Tank) = 0x11 "tank",
            /// Part of a deformation curve: answer to `get_calibration`.
            DeformationCurve(DeformationCurve) = 0x12 "deformation_curve",
            /// Calibration of the cross-talk: answer to `get_calibration`.
            Crosstalk(Crosstalk) = 0x13 "crosstalk",
            /// Spring constants: answer to `get_calibration`.
            Springs(Springs) = 0x14 "springs",
            /// Coefficients of the magnetorheological effect: answer to `get_calibration`.
            Stiffening(Stiffening) = 0x15 "stiffening",
            /// Part of the stiffening curve: answer to `get_calibration`.
            StiffeningCurve(StiffeningCurve) = 0x16 "stiffening_curve",
            /// The coil's data: answer to `get_calibration`.
            Coil(Coil) = 0x17 "coil",
            /// Attraction between the halves of the actuated layer: answer to `get_calibration`.
            Attraction(Attraction) = 0x18 "attraction",
            /// Uncertainty added by a temperature other than the calibration's: answer to
            /// `get_calibration`.
            TemperatureEffect(TemperatureEffect) = 0x19 "temperature_effect",
            /// Calibration of the current measurement: answer to `get_calibration`.
            CurrentCorrection(CurrentCorrection) = 0x1A "current_correction",
            /// Identity of the active calibration: answer to `get_calibration`.
            CalibrationIdentity(CalibrationIdentity) = 0x1B "calibration_identity",
            /// Change of springs and rise with temperature: answer to `get_calibration`.
            TemperatureCoefficients(TemperatureCoefficients) = 0x1C "temperature_coefficients",
            /// Relaxation of the pressed object: 0.2 s after the train of an estimate, and once more 3 s
            /// after the press became steady, each if the press is still steady then.
            Relaxation(Relaxation) = 0x21 "relaxation",
            /// Declared tip and object: answer to `get_calibration`.
            Tip(Tip) = 0x23 "tip",
            /// Contacts for which intervals hold: answer to `get_calibration`.
            Contact(ContactTolerance) = 0x28 "contact",
            /// Part of an array's calibration: answer to `get_calibration`.
            TouchArray(TouchArray) = 0x29 "touch_array",
            /// Place, force and contact radius of a press: with an array, for every scan of its coils.
            Touch(Touch) = 0x2A "touch",
            /// Creep of the sensor's layers: answer to `get_calibration`.
            Creep(Creep) = 0x2B "creep",
        }
    }
}

/// Decoder of records.
pub type RecordDecoder = Decoder<Record, { MAX_HEADER + <Record as Message>::MAX_PAYLOAD + 4 }>;
