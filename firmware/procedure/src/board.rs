//! What the board is and what it may do: compiled in, never a setting.

use palpate_model::units::{Ampere, Celsius, Hertz};
use palpate_wire::record::{Crash, Hello};

/// A board, as far as the procedure has to know it.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardInfo {
    /// A random number that the device drew when it started, never 0.
    pub boot_id: u32,
    /// Who speaks; the procedure fills in the configuration's check number.
    pub hello: Hello,
    /// What the last run died of.
    pub crash: Option<Crash>,
    /// Channels that the first and the second converter have: bit n for channel n, 0 without
    /// the converter.
    pub channels: [u8; 2],
    /// Whether there are bridge, coil and current measurement.
    pub coil: bool,
    /// Whether there is a storage for settings and calibration.
    pub storage: bool,
    /// Crashes in a row, of which the last run's was the last.
    pub crashes: u8,
    /// What no setting, command or calibration exceeds.
    pub limits: Limits,
}

/// Crashes in a row after which the outputs stay off until the device is started without one.
pub const MOST_CRASHES: u8 = 5;

/// What no setting, command or calibration exceeds.
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
    /// Scans per second.
    pub rate: Hertz,
}

/// What the drive of the reference board never exceeds: the one place of these numbers.
///
/// 12 A: bridges for 15 A, with a margin. 12.7 A is the end of the converter's range less the
/// tolerance of its zero. Bridges keep their upper switches supplied for 2 % of the time. 60 J would
/// heat copper of 0.8 J/K by 75 K if it kept them all; from 25 degrees Celsius that ends at the 100
/// allowed. 3.5 W is the continuous rating of the paper's coils, 3 A; 20 s is what it makes of 60 J.
/// Resistance and inductance are those of coils that make sense here, with a factor to spare.
pub const DRIVE: coil_hbridge::Limits = coil_hbridge::Limits {
    current_a: 12.0,
    trip_a: 12.7,
    duty: 0.98,
    on_time_s: 20.0,
    energy_j: 60.0,
    continuous_w: 3.5,
    supply_v: [4.5, 14.0],
    resistance_ohm: [0.15, 3.0],
    inductance_h: [10e-6, 400e-6],
};

impl Limits {
    /// For the reference board and the paper's coils: those of its [drive](DRIVE), and 5 kHz, the
    /// protocol's limit.
    pub const REFERENCE: Self = Self {
        current: Ampere(DRIVE.current_a),
        energy_j: DRIVE.energy_j,
        on_time_s: DRIVE.on_time_s,
        temperature: Celsius(100.0),
        rate: Hertz(5_000.0),
    };
}

#[cfg(test)]
pub(crate) mod tests {
    use palpate_wire::code::{Board, Chip, ResetCause};

    use super::*;

    /// A board with one converter and a coil.
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
        limits: Limits::REFERENCE,
    };
}
