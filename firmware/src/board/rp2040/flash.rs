//! Flash memory: its unique number, and the area for settings and calibration.
//!
//! The boot ROM's functions do the work (RP2040 datasheet, 2.8.3.1.3). While one of them runs, flash
//! cannot be read, so all code that runs meanwhile is in RAM, with its constants (build.rs), and
//! interrupts stay enabled. Afterwards flash is read over four wires again, as the second stage sets it
//! up. With the ROM's own command, a cache line would take 3 us, in which no interrupt starts, and time
//! stamps would be off by as much. The second stage is not run again: an interrupt could split one of
//! its commands.

#![allow(unsafe_code)]

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use rp2040_hal::rom_data;
use rp2040_pac::{IO_QSPI, PADS_QSPI, XIP_SSI};

use super::safe::bridge_off;

/// Address at which flash is mapped (datasheet 2.6.3).
const BASE: usize = 0x1000_0000;
/// Flash size in bytes: 2 MiB on a Raspberry Pi Pico.
const CAPACITY: usize = 2 * 1024 * 1024;
/// Size of the storage area at the end of flash, in bytes.
pub const AREA: usize = 64 * 1024;
/// Offset of the storage area from the start of flash.
const AREA_START: usize = CAPACITY - AREA;
/// Size of a sector, the unit of erasing, in bytes (W25Q16JV datasheet, 8.2.15).
const SECTOR: usize = 4096;
/// Size of a page, the unit of programming, in bytes (8.2.13).
const PAGE: usize = 256;
/// Size of a block that the ROM may erase at once, in bytes. The area is erased sector by sector: a
/// block erase takes longer than the storage may wait.
const BLOCK: u32 = 64 * 1024;
/// Command that erases such a block (8.2.17).
const ERASE_BLOCK: u8 = 0xD8;
/// Command Fast Read Quad I/O (8.2.11).
const FAST_READ: u32 = 0xEB;
/// Mode bits after the address of [`FAST_READ`] that let the next read omit the command.
const CONTINUOUS: u32 = 0xA0;
/// Register CTRLR0 (RP2040 datasheet 4.10.13): after an address, a word of 32 bits comes in on four
/// wires.
const WORD_ON_FOUR_WIRES: u32 = 2 << 21 | 31 << 16 | 3 << 8;
/// Register SPI_CTRLR0: an 8-bit command on one wire, 32 bits of address and mode on four wires, and
/// four wait clocks.
const WITH_COMMAND: u32 = 4 << 11 | 2 << 8 | 8 << 2 | 1;
/// Register SPI_CTRLR0: as [`WITH_COMMAND`], without a command, and with the mode bits [`CONTINUOUS`] in
/// each read.
const WITHOUT_COMMAND: u32 = CONTINUOUS << 24 | 4 << 11 | 8 << 2 | 2;
/// Processor clocks per flash clock, as the second stage sets it: the flash runs at 50 MHz and allows
/// 133 MHz (W25Q16JV datasheet 9.6).
const FLASH_DIVIDER: u32 = 4;
/// Command Read Unique ID Number (8.2.27).
const READ_NUMBER: u8 = 0x4B;
/// Bytes before the unique number: the command and four dummy bytes.
const BEFORE_NUMBER: usize = 5;
/// Bytes of the flash's unique number.
const NUMBER: usize = 8;
/// Maximum number of polls for a byte of an answer: 100 us at 200 MHz; a byte takes half a microsecond.
const POLLS: usize = 2_000;

/// Runs `work` with flash in command mode.
///
/// # Safety
///
/// All code that runs until it returns, including interrupts, must be in RAM.
#[inline(always)]
unsafe fn by_commands<T>(work: impl FnOnce() -> T) -> T {
    let pads = Pads::read();
    // SAFETY: called in the order that the datasheet prescribes (2.8.3.1.3).
    let result = unsafe {
        rom_data::connect_internal_flash();
        rom_data::flash_exit_xip();
        let result = work();
        rom_data::flash_flush_cache();
        result
    };
    pads.write();
    read_on_four_wires();
    result
}

