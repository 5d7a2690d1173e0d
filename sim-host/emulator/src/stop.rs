//! Reasons why the emulation stops.

use std::fmt;

/// An access or event that the emulated board cannot handle. The emulator never guesses: whatever
/// is not modelled ends the run here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// An access to a register that is not modelled.
    Unmodelled {
        /// Address of the access.
        address: u32,
        /// Address of the instruction.
        pc: u32,
        /// Written value; `None` for a read.
        written: Option<u32>,
    },
    /// A value or an order of accesses that is not modelled.
    UnmodelledUse {
        /// Description.
        what: &'static str,
        /// Address of the instruction.
        pc: u32,
    },
    /// An access to a peripheral in reset.
    InReset {
        /// Address of the access.
        address: u32,
        /// Address of the instruction.
        pc: u32,
    },
    /// An access that the chip forbids: the chip would hang or return an arbitrary value.
    Misused {
        /// Description of the misuse, with the right way to do it.
        what: &'static str,
        /// Address of the instruction.
        pc: u32,
    },
    /// The expected event did not happen in time.
    TimedOut,
}

/// Reason why a block refuses an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The register, or this value of it, is not modelled.
    Unmodelled,
    /// The chip forbids the access: description of the misuse, with the right way to do it.
    Misuse(&'static str),
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unmodelled {
                address,
                pc,
                written: None,
            } => write!(
                f,
                "the instruction at {pc:#010x} reads {address:#010x}, which is not modelled"
            ),
            Self::Unmodelled {
                address,
                pc,
                written: Some(value),
            } => write!(
                f,
                "the instruction at {pc:#010x} writes {value:#010x} to {address:#010x}, which is \
                 not modelled"
            ),
            Self::UnmodelledUse { what, pc } => {
                write!(f, "the instruction at {pc:#010x}: {what} is not modelled")
            }
            Self::InReset { address, pc } => write!(
                f,
                "the instruction at {pc:#010x} accesses {address:#010x}, whose block is in reset"
            ),
            Self::Misused { what, pc } => write!(f, "the instruction at {pc:#010x} {what}"),
            Self::TimedOut => f.write_str("what was waited for did not happen in time"),
        }
    }
}

impl std::error::Error for Stop {}
