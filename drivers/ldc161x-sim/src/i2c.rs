//! The chip as a target on the I2C bus, byte by byte (datasheet 7.5).

use crate::chip::Chip;
use crate::faults::{ChipFault, Path};
use crate::i2c_state::{Expecting, Link};
use crate::sensor::Sensors;
use crate::switches::{BurstRead, EarlyTermination};
use crate::time::Time;

/// The acknowledge bit after a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ack {
    /// The receiver pulls the line low: it accepts the byte, or the master reads more bytes.
    Ack,
    /// The line stays high: the receiver refuses the byte, or the master reads no more bytes.
    Nack,
}

impl Ack {
    /// Whether it is [`Ack::Ack`].
    #[must_use]
    pub const fn is_ack(self) -> bool {
        matches!(self, Self::Ack)
    }
}

impl<S: Sensors> Chip<S> {
    /// Handles a START or repeated START with its address byte: seven bits of address, then 1 for a
    /// read or 0 for a write.
    ///
    /// `time` is that of the ninth clock, the acknowledge bit. Together with `write`, `read` and
    /// `stop`, this method is the chip's side of the wires, for a bus or an emulated
    /// microcontroller that keeps its own time; [`crate::Bus`] uses them.
    pub fn start(&mut self, time: Time, address_byte: u8) -> Ack {
        self.advance_to(time);
        self.break_off(true);
        self.begin_transaction();
        self.traffic.starts += 1;
        self.traffic.bytes += 1;
        let addressed = address_byte >> 1 == self.bus_address();
        if !addressed || !self.answers() || self.refuses() {
            return Ack::Nack;
        }
        self.link.expecting = if address_byte & 1 == 1 {
            Expecting::SendHigh
        } else {
            Expecting::Pointer
        };
        self.count_byte();
        Ack::Ack
    }

    /// Receives a byte from the master; `time` is that of its ninth clock. The register changes
    /// with the second data byte.
    pub fn write(&mut self, time: Time, byte: u8) -> Ack {
        self.advance_to(time);
        self.traffic.bytes += 1;
        let takes = match self.link.expecting {
            Expecting::Pointer | Expecting::HighByte | Expecting::LowByte(_) => true,
            Expecting::NoByte => self.settings.switches.burst_read == BurstRead::AutoIncrement,
            _ => false,
        };
        if !takes || !self.answers() || self.refuses() {
            self.link.expecting = Expecting::Start;
            return Ack::Nack;
        }
        self.take(byte);
        self.count_byte();
        Ack::Ack
    }

    /// Sends a byte to the master, which answers with `ack`; `time` is that of the byte's first
    /// clock, at which the chip must know the byte. The effects of a register read occur with the
    /// first byte of the register.
    pub fn read(&mut self, time: Time, ack: Ack) -> u8 {
        self.advance_to(time);
        self.traffic.bytes += 1;
        if self.sda_is_stuck() {
            return 0x00;
        }
        if !self.answers() {
            return 0xFF;
        }
        let Some(byte) = self.next_byte() else {
            return 0xFF;
        };
        let byte = if self.link.slipped {
            (byte >> 1) | 0x80
        } else {
            byte
        };
        let byte = self.faults.distort(Path::ReadData, self.link.sent, byte);
        self.link.sent = self.link.sent.saturating_add(1);
        self.count_byte();
        if ack == Ack::Nack {
            self.link.expecting = match self.link.expecting {
                Expecting::SendLow(_) => Expecting::CutShort,
                _ => Expecting::Start,
            };
        }
        byte
    }

    /// Handles a STOP.
    pub fn stop(&mut self, time: Time) {
        self.advance_to(time);
        self.break_off(true);
        self.traffic.stops += 1;
        self.link.slipped = false;
        let mut counted = core::mem::take(&mut self.link.in_transaction);
        while let Some(change) = self.faults.end_transaction(counted) {
            counted = false;
            self.apply(change);
        }
    }

    /// Time until which the chip or a stuck line holds SDA low outside of a transfer; [`Time::MAX`]
    /// if SDA is never released, `None` if SDA is not held low.
    pub fn sda_held_until(&mut self, time: Time) -> Option<Time> {
        self.advance_to(time);
        let is_stuck = |fault: &ChipFault| matches!(fault, ChipFault::SdaStuck { .. });
        self.faults.lasts_until(is_stuck)
    }

    /// Whether SDA is held low outside of a transfer.
    pub fn sda_held_low(&mut self, time: Time) -> bool {
        self.sda_held_until(time).is_some()
    }

    /// Time until which SCL is held low; [`Time::MAX`] if SCL is never released, `None` if SCL is
    /// not held low. The chip itself never stretches the clock (datasheet 7.5.1).
    pub fn scl_held_until(&mut self, time: Time) -> Option<Time> {
        self.advance_to(time);
        self.faults
            .lasts_until(|fault| matches!(fault, ChipFault::SclStuck))
    }

