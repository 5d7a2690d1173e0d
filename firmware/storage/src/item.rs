//! Items: the values stored under one key each.

use heapless::Vec;

/// Number of bytes before an item's payload: key, version and generation.
const HEAD: usize = 3 + 1 + 4;

/// Maximum size of an item in bytes, in every version of the format.
pub(crate) const MAX_ITEM: usize = 255;

/// Maximum payload of an item in bytes.
pub(crate) const MAX_PAYLOAD: usize = MAX_ITEM - HEAD;

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
}

/// One stored value with its key.
#[derive(Debug)]
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
        let ([number, place, index, version], rest) = bytes.split_first_chunk()?;
        let (generation, payload) = rest.split_first_chunk()?;
        let item = Self {
            key: Key {
                number: *number,
                place: *place,
                index: *index,
            },
            version: *version,
            payload: Vec::from_slice(payload).ok()?,
        };
        Some((u32::from_le_bytes(*generation), item))
    }

    /// Returns the item as it is stored in flash.
    pub(crate) fn bytes(&self, generation: u32) -> Vec<u8, MAX_ITEM> {
        let Key {
            number,
            place,
            index,
        } = self.key;
        let head = [number, place, index, self.version];
        joined([&head, &generation.to_le_bytes(), &self.payload])
    }
}

/// Joins parts that fit: a payload is at most [`MAX_PAYLOAD`] bytes, and the others are [`HEAD`] in total.
pub(crate) fn joined<const N: usize>(parts: [&[u8]; 3]) -> Vec<u8, N> {
    let mut all = Vec::new();
    for part in parts {
        // Not `collect`, which would panic if the parts did not fit.
        let _ = all.extend_from_slice(part);
    }
    all
}
