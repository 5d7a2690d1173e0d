//! Who the virtual board says it is.

use palpate_procedure::{Board, Limits};
use palpate_wire::code::{Board as Kind, Chip, ResetCause};
use palpate_wire::record::Hello;
use palpate_wire::{MINOR_VERSION, SCHEMA_HASH};

/// Its boot id: a simulation starts only once.
pub const BOOT_ID: u32 = 1;

/// The board as it is reported to the procedure: no hardware, one converter with four channels, a coil.
#[must_use]
pub fn board() -> Board {
    let part = |number: Option<&str>| number.and_then(|text| text.parse().ok()).unwrap_or(0);
    Board {
        boot_id: BOOT_ID,
        hello: Hello {
            minor_version: MINOR_VERSION,
            schema_hash: SCHEMA_HASH,
            firmware_major: part(option_env!("CARGO_PKG_VERSION_MAJOR")),
            firmware_minor: part(option_env!("CARGO_PKG_VERSION_MINOR")),
            firmware_patch: part(option_env!("CARGO_PKG_VERSION_PATCH")),
            commit: 0,
            dirty: false,
            simulated: true,
            board: Kind::Virtual,
            unit: 0,
            reset_cause: ResetCause::PowerOn,
            chip: Chip::Ldc161x,
            second_chip: Chip::Absent,
            configuration_crc: 0,
        },
        crash: None,
        crashes: 0,
        channels: [0b1111, 0],
        coil: true,
        limits: Limits::REFERENCE,
    }
}
