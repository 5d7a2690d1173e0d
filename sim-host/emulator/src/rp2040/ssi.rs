//! The flash interface: SSI, IO_QSPI and PADS_QSPI (RP2040 datasheet 4.10, 2.19).

use std::collections::VecDeque;

use crate::board::flash::Flash;
use crate::stop::Refusal;
use crate::time::periods_ps;

/// Entries of each queue (4.10.2).
const DEPTH: usize = 16;

/// Registers of the SSI by offset (4.10.13).
mod register {
    pub(super) const CTRLR0: u32 = 0x00;
    pub(super) const CTRLR1: u32 = 0x04;
    pub(super) const SSIENR: u32 = 0x08;
    pub(super) const SER: u32 = 0x10;
    pub(super) const BAUDR: u32 = 0x14;
    pub(super) const TXFLR: u32 = 0x20;
    pub(super) const RXFLR: u32 = 0x24;
    pub(super) const SR: u32 = 0x28;
    pub(super) const ICR: u32 = 0x48;
    pub(super) const IDR: u32 = 0x58;
    pub(super) const VERSION: u32 = 0x5C;
    pub(super) const DR0: u32 = 0x60;
    pub(super) const RX_SAMPLE_DLY: u32 = 0xF0;
    pub(super) const SPI_CTRLR0: u32 = 0xF4;
}

/// SR: busy, transmit queue not full, transmit queue empty, receive queue not empty, receive queue
/// full (4.10.13).
mod status {
    pub(super) const BUSY: u32 = 1 << 0;
    pub(super) const TFNF: u32 = 1 << 1;
    pub(super) const TFE: u32 = 1 << 2;
    pub(super) const RFNE: u32 = 1 << 3;
    pub(super) const RFF: u32 = 1 << 4;
}

/// Value of the identification registers (4.10.13).
const IDENTIFICATION: u32 = 0x5153_5049;
const VERSION_4_01: u32 = 0x3430_312A;

/// CTRLR0: bytes in both directions on one wire.
const BYTES: u32 = 7 << 16;
/// CTRLR0: sends an instruction and an address, receives a word of 32 bits, on four wires.
const READ_QUAD: u32 = 2 << 21 | 31 << 16 | 3 << 8;
/// SPI_CTRLR0 of the read that starts continuous read: a command on one wire, then address and mode
/// bits on four wires, and four wait clocks.
const FIRST_QUAD: u32 = 4 << 11 | 2 << 8 | 8 << 2 | 1;
/// SPI_CTRLR0: address and mode bits A0h on four wires without a command, and four wait clocks.
const EACH_QUAD: u32 = 0xA0 << 24 | 4 << 11 | 8 << 2 | 2;
/// Command of the fast read on four wires (W25Q16JV datasheet, instructions).
const FAST_READ_QUAD: u32 = 0xEB;
/// Clocks of the read that starts continuous read: the command, address and mode bits, wait, a
/// word.
const FIRST_QUAD_CLOCKS: u64 = 8 + 8 + 4 + 8;

/// System clocks per flash clock in the boot ROM (2.8.3, `flash_exit_xip`).
const ROM_DIVIDER: u32 = 6;
/// System clocks per flash clock in the second stage of the image (`rp2040-boot2`,
/// `boot2_w25q080.S`).
const SECOND_STAGE_DIVIDER: u32 = 4;

/// Mask of the function in CTRL of the chip select pin (IO_QSPI): 0 is XIP, 31 is none (2.19.6).
const FUNCTION: u32 = 0x1F;
const NO_FUNCTION: u32 = 31;
const CHIP_SELECT: usize = 1;
/// Number of pins of the bank: SCLK, SS, SD0 to SD3.
const PINS: usize = 6;
/// PADS_QSPI after a reset: VOLTAGE_SELECT, SCLK, SD0 to SD3, SS (2.19.6.4).
const PADS: [u32; 7] = [0, 0x56, 0x52, 0x52, 0x52, 0x52, 0x5A];

