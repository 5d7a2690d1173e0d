//! The cells of the flash: sectors that snapshots share until one of them writes.

use std::sync::Arc;

use super::geometry::{PAGE, SECTOR, SIZE};

/// Value of an erased byte.
const ERASED: u8 = 0xFF;

/// The chip's contents. A clone shares every sector with its origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Sectors(Vec<Arc<[u8; SECTOR]>>);

impl Sectors {
    /// Contents from the start of the flash; the rest of the flash is erased, and excess bytes are
    /// ignored.
    pub(super) fn new(contents: &[u8]) -> Self {
        let erased = Arc::new([ERASED; SECTOR]);
        let mut sectors = Self(vec![erased; SIZE / SECTOR]);
        for (sector, bytes) in sectors.0.iter_mut().zip(contents.chunks(SECTOR)) {
            if bytes.iter().any(|&byte| byte != ERASED) {
                let cells = Arc::make_mut(sector);
                for (cell, byte) in cells.iter_mut().zip(bytes) {
                    *cell = *byte;
                }
            }
        }
        sectors
    }

    /// A byte. Addresses wrap at the end: the chip has no more address bits.
    #[inline]
    pub(super) fn byte(&self, address: u32) -> u8 {
        let address = address as usize % SIZE;
        let sector = self.0.get(address / SECTOR);
        sector
            .and_then(|cells| cells.get(address % SECTOR))
            .map_or(ERASED, |&cell| cell)
    }

    /// A little-endian word.
    #[inline]
    pub(super) fn word(&self, address: u32) -> u32 {
        let address = address as usize % SIZE;
        let offset = address % SECTOR;
        let cells = self.0.get(address / SECTOR);
        match cells.and_then(|cells| cells.get(offset..offset + 4)) {
            Some(&[first, second, third, fourth]) => {
                u32::from_le_bytes([first, second, third, fourth])
            }
            _ => self.word_across_sectors(address as u32),
        }
    }

    #[cold]
    fn word_across_sectors(&self, address: u32) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|offset| self.byte(address + offset)))
    }

    pub(super) fn bytes(&self) -> impl Iterator<Item = u8> + '_ {
        self.0.iter().flat_map(|cells| cells.iter().copied())
    }

    fn sector_mut(&mut self, address: u32) -> &mut [u8] {
        let sector = self.0.get_mut(address as usize % SIZE / SECTOR);
        sector.map_or(&mut [], |cells| Arc::make_mut(cells).as_mut_slice())
    }

    /// Changes every byte of the sector at an address.
    pub(super) fn change_sector(&mut self, address: u32, mut change: impl FnMut(u8) -> u8) {
        for cell in self.sector_mut(address) {
            *cell = change(*cell);
        }
    }

    /// Changes every byte of the page at an address, each with its own data byte.
    pub(super) fn change_page(
        &mut self,
        address: u32,
        page: &[u8; PAGE],
        mut change: impl FnMut(u8, u8) -> u8,
    ) {
        let first = address as usize % SECTOR / PAGE * PAGE;
        let cells = self.sector_mut(address).iter_mut().skip(first);
        for (cell, &byte) in cells.zip(page) {
            *cell = change(*cell, byte);
        }
    }

    pub(super) fn change_byte(&mut self, address: u32, change: impl FnOnce(u8) -> u8) {
        let offset = address as usize % SECTOR;
        if let Some(cell) = self.sector_mut(address).get_mut(offset) {
            *cell = change(*cell);
        }
    }
}
