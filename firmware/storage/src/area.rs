//! Flash area of the storage, with its two slots.

use core::ops::Range;

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use embedded_storage_async::nor_flash::{NorFlashError, NorFlashErrorKind};
use sequential_storage::Error as MapError;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use crate::Error;
use crate::item::{Item, KEY, Key, WORK};

/// Number of bytes that are read at a time to check whether a sector is erased.
const POLL: usize = 256;

/// Minimum number of sectors of a slot: the map (sequential-storage) always keeps one of them erased.
const LEAST_SECTORS: u32 = 2;

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
    /// Number of sectors of a slot.
    sectors: u32,
}

impl<S: NorFlash> Area<S> {
    /// Size of a sector in bytes. Its computation checks that sector, read block and word size divide
    /// each other.
    const SECTOR: u32 = {
        assert!(POLL.is_multiple_of(S::READ_SIZE) && S::ERASE_SIZE.is_multiple_of(POLL));
        S::ERASE_SIZE as u32
    };

    pub(crate) fn new(flash: S, range: &Range<u32>) -> Result<Self, Error<S::Error>> {
        let size = range.end.checked_sub(range.start).ok_or(Error::Range)?;
        let sectors = size / Self::SECTOR / 2;
        let area = Self {
            flash,
            start: range.start,
            slot: sectors.saturating_mul(Self::SECTOR),
            sectors,
        };
        let is_aligned = range.start.is_multiple_of(Self::SECTOR) && area.slot * 2 == size;
        let is_within = range.end as usize <= area.flash.capacity();
        let is_long_enough = sectors >= LEAST_SECTORS;
        // The map refuses unsuitable ranges and too long words.
        let is_accepted = MapConfig::<Window<'_, S>>::try_new(0..area.slot).is_ok();
        if is_aligned && is_within && is_long_enough && is_accepted {
            Ok(area)
        } else {
            Err(Error::Range)
        }
    }

    fn start_of(&self, slot: Slot) -> u32 {
        match slot {
            Slot::First => self.start,
            Slot::Second => self.start.wrapping_add(self.slot),
        }
    }

