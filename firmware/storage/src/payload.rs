//! Serialisation of values in the postcard layout of the protocol.

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::item::MAX_PAYLOAD;

/// Serialises a value. `None` if it is too long.
pub(crate) fn write<T: Serialize>(value: &T) -> Option<Vec<u8, MAX_PAYLOAD>> {
    let mut buffer = [0; MAX_PAYLOAD];
    let bytes = postcard::to_slice(value, &mut buffer).ok()?;
    Vec::from_slice(bytes).ok()
}

/// Deserialises a value. `None` if the bytes are not exactly one value.
pub(crate) fn read<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    // Not `take_from_bytes`: the image would place that function in RAM, but this one is in flash.
    let mut from = postcard::Deserializer::from_bytes(bytes);
    let value = T::deserialize(&mut from).ok()?;
    from.finalize().ok()?.is_empty().then_some(value)
}
