//! UF2: blocks of 512 bytes, each with the target address of its 256 data bytes (the UF2
//! specification, github.com/microsoft/uf2).

use std::collections::BTreeSet;

use crate::board::flash::{PAGE, SECTOR};

/// Size of a block, bytes.
pub(crate) const BLOCK: usize = 512;
/// Data bytes of a block for the RP2040 (RP2040 datasheet 2.8.4.2).
pub(crate) const PAYLOAD: usize = PAGE;
const FIRST_MAGIC: u32 = 0x0A32_4655;
const SECOND_MAGIC: u32 = 0x9E5D_5157;
const LAST_MAGIC: u32 = 0x0AB1_6F30;
/// Flags of a block: not for the main flash; with a family ID.
const NOT_MAIN_FLASH: u32 = 1;
const HAS_FAMILY: u32 = 0x2000;
/// Family ID of the RP2040 (2.8.4.2).
const FAMILY: u32 = 0xE48B_FF56;
/// Offsets in a block: of the payload, and of the last magic number.
const HEADER: usize = 32;
const LAST: usize = 508;

/// A block that the boot ROM of an RP2040 accepts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Uf2Block {
    pub(crate) address: u32,
    pub(crate) number: u32,
    pub(crate) count: u32,
    pub(crate) payload: Box<[u8; PAYLOAD]>,
}

impl Uf2Block {
    /// Parses a block; `None` for a block that the boot ROM skips: not a UF2, another family,
    /// another size.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let word = |offset: usize| {
            let bytes = bytes.get(offset..offset + 4)?;
            bytes.try_into().ok().map(u32::from_le_bytes)
        };
        let flags = word(8)?;
        let is_ours = word(0)? == FIRST_MAGIC
            && word(4)? == SECOND_MAGIC
            && word(LAST)? == LAST_MAGIC
            && flags & HAS_FAMILY != 0
            && flags & NOT_MAIN_FLASH == 0
            && word(16)? == PAYLOAD as u32
            && word(28)? == FAMILY;
        let payload = bytes.get(HEADER..HEADER + PAYLOAD)?;
        is_ours.then_some(Self {
            address: word(12)?,
            number: word(20)?,
            count: word(24)?,
            payload: Box::new(payload.try_into().ok()?),
        })
    }

    fn bytes(&self) -> [u8; BLOCK] {
        let words = [
            FIRST_MAGIC,
            SECOND_MAGIC,
            HAS_FAMILY,
            self.address,
            PAYLOAD as u32,
            self.number,
            self.count,
            FAMILY,
        ];
        let header = words.into_iter().flat_map(u32::to_le_bytes);
        let padding = std::iter::repeat_n(0, LAST - HEADER - PAYLOAD);
        let content = header
            .chain(*self.payload)
            .chain(padding)
            .chain(LAST_MAGIC.to_le_bytes());
        let mut block = [0; BLOCK];
        for (place, byte) in block.iter_mut().zip(content) {
            *place = byte;
        }
        block
    }
}

/// A UF2 of whole sectors, each given by its start address and its bytes.
///
/// The boot ROM erases a sector at every sixteenth block number, not at every new sector: only
/// files of whole sectors are written correctly.
pub(crate) fn write<'a>(sectors: impl Iterator<Item = (u32, &'a [u8])>) -> Vec<u8> {
    let pages: Vec<(u32, &[u8])> = sectors
        .flat_map(|(address, bytes)| (address..).step_by(PAYLOAD).zip(bytes.chunks(PAYLOAD)))
        .collect();
    let count = pages.len() as u32;
    let blocks = (0..).zip(pages).map(|(number, (address, bytes))| {
        let mut payload = Box::new([0xFF; PAYLOAD]);
        for (place, byte) in payload.iter_mut().zip(bytes) {
            *place = *byte;
        }
        Uf2Block {
            address,
            number,
            count,
            payload,
        }
    });
    blocks.flat_map(|block| block.bytes()).collect()
}

/// State of the boot ROM for the file being received (its source, `virtual_disk.c`).
#[derive(Clone, Debug, Default)]
pub(crate) struct Download {
    count: u32,
    written: BTreeSet<u32>,
    erased: BTreeSet<u32>,
}

/// Write that a block requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Uf2Write {
    /// Whether the sector of the block is erased first.
    pub(crate) erases: bool,
}

impl Download {
    /// Accepts a block; `None` for a repeated block, or an invalid number or address.
    pub(crate) fn take(&mut self, block: &Uf2Block) -> Option<Uf2Write> {
        if block.count != self.count {
            *self = Self {
                count: block.count,
                ..Self::default()
            };
        }
        if block.number >= block.count || !block.address.is_multiple_of(PAYLOAD as u32) {
            *self = Self::default();
            return None;
        }
        let is_new = self.written.insert(block.number);
        let sector = block.number * PAYLOAD as u32 / SECTOR as u32;
        is_new.then(|| Uf2Write {
            erases: self.erased.insert(sector),
        })
    }

    /// Whether all blocks of the file have been received.
    pub(crate) fn is_whole(&self) -> bool {
        self.count > 0 && self.written.len() == self.count as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_read_as_it_is_written_and_a_foreign_one_is_passed_over() {
        let sector = [0x5A; SECTOR];
        let file = write([(0x1000_1000, sector.as_slice())].into_iter());
        assert_eq!(file.len(), SECTOR / PAYLOAD * BLOCK);
        let second = Uf2Block::parse(&file[BLOCK..]).unwrap();
        assert_eq!(
            (second.address, second.number, second.count),
            (0x1000_1100, 1, 16)
        );
        assert_eq!(*second.payload, [0x5A; PAYLOAD]);
        // Offset of each word that identifies the block.
        for offset in [0, 4, 8, 16, 28, LAST] {
            let mut foreign = file[..BLOCK].to_vec();
            foreign[offset] ^= 1;
            assert_eq!(Uf2Block::parse(&foreign), None, "at {offset}");
        }
    }
}