/// Pad settings of the flash's clock and data, as the second stage sets them for its clock. The ROM
/// resets them.
struct Pads {
    clock: u32,
    data: [u32; 4],
}

impl Pads {
    #[inline(always)]
    fn read() -> Self {
        // SAFETY: registers are read.
        let pads = unsafe { &*PADS_QSPI::ptr() };
        Self {
            clock: pads.gpio_qspi_sclk().read().bits(),
            data: [
                pads.gpio_qspi_sd0().read().bits(),
                pads.gpio_qspi_sd1().read().bits(),
                pads.gpio_qspi_sd2().read().bits(),
                pads.gpio_qspi_sd3().read().bits(),
            ],
        }
    }

    #[inline(always)]
    fn write(&self) {
        // SAFETY: only the flash uses these pads, and they get back their earlier values.
        unsafe {
            let pads = &*PADS_QSPI::ptr();
            pads.gpio_qspi_sclk().write(|w| w.bits(self.clock));
            let [first, second, third, fourth] = self.data;
            pads.gpio_qspi_sd0().write(|w| w.bits(first));
            pads.gpio_qspi_sd1().write(|w| w.bits(second));
            pads.gpio_qspi_sd2().write(|w| w.bits(third));
            pads.gpio_qspi_sd3().write(|w| w.bits(fourth));
        }
    }
}

/// Sets flash to be read over four wires without commands. The second stage has enabled four wires at
/// start-up.
#[inline(always)]
fn read_on_four_wires() {
    // SAFETY: only this code uses the controller, and flash is not read meanwhile.
    let controller = unsafe { &*XIP_SSI::ptr() };
    let set_up = |format: u32| {
        // SAFETY: only this code uses the controller, and flash is not read meanwhile.
        unsafe {
            controller.ssienr().write(|w| w.bits(0));
            controller.baudr().write(|w| w.bits(FLASH_DIVIDER));
            controller.ctrlr0().write(|w| w.bits(WORD_ON_FOUR_WIRES));
            controller.spi_ctrlr0().write(|w| w.bits(format));
            controller.ssienr().write(|w| w.bits(1));
        }
    };
    set_up(WITH_COMMAND);
    // Interrupts are off for these ten cycles: the controller sends only what is in its FIFO in time.
    cortex_m::interrupt::free(|_| {
        for word in [FAST_READ, CONTINUOUS] {
            // SAFETY: only this code uses the controller, and flash is not read meanwhile.
            controller.dr0().write(|w| unsafe { w.bits(word) });
        }
    });
    let is_sent = || {
        let status = controller.sr().read();
        status.tfe().bit_is_set() && status.busy().bit_is_clear()
    };
    let _ = (0..POLLS).any(|_| is_sent());
    set_up(WITHOUT_COMMAND);
}

/// Returns the flash's unique number, or 0 if it does not answer. Call it once, before interrupts are
/// on.
#[inline(never)]
pub fn number() -> u64 {
    let ask = || {
        select(true);
        let number = exchange_number();
        select(false);
        number.unwrap_or(0)
    };
    // SAFETY: this code and its constants are in RAM, and no interrupt is enabled.
    unsafe { by_commands(ask) }
}

/// Drives the chip select: low for `true`, high for `false`.
fn select(on: bool) {
    // SAFETY: only the flash uses the pin. The ROM gives it back to the controller afterwards.
    let pin = unsafe { &*IO_QSPI::ptr() }.gpio_qspiss();
    pin.gpio_ctrl().modify(|_, w| {
        if on {
            w.outover().low()
        } else {
            w.outover().high()
        }
    });
}

fn exchange_number() -> Option<u64> {
    let mut number = 0;
    for index in 0..BEFORE_NUMBER + NUMBER {
        let sent = if index == 0 { READ_NUMBER } else { 0 };
        let answer = exchange(sent)?;
        if index >= BEFORE_NUMBER {
            number = number << 8 | u64::from(answer);
        }
    }
    Some(number)
}

