//! Reads the items of a set one at a time.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use crate::Error;
use crate::area::Area;
use crate::item::{Item, MAX_ITEM};
use crate::scan::Located;
use crate::seal::SealCopy;

/// Bytes that are kept of what one pass over a slot brings: the map's own iterator cannot be kept
/// from one call to the next, and each item would need a pass of its own. A set of 2 KiB takes
/// five passes; it has to hold the longest item.
const BATCH: usize = 512;

/// Reads the items of a set in the order of their keys.
#[derive(Debug)]
pub(crate) struct Reader {
    /// Items that were passed by.
    passed: u16,
    /// Where in the batch the next item begins.
    at: usize,
    /// Items with their generation, each behind its size in one byte.
    batch: Vec<u8, BATCH>,
}

impl Reader {
    /// Before the first item.
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

    /// The next item, which stays the next; `None` behind the last.
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

    /// Passes by the next item.
    pub(crate) fn advance(&mut self) {
        let bytes = self.batch.get(self.at..).and_then(first);
        self.at += 1 + bytes.map_or(0, <[u8]>::len);
        self.passed = self.passed.saturating_add(1);
    }

    /// Fills the batch with the items from the next one on.
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

/// The first item of some bytes, which begin with its size.
fn first(bytes: &[u8]) -> Option<&[u8]> {
    let (size, rest) = bytes.split_first()?;
    rest.get(..usize::from(*size))
}

/// Puts an item into the batch; false if it does not fit.
fn push(batch: &mut Vec<u8, BATCH>, generation: u32, item: &Item) -> bool {
    let bytes = item.bytes(generation);
    if batch.len() + 1 + bytes.len() > batch.capacity() {
        return false;
    }
    // It fits; an item is no longer than its size can say.
    let _ = batch.push(bytes.len() as u8);
    batch.extend_from_slice(&bytes).is_ok()
}
