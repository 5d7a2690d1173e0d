//! Memory of the processor: boot ROM, flash behind its cache, and RAM.

use std::sync::Arc;

use crate::board::flash::Flash;
use crate::rp2040::rom;
use crate::rp2040::xip::Cache;

pub(crate) const RAM: u32 = 0x2000_0000;
/// Size of the RAM, bytes: four banks of 64 KiB and two of 4 KiB (datasheet 2.6.2).
pub(crate) const RAM_SIZE: usize = 264 * 1024;
/// Content of the RAM after power on; real memory has random content.
const RAM_FILL: u8 = 0xA5;
/// Mask of the offset in a window of the flash, in which the flash's content repeats.
const FLASH_MASK: u32 = 0xFF_FFFF;

/// Windows of the flash (2.6.3), 16 MiB each: cached, without allocation, with a forced refill, and
/// uncached.
mod window {
    pub(super) const CACHED: u32 = 0x10;
    pub(super) const NO_ALLOCATION: u32 = 0x11;
    pub(super) const REFILL: u32 = 0x12;
    pub(super) const UNCACHED: u32 = 0x13;

    /// Window of an address.
    pub(super) const fn of(address: u32) -> u32 {
        address >> 24
    }
}

/// Boot ROM, flash and RAM.
#[derive(Clone)]
pub(crate) struct Memory {
    rom: Arc<[u8]>,
    pub(crate) flash: Flash,
    /// Reason why the flash cannot be read in place now.
    pub(crate) closed: Option<&'static str>,
    ram: Vec<u8>,
    pub(crate) cache: Cache,
}

impl Memory {
    /// A flash, and a RAM as after power on.
    pub(crate) fn new(flash: Flash, miss_cycles: u32) -> Self {
        Self {
            rom: rom::image(),
            flash,
            closed: None,
            ram: vec![RAM_FILL; RAM_SIZE],
            cache: Cache::new(miss_cycles),
        }
    }

    /// Fills the RAM as at power on.
    pub(crate) fn forget_ram(&mut self) {
        self.ram.fill(RAM_FILL);
    }

    /// Whether an address is memory.
    #[inline]
    pub(crate) fn contains(address: u32) -> bool {
        Self::is_flash(address) || Self::is_ram(address) || address < rom::SIZE
    }

    #[inline]
    pub(crate) const fn is_flash(address: u32) -> bool {
        matches!(window::of(address), window::CACHED..=window::UNCACHED)
    }

    #[inline]
    pub(crate) fn is_ram(address: u32) -> bool {
        (RAM..RAM + RAM_SIZE as u32).contains(&address)
    }

    /// Wait cycles of an access to flash.
    #[inline]
    pub(crate) fn wait(&mut self, address: u32) -> u32 {
        if window::of(address) == window::CACHED {
            return self.cache.access(address & FLASH_MASK);
        }
        self.wait_past_cache(address)
    }

    #[cold]
    fn wait_past_cache(&mut self, address: u32) -> u32 {
        let offset = address & FLASH_MASK;
        match window::of(address) {
            window::NO_ALLOCATION => self.cache.read_only(offset),
            window::REFILL => self.cache.refill(offset),
            _ => self.cache.word_cycles(),
        }
    }

    /// A byte; 0 outside of memory.
    #[inline]
    pub(crate) fn byte(&self, address: u32) -> u8 {
        if Self::is_flash(address) {
            return self.flash.byte(address & FLASH_MASK);
        }
        let (memory, offset) = if address < rom::SIZE {
            (&*self.rom, address as usize)
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

    pub(crate) fn word(&self, address: u32) -> u32 {
        if Self::is_flash(address) {
            return self.flash.word(address & FLASH_MASK);
        }
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

    /// A word of RAM; `None` elsewhere.
    #[inline]
    pub(crate) fn ram_word(&self, address: u32) -> Option<u32> {
        let offset = ram_offset(address);
        let bytes = self.ram.get(offset..offset.wrapping_add(4))?;
        bytes.try_into().ok().map(u32::from_le_bytes)
    }

    /// A word of RAM, to write; `None` elsewhere.
    #[inline]
    pub(crate) fn ram_word_mut(&mut self, address: u32) -> Option<&mut [u8]> {
        let offset = ram_offset(address);
        self.ram.get_mut(offset..offset.wrapping_add(4))
    }
}

#[inline]
const fn ram_offset(address: u32) -> usize {
    address.wrapping_sub(RAM) as usize
}