/// Output override of the chip select pin (OUTOVER, 2.19.6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Override {
    Normal,
    Low,
    High,
}

/// A frame in transmission, with its end time.
#[derive(Clone, Copy, Debug)]
struct Frame {
    word: u32,
    ends_ps: u64,
}

/// Controller of the flash.
#[derive(Clone, Debug)]
pub(crate) struct Ssi {
    is_enabled: bool,
    control: u32,
    spi_control: u32,
    frames: u32,
    divider: u32,
    slaves: u32,
    sample_delay: u32,
    sent: VecDeque<Frame>,
    received: VecDeque<u32>,
    /// Instruction of a quad read, until its address arrives.
    instruction: Option<u32>,
    select: Override,
    functions: [u32; PINS],
    pads: [u32; PADS.len()],
}

impl Ssi {
    /// State after the second stage.
    pub(crate) fn new() -> Self {
        Self {
            is_enabled: true,
            control: READ_QUAD,
            spi_control: EACH_QUAD,
            frames: 0,
            divider: SECOND_STAGE_DIVIDER,
            slaves: 1,
            sample_delay: 1,
            sent: VecDeque::new(),
            received: VecDeque::new(),
            instruction: None,
            select: Override::Normal,
            functions: [0; PINS],
            pads: PADS,
        }
    }

    // ---- functions of the boot ROM ----

    /// `connect_internal_flash`: resets pads and pins, then selects XIP at the pins.
    pub(crate) fn connect(&mut self) {
        self.reset_pads();
        self.reset_pins();
        self.functions = [0; PINS];
    }

    /// `flash_exit_xip`: byte transfers on one wire.
    pub(crate) fn set_serial(&mut self) {
        self.clear_queues();
        self.control = BYTES;
        self.is_enabled = true;
        self.divider = ROM_DIVIDER;
        self.slaves = 1;
        self.select = Override::Normal;
    }

    /// Drives chip select high by software, as the ROM leaves it after its commands.
    pub(crate) const fn deselect_by_hand(&mut self) {
        self.select = Override::High;
    }

    /// Returns chip select to the SSI.
    pub(crate) const fn release_select(&mut self) {
        self.select = Override::Normal;
    }

    /// Whether commands can be sent byte by byte.
    pub(crate) fn is_serial(&self) -> bool {
        self.is_enabled && self.control == BYTES && self.is_connected()
    }

    /// Whether all pins are connected to the flash.
    fn is_connected(&self) -> bool {
        self.functions == [0; PINS]
    }

    /// System clocks per flash clock.
    pub(crate) const fn divider(&self) -> u32 {
        self.divider
    }

    // ---- execute in place ----

