//! State of a save under way.

use palpate_wire::ConfigurationCrc;

use crate::area::Slot;
use crate::item::{Item, Key};
use crate::knows;
use crate::scan::Located;
use crate::seal::Sum;

/// Save in progress.
pub(crate) struct Save {
    pub(crate) slot: Slot,
    pub(crate) generation: u32,
    /// The stored set that is replaced.
    pub(crate) stored: Option<Located>,
    /// Number of items so far.
    pub(crate) items: u16,
    pub(crate) digest: u32,
    /// The items are being written. `false` as long as they equal the stored ones.
    pub(crate) is_writing: bool,
    /// Key of the last item that the caller has put.
    pub(crate) last: Option<Key>,
    pub(crate) configuration_crc: ConfigurationCrc,
}

impl core::fmt::Debug for Save {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Save")
            .field("generation", &self.generation)
            .field("items", &self.items)
            .field("is_writing", &self.is_writing)
            .finish_non_exhaustive()
    }
}

impl Save {
    pub(crate) const fn sum(&self, configuration_crc: u32) -> Sum {
        Sum {
            items: self.items,
            digest: self.digest,
            configuration_crc,
            erased: match self.stored {
                Some(set) => set.sum.erased,
                None => 0,
            },
        }
    }

    /// Returns whether a stored item that the caller did not put remains: if this firmware does not know
    /// it and the save does not replace it.
    pub(crate) fn keeps(&self, stored: &Item, next: Key) -> bool {
        let is_replaced = |key: Key| key.is_of_one_part(stored.key);
        !knows(stored.key, stored.version)
            && !is_replaced(next)
            && !self.last.is_some_and(is_replaced)
    }
}
