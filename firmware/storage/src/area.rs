//! Flash area of the storage, with its two slots.

use core::ops::Range;

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use sequential_storage::Error as QueueError;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::queue::{QueueConfig, QueueStorage};

use crate::item::{Item, MAX_ITEM};
use crate::seal::{self, Sum};
use crate::{Contents, Error, Set};

/// Number of bytes that are read at a time to check whether a sector is erased.
const POLL: usize = 256;

/// Working memory of the queue in bytes: the longest item, padded to the longest supported word (32 bytes,
/// `MAX_WORD_SIZE` of sequential-storage).
const WORK: usize = MAX_ITEM.next_multiple_of(32);

/// One half of the area. A save goes to the slot that does not hold the stored set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    First,
    Second,
}

impl Slot {
    pub(crate) const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// Flash area of the storage.
#[derive(Debug)]
pub(crate) struct Area<S> {
    flash: S,
    /// Start address of the first slot.
    start: u32,
    /// Size of a slot in bytes.
    slot: u32,
}

impl<S: NorFlash> Area<S> {
    /// Size of a sector in bytes. The compiler checks that [`POLL`] is a multiple of the read block, and
    /// divides a sector.
    const SECTOR: u32 = {
        assert!(POLL.is_multiple_of(S::READ_SIZE) && S::ERASE_SIZE.is_multiple_of(POLL));
        S::ERASE_SIZE as u32
    };

    pub(crate) fn new(flash: S, range: &Range<u32>) -> Result<Self, Error<S::Error>> {
        let size = range.end.checked_sub(range.start).ok_or(Error::Range)?;
        let slot = size / 2;
        let is_aligned =
            range.start.is_multiple_of(Self::SECTOR) && size.is_multiple_of(2 * Self::SECTOR);
        let is_within = range.end as usize <= flash.capacity();
        // The queue refuses too short ranges and too long words.
        let is_accepted = is_aligned && QueueConfig::<Window<'_, S>>::try_new(0..slot).is_ok();
        if !(is_within && is_accepted) {
            return Err(Error::Range);
        }
        Ok(Self {
            flash,
            start: range.start,
            slot,
        })
    }

    fn start_of(&self, slot: Slot) -> u32 {
        match slot {
            Slot::First => self.start,
            Slot::Second => self.start.wrapping_add(self.slot),
        }
    }

    /// Returns the queue of a slot, rotated so that it starts with another sector in every generation:
    /// all sectors wear equally.
    fn queue(&mut self, slot: Slot, generation: u32) -> Result<Queue<'_, S>, Error<S::Error>> {
        // Half the generation, since only every other generation goes to this slot.
        let turn = (generation / 2).wrapping_mul(Self::SECTOR);
        let window = Window {
            start: self.start_of(slot),
            size: self.slot,
            turn: turn.checked_rem(self.slot).unwrap_or(0),
            flash: &mut self.flash,
        };
        let config = QueueConfig::try_new(0..self.slot).map_err(|_| Error::Range)?;
        Ok(QueueStorage::new(window, config, Cache::new_uncached()))
    }

    /// Passes the items of a slot to `show` in the order in which they were written, with the generation
    /// of their save, until `show` returns `false`. Returns `false` if the slot cannot be read to its
    /// end. Does not write. The queue omits items whose checksum is wrong, so the caller has to count
    /// the items.
    pub(crate) async fn read(
        &mut self,
        slot: Slot,
        show: &mut dyn FnMut(u32, Item) -> bool,
    ) -> Result<bool, Error<S::Error>> {
        // Rotated by 0 instead of by the slot's generation, which is not known yet: the queue finds its
        // first sector at any position.
        let mut queue = self.queue(slot, 0)?;
        match show_all(&mut queue, show).await {
            Ok(()) => Ok(true),
            Err(QueueError::Storage { value, .. }) => Err(Error::Flash(value)),
            Err(_) => Ok(false),
        }
    }

    /// Passes the items of a stored set to `show`, until it returns `false`.
    pub(crate) async fn read_set(
        &mut self,
        set: &Located,
        show: &mut dyn FnMut(Item) -> bool,
    ) -> Result<(), Error<S::Error>> {
        let mut left = set.sum.items;
        let mut goes_on = true;
        let mut show_item = |_, item: Item| {
            if item.key.number != seal::NUMBER {
                left = left.saturating_sub(1);
                goes_on = show(item);
            }
            goes_on
        };
        self.read(set.slot, &mut show_item).await?;
        if goes_on && left > 0 {
            return Err(Error::Damaged);
        }
        Ok(())
    }

