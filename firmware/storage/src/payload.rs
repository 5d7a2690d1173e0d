//! Values as bytes: the layout of postcard, as in the protocol.

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::item::MAX_PAYLOAD;

/// The bytes of a value. `None` if there are too many.
pub(crate) fn write<T: Serialize>(value: &T) -> Option<Vec<u8, MAX_PAYLOAD>> {
    let mut buffer = [0; MAX_PAYLOAD];
    let bytes = postcard::to_slice(value, &mut buffer).ok()?;
    Vec::from_slice(bytes).ok()
}

/// The value of some bytes. `None` if they are no such value, or more than one.
pub(crate) fn read<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes(bytes).ok()?;
    rest.is_empty().then_some(value)
}
