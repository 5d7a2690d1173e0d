//! Scan of the slots and evaluation of the whole area.

use embedded_storage_async::nor_flash::NorFlash;

use crate::area::{Area, Located, Slot};
use crate::item::{Item, Key};
use crate::seal::{self, Seal};
use crate::{Contents, Error, knows};

/// Result of one pass over a slot.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Scan {
    /// The slot cannot be read to its end, or its items are not of one generation in the order of their
    /// keys.
    is_unsound: bool,
    /// Generation of the items.
    generation: u32,
    /// Key of the last item.
    last: Option<Key>,
    /// Number of items; `unknown` is the number of those that this firmware does not know.
    items: u16,
    unknown: u16,
    /// Seal of this slot's save, after its items.
    seal: Option<Seal>,
    /// Copy of the other slot's seal.
    seal_of_other_slot: Option<Seal>,
}

impl Scan {
    /// Reads a slot from its start to its end.
    pub(crate) async fn of<S: NorFlash>(
        area: &mut Area<S>,
        slot: Slot,
    ) -> Result<Self, Error<S::Error>> {
        let mut scan = Self::default();
        let mut take = |generation, item: Item| {
            scan.take(generation, &item);
            true
        };
        let is_readable = area.read(slot, &mut take).await?;
        scan.is_unsound |= !is_readable;
        Ok(scan)
    }

    fn take(&mut self, generation: u32, item: &Item) {
        if item.key.number == seal::NUMBER {
            let to = match item.key.place {
                seal::OF_OTHER_SLOT => &mut self.seal_of_other_slot,
                _ => &mut self.seal,
            };
            *to = (*to).max(Some(Seal::read(generation, item)));
            return;
        }
        let is_first = self.last.is_none();
        let follows = self.generation == generation && self.last < Some(item.key);
        self.is_unsound |= !(is_first || follows);
        self.generation = generation;
        self.last = Some(item.key);
        self.items = self.items.saturating_add(1);
        let is_unknown = !knows(item.key, item.version);
        self.unknown = self.unknown.saturating_add(is_unknown.into());
    }

    /// Returns whether the slot holds all items of a save and no other.
    pub(crate) fn holds(&self, generation: u32, items: u16) -> bool {
        let is_of_it = items == 0 || self.generation == generation;
        !self.is_unsound && is_of_it && self.items == items
    }
}

/// State of the area.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Survey {
    pub(crate) contents: Contents,
    /// Stored set, possibly of no items.
    pub(crate) stored: Option<Located>,
    /// Slot of the next save: the one without the stored set, which remains until the save has ended.
    pub(crate) target: Slot,
    /// Generation of the stored set; 0 if there was never one.
    pub(crate) generation: u32,
}

impl Survey {
    /// Reads both slots.
    pub(crate) async fn of<S: NorFlash>(area: &mut Area<S>) -> Result<Self, Error<S::Error>> {
        let first = Scan::of(area, Slot::First).await?;
        let second = Scan::of(area, Slot::Second).await?;
        Ok(Self::from(&first, &second))
    }

    fn from(first: &Scan, second: &Scan) -> Self {
        let of_first = first.seal.max(second.seal_of_other_slot);
        let of_second = second.seal.max(first.seal_of_other_slot);
        let newest = of_first.max(of_second);
        let (slot, scan) = if newest == of_first {
            (Slot::First, first)
        } else {
            (Slot::Second, second)
        };
        let generation = newest.map_or(0, |seal| seal.generation);
        let sum = newest.and_then(|seal| seal.sum);
        let whole = sum.filter(|sum| scan.holds(generation, sum.items));
        let stored = whole.map(|sum| Located {
            slot,
            generation,
            sum,
            unknown: scan.unknown,
        });
        let contents = match (newest, sum, stored) {
            (None, ..) if first.is_unsound || second.is_unsound => Contents::Damaged,
            (None, ..) => Contents::Empty,
            (Some(_), None, _) => Contents::Newer,
            (Some(_), Some(_), None) => Contents::Damaged,
            (.., Some(set)) => set.reported(),
        };
        Self {
            contents,
            stored,
            target: stored.map_or(slot, |set| set.slot.other()),
            generation,
        }
    }
}
