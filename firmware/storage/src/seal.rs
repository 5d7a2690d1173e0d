//! Seals: proof that a save is complete.

use crate::item::{Item, Key, joined};

/// Kind number of a seal; all other items have at most 240.
pub(crate) const NUMBER: u8 = 255;

/// Version of a seal's layout.
const VERSION: u8 = 2;

/// Version of the seals with a checksum over all items. It is not read: each item has one.
const WITH_CHECKSUM: u8 = 1;

/// Place in the key of a seal that completes the save of its own slot.
pub(crate) const OF_THIS_SLOT: u8 = 0;
/// Place in the key of a seal that completes the save of the other slot.
pub(crate) const OF_OTHER_SLOT: u8 = 2;

/// Seal, written after the items of a save. The later of two seals is the greater one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Seal {
    /// Generation of the save.
    pub(crate) generation: u32,
    /// Sum of the save; `None` in a format that this firmware does not know.
    pub(crate) sum: Option<Sum>,
}

/// Summary of a save.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Sum {
    /// Number of items.
    pub(crate) items: u16,
    /// `configuration_crc` over the commands that were saved.
    pub(crate) configuration_crc: u32,
    /// Generation of the last erasure; 0 if there was none.
    pub(crate) erased: u32,
}

impl Sum {
    /// Returns the item of a seal.
    pub(crate) fn seal(&self, place: u8) -> Item {
        let key = Key {
            number: NUMBER,
            place,
            index: 0,
        };
        Item {
            key,
            version: VERSION,
            payload: joined([
                &self.items.to_le_bytes(),
                &self.configuration_crc.to_le_bytes(),
                &self.erased.to_le_bytes(),
            ]),
        }
    }

    fn read(item: &Item) -> Option<Self> {
        let (items, rest) = item.payload.split_first_chunk()?;
        let rest = match item.version {
            VERSION => rest,
            WITH_CHECKSUM => rest.get(4..)?,
            _ => return None,
        };
        let (configuration_crc, erased) = rest.split_first_chunk()?;
        Some(Self {
            items: u16::from_le_bytes(*items),
            configuration_crc: u32::from_le_bytes(*configuration_crc),
            erased: u32::from_le_bytes(erased.try_into().ok()?),
        })
    }
}

impl Seal {
    /// Parses the seal in an item.
    pub(crate) fn read(generation: u32, item: &Item) -> Self {
        let sum = Sum::read(item);
        Self { generation, sum }
    }
}
