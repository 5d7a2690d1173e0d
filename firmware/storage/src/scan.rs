//! Scan of the slots and evaluation of the whole area.

use embedded_storage_async::nor_flash::NorFlash;

use crate::area::{Area, Slot};
use crate::item::Item;
use crate::seal::{Seal, SealCopy, Sum};
use crate::{Contents, Error, Set, knows};

/// Result of one pass over a slot.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Scan {
    /// The map cannot read the slot to its end.
    is_unreadable: bool,
    /// Latest generation of the slot's items; 0 without items.
    generation: u32,
    /// Number of items of that generation; the next field is the number of those that this firmware does
    /// not know.
    items: u16,
    unknown: u16,
    /// CRC-32 over the items of that generation.
    digest: u32,
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
        scan.is_unreadable = !is_readable;
        Ok(scan)
    }

    fn take(&mut self, generation: u32, item: &Item) {
        match SealCopy::of(item.key) {
            Some(copy) => {
                let to = match copy {
                    SealCopy::Own(_) => &mut self.seal,
                    SealCopy::OtherSlot => &mut self.seal_of_other_slot,
                };
                *to = Seal::later(*to, Some(Seal::read(generation, item)));
            }
            None => self.count(generation, item),
        }
    }

    fn count(&mut self, generation: u32, item: &Item) {
        if generation > self.generation {
            *self = Self {
                seal: self.seal,
                seal_of_other_slot: self.seal_of_other_slot,
                generation,
                ..Self::default()
            };
        }
        if generation == self.generation {
            self.items = self.items.saturating_add(1);
            let is_unknown = !knows(item.key, item.version);
            self.unknown = self.unknown.saturating_add(is_unknown.into());
            self.digest = item.digest(self.digest);
        }
    }

    /// Returns whether the slot's content matches a seal.
    pub(crate) fn holds(&self, generation: u32, sum: &Sum) -> bool {
        let is_of_it = sum.items == 0 || self.generation == generation;
        !self.is_unreadable && is_of_it && self.items == sum.items && self.digest == sum.digest
    }

    /// Returns the set of the slot if it is whole.
    fn set(&self, slot: Slot, seal: Option<Seal>) -> Option<Located> {
        let Seal { generation, sum } = seal?;
        let sum = sum.filter(|sum| self.holds(generation, sum))?;
        Some(Located {
            slot,
            generation,
            sum,
            unknown: self.unknown,
        })
    }
}

/// A whole set and its location.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Located {
    pub(crate) slot: Slot,
    pub(crate) generation: u32,
    pub(crate) sum: Sum,
    unknown: u16,
}

impl Located {
    /// Returns the set as reported; `None` if it is empty.
    fn reported(&self) -> Option<Set> {
        (self.sum.items > 0).then_some(Set {
            generation: self.generation.saturating_sub(self.sum.erased),
            items: self.sum.items,
            unknown_items: self.unknown,
            configuration_crc: self.sum.configuration_crc,
        })
    }
}

/// State of the area.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Survey {
    pub(crate) contents: Contents,
    /// A save after the stored set was begun and not completed.
    pub(crate) is_interrupted: bool,
    /// Stored set, possibly of no items.
    pub(crate) stored: Option<Located>,
    /// If the stored set is damaged: the set before it, if that is whole.
    pub(crate) older: Option<Located>,
    /// Slot of the next save.
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
        let first_seal = Seal::later(first.seal, second.seal_of_other_slot);
        let second_seal = Seal::later(second.seal, first.seal_of_other_slot);
        let generation = |seal: Option<Seal>| seal.map_or(0, |seal| seal.generation);
        let sealed = generation(first_seal).max(generation(second_seal));
        let begun = first.generation.max(second.generation);
        let older_first = generation(first_seal) < generation(second_seal);
        let (newest, newest_seal, other) = if older_first {
            let other = first.set(Slot::First, first_seal);
            (second.set(Slot::Second, second_seal), second_seal, other)
        } else {
            let other = second.set(Slot::Second, second_seal);
            (first.set(Slot::First, first_seal), first_seal, other)
        };
        let is_unreadable = first.is_unreadable || second.is_unreadable;
        let older = other.filter(|_| newest.is_none());
        let contents = match (newest_seal, newest) {
            (None, _) if is_unreadable => Contents::Damaged { older: None },
            (None, _) => Contents::Empty,
            (Some(Seal { sum: None, .. }), _) => Contents::Newer,
            (Some(_), Some(set)) => set.reported().map_or(Contents::Empty, Contents::Whole),
            (Some(_), None) => Contents::Damaged {
                older: older.and_then(|set| set.reported()),
            },
        };
        let newest_slot = if older_first {
            Slot::Second
        } else {
            Slot::First
        };
        Self {
            contents,
            is_interrupted: begun > sealed,
            stored: newest,
            older,
            // The next save goes to the slot without the whole set, which remains until the save has
            // ended.
            target: match newest {
                Some(set) => set.slot.other(),
                None => newest_slot,
            },
            generation: sealed,
        }
    }
}
