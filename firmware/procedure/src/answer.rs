//! Answers to commands.

use palpate_wire::code::Outcome;
use palpate_wire::record::Acknowledgement;
use palpate_wire::{Header, Invalid, Problem};

/// Answer to a command: an outcome, or the field that was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer {
    Outcome(Outcome),
    Invalid(Invalid),
}

impl Answer {
    /// Refuses a field whose value is beyond the limits of the board or of the settings, which are
    /// narrower than the protocol's limits.
    pub(crate) const fn out_of_range(field: u8, value: f32, [low, high]: [f32; 2]) -> Self {
        Self::Invalid(Invalid {
            field,
            item: None,
            problem: Problem::OutOfRange { value, low, high },
        })
    }

    pub(crate) const fn acknowledge(&self, command: &Header, kind: u8) -> Acknowledgement {
        match self {
            Self::Outcome(outcome) => Acknowledgement::new(command, kind, *outcome),
            Self::Invalid(invalid) => Acknowledgement::invalid(command, kind, invalid),
        }
    }
}

impl From<Outcome> for Answer {
    fn from(outcome: Outcome) -> Self {
        Self::Outcome(outcome)
    }
}

/// Number of a field by its name. The compiler rejects an unknown name.
macro_rules! field {
    ($structure:ty, $name:ident) => {
        const {
            palpate_wire::schema::field_number(
                &<$structure as palpate_wire::schema::Described>::TYPE,
                stringify!($name),
            )
        }
    };
}
pub(crate) use field;
