//! Commands from the host to the device.

use crate::Message;
use crate::decoder::Decoder;
use crate::frame::MAX_HEADER;

mod calibration;
mod current;
mod curve;
mod request;
mod settings;

pub use calibration::{
    Attraction, CalibrationIdentity, Coil, Crosstalk, Springs, Stiffening, Tank,
    TemperatureCoefficients, TemperatureEffect,
};
pub use current::{CurrentCorrection, MAX_POINTS};
pub use curve::{
    DeformationCurve, DeformationKnot, KNOTS_PER_CHUNK, MAX_KNOTS, StiffeningCurve, StiffeningKnot,
};
pub use request::{ClearFault, DriveCoil, GetCalibration, Locate, Reboot};
pub use settings::Settings;

messages! {
    /// A command, from the PC to the device.
    ///
    /// The device answers every command frame that arrives whole with one `acknowledgement`.
    pub enum Command {
        bare {
            /// Asks for `hello`. May be addressed to any boot.
            Identify = 0x81 "identify",
            /// Allows the coil to be driven, and goes to stiffness mode.
            Arm = 0x82 "arm",
            /// Forbids the coil to be driven; aborts a measurement. May be addressed to any boot.
            Disarm = 0x83 "disarm",
            /// Begins a measurement of the object that touches. The device has to be armed.
            Measure = 0x84 "measure",
            /// Bridge off first, in every state: ends a measurement with a refusal, and a current that
            /// was commanded, or the coil's test, without one. A command that waits for the test is
            /// dropped. May be addressed to any boot.
            Abort = 0x85 "abort",
            /// Disarms, and goes to sensing-only mode. May be addressed to any boot.
            SensingOnly = 0x86 "sensing_only",
            /// Drives the train of ramps once and evaluates nothing, whether anything touches or
            /// not: for calibration. The device has to be armed.
            Sweep = 0x8A "sweep",
            /// Asks for `settings`.
            GetSettings = 0x88 "get_settings",
            /// Tests bridge, coil and current measurement, with up to 6 A for a tenth of a second;
            /// answered by `coil_test` or a fault. The device has to be armed.
            TestCoil = 0x8B "test_coil",
            /// Stores settings and calibration in force, so that they are in force again after the next
            /// start. All of it is stored, or nothing, whenever the power fails. Accepted when it
            /// begins; the record `storage` says how it ended. Nothing else may use the coil or set
            /// anything meanwhile. Not while armed.
            Store = 0x8D "store",
            /// Brings what is stored into force again, in the place of all that was set since. This is how a
            /// calibration that was begun is abandoned. Answered as `store`. Not while armed.
            Load = 0x8E "load",
            /// Erases all that is stored. What is in force stays so until the device starts anew.
            /// Answered as `store`. Not while armed.
            Erase = 0x8F "erase",
            /// Asks for `storage`.
            GetStorage = 0xA0 "get_storage",
        }
        with payload {
            /// Clears a fault. Refused if another one stands, or its cause has not gone.
            ClearFault(ClearFault) = 0x87 "clear_fault",
            /// A curve comes as several records.
            GetCalibration(GetCalibration) = 0x89 "get_calibration",
            /// Drives a current directly, for tests of the coil. The device has to be armed. It ends
            /// with a fault 100 ms after its answer or the last command of any kind; `abort` ends it
            /// without one.
            DriveCoil(DriveCoil) = 0x8C "drive_coil",
            /// Replaces all settings. Not while armed.
            SetSettings(Settings) = 0x90 "set_settings",
            /// Calibrates a resonator. Not while armed.
            SetTank(Tank) = 0x91 "set_tank",
            /// Calibrates deformation against inductance, chunk by chunk. Not while armed.
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
            /// Calibrates the attraction of the actuated layer's halves. Not while armed.
            SetAttraction(Attraction) = 0x98 "set_attraction",
            /// Sets the uncertainty added by a temperature other than the calibration's. Not while
            /// armed.
            SetTemperatureEffect(TemperatureEffect) = 0x99 "set_temperature_effect",
            /// Calibrates the measurement of the coil's current. Not while armed.
            SetCurrentCorrection(CurrentCorrection) = 0x9A "set_current_correction",
            /// Says which calibration the parts in force are: the last command of a calibration. A part
            /// that is set later takes the identity away again. Not while armed.
            SetCalibrationIdentity(CalibrationIdentity) = 0x9B "set_calibration_identity",
            /// Sets how springs and magnetorheological rise change with the temperature. Not while armed.
            SetTemperatureCoefficients(TemperatureCoefficients) = 0x9C "set_temperature_coefficients",
            /// Starts the device anew, bridge off first. Not while something is being stored.
            Reboot(Reboot) = 0xA1 "reboot",
            /// Shows which board this is: its LED flickers for a while.
            Locate(Locate) = 0xA2 "locate",
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