    /// Receives SCL pulses outside of a transaction, which a master sends to free SDA.
    pub fn clock_pulses(&mut self, time: Time, pulses: u32) {
        self.advance_to(time);
        self.faults.clock_pulses(pulses);
    }

    fn sda_is_stuck(&self) -> bool {
        self.faults
            .active()
            .any(|fault| matches!(fault, ChipFault::SdaStuck { .. }))
    }

    /// Whether the chip can take part in transfers.
    fn answers(&self) -> bool {
        let is_silenced = self.faults.active().any(|fault| {
            matches!(
                fault,
                ChipFault::Absent | ChipFault::SdaStuck { .. } | ChipFault::SclStuck
            )
        });
        self.is_on_the_bus() && !is_silenced
    }

    /// Whether a fault keeps the chip from acknowledging this byte.
    fn refuses(&self) -> bool {
        let bytes = self.link.bytes;
        self.faults
            .active()
            .any(|fault| matches!(fault, ChipFault::Nack { after_bytes } if bytes >= *after_bytes))
    }

    fn begin_transaction(&mut self) {
        if self.link.in_transaction {
            return;
        }
        let number = self.traffic.transactions;
        self.traffic.transactions += 1;
        self.link = Link {
            pointer: self.link.pointer,
            in_transaction: true,
            slipped: self.link.slips_next,
            ..Link::default()
        };
        while let Some(change) = self.faults.begin_transaction(number, self.now) {
            self.apply(change);
        }
    }

    /// Handles one byte of a write.
    fn take(&mut self, byte: u8) {
        let byte = if self.link.slipped { byte >> 1 } else { byte };
        self.link.expecting = match self.link.expecting {
            Expecting::Pointer => {
                self.link.pointer = self.faults.distort(Path::Pointer, self.link.pointers, byte);
                self.link.pointers = self.link.pointers.saturating_add(1);
                Expecting::HighByte
            }
            Expecting::HighByte => Expecting::LowByte(self.distort_written(byte)),
            Expecting::LowByte(high) => {
                let low = self.distort_written(byte);
                self.write_register(self.link.pointer, u16::from_be_bytes([high, low]));
                Expecting::NoByte
            }
            // Reached only if burst accesses increment the address.
            Expecting::NoByte => {
                self.link.pointer = self.link.pointer.wrapping_add(1);
                Expecting::LowByte(self.distort_written(byte))
            }
            other => other,
        };
    }

    fn distort_written(&mut self, byte: u8) -> u8 {
        let index = self.link.written;
        self.link.written = self.link.written.saturating_add(1);
        self.faults.distort(Path::WriteData, index, byte)
    }

    /// The next byte that the chip sends; `None` if it sends none.
    fn next_byte(&mut self) -> Option<u8> {
        let (byte, expecting) = match self.link.expecting {
            Expecting::SendHigh => self.fetch(),
            Expecting::SendLow(low) => (low, Expecting::SendMore),
            Expecting::SendMore => match self.settings.switches.burst_read {
                BurstRead::Released => return None,
                BurstRead::Repeats => self.fetch(),
                BurstRead::AutoIncrement => {
                    self.link.pointer = self.link.pointer.wrapping_add(1);
                    self.fetch()
                }
            },
            _ => return None,
        };
        self.link.expecting = expecting;
        Some(byte)
    }

    fn fetch(&mut self) -> (u8, Expecting) {
        let [high, low] = self.read_register(self.link.pointer).to_be_bytes();
        (high, Expecting::SendLow(low))
    }

    /// Counts a byte; a fault may insert a STOP after it.
    fn count_byte(&mut self) {
        self.link.bytes = self.link.bytes.saturating_add(1);
        let bytes = self.link.bytes;
        let stops = self.faults.active().any(
            |fault| matches!(fault, ChipFault::EarlyStop { after_bytes } if bytes == *after_bytes),
        );
        if stops {
            self.break_off(false);
        }
    }

    /// Ends the current access. An access that transferred only one of a register's two bytes
    /// counts as an early termination.
    fn break_off(&mut self, by_master: bool) {
        let is_early = matches!(
            self.link.expecting,
            Expecting::LowByte(_) | Expecting::SendLow(_) | Expecting::CutShort
        );
        if is_early {
            self.misuse.early_terminations += u64::from(by_master);
            if self.settings.switches.early_termination == EarlyTermination::CorruptsFollowing {
                self.garble();
            }
        }
        self.link.expecting = Expecting::Start;
    }

    /// Applies the effects of an early termination: a half-written register, and a shift of the
    /// following bytes by one bit.
    fn garble(&mut self) {
        self.link.slips_next = true;
        if let Expecting::LowByte(high) = self.link.expecting {
            let [_, low] = self.registers.get(self.link.pointer).to_be_bytes();
            self.write_register(self.link.pointer, u16::from_be_bytes([high, low]));
        }
    }
}
