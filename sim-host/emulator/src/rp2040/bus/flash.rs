//! The flash on the bus: registers of its controller and of its cache, and whether it can be read
//! in place.

use crate::board::plant::Plant;
use crate::stop::{Refusal, Stop};

use super::SystemBus;

/// Base addresses of cache and controller (RP2040 datasheet 2.2.2).
mod base {
    pub(super) const XIP_CTRL: u32 = 0x1400_0000;
    pub(super) const SSI: u32 = 0x1800_0000;

    /// Base of an address's block, for any of the four views of its registers.
    pub(super) const fn of(address: u32) -> u32 {
        address & !0x3FFF
    }
}

/// Registers of XIP_CTRL by offset; last, the value of CTRL after a reset: enabled, errors on
/// writes (2.6.3.6).
const CTRL: u32 = 0x0;
const FLUSH: u32 = 0x4;
const STAT: u32 = 0x8;
const ENABLED: u32 = 0b11;
/// Value of STAT: a flush is complete, and nothing is streamed.
const READY: u32 = 0b11;
/// Offset of the watchdog's scratch register that requests a start at an address given in other
/// scratch registers, and its value for this request (2.8.1.1).
const DIRECT_BOOT_SCRATCH: u32 = 0x1C;
const DIRECT_BOOT: u32 = 0xB007_C0D3;
/// Mode bits that keep the flash in continuous read, as the second stage sends them.
const CONTINUOUS: u8 = 0xA0;
/// Bytes of the second stage, and of the checksum at its end (2.8.1.3).
const SECOND_STAGE: u32 = 256;
const CHECKSUM: u32 = 4;

impl<P: Plant> SystemBus<P> {
    /// Value of an access to a block; `None` if the access is not modelled. A misuse stops the run.
    pub(super) fn accept<T: Default>(&mut self, result: Result<T, Refusal>) -> Option<T> {
        match result {
            Ok(value) => Some(value),
            Err(Refusal::Unmodelled) => None,
            Err(Refusal::Misuse(what)) => {
                self.misuse(what);
                Some(T::default())
            }
        }
    }

    #[cold]
    pub(super) fn read_closed_flash(&mut self) {
        if let Some(what) = self.memory.closed {
            self.misuse(what);
        }
    }

    #[cold]
    pub(super) fn misuse(&mut self, what: &'static str) {
        let pc = self.pc;
        self.stop.get_or_insert(Stop::Misused { what, pc });
    }

    /// Checks an access to the flash controller, which is invalid while a function of the boot ROM
    /// uses it.
    pub(super) fn check_controller(&mut self) {
        if self.rom_calls.running.is_some() {
            self.misuse("accesses the flash's controller while a function of the boot ROM runs");
        }
    }

    pub(super) fn read_controller(&mut self, address: u32) -> Option<u32> {
        let offset = address & 0xFFF;
        match base::of(address) {
            base::XIP_CTRL => match offset {
                CTRL => Some(ENABLED),
                FLUSH => Some(0),
                STAT => Some(READY),
                _ => None,
            },
            base::SSI => {
                self.check_controller();
                let now_ps = self.clock.now_ps();
                let value = self.ssi.read(offset, now_ps, &mut self.memory.flash);
                self.follow_flash();
                self.refresh();
                self.accept(value)
            }
            _ => None,
        }
    }

    pub(super) fn write_controller(&mut self, address: u32, value: u32) -> Option<()> {
        let offset = address & 0xFFF;
        match base::of(address) {
            base::XIP_CTRL => self.write_cache(address, value),
            base::SSI => {
                self.check_controller();
                let (now_ps, hz) = (self.clock.now_ps(), self.clock.hz());
                let flash = &mut self.memory.flash;
                let done = self.ssi.write(offset, value, now_ps, hz, flash);
                self.follow_flash();
                self.accept(done)
            }
            _ => None,
        }
    }

    /// Writes a cache register. CTRL must keep its reset value: use as memory is not modelled.
    fn write_cache(&mut self, address: u32, value: u32) -> Option<()> {
        let control = match address >> 12 & 0b11 {
            0 => value,
            1 => ENABLED ^ value,
            2 => ENABLED | value,
            _ => ENABLED & !value,
        };
        match address & 0xFFF {
            CTRL if control == ENABLED => Some(()),
            FLUSH => {
                self.flush_cache();
                Some(())
            }
            _ => None,
        }
    }

    pub(super) fn write_select(&mut self, offset: u32, value: u32) -> Option<()> {
        self.check_controller();
        let now_ps = self.clock.now_ps();
        let flash = &mut self.memory.flash;
        let done = self.ssi.write_pins(offset, value, now_ps, flash);
        self.follow_flash();
        self.accept(done)
    }

    pub(super) fn flush_cache(&mut self) {
        self.memory.cache.flush();
    }

    /// Updates whether the flash can be read in place.
    pub(crate) fn follow_flash(&mut self) {
        self.memory.closed = self.ssi.closed(&self.memory.flash);
    }

    /// Stops the run at a start at an address from the watchdog's scratch registers (2.8.1.1).
    pub(crate) fn check_direct_boot(&mut self) {
        if self.watchdog.read(DIRECT_BOOT_SCRATCH) == Some(DIRECT_BOOT) {
            self.fail("a start through the watchdog's scratch registers");
        }
    }

    /// Effect of the second stage on the flash.
    pub(crate) fn enter_quad_xip(&mut self) {
        self.memory.flash.read_quad(CONTINUOUS);
        self.follow_flash();
    }

    /// Whether the boot ROM finds a second stage with a valid checksum (2.8.1.3.1).
    pub(crate) fn has_second_stage(&self) -> bool {
        let flash = &self.memory.flash;
        if flash.is_busy() {
            return false;
        }
        let code = SECOND_STAGE - CHECKSUM;
        flash.bytes(code, CHECKSUM) == checksum(&flash.bytes(0, code)).to_le_bytes()
    }
}

/// CRC-32 with the polynomial 04C11DB7, high bit first, initial value of all ones, not inverted
/// (2.8.1.3.1).
pub(crate) fn checksum(bytes: &[u8]) -> u32 {
    let bits = |rest: u32| {
        let polynomial = if rest >> 31 == 1 { 0x04C1_1DB7 } else { 0 };
        rest << 1 ^ polynomial
    };
    bytes.iter().fold(u32::MAX, |checksum, &byte| {
        (0..8).fold(checksum ^ u32::from(byte) << 24, |rest, _| bits(rest))
    })
}
