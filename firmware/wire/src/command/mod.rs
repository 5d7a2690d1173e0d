//! Commands from the host to the device.

use crate::Message;
use crate::decoder::Decoder;
use crate::frame::MAX_HEADER;
use crate::message::messages;

mod calibration;
mod current;
mod curve;
mod request;
mod settings;
mod touch;

pub use calibration::{
    Attraction, CalibrationIdentity, Coil, ContactTolerance, Creep, Crosstalk, Springs, Stiffening,
    Tank, TemperatureCoefficients, TemperatureEffect, Tip,
};
pub use current::{CurrentCorrection, MAX_POINTS};
pub use curve::{
    DeformationCurve, DeformationKnot, KNOTS_PER_CHUNK, MAX_KNOTS, StiffeningCurve, StiffeningKnot,
};
pub use request::{ClearFault, DriveCoil, GetCalibration, Locate, Reboot};
pub use settings::Settings;
pub use touch::{ARRAY_NUMBERS, COIL_NUMBERS, NUMBERS_PER_CHUNK, TouchArray};

messages! {
    /// A command from the PC to the device.
    ///
    /// The device answers every whole command frame with one `acknowledgement`.
    pub enum Command {
        bare {
            /// Requests `hello`. May be addressed to any boot.
            Identify = 0x81 "identify",
            /// Arms the coil's drive and enters stiffness mode.
            Arm = 0x82 "arm",
            /// Disarms the coil's drive; aborts a measurement. May be addressed to any boot.
            Disarm = 0x83 "disarm",
            /// Starts a measurement of the touching object. The device must be armed.
            Measure = 0x84 "measure",
            /// Switches the bridge off first, in every state. Ends a measurement with a refusal, and a
            /// commanded current or the coil's test without one. Drops a command that waits for the
            /// test. May be addressed to any boot.
            Abort = 0x85 "abort",
            /// Disarms and enters sensing-only mode. May be addressed to any boot.
            SensingOnly = 0x86 "sensing_only",
            /// Drives the train of ramps once without an evaluation, with or without contact: for
            /// calibration. The device must be armed.
            Sweep = 0x8A "sweep",
            /// Requests `settings`.
            GetSettings = 0x88 "get_settings",
            /// Tests bridge, coil and current measurement, with up to 6 A for a tenth of a second;
            /// answered by `coil_test` or a fault. The device must be armed.
            TestCoil = 0x8B "test_coil",
            /// Stores the active settings and calibration, so that they are active after the next start.
            /// A power failure at any moment leaves all or nothing stored. Accepted when it starts; the
            /// record `storage` reports the result. Until then no other command may use the coil or set
            /// a value. Not while armed.
            Store = 0x8D "store",
            /// Applies the stored set again, in place of everything set since: this abandons a started
            /// calibration. Answered as `store`. Not while armed.
            Load = 0x8E "load",
            /// Erases the stored set. Active settings and calibration remain until the device restarts.
            /// Answered as `store`. Not while armed.
            Erase = 0x8F "erase",
            /// Requests `storage`.
            GetStorage = 0xA0 "get_storage",
        }
        with payload {
            /// Clears a fault. Refused if another one is latched, or if its cause persists.
            ClearFault(ClearFault) = 0x87 "clear_fault",
            /// Requests a part of the calibration. A curve comes as several records.
            GetCalibration(GetCalibration) = 0x89 "get_calibration",
            /// Drives a current directly, for tests of the coil. The device must be armed. It ends with
            /// a fault 100 ms after its answer or the last command of any kind; `abort` ends it without
            /// one.
            DriveCoil(DriveCoil) = 0x8C "drive_coil",
            /// Replaces all settings. Not while armed.
            SetSettings(Settings) = 0x90 "set_settings",
            /// Calibrates a resonator. Not while armed.
            SetTank(Tank) = 0x91 "set_tank",
            /// Calibrates deformation as a function of inductance, chunk by chunk. Not while armed.
            SetDeformationCurve(DeformationCurve) = 0x92 "set_deformation_curve",
            /// Calibrates the coil's effect on the sensing layer. Not while armed.
            SetCrosstalk(Crosstalk) = 0x93 "set_crosstalk",
            /// Calibrates the springs. Not while armed.
            SetSprings(Springs) = 0x94 "set_springs",
            /// Calibrates the magnetorheological effect as a law; replaces a curve. Not while
            /// armed.
            SetStiffening(Stiffening) = 0x95 "set_stiffening",
            /// Calibrates the magnetorheological effect as a curve, chunk by chunk; replaces a
            /// law. Not while armed.
            SetStiffeningCurve(StiffeningCurve) = 0x96 "set_stiffening_curve",
            /// Sets the coil's data. Not while armed.
            SetCoil(Coil) = 0x97 "set_coil",
            /// Calibrates the attraction between the halves of the actuated layer. Not while armed.
            SetAttraction(Attraction) = 0x98 "set_attraction",
            /// Sets the uncertainty added by a temperature other than the calibration's. Not while
            /// armed.
            SetTemperatureEffect(TemperatureEffect) = 0x99 "set_temperature_effect",
            /// Calibrates the measurement of the coil's current. Not while armed.
            SetCurrentCorrection(CurrentCorrection) = 0x9A "set_current_correction",
            /// Sets the identity of the active calibration: the last command of a calibration. A part
            /// that is set later removes the identity. Not while armed.
            SetCalibrationIdentity(CalibrationIdentity) = 0x9B "set_calibration_identity",
            /// Sets the change of springs and magnetorheological rise with temperature. Not while armed.
            SetTemperatureCoefficients(TemperatureCoefficients) = 0x9C "set_temperature_coefficients",
            /// Declares the tip on the sensor and the object under it. Not while armed.
            SetTip(Tip) = 0xA3 "set_tip",
            /// Restarts the device, bridge off first. Not during a storage operation.
            Reboot(Reboot) = 0xA1 "reboot",
            /// Identifies this board: its LED flickers for a while.
            Locate(Locate) = 0xA2 "locate",
            /// Sets the contacts for which intervals hold. Not while armed.
            SetContact(ContactTolerance) = 0xA8 "set_contact",
            /// Calibrates an array of coils for place, force and radius of a press, chunk by chunk: it
            /// then learns the reading of the untouched sensor, and sends `touch`. Not while armed.
            SetTouchArray(TouchArray) = 0xA9 "set_touch_array",
            /// Calibrates the creep of the sensor's layers. Not while armed.
            SetCreep(Creep) = 0xAB "set_creep",
        }
    }
}

impl Command {
    /// Returns whether a device with boot id `boot` may execute the command in a frame addressed to
    /// `addressee`.
    ///
    /// A command that was in transit during a restart would reach the device in another state than its
    /// sender assumed: armed by mistake, or with other settings. So a command carries the boot id of its
    /// target. Commands that cannot reduce safety may be addressed to
    /// [`Header::ANY_BOOT`](crate::Header::ANY_BOOT).
    ///
    /// ```
    /// use palpate_wire::{Command, Header};
    /// assert!(Command::Arm.is_for(7, 7));
    /// assert!(!Command::Arm.is_for(7, Header::ANY_BOOT));
    /// assert!(Command::Disarm.is_for(7, Header::ANY_BOOT));
    /// assert!(!Command::Disarm.is_for(7, 6));
    /// ```
    pub const fn is_for(&self, boot: u32, addressee: u32) -> bool {
        let harmless = matches!(
            self,
            Self::Identify | Self::Disarm | Self::Abort | Self::SensingOnly
        );
        addressee == boot || (harmless && addressee == crate::Header::ANY_BOOT)
    }
}

/// Decoder of commands.
pub type CommandDecoder = Decoder<Command, { MAX_HEADER + <Command as Message>::MAX_PAYLOAD + 4 }>;
