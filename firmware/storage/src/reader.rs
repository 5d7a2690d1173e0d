//! Reader of a set, item by item.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use crate::Error;
use crate::area::Area;
use crate::item::{Item, MAX_ITEM};
use crate::scan::Located;
use crate::seal::SealCopy;

/// Size in bytes of the buffer for the items that one pass over a slot collects. The map's own iterator
/// cannot be kept between calls, and without a buffer each item would need a separate pass. A set of 2
/// KiB takes five passes; the buffer must hold the longest item.
const BATCH: usize = 512;

/// Reader of a set's items in the order of their keys.
#[derive(Debug)]
pub(crate) struct Reader {
    /// Number of items already passed by the reader.
    passed: u16,
    /// Offset of the next item in the batch.
    at: usize,
    /// Items of the last pass with their generation, each preceded by its size in one byte.
    batch: Vec<u8, BATCH>,
}

impl Reader {
    /// Creates a reader before the first item.
    pub(crate) const fn new() -> Self {
        const { assert!(BATCH > MAX_ITEM) };
        Self {
            passed: 0,
            at: 0,
            batch: Vec::new(),
        }
    }

    /// Goes back to the first item.
    pub(crate) fn rewind(&mut self) {
        *self = Self::new();
    }

    /// Returns the next item without advancing; `None` after the last.
    pub(crate) async fn peek<S: NorFlash>(
        &mut self,
        area: &mut Area<S>,
        set: &Located,
    ) -> Result<Option<Item>, Error<S::Error>> {
        if self.passed >= set.sum.items {
            return Ok(None);
        }
        if self.at >= self.batch.len() {
            self.fetch(area, set).await?;
        }
        let bytes = self.batch.get(self.at..).and_then(first);
        let item = bytes.and_then(Item::read);
        item.map(|(_, item)| Some(item)).ok_or(Error::Damaged)
    }

    /// Advances past the next item.
    pub(crate) fn advance(&mut self) {
        let bytes = self.batch.get(self.at..).and_then(first);
        self.at += 1 + bytes.map_or(0, <[u8]>::len);
        self.passed = self.passed.saturating_add(1);
    }

    /// Fills the batch, starting with the next item.
    async fn fetch<S: NorFlash>(
        &mut self,
        area: &mut Area<S>,
        set: &Located,
    ) -> Result<(), Error<S::Error>> {
        self.batch.clear();
        self.at = 0;
        let mut before = self.passed;
        let batch = &mut self.batch;
        let mut take = |generation, item: Item| {
            if generation != set.generation || SealCopy::of(item.key).is_some() {
                return true;
            }
            if before > 0 {
                before -= 1;
                return true;
            }
            push(batch, generation, &item)
        };
        area.read(set.slot, &mut take).await?;
        Ok(())
    }
}

/// Returns the first item of a batch, which starts with its size.
fn first(bytes: &[u8]) -> Option<&[u8]> {
    let (size, rest) = bytes.split_first()?;
    rest.get(..usize::from(*size))
}

/// Adds an item to the batch; `false` if it does not fit.
fn push(batch: &mut Vec<u8, BATCH>, generation: u32, item: &Item) -> bool {
    let bytes = item.bytes(generation);
    if batch.len() + 1 + bytes.len() > batch.capacity() {
        return false;
    }
    // The space was checked above, and the size of an item fits into one byte.
    let _ = batch.push(bytes.len() as u8);
    batch.extend_from_slice(&bytes).is_ok()
}
