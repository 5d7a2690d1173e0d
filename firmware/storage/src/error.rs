//! Errors of reading and writing the storage.

use palpate_wire::Invalid;

/// Error of a storage operation. The previously stored set remains, except after [`Flash`](Self::Flash)
/// and [`NotKept`](Self::NotKept) at the very end of a save: check
/// [`Store::contents`](crate::Store::contents), which reads the flash again.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Error<E> {
    /// The flash driver failed; its own error gives the cause.
    #[error("the flash failed: {0:?}")]
    Flash(E),
    /// The range is not aligned to sectors, is smaller than two sectors, or exceeds the
    /// flash: correct the memory map.
    #[error("the range is not two slots of whole sectors within the flash; correct the memory map")]
    Range,
    /// The flash does not contain the written data: save again; if it persists, the flash is worn out.
    #[error("the flash reads back differently; save again, and replace a worn-out flash")]
    NotKept,
    /// The stored set differs from the saved one: set everything again and save it, or erase.
    #[error("the stored set is damaged; set everything again and save it, or erase")]
    Damaged,
    /// A later firmware stored the set in a format that this one does not know: update the firmware, or
    /// erase.
    #[error("a later firmware stored this in another format; update the firmware, or erase")]
    Newer,
    /// The items exceed a slot: omit parts that no sensor needs.
    #[error("the items do not fit; leave out what no sensor needs")]
    Full,
    /// All 2^32 - 1 generations are used: no further save is possible.
    #[error("all generation numbers are used up; no save is possible")]
    Exhausted,
    /// The command sets no stored value.
    #[error("the command of kind 0x{kind:02x} sets nothing to be stored")]
    NotASetter {
        /// Kind of the command.
        kind: u8,
    },
    /// The command or the stored set has a value beyond its limits: correct it.
    #[error("{0}; correct it")]
    Invalid(Invalid),
    /// The command must precede an earlier one: put the settings first, then each part in the order of
    /// its number, converter, channel and first knot, each once.
    #[error(
        "the command of kind 0x{kind:02x} comes too late or twice; settings come first, then each part in \
         the order of its number"
    )]
    OutOfOrder {
        /// Kind of the command.
        kind: u8,
    },
    /// An item has a known number and version but an unreadable value: the firmware that stored it is
    /// defective. Update the firmware, or erase.
    #[error("the stored item of kind {number} cannot be read; update the firmware, or erase")]
    Unreadable {
        /// Number of the item's kind.
        number: u8,
    },
    /// No save is in progress, or it ended with an error: begin one.
    #[error("no save has begun; begin one")]
    NotBegun,
    /// A save is in progress: commit or abandon it first.
    #[error("a save has begun; commit or abandon it first")]
    Saving,
}
