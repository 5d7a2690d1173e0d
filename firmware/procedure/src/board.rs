//! Properties and limits of the board: compiled in, never a setting.

use palpate_model::units::{Ampere, Celsius, Hertz};
use palpate_wire::record::{Crash, Hello};

/// Board properties that the procedure needs.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardInfo {
    /// Random boot id of this run, never 0.
    pub boot_id: u32,
    /// Identification of the device; the procedure fills in the CRC of the configuration.
    pub hello: Hello,
    /// Crash of the last run; `None` if it left no crash record.
    pub crash: Option<Crash>,
    /// Channels of the first and the second converter: bit n for channel n, 0 without the converter.
    pub channels: [u8; 2],
    /// Whether the board has bridge, coil and current measurement.
    pub coil: bool,
    /// Whether the board has a storage for settings and calibration.
    pub storage: bool,
    /// Number of consecutive crashes, up to and including the last run.
    pub crashes: u8,
    /// Hard limits of every setting, command and calibration.
    pub limits: Limits,
}

/// Number of consecutive crashes after which the outputs stay off until a start that follows no crash.
pub const MOST_CRASHES: u8 = 5;

/// Hard limits of every setting, command and calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Current in the coil.
    pub current: Ampere,
    /// Energy into the coil in one measurement, in joules.
    pub energy_j: f32,
    /// Time with current in one measurement, in seconds.
    pub on_time_s: f32,
    /// Temperature of the coil.
    pub temperature: Celsius,
    /// Scan rate.
    pub rate: Hertz,
}

#[cfg(test)]
pub(crate) mod tests {
    use palpate_wire::code::{Board, Chip, ResetCause};

    use super::*;

    /// Board of the tests, with one converter and a coil. The limits of the Pico stand in
    /// `firmware/node/src/board.rs`.
    pub(crate) const BOARD: BoardInfo = BoardInfo {
        boot_id: 7,
        hello: Hello {
            minor_version: 0,
            schema_hash: 0,
            firmware_major: 0,
            firmware_minor: 0,
            firmware_patch: 0,
            commit: 0,
            dirty: false,
            simulated: true,
            board: Board::Native,
            unit: 0,
            reset_cause: ResetCause::PowerOn,
            chip: Chip::Ldc161x,
            second_chip: Chip::Absent,
            configuration_crc: 0,
        },
        crash: None,
        channels: [0b1111, 0],
        coil: true,
        storage: false,
        crashes: 0,
        limits: Limits {
            current: Ampere(12.0),
            energy_j: 60.0,
            on_time_s: 20.0,
            temperature: Celsius(100.0),
            rate: Hertz(5_000.0),
        },
    };
}