    /// Writes an item after the existing items of a slot.
    pub(crate) async fn append(
        &mut self,
        slot: Slot,
        generation: u32,
        item: &Item,
    ) -> Result<(), Error<S::Error>> {
        let mut queue = self.queue(slot, generation)?;
        let pushed = queue.push(&item.bytes(generation), false).await;
        pushed.map_err(|error| match error {
            QueueError::Storage { value, .. } => Error::Flash(value),
            QueueError::FullStorage | QueueError::ItemTooBig => Error::Full,
            _ => Error::NotKept,
        })
    }

    /// Erases every sector of a slot that is not erased.
    pub(crate) async fn clear(&mut self, slot: Slot) -> Result<(), Error<S::Error>> {
        let start = self.start_of(slot);
        for offset in (0..self.slot).step_by(S::ERASE_SIZE) {
            let from = start.wrapping_add(offset);
            if !self.is_erased(from).await? {
                let to = from.wrapping_add(Self::SECTOR);
                self.flash.erase(from, to).await.map_err(Error::Flash)?;
            }
        }
        Ok(())
    }

    async fn is_erased(&mut self, sector: u32) -> Result<bool, Error<S::Error>> {
        let mut bytes = [0; POLL];
        for offset in (0..Self::SECTOR).step_by(POLL) {
            let from = sector.wrapping_add(offset);
            let read = self.flash.read(from, &mut bytes).await;
            read.map_err(Error::Flash)?;
            if bytes.iter().any(|byte| *byte != u8::MAX) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    pub(crate) fn into_flash(self) -> S {
        self.flash
    }
}

async fn show_all<S: NorFlash>(
    queue: &mut Queue<'_, S>,
    show: &mut dyn FnMut(u32, Item) -> bool,
) -> Result<(), QueueError<S::Error>> {
    let mut work = [0; WORK];
    let mut items = queue.iter().await?;
    while let Some(bytes) = items.next(&mut work).await? {
        if let Some((generation, item)) = Item::read(&bytes)
            && !show(generation, item)
        {
            break;
        }
    }
    Ok(())
}

type Queue<'a, S> = QueueStorage<Window<'a, S>, Cache<Uncached, Uncached, Uncached>>;

/// A slot as a flash of its own that the queue reads and writes, but does not erase. The queue erases to
/// repair an operation of its own that seems interrupted, and erases sectors in which it finds no item.
/// Both could destroy stored items. It needs no erasure, since a slot is erased before a save.
struct Window<'a, S> {
    flash: &'a mut S,
    /// Start address of the slot; `size` is the slot's size.
    start: u32,
    size: u32,
    /// Offset in the slot of the window's address 0: the rotation of the queue.
    turn: u32,
}

impl<S> Window<'_, S> {
    fn address(&self, offset: u32) -> u32 {
        let turned = self.turn.wrapping_add(offset);
        let within = turned.checked_rem(self.size).unwrap_or(0);
        self.start.wrapping_add(within)
    }
}

impl<S: NorFlash> ErrorType for Window<'_, S> {
    type Error = S::Error;
}

impl<S: NorFlash> ReadNorFlash for Window<'_, S> {
    const READ_SIZE: usize = S::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.flash.read(self.address(offset), bytes).await
    }

    fn capacity(&self) -> usize {
        self.size as usize
    }
}

impl<S: NorFlash> NorFlash for Window<'_, S> {
    const WRITE_SIZE: usize = S::WRITE_SIZE;
    const ERASE_SIZE: usize = S::ERASE_SIZE;

    async fn erase(&mut self, _from: u32, _to: u32) -> Result<(), Self::Error> {
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.flash.write(self.address(offset), bytes).await
    }
}

/// A whole set and its location.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Located {
    pub(crate) slot: Slot,
    pub(crate) generation: u32,
    pub(crate) sum: Sum,
    /// Number of items that this firmware does not know.
    pub(crate) unknown: u16,
}

impl Located {
    /// Returns the set as reported.
    pub(crate) fn reported(&self) -> Contents {
        if self.sum.items == 0 {
            return Contents::Empty;
        }
        Contents::Whole(Set {
            generation: self.generation.saturating_sub(self.sum.erased),
            items: self.sum.items,
            unknown_items: self.unknown,
            configuration_crc: self.sum.configuration_crc,
        })
    }
}
