//! Memory of the processor: flash behind its cache, and RAM.

use std::sync::Arc;

use crate::image::FLASH_SIZE;
use crate::xip::Cache;

pub(crate) const RAM: u32 = 0x2000_0000;
/// Four banks of 64 KiB and two of 4 KiB (datasheet 2.6.2).
pub(crate) const RAM_SIZE: usize = 264 * 1024;
/// Addresses of the flash's window, in which its content repeats.
const FLASH_MASK: u32 = 0xFF_FFFF;

/// Flash and RAM.
#[derive(Clone)]
pub(crate) struct Memory {
    flash: Arc<[u8]>,
    ram: Vec<u8>,
    pub(crate) cache: Cache,
}

impl Memory {
    /// Flash with this content, and RAM that is filled with a byte.
    pub(crate) fn new(flash: Arc<[u8]>, fill: u8, miss_cycles: u32) -> Self {
        Self {
            flash,
            ram: vec![fill; RAM_SIZE],
            cache: Cache::new(miss_cycles),
        }
    }

    /// Whether an address is memory.
    #[inline]
    pub(crate) fn contains(address: u32) -> bool {
        is_flash(address) || Self::is_ram(address)
    }

    /// Whether an address is RAM.
    #[inline]
    pub(crate) fn is_ram(address: u32) -> bool {
        (RAM..RAM + RAM_SIZE as u32).contains(&address)
    }

    /// The cycles that an access waits.
    #[inline]
    pub(crate) fn wait(&mut self, address: u32) -> u32 {
        if is_flash(address) {
            self.cache.access(address & FLASH_MASK)
        } else {
            0
        }
    }

    /// A byte; 0 outside of memory.
    #[inline]
    pub(crate) fn byte(&self, address: u32) -> u8 {
        let (memory, offset) = if is_flash(address) {
            (&*self.flash, (address & FLASH_MASK) as usize % FLASH_SIZE)
        } else {
            (&*self.ram, ram_offset(address))
        };
        memory.get(offset).copied().unwrap_or(0)
    }

    /// Writes a byte of RAM; without effect elsewhere.
    #[inline]
    pub(crate) fn set_byte(&mut self, address: u32, value: u8) {
        if let Some(byte) = self.ram.get_mut(ram_offset(address)) {
            *byte = value;
        }
    }

    /// A half-word.
    #[inline]
    pub(crate) fn half_word(&self, address: u32) -> u16 {
        u16::from_le_bytes([self.byte(address), self.byte(address + 1)])
    }

    /// Writes a half-word of RAM.
    #[inline]
    pub(crate) fn set_half_word(&mut self, address: u32, value: u16) {
        let [low, high] = value.to_le_bytes();
        self.set_byte(address, low);
        self.set_byte(address + 1, high);
    }

    /// A word.
    pub(crate) fn word(&self, address: u32) -> u32 {
        (0..4).fold(0, |word, offset| {
            word | u32::from(self.byte(address + offset)) << (8 * offset)
        })
    }

    /// Writes a word of RAM.
    pub(crate) fn set_word(&mut self, address: u32, value: u32) {
        for (offset, byte) in (0..).zip(value.to_le_bytes()) {
            self.set_byte(address + offset, byte);
        }
    }

    /// A word of RAM; nothing elsewhere.
    #[inline]
    pub(crate) fn ram_word(&self, address: u32) -> Option<u32> {
        let offset = ram_offset(address);
        let bytes = self.ram.get(offset..offset.wrapping_add(4))?;
        bytes.try_into().ok().map(u32::from_le_bytes)
    }

    /// A word of RAM, to write; nothing elsewhere.
    #[inline]
    pub(crate) fn ram_word_mut(&mut self, address: u32) -> Option<&mut [u8]> {
        let offset = ram_offset(address);
        self.ram.get_mut(offset..offset.wrapping_add(4))
    }
}

#[inline]
const fn is_flash(address: u32) -> bool {
    address >> 28 == 1
}

#[inline]
const fn ram_offset(address: u32) -> usize {
    address.wrapping_sub(RAM) as usize
}
