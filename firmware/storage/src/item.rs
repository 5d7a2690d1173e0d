//! Items: what is stored under one key.

use heapless::Vec;
use palpate_wire::crc32;
use sequential_storage::map::{self, SerializationError};

/// Bytes of a key.
pub(crate) const KEY: usize = 3;

/// Bytes before an item's payload: key, version and generation.
const HEAD: usize = KEY + 1 + 4;

/// Greatest size of an item in bytes, in every version of the format: its size is stored in one
/// byte of a [batch](crate::reader).
pub(crate) const MAX_ITEM: usize = 255;

/// Greatest payload of an item in bytes.
pub(crate) const MAX_PAYLOAD: usize = MAX_ITEM - HEAD;

/// Bytes for the map to work with: the longest item, padded to the longest word that the map
/// supports (32 bytes, `MAX_WORD_SIZE` of sequential-storage).
pub(crate) const WORK: usize = MAX_ITEM.next_multiple_of(32);

/// What an item is. Items are stored and read in the order of their keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    /// Number of the kind: 1 for the settings, then those of [`parts`](crate::parts).
    pub(crate) number: u8,
    /// Which of this kind: the number of a setting, converter and channel of a part.
    pub(crate) place: u8,
    /// 0 for what is one item, 1 and up for chunks.
    pub(crate) index: u8,
}

impl Key {
    /// Above every item's.
    pub(crate) const LAST: Self = Self {
        number: u8::MAX,
        place: u8::MAX,
        index: u8::MAX,
    };

    /// Whether two items belong to one setting or one part, so that a new one replaces the other.
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

    /// Gives 0 for the length, so that the map returns the key within the value. The map takes the
    /// value from behind the key, and panics if an item in the flash is shorter than that; so the
    /// key is taken off by [`Item::read`].
    fn deserialize_from(buffer: &[u8]) -> Result<(Self, usize), SerializationError> {
        let key = buffer.first_chunk::<KEY>();
        let key = key.ok_or(SerializationError::BufferTooSmall)?;
        Ok((Self::from_bytes(*key), 0))
    }
}

/// An item.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Item {
    /// What it is.
    pub(crate) key: Key,
    /// Version of the payload's layout.
    pub(crate) version: u8,
    /// Its value.
    pub(crate) payload: Vec<u8, MAX_PAYLOAD>,
}

impl Item {
    /// Takes an item from the flash apart, with the generation of its save. `None` if it is too
    /// short to be one.
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

    /// The item as it lies in the flash.
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

    /// CRC-32 over key, version and payload, going on from that of the items before.
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

/// One behind the other. They fit: a payload is [`MAX_PAYLOAD`] bytes at most, and the others are
/// [`HEAD`] in all.
fn concatenated<const N: usize>(parts: [&[u8]; 4]) -> Vec<u8, N> {
    let mut all = Vec::new();
    for part in parts {
        // `collect` would panic where they did not.
        let _ = all.extend_from_slice(part);
    }
    all
}
