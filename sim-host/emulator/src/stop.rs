//! Why the emulation cannot go on.

use std::fmt;

/// Something the emulated board does not know how to do. It never guesses: what is not modelled
/// ends the run here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// An access to a register that is not modelled.
    Unmodelled {
        /// Where.
        address: u32,
        /// The instruction that did it.
        pc: u32,
        /// What it wrote, if it was not a read.
        written: Option<u32>,
    },
    /// A value or an order of accesses that the model does not follow.
    NotFollowed {
        /// What.
        what: &'static str,
        /// The instruction that did it.
        pc: u32,
    },
    /// An access to a peripheral that is held in reset.
    InReset {
        /// Where.
        address: u32,
        /// The instruction that did it.
        pc: u32,
    },
    /// Something that the chip forbids, and on which it would hang or return anything.
    Misused {
        /// What, and how it is done instead.
        what: &'static str,
        /// The instruction that did it.
        pc: u32,
    },
    /// The expected event did not come in time.
    TimedOut,
}

/// Why a block does not take an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The register, or this value of it, is not modelled.
    Unmodelled,
    /// The chip forbids it: what, and how it is done instead.
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
            Self::NotFollowed { what, pc } => {
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
