//! Seals: what says that a save is whole.

use heapless::Vec;

use crate::item::{Item, Key};

/// Number of the kind of item that is a seal; no other item has one above 240.
pub(crate) const NUMBER: u8 = 255;

/// Version of the format of a set: of its seal, and of the order in which its items are summed up.
const VERSION: u8 = 1;

/// Copies of a seal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SealCopy {
    /// The first and the second behind the items.
    Own(u8),
    /// In the other slot.
    Abroad,
}

impl SealCopy {
    const fn place(self) -> u8 {
        match self {
            Self::Own(number) => number,
            Self::Abroad => 2,
        }
    }

    /// The copy that an item is. `None` if it is none.
    pub(crate) const fn of(key: Key) -> Option<Self> {
        match (key.number, key.place) {
            (NUMBER, place @ 0..=1) => Some(Self::Own(place)),
            (NUMBER, 2) => Some(Self::Abroad),
            _ => None,
        }
    }
}

/// A seal, written behind the items of a save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seal {
    /// Generation of the save.
    pub(crate) generation: u32,
    /// What was saved; `None` in a format that this firmware does not know.
    pub(crate) sum: Option<Sum>,
}

/// What a save adds up to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sum {
    /// Number of the items.
    pub(crate) items: u16,
    /// CRC-32 over all of them in the order of their keys; see [`Item::digest`].
    pub(crate) digest: u32,
    /// `configuration_crc` over the commands that were saved.
    pub(crate) configuration_crc: u32,
    /// Generation in which all was erased; 0 if it never was.
    pub(crate) erased: u32,
}

impl Sum {
    /// Of nothing.
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

    /// `None` if that is no sum.
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
    /// The item that holds a sum.
    pub(crate) fn item(sum: &Sum, copy: SealCopy) -> Item {
        let key = Key {
            number: NUMBER,
            place: copy.place(),
            index: 0,
        };
        Item {
            key,
            version: VERSION,
            // It fits.
            payload: Vec::from_slice(&sum.payload()).unwrap_or_default(),
        }
    }

    /// The seal that an item holds.
    pub(crate) fn read(generation: u32, item: &Item) -> Self {
        let is_known = item.version == VERSION;
        let sum = is_known.then(|| Sum::read(&item.payload)).flatten();
        Self { generation, sum }
    }

    /// The later of two.
    pub(crate) fn later(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        match (one, other) {
            (Some(a), Some(b)) if b.generation > a.generation => Some(b),
            (None, b) => b,
            (a, _) => a,
        }
    }
}