/// Sends a byte and returns the byte received for it.
fn exchange(sent: u8) -> Option<u8> {
    // SAFETY: only this code uses the controller, which is in the ROM's serial mode.
    let controller = unsafe { &*XIP_SSI::ptr() };
    // SAFETY: any byte may be sent.
    controller.dr0().write(|w| unsafe { w.bits(sent.into()) });
    let has_come = (0..POLLS).any(|_| controller.sr().read().rfne().bit_is_set());
    has_come.then(|| controller.dr0().read().bits() as u8)
}

/// Storage area for settings and calibration; there is one.
pub struct Area(());

impl Area {
    /// Creates the area.
    ///
    /// # Safety
    ///
    /// Call it once: its owner must be the only code that reads or changes flash.
    pub const unsafe fn take() -> Self {
        Self(())
    }
}

/// Failure of a flash operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError(NorFlashErrorKind);

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl ErrorType for Area {
    type Error = FlashError;
}

/// Returns the offset from the start of flash, if `length` bytes at `offset` are within the area.
fn within(offset: u32, length: usize, unit: usize) -> Result<u32, FlashError> {
    let offset = offset as usize;
    if !offset.is_multiple_of(unit) || !length.is_multiple_of(unit) {
        return Err(FlashError(NorFlashErrorKind::NotAligned));
    }
    match offset.checked_add(length) {
        Some(end) if end <= AREA => Ok((AREA_START + offset) as u32),
        _ => Err(FlashError(NorFlashErrorKind::OutOfBounds)),
    }
}

/// Erases the sector at an offset from the start of flash, with the bridge off.
// Never inlined into the storage's code, which is in flash (build.rs).
#[inline(never)]
fn erase_sector(address: u32) {
    bridge_off();
    // SAFETY: a sector of the area, in which no code lies.
    let erase = || unsafe { rom_data::flash_range_erase(address, SECTOR, BLOCK, ERASE_BLOCK) };
    // SAFETY: of the code that can run, only the storage's is in flash, and it waits here.
    unsafe { by_commands(erase) }
}

/// Programs a page, with the bridge off. This function is in RAM.
#[inline(never)]
fn program_page(address: u32, page: &[u8; PAGE]) {
    bridge_off();
    // SAFETY: a page of the area.
    let program = || unsafe { rom_data::flash_range_program(address, page.as_ptr(), PAGE) };
    // SAFETY: of the code that can run, only the storage's is in flash, and it waits here.
    unsafe { by_commands(program) }
}

impl ReadNorFlash for Area {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let address = BASE + within(offset, bytes.len(), Self::READ_SIZE)? as usize;
        for (slot, at) in bytes.iter_mut().zip(address..) {
            // SAFETY: within the flash, which can be read now.
            *slot = unsafe { (at as *const u8).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        AREA
    }
}

impl NorFlash for Area {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let length = to.checked_sub(from);
        let length = length.ok_or(FlashError(NorFlashErrorKind::OutOfBounds))? as usize;
        let start = within(from, length, SECTOR)?;
        for sector in (0..length).step_by(SECTOR) {
            erase_sector(start + sector as u32);
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let start = within(offset, bytes.len(), Self::WRITE_SIZE)? as usize;
        let mut rest = bytes;
        let mut at = start;
        while !rest.is_empty() {
            let from = at % PAGE;
            let (now, later) = rest.split_at(rest.len().min(PAGE - from));
            // Bytes beyond the data are ones: programming a one leaves a bit as it is.
            let mut page = [0xFF; PAGE];
            for (slot, byte) in page.iter_mut().skip(from).zip(now) {
                *slot = *byte;
            }
            program_page((at - from) as u32, &page);
            at += now.len();
            rest = later;
        }
        Ok(())
    }
}
