//! Items: the values stored under one key each.

use heapless::Vec;
use palpate_wire::crc32;
use sequential_storage::map::{self, SerializationError};

/// Size of a key in bytes: kind number, place and index.
pub(crate) const KEY: usize = 3;

/// Number of bytes before an item's payload: key, version and generation.
const HEAD: usize = KEY + 1 + 4;

/// Maximum size of an item in bytes, in every version of the format: a [batch](crate::reader) stores it
/// in one byte.
pub(crate) const MAX_ITEM: usize = 255;

/// Maximum payload of an item in bytes.
pub(crate) const MAX_PAYLOAD: usize = MAX_ITEM - HEAD;

/// Working memory of the map in bytes: the longest item, padded to the longest supported word (32 bytes,
/// `MAX_WORD_SIZE` of sequential-storage).
pub(crate) const WORK: usize = MAX_ITEM.next_multiple_of(32);

/// Identity of an item. Items are stored and read in the order of their keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    /// Number of the kind: 1 for settings, the others as in [`parts`](crate::parts).
    pub(crate) number: u8,
    /// Item within its kind: number of a setting, or converter and channel of a part.
    pub(crate) place: u8,
    /// 0 for a single item, 1 and up for chunks.
    pub(crate) index: u8,
}

impl Key {
    /// A key that is after those of all items.
    pub(crate) const LAST: Self = Self {
        number: u8::MAX,
        place: u8::MAX,
        index: u8::MAX,
    };

    /// Returns whether two items belong to one setting or part, so that a new one replaces the other.
    pub(crate) const fn is_of_one_part(self, other: Self) -> bool {
        self.number == other.number && self.place == other.place
    }

    const fn bytes(self) -> [u8; KEY] {
        [self.number, self.place, self.index]
    }

    const fn from_bytes([number, place, index]: [u8; KEY]) -> Self {
        Self {
            number,
            place,
            index,
        }
    }
}

impl map::Key for Key {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        let to = buffer.first_chunk_mut::<KEY>();
        *to.ok_or(SerializationError::BufferTooSmall)? = self.bytes();
        Ok(KEY)
    }

    /// Returns 0 as the key's length, so that the map returns the key as part of the value. Otherwise
    /// the map would take the value from after the key, and panic if an item in flash is shorter than a
    /// key; so [`Item::read`] splits the key off.
    fn deserialize_from(buffer: &[u8]) -> Result<(Self, usize), SerializationError> {
        let key = buffer.first_chunk::<KEY>();
        let key = key.ok_or(SerializationError::BufferTooSmall)?;
        Ok((Self::from_bytes(*key), 0))
    }
}

/// One stored value with its key.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Item {
    /// Key of the item.
    pub(crate) key: Key,
    /// Version of the payload's layout.
    pub(crate) version: u8,
    /// Value of the item, serialised.
    pub(crate) payload: Vec<u8, MAX_PAYLOAD>,
}

impl Item {
    /// Parses an item read from flash; also returns the generation of its save. `None` if it is too
    /// short.
    pub(crate) fn read(bytes: &[u8]) -> Option<(u32, Self)> {
        let (key, rest) = bytes.split_first_chunk::<KEY>()?;
        let (version, rest) = rest.split_first()?;
        let (generation, payload) = rest.split_first_chunk::<4>()?;
        let item = Self {
            key: Key::from_bytes(*key),
            version: *version,
            payload: Vec::from_slice(payload).ok()?,
        };
        Some((u32::from_le_bytes(*generation), item))
    }

    /// Returns the item as it is stored in flash.
    pub(crate) fn bytes(&self, generation: u32) -> Vec<u8, MAX_ITEM> {
        let generation = generation.to_le_bytes();
        let parts: [&[u8]; 4] = [
            &self.key.bytes(),
            &[self.version],
            &generation,
            &self.payload,
        ];
        concatenated(parts)
    }

    /// Returns the CRC-32 over key, version and payload, continuing that of the previous items.
    pub(crate) fn digest(&self, before: u32) -> u32 {
        let parts: [&[u8]; 4] = [
            &before.to_le_bytes(),
            &self.key.bytes(),
            &[self.version],
            &self.payload,
        ];
        crc32(&concatenated::<MAX_ITEM>(parts))
    }
}

/// Concatenates the parts. They fit: a payload is at most [`MAX_PAYLOAD`] bytes, and the others are
/// [`HEAD`] in total.
fn concatenated<const N: usize>(parts: [&[u8]; 4]) -> Vec<u8, N> {
    let mut all = Vec::new();
    for part in parts {
        // Not `collect`, which would panic if the parts did not fit.
        let _ = all.extend_from_slice(part);
    }
    all
}
