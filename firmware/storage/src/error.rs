//! What reading and writing the storage fails of.

use core::fmt;

use palpate_wire::Invalid;

/// Why the storage did not do what was asked for. What was stored before is still stored, but for
/// [`Flash`](Self::Flash) and [`NotKept`](Self::NotKept) at the very end of a save: look at
/// [`Store::contents`](crate::Store::contents), which is taken from the flash anew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error<E> {
    /// The flash driver failed; its own error says of what.
    Flash(E),
    /// The range given is not aligned to sectors, is not two slots of two sectors at least, or lies
    /// beyond the flash: correct the memory map.
    Range,
    /// The flash does not hold what was written: save again; if it stays so, the flash is worn out.
    NotKept,
    /// What is stored is not what was saved: set everything anew and save it, or erase.
    Damaged,
    /// A later firmware stored it in a format that this one does not know: update the firmware, or
    /// erase.
    Newer,
    /// The items do not fit a slot: leave out what no sensor needs.
    Full,
    /// All 2^32 - 1 generations are used up: no save is possible any more.
    Exhausted,
    /// The command sets nothing, so there is nothing of it to store.
    NotASetter {
        /// Kind of the command.
        kind: u8,
    },
    /// The command, or what is stored, has a value beyond its limits: correct it.
    Invalid(Invalid),
    /// The command belongs before one that was given already: give the settings first, then each
    /// part in the order of its number, converter, channel and first knot, and nothing twice.
    OutOfOrder {
        /// Kind of the command.
        kind: u8,
    },
    /// An item has a number and a version that this firmware knows, and a value that it cannot
    /// read: the firmware that stored it is defective. Update the firmware, or erase.
    Unreadable {
        /// Number of the item's kind.
        number: u8,
    },
    /// No save has begun, or it ended with an error: begin one.
    NotBegun,
    /// A save has begun: commit or abandon it first.
    Saving,
}

impl<E: fmt::Debug> fmt::Display for Error<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flash(error) => write!(f, "the flash failed: {error:?}"),
            Self::Range => f.write_str(
                "the range is not two slots of whole sectors within the flash; correct the memory map",
            ),
            Self::NotKept => f.write_str(
                "the flash does not hold what was written; save again, and replace a worn-out flash",
            ),
            Self::Damaged => f.write_str(
                "what is stored is not what was saved; set everything anew and save it, or erase",
            ),
            Self::Newer => f.write_str(
                "a later firmware stored this in another format; update the firmware, or erase",
            ),
            Self::Full => f.write_str("the items do not fit; leave out what no sensor needs"),
            Self::Exhausted => f.write_str("all generations are used up; no save is possible"),
            Self::NotASetter { kind } => {
                write!(f, "the command of kind 0x{kind:02x} sets nothing to be stored")
            }
            Self::Invalid(invalid) => write!(f, "{invalid}; correct it"),
            Self::OutOfOrder { kind } => write!(
                f,
                "the command of kind 0x{kind:02x} comes too late or twice; settings come first, \
                 then each part in the order of its number"
            ),
            Self::Unreadable { number } => write!(
                f,
                "the stored item of kind {number} cannot be read; update the firmware, or erase"
            ),
            Self::NotBegun => f.write_str("no save has begun; begin one"),
            Self::Saving => f.write_str("a save has begun; commit or abandon it first"),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for Error<E> {}