    /// Reason why the flash cannot be executed in place, if it cannot.
    pub(crate) fn closed(&self, flash: &Flash) -> Option<&'static str> {
        if flash.is_busy() {
            return Some(
                "reads flash that erases or programs: what runs meanwhile, and its data, must lie \
                 in RAM",
            );
        }
        if self.select != Override::Normal {
            return Some(
                "reads flash whose chip select is driven by hand: flash_flush_cache gives it back",
            );
        }
        let is_ready = self.is_enabled && self.is_connected() && self.slaves == 1;
        let is_quad = (self.control, self.spi_control) == (READ_QUAD, EACH_QUAD);
        (!is_ready || !is_quad || !flash.is_continuous()).then_some(
            "reads flash that is not in XIP mode: the second stage, run from RAM, enters it",
        )
    }

    // ---- registers of the SSI ----

    /// Sends all frames that are due.
    pub(crate) fn advance(&mut self, now_ps: u64, flash: &mut Flash) -> Result<(), Refusal> {
        while let Some(&frame) = self.sent.front()
            && frame.ends_ps <= now_ps
        {
            self.sent.pop_front();
            let word = self.exchange(frame.word, flash)?;
            if self.received.len() == DEPTH {
                return Err(Refusal::Misuse(
                    "lets the SSI's receive queue overflow: at most 16 bytes may be on their way",
                ));
            }
            self.received.push_back(word);
            if self.sent.is_empty() && self.select == Override::Normal {
                flash.deselect(frame.ends_ps);
            }
        }
        Ok(())
    }

    fn exchange(&self, word: u32, flash: &mut Flash) -> Result<u32, Refusal> {
        if self.control == READ_QUAD {
            flash.read_quad(word as u8);
            let bytes = [0, 1, 2, 3].map(|offset| flash.byte((word >> 8) + offset));
            return Ok(u32::from_be_bytes(bytes));
        }
        if flash.is_continuous() {
            return Err(Refusal::Misuse(
                "sends a command to flash in continuous read: flash_exit_xip ends it",
            ));
        }
        if self.select == Override::Normal {
            flash.select();
        }
        let byte = flash.exchange(word as u8);
        byte.map(u32::from).ok_or(Refusal::Misuse(
            "sends a command of the flash that is not modelled",
        ))
    }

    pub(crate) fn read(
        &mut self,
        offset: u32,
        now_ps: u64,
        flash: &mut Flash,
    ) -> Result<u32, Refusal> {
        self.advance(now_ps, flash)?;
        Ok(match offset {
            register::CTRLR0 => self.control,
            register::CTRLR1 => self.frames,
            register::SSIENR => u32::from(self.is_enabled),
            register::SER => self.slaves,
            register::BAUDR => self.divider,
            register::TXFLR => self.waiting() as u32,
            register::RXFLR => self.received.len() as u32,
            register::SR => self.status(),
            register::ICR => 0,
            register::IDR => IDENTIFICATION,
            register::VERSION => VERSION_4_01,
            register::DR0 => self.received.pop_front().ok_or(Refusal::Misuse(
                "reads the SSI's empty receive queue: SR says when something has come",
            ))?,
            register::RX_SAMPLE_DLY => self.sample_delay,
            register::SPI_CTRLR0 => self.spi_control,
            _ => return Err(Refusal::Unmodelled),
        })
    }

    /// Number of frames in the queue; the first one is already in transmission.
    fn waiting(&self) -> usize {
        self.sent.len().saturating_sub(1)
    }

    fn status(&self) -> u32 {
        let flags = [
            (!self.sent.is_empty(), status::BUSY),
            (self.waiting() < DEPTH, status::TFNF),
            (self.waiting() == 0, status::TFE),
            (!self.received.is_empty(), status::RFNE),
            (self.received.len() == DEPTH, status::RFF),
        ];
        flags.iter().fold(
            0,
            |all, &(is_set, flag)| if is_set { all | flag } else { all },
        )
    }

    /// Writes a register. `sys_hz` is the system clock, from which the flash clock is divided.
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now_ps: u64,
        sys_hz: f64,
        flash: &mut Flash,
    ) -> Result<(), Refusal> {
        self.advance(now_ps, flash)?;
        match offset {
            register::SSIENR => self.set_enabled(value & 1 == 1, now_ps, flash),
            register::SER => self.slaves = value & 1,
            register::DR0 => self.send(value, now_ps, sys_hz)?,
            _ => self.set_up(offset, value)?,
        }
        Ok(())
    }

    /// Writes a register that may change only while the SSI is disabled (4.10.13).
    fn set_up(&mut self, offset: u32, value: u32) -> Result<(), Refusal> {
        let place = match offset {
            register::CTRLR0 => &mut self.control,
            register::CTRLR1 => &mut self.frames,
            register::BAUDR => &mut self.divider,
            register::RX_SAMPLE_DLY => &mut self.sample_delay,
            register::SPI_CTRLR0 => &mut self.spi_control,
            _ => return Err(Refusal::Unmodelled),
        };
        if self.is_enabled {
            return Err(Refusal::Misuse(
                "sets up the SSI while it is enabled: SSIENR has to be 0",
            ));
        }
        *place = value;
        Ok(())
    }

    fn set_enabled(&mut self, enable: bool, now_ps: u64, flash: &mut Flash) {
        if !enable {
            self.clear_queues();
            if self.select == Override::Normal {
                flash.deselect(now_ps);
            }
        }
        self.is_enabled = enable;
    }

    fn clear_queues(&mut self) {
        self.sent.clear();
        self.received.clear();
        self.instruction = None;
    }

    fn send(&mut self, word: u32, now_ps: u64, sys_hz: f64) -> Result<(), Refusal> {
        if !self.is_enabled || self.slaves == 0 || !self.is_connected() {
            return Err(Refusal::Misuse(
                "sends through an SSI that is disabled, without a slave, or off the flash's pins",
            ));
        }
        let clocks = match (self.control, self.spi_control) {
            (BYTES, _) => 8,
            (READ_QUAD, FIRST_QUAD) if self.instruction == Some(FAST_READ_QUAD) => {
                self.instruction = None;
                FIRST_QUAD_CLOCKS
            }
            (READ_QUAD, FIRST_QUAD) => {
                self.instruction = Some(word);
                return Ok(());
            }
            _ => return Err(Refusal::Misuse("sends in a format that is not modelled")),
        };
        if self.waiting() == DEPTH {
            return Err(Refusal::Misuse(
                "lets the SSI's transmit queue overflow: SR says when there is room",
            ));
        }
        let begins_ps = self.sent.back().map_or(now_ps, |last| last.ends_ps);
        let cycles = clocks * u64::from(self.divider);
        self.sent.push_back(Frame {
            word,
            ends_ps: begins_ps + periods_ps(cycles, sys_hz),
        });
        Ok(())
    }

    // ---- pins and pads ----

    /// Resets IO_QSPI.
    pub(crate) const fn reset_pins(&mut self) {
        self.functions = [NO_FUNCTION; PINS];
        self.select = Override::Normal;
    }

    /// Resets PADS_QSPI.
    pub(crate) const fn reset_pads(&mut self) {
        self.pads = PADS;
    }

    pub(crate) fn read_pins(&self, offset: u32) -> Option<u32> {
        let pin = (offset / 8) as usize;
        let function = *self.functions.get(pin)?;
        let select = match self.select {
            Override::Low if pin == CHIP_SELECT => 2 << 8,
            Override::High if pin == CHIP_SELECT => 3 << 8,
            _ => 0,
        };
        (offset % 8 == 4).then_some(function | select)
    }

    pub(crate) fn write_pins(
        &mut self,
        offset: u32,
        value: u32,
        now_ps: u64,
        flash: &mut Flash,
    ) -> Result<(), Refusal> {
        self.advance(now_ps, flash)?;
        let pin = (offset / 8) as usize;
        let select = match value & !FUNCTION {
            0 => Override::Normal,
            0x200 if pin == CHIP_SELECT => Override::Low,
            0x300 if pin == CHIP_SELECT => Override::High,
            _ => return Err(Refusal::Unmodelled),
        };
        let place = self.functions.get_mut(pin).filter(|_| offset % 8 == 4);
        *place.ok_or(Refusal::Unmodelled)? = value & FUNCTION;
        if pin == CHIP_SELECT {
            self.drive_select(select, now_ps, flash)?;
        }
        Ok(())
    }

    fn drive_select(
        &mut self,
        select: Override,
        now_ps: u64,
        flash: &mut Flash,
    ) -> Result<(), Refusal> {
        let before = std::mem::replace(&mut self.select, select);
        if before == select {
            return Ok(());
        }
        if !self.sent.is_empty() {
            return Err(Refusal::Misuse(
                "moves the flash's chip select within a byte: SR says when all has been sent",
            ));
        }
        match select {
            Override::Low => flash.select(),
            Override::Normal | Override::High => flash.deselect(now_ps),
        }
        Ok(())
    }

    pub(crate) fn read_pads(&self, offset: u32) -> Option<u32> {
        self.pads.get(offset as usize / 4).copied()
    }

    pub(crate) fn write_pads(&mut self, offset: u32, value: u32) -> Option<()> {
        *self.pads.get_mut(offset as usize / 4)? = value & 0xFF;
        Some(())
    }
}
