//! Reading and writing of a field.
//!
//! One function for each type of field, called by all structures: inlined into each field they would take
//! some 20 bytes more of the firmware's memory for every field of the protocol.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[inline(never)]
pub(crate) fn write<T: Serialize, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    value.serialize(to)
}

#[inline(never)]
pub(crate) fn read<'de, T: Deserialize<'de>, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    T::deserialize(from)
}
