//! Identity of the device, and how its last run ended.

use heapless::String;

use crate::code::{Board, Chip, ResetCause};

structure! {
    /// Identity of the device and its firmware. A receiver that connects in mid-run requests it with
    /// `identify`.
    pub struct Hello {
        /// Minor version of the protocol; the major one is the first byte of every frame.
        minor_version: u8,
        /// CRC-32 over the layout of all frames. If it differs from the receiver's own although the
        /// versions are the same, one of the two was built from changed sources.
        schema_hash: u32,
        /// Version of the firmware, first part.
        firmware_major: u16,
        /// Version of the firmware, second part.
        firmware_minor: u16,
        /// Version of the firmware, third part.
        firmware_patch: u16,
        /// First 32 bits of the commit that the firmware was built from; 0 if unknown.
        commit: u32,
        /// The sources differed from that commit.
        dirty: bool,
        /// The data come from a simulation. Never true on a real board.
        simulated: bool,
        /// Type of the board.
        board: Board,
        /// Number of this copy of the board; 0 if it has none.
        unit: u64,
        /// Cause of the device's start.
        reset_cause: ResetCause,
        /// Converter at the first address.
        chip: Chip,
        /// Converter at the second address.
        second_chip: Chip,
        /// CRC-32 over the active settings and calibration: it shows whether data were taken with a
        /// known configuration.
        configuration_crc: u32,
    }
}

structure! {
    /// Location of the crash, as far as it is known.
    pub struct Crash {
        /// Cause of the crash.
        cause: ResetCause,
        /// Number of consecutive runs that ended in a crash.
        streak: u8 ["1", 1, 255],
        /// End of the name of the source file, for a panic.
        file: String<48>,
        /// Line in that file, 0 if unknown.
        line: u32,
        /// Program counter, for a hard fault; 0 if unknown.
        program_counter: u32,
        /// Link register, for a hard fault; 0 if unknown.
        link_register: u32,
        /// Time from the start to the crash, to within a millisecond; 0 if unknown.
        uptime_ms: u32 ["ms"],
    }
}
