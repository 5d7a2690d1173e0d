//! Seals: proof that a save is complete.

use heapless::Vec;

use crate::item::{Item, Key};

/// Kind number of a seal; all other items have at most 240.
pub(crate) const NUMBER: u8 = 255;

/// Version of a set's format: the layout of its seal, and the order of its items in the checksum.
const VERSION: u8 = 1;

/// Copy of a seal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SealCopy {
    /// First and second copy, after the items.
    Own(u8),
    /// Copy in the other slot.
    OtherSlot,
}

impl SealCopy {
    const fn place(self) -> u8 {
        match self {
            Self::Own(number) => number,
            Self::OtherSlot => 2,
        }
    }

    /// Returns which copy of a seal has this key. `None` if it is not the key of a seal.
    pub(crate) const fn of(key: Key) -> Option<Self> {
        match (key.number, key.place) {
            (NUMBER, place @ 0..=1) => Some(Self::Own(place)),
            (NUMBER, 2) => Some(Self::OtherSlot),
            _ => None,
        }
    }
}

/// Seal, written after the items of a save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seal {
    /// Generation of the save.
    pub(crate) generation: u32,
    /// Checksums of the save; `None` in a format that this firmware does not know.
    pub(crate) sum: Option<Sum>,
}

/// Checksums of a save.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sum {
    /// Number of items.
    pub(crate) items: u16,
    /// CRC-32 over all items in the order of their keys; see [`Item::digest`].
    pub(crate) digest: u32,
    /// `configuration_crc` over the commands that were saved.
    pub(crate) configuration_crc: u32,
    /// Generation of the last erasure; 0 if there was none.
    pub(crate) erased: u32,
}

impl Sum {
    /// Checksums of a save without items.
    pub(crate) const NOTHING: Self = Self {
        items: 0,
        digest: 0,
        configuration_crc: 0,
        erased: 0,
    };

    fn payload(&self) -> [u8; 14] {
        let [a, b] = self.items.to_le_bytes();
        let [c, d, e, f] = self.digest.to_le_bytes();
        let [g, h, i, j] = self.configuration_crc.to_le_bytes();
        let [k, l, m, n] = self.erased.to_le_bytes();
        [a, b, c, d, e, f, g, h, i, j, k, l, m, n]
    }

    /// Parses a payload; `None` if it is invalid.
    fn read(payload: &[u8]) -> Option<Self> {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n] = *payload else {
            return None;
        };
        Some(Self {
            items: u16::from_le_bytes([a, b]),
            digest: u32::from_le_bytes([c, d, e, f]),
            configuration_crc: u32::from_le_bytes([g, h, i, j]),
            erased: u32::from_le_bytes([k, l, m, n]),
        })
    }
}

impl Seal {
    /// Returns the item of a seal.
    pub(crate) fn item(sum: &Sum, copy: SealCopy) -> Item {
        let key = Key {
            number: NUMBER,
            place: copy.place(),
            index: 0,
        };
        Item {
            key,
            version: VERSION,
            // A seal's payload always fits.
            payload: Vec::from_slice(&sum.payload()).unwrap_or_default(),
        }
    }

    /// Parses the seal in an item.
    pub(crate) fn read(generation: u32, item: &Item) -> Self {
        let is_known = item.version == VERSION;
        let sum = is_known.then(|| Sum::read(&item.payload)).flatten();
        Self { generation, sum }
    }

    /// Returns the later of two seals.
    pub(crate) fn later(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        match (one, other) {
            (Some(a), Some(b)) if b.generation > a.generation => Some(b),
            (None, b) => b,
            (a, _) => a,
        }
    }
}
