//! Enumerations of the format: numbers with a meaning.
//!
//! A number never changes its meaning and is one byte on the wire. In a text format a value is its name;
//! a number that this version does not know stays that number.

use core::fmt;
use core::marker::PhantomData;

use serde::de::{self, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serializer};

mod fault;
mod identity;
mod outcome;
mod procedure;
mod refusal;
mod storage;

pub use fault::{FaultCode, Location};
pub use identity::{Board, Chip, ResetCause};
pub use outcome::Outcome;
pub use procedure::{Contact, Drift, Mode, Part, State, Stream, TipShape, TouchVerdict};
pub use refusal::RefusalReason;
pub use storage::{RebootTarget, StorageAction, StorageState};

/// Properties of an enumeration that the encodings need.
pub(crate) trait Code: Copy {
    const NAMES: &'static [&'static str];

    fn to_number(self) -> u8;
    fn with_number(number: u8) -> Self;
    fn to_name(self) -> Option<&'static str>;
    fn with_name(name: &str) -> Option<Self>;
}

pub(crate) fn serialize<C: Code, S: Serializer>(code: C, to: S) -> Result<S::Ok, S::Error> {
    match code.to_name() {
        Some(name) if to.is_human_readable() => to.serialize_str(name),
        _ => to.serialize_u8(code.to_number()),
    }
}

pub(crate) fn deserialize<'de, C: Code, D: Deserializer<'de>>(from: D) -> Result<C, D::Error> {
    if from.is_human_readable() {
        from.deserialize_any(NameOrNumber(PhantomData))
    } else {
        u8::deserialize(from).map(C::with_number)
    }
}

struct NameOrNumber<C>(PhantomData<C>);

impl<C: Code> Visitor<'_> for NameOrNumber<C> {
    type Value = C;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number from 0 to 255 or one of")?;
        C::NAMES
            .iter()
            .zip([" "].into_iter().chain(core::iter::repeat(", ")))
            .try_for_each(|(name, before)| write!(f, "{before}{name}"))
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<C, E> {
        C::with_name(name).ok_or_else(|| E::invalid_value(Unexpected::Str(name), &self))
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<C, E> {
        u8::try_from(number)
            .map(C::with_number)
            .map_err(|_| E::invalid_value(Unexpected::Unsigned(number), &self))
    }
}
