//! Identity that the native board reports.

use palpate_node::board::LIMITS;
use palpate_node::instrument::Identity;
use palpate_procedure::boot::Boot;
use palpate_wire::code::{Board, Chip, ResetCause};
use palpate_wire::record::Hello;

/// Boot id after the first start.
pub const FIRST_BOOT_ID: u32 = 1;

/// Identity of the board at the start of the instrument: no hardware.
pub(super) fn identity(boot_id: u32) -> Identity {
    let part = |number: Option<&str>| number.and_then(|text| text.parse().ok()).unwrap_or(0);
    Identity {
        boot_id,
        hello: Hello {
            minor_version: 0,
            schema_hash: 0,
            firmware_major: part(option_env!("CARGO_PKG_VERSION_MAJOR")),
            firmware_minor: part(option_env!("CARGO_PKG_VERSION_MINOR")),
            firmware_patch: part(option_env!("CARGO_PKG_VERSION_PATCH")),
            commit: 0,
            dirty: false,
            simulated: true,
            board: Board::Native,
            unit: 0,
            reset_cause: ResetCause::PowerOn,
            chip: Chip::Absent,
            second_chip: Chip::Absent,
            configuration_crc: 0,
        },
        boot: Boot {
            cause: ResetCause::PowerOn,
            streak: 0,
            crash: None,
        },
        clocks_run: true,
        storage: true,
        limits: LIMITS,
    }
}