    /// Returns the map of a slot, rotated so that it starts with another sector in every generation: all
    /// sectors wear equally.
    fn map(&mut self, slot: Slot, generation: u32) -> Result<Map<'_, S>, Error<S::Error>> {
        let start = self.start_of(slot);
        // Half the generation, since only every other generation goes to this slot.
        let turn = (generation / 2).checked_rem(self.sectors).unwrap_or(0);
        let window = Window {
            flash: &mut self.flash,
            start,
            size: self.slot,
            turn: turn.wrapping_mul(Self::SECTOR),
            reads_left: self.slot,
        };
        let config = MapConfig::try_new(0..self.slot).map_err(|_| Error::Range)?;
        Ok(MapStorage::new(window, config, Cache::new_uncached()))
    }

    /// Passes the items of a slot to `show` in the order in which they were written, with the generation
    /// of their save, until `show` returns `false`. Returns `false` if the slot cannot be read to its
    /// end. Writes nothing. Damaged items are skipped, so a checksum over the items is needed.
    pub(crate) async fn read(
        &mut self,
        slot: Slot,
        show: &mut dyn FnMut(u32, Item) -> bool,
    ) -> Result<bool, Error<S::Error>> {
        // Rotated by 0 instead of by the slot's generation, which is not known yet: the map finds its
        // first sector at any position.
        let mut map = self.map(slot, 0)?;
        let mut work = [0; WORK];
        let mut items = match map.fetch_all_items(&mut work).await {
            Ok(items) => items,
            Err(error) => return unreadable(error),
        };
        loop {
            match items.next::<&[u8]>(&mut work).await {
                Ok(None) => return Ok(true),
                Ok(Some((_, bytes))) => {
                    if let Some((generation, item)) = Item::read(bytes)
                        && !show(generation, item)
                    {
                        return Ok(true);
                    }
                }
                Err(error) => return unreadable(error),
            }
        }
    }

    /// Writes an item after the existing items of a slot.
    pub(crate) async fn append(
        &mut self,
        slot: Slot,
        generation: u32,
        item: &Item,
    ) -> Result<(), Error<S::Error>> {
        let mut map = self.map(slot, generation)?;
        let bytes = item.bytes(generation);
        let value = bytes.get(KEY..).unwrap_or_default();
        let mut work = [0; WORK];
        let stored = map.store_item(&mut work, &item.key, &value);
        stored.await.map_err(|error| match error {
            MapError::Storage {
                value: WindowError::Flash(error),
                ..
            } => Error::Flash(error),
            // The map wants to erase when a slot is full, and its search for space does not end in
            // garbage; both mean that there is no space.
            MapError::Storage { .. } | MapError::FullStorage | MapError::ItemTooBig => Error::Full,
            _ => Error::NotKept,
        })
    }

    /// Erases every sector of a slot that is not erased.
    pub(crate) async fn clear(&mut self, slot: Slot) -> Result<(), Error<S::Error>> {
        let start = self.start_of(slot);
        for sector in 0..self.sectors {
            let from = start.wrapping_add(sector.wrapping_mul(Self::SECTOR));
            if !self.is_erased(from).await? {
                let to = from.wrapping_add(Self::SECTOR);
                self.flash.erase(from, to).await.map_err(Error::Flash)?;
            }
        }
        Ok(())
    }

    async fn is_erased(&mut self, sector: u32) -> Result<bool, Error<S::Error>> {
        let mut bytes = [0; POLL];
        for look in 0..Self::SECTOR / POLL as u32 {
            let from = sector.wrapping_add(look.wrapping_mul(POLL as u32));
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

/// Distinguishes data that the map cannot read from a flash that does not answer.
fn unreadable<E>(error: MapError<WindowError<E>>) -> Result<bool, Error<E>> {
    match error {
        MapError::Storage {
            value: WindowError::Flash(error),
            ..
        } => Err(Error::Flash(error)),
        _ => Ok(false),
    }
}

type Map<'a, S> = MapStorage<Key, Window<'a, S>, Cache<Uncached, Uncached, Uncached, Key>>;

/// A slot as a separate flash that the map may read and write but never erase. The map erases to reuse a
/// sector, and to repair an apparently interrupted operation of its own, which could destroy the stored
/// set.
struct Window<'a, S> {
    flash: &'a mut S,
    /// Start address of the slot, and its size.
    start: u32,
    size: u32,
    /// Offset in the slot of the window's address 0: the rotation of the map.
    turn: u32,
    /// Remaining number of reads, at first four for each word of the slot. The map reads each word of
    /// its own items once or twice; in garbage that resembles items, a search for space restarts at most
    /// words.
    reads_left: u32,
}

impl<S> Window<'_, S> {
    fn address(&self, offset: u32) -> u32 {
        let turned = self.turn.wrapping_add(offset);
        let within = turned.checked_rem(self.size).unwrap_or(0);
        self.start.wrapping_add(within)
    }
}

/// Error of a window.
#[derive(Debug)]
enum WindowError<E> {
    Flash(E),
    /// The map tried to erase.
    Erases,
    /// The map exceeded the number of reads.
    Endless,
}

impl<E: NorFlashError> NorFlashError for WindowError<E> {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Flash(error) => error.kind(),
            Self::Erases | Self::Endless => NorFlashErrorKind::Other,
        }
    }
}

impl<S: NorFlash> ErrorType for Window<'_, S> {
    type Error = WindowError<S::Error>;
}

impl<S: NorFlash> ReadNorFlash for Window<'_, S> {
    const READ_SIZE: usize = S::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        let left = self.reads_left.checked_sub(1);
        self.reads_left = left.ok_or(WindowError::Endless)?;
        let address = self.address(offset);
        let read = self.flash.read(address, bytes).await;
        read.map_err(WindowError::Flash)
    }

    fn capacity(&self) -> usize {
        self.size as usize
    }
}

impl<S: NorFlash> NorFlash for Window<'_, S> {
    const WRITE_SIZE: usize = S::WRITE_SIZE;
    const ERASE_SIZE: usize = S::ERASE_SIZE;

    async fn erase(&mut self, _from: u32, _to: u32) -> Result<(), Self::Error> {
        Err(WindowError::Erases)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let address = self.address(offset);
        let written = self.flash.write(address, bytes).await;
        written.map_err(WindowError::Flash)
    }
}
