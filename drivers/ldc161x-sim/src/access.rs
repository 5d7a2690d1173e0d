//! Effects of register reads and writes.

use crate::chip::Chip;
use crate::faults::ChipFault;
use crate::registers::{Config, address, describe};
use crate::sensor::Sensors;
use crate::switches::{ActiveWrite, ConfigReadback};

/// Bits 5:0 of CONFIG, which are reserved and must be written 00 0001.
const CONFIG_RESERVED: u16 = 0x003F;
/// Reset bit of RESET_DEV.
const RESET: u16 = 0x8000;

impl<S: Sensors> Chip<S> {
    /// Value that a read of the register would return, for tests: unlike a read over the bus, it
    /// changes nothing. Zero if there is no register at the address (guess).
    #[must_use]
    pub fn register(&self, register: u8) -> u16 {
        match register {
            0x00..=0x07 if register & 1 == 0 => self.results.msb(register / 2),
            0x00..=0x07 => {
                let latch = self.settings.switches.shadow_latch;
                self.results.lsb(register / 2, latch)
            }
            address::STATUS => self.results.status(),
            address::CONFIG => self.config_as_read(),
            address::MANUFACTURER_ID | address::DEVICE_ID => self.identity(register),
            _ => self.registers.get(register),
        }
    }

    fn config_as_read(&self) -> u16 {
        let config = self.registers.get(address::CONFIG);
        match self.settings.switches.config_readback {
            ConfigReadback::AsWritten => config,
            ConfigReadback::ReservedAsZero => config & !CONFIG_RESERVED,
        }
    }

    fn identity(&self, register: u8) -> u16 {
        let forged = self.faults.active().find_map(|fault| match fault {
            ChipFault::WrongIdentity {
                manufacturer,
                device,
            } => Some((*manufacturer, *device)),
            _ => None,
        });
        let (manufacturer, device) = forged.unwrap_or((0x5449, 0x3055));
        if register == address::MANUFACTURER_ID {
            manufacturer
        } else {
            device
        }
    }

    /// Reads a register over the bus, with all effects of the read.
    pub(crate) fn read_register(&mut self, register: u8) -> u16 {
        let value = self.register(register);
        match register {
            0x00..=0x07 if register & 1 == 0 => self
                .results
                .msb_was_read(register / 2, &self.settings.switches),
            address::STATUS => self.results.status_was_read(&self.settings.switches),
            _ => self.misuse.unknown_registers += u64::from(describe(register).is_none()),
        }
        value
    }

    /// Writes a register over the bus, with all effects of the write.
    pub(crate) fn write_register(&mut self, register: u8, value: u16) {
        let Some(described) = describe(register) else {
            self.misuse.unknown_registers += 1;
            return;
        };
        if described.writable == 0 {
            self.misuse.read_only_writes += 1;
            return;
        }
        self.misuse.reserved_bits += u64::from(value & described.reserved != described.required);
        match register {
            address::RESET_DEV if value & RESET != 0 => self.reset(),
            address::RESET_DEV => {}
            address::CONFIG => self.write_config(value),
            _ => self.store(register, value),
        }
    }

    fn write_config(&mut self, value: u16) {
        let slept = self.registers.config().sleeps();
        if slept || Config(value).sleeps() {
            self.registers.write(address::CONFIG, value);
            self.follow_sleep(slept);
        } else {
            self.store(address::CONFIG, value);
        }
    }

    /// Stores a value in a register that may be written only while the chip sleeps.
    fn store(&mut self, register: u8, value: u16) {
        if self.registers.config().sleeps() {
            self.registers.write(register, value);
            return;
        }
        self.misuse.writes_while_active += 1;
        match self.settings.switches.active_write {
            ActiveWrite::Ignored => {}
            ActiveWrite::Accepted => self.registers.write(register, value),
            ActiveWrite::CorruptsConversion => {
                self.registers.write(register, value);
                self.sequence.disturb();
            }
        }
    }
}
