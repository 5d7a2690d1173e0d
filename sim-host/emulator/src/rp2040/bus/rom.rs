//! Execution of the boot ROM's functions: checks, effects and durations.

use std::collections::VecDeque;

use crate::board::flash::{FlashOperationKind, PAGE, SECTOR, SIZE};
use crate::board::plant::Plant;
use crate::rp2040::memory::Memory;
use crate::rp2040::rom::{RomFunction, request};
use crate::rp2040::rom_calls::{EXIT_XIP_CYCLES, Running, Step, erase_steps};
use crate::rp2040::xip::FLUSH_CYCLES;
use crate::stop::Refusal;
use crate::time::periods_ps;

use super::SystemBus;

/// Delay from `reset_to_usb_boot` to the reset (the boot ROM's source, `bootrom_main.c`), ms.
const USB_BOOT_MS: u32 = 10;
/// WATCHDOG registers by offset; last, the enable bit of CTRL (RP2040 datasheet 4.7.6).
const WATCHDOG_CTRL: u32 = 0x00;
const WATCHDOG_LOAD: u32 = 0x04;
const WATCHDOG_SCRATCH: [u32; 2] = [0x0C, 0x10];
const WATCHDOG_TICK: u32 = 0x2C;
const WATCHDOG_ENABLE: u32 = 1 << 30;
/// Value of TICK for a tick of 12 cycles of the crystal, to which the boot ROM switches the
/// reference clock, and the crystal's frequency, Hz.
const TICK_OF_12: u32 = 1 << 9 | 12;
const CRYSTAL_HZ: f64 = 12e6;

impl<P: Plant> SystemBus<P> {
    // ---- the private register block ----

    pub(super) fn read_request(&self, address: u32) -> Option<u32> {
        let running = self.rom_calls.running.as_ref();
        match address.checked_sub(request::BASE)? {
            request::FUNCTION => Some(running.map_or(0, |running| running.function as u32 + 1)),
            _ => None,
        }
    }

    pub(super) fn write_request(&mut self, address: u32, value: u32) -> Result<(), Refusal> {
        let offset = address
            .checked_sub(request::BASE)
            .ok_or(Refusal::Unmodelled)?;
        if self.rom_calls.running.is_some() {
            return Err(Refusal::Misuse(
                "calls the boot ROM while one of its functions runs: interrupt handlers must not",
            ));
        }
        if offset == request::FUNCTION {
            let function = RomFunction::numbered(value).ok_or(Refusal::Unmodelled)?;
            return self.call(function);
        }
        let arguments = &mut self.rom_calls.arguments;
        let place = arguments.get_mut(offset as usize / 4);
        *place.ok_or(Refusal::Unmodelled)? = value;
        Ok(())
    }

    // ---- the functions ----

    fn call(&mut self, function: RomFunction) -> Result<(), Refusal> {
        match function {
            RomFunction::ConnectInternalFlash => self.connect_internal_flash(),
            RomFunction::FlashExitXip => self.flash_exit_xip(),
            RomFunction::FlashRangeErase => self.flash_range_erase(),
            RomFunction::FlashRangeProgram => self.flash_range_program(),
            RomFunction::FlashFlushCache => {
                self.flush_cache();
                self.ssi.release_select();
                self.rom_calls.is_connected = false;
                self.wait(function, FLUSH_CYCLES);
                Ok(())
            }
            RomFunction::ResetToUsbBoot => self.reset_to_usb_boot(),
        }
    }

    fn connect_internal_flash(&mut self) -> Result<(), Refusal> {
        self.ssi.connect();
        self.rom_calls.is_connected = true;
        self.wait(RomFunction::ConnectInternalFlash, 0);
        Ok(())
    }

    fn flash_exit_xip(&mut self) -> Result<(), Refusal> {
        if !self.rom_calls.is_connected {
            return Err(Refusal::Misuse(
                "calls flash_exit_xip before connect_internal_flash",
            ));
        }
        self.ssi.set_serial();
        self.memory.flash.exit_continuous();
        self.wait(RomFunction::FlashExitXip, EXIT_XIP_CYCLES);
        Ok(())
    }

    fn flash_range_erase(&mut self) -> Result<(), Refusal> {
        let [address, count, block_size, command] = self.rom_calls.arguments;
        self.check_range(address, count, SECTOR as u32)?;
        let block = erased_block(block_size, command)?;
        let steps = erase_steps(address, count, block);
        self.run(RomFunction::FlashRangeErase, steps);
        Ok(())
    }

    fn flash_range_program(&mut self) -> Result<(), Refusal> {
        let [address, data, count, _] = self.rom_calls.arguments;
        self.check_range(address, count, PAGE as u32)?;
        if count > 0 && !(Memory::is_ram(data) && Memory::is_ram(data.saturating_add(count - 1))) {
            return Err(Refusal::Misuse(
                "calls flash_range_program with data that are not in RAM: flash cannot be read \
                 then",
            ));
        }
        let steps = (0..count)
            .step_by(PAGE)
            .map(|offset| Step::program(address + offset, self.page_of_ram(data + offset)))
            .collect();
        self.run(RomFunction::FlashRangeProgram, steps);
        Ok(())
    }

    fn page_of_ram(&self, address: u32) -> Box<[u8; PAGE]> {
        let mut page = Box::new([0; PAGE]);
        for (place, address) in page.iter_mut().zip(address..) {
            *place = self.memory.byte(address);
        }
        page
    }

    fn check_range(&self, address: u32, count: u32, unit: u32) -> Result<(), Refusal> {
        if !self.ssi.is_serial() {
            return Err(Refusal::Misuse(
                "erases or programs flash before flash_exit_xip",
            ));
        }
        if !address.is_multiple_of(unit) || !count.is_multiple_of(unit) {
            return Err(Refusal::Misuse(
                "erases parts of sectors of 4096 bytes, or programs parts of pages of 256",
            ));
        }
        let end = address.checked_add(count);
        if end.is_none_or(|end| end > SIZE as u32) {
            return Err(Refusal::Misuse(
                "erases or programs beyond the flash's 2 MiB: addresses count from its beginning",
            ));
        }
        Ok(())
    }

    /// Ends in a watchdog reset; until then interrupts continue.
    fn reset_to_usb_boot(&mut self) -> Result<(), Refusal> {
        let [activity_pins, disabled_interfaces, ..] = self.rom_calls.arguments;
        self.rom_calls.usb_boot = Some(disabled_interfaces);
        self.reboot_by_watchdog(USB_BOOT_MS)
            .ok_or(Refusal::Unmodelled)?;
        // By its source, the boot ROM passes both masks over the reset in the first two watchdog
        // scratch registers; values that the firmware keeps there are lost.
        for (register, mask) in WATCHDOG_SCRATCH
            .into_iter()
            .zip([activity_pins, disabled_interfaces])
        {
            let (now_ps, ref_hz) = (self.clock.now_ps(), CRYSTAL_HZ);
            self.watchdog
                .write(register, mask, now_ps, ref_hz)
                .ok_or(Refusal::Unmodelled)?;
        }
        self.rom_calls.running = Some(Running {
            function: RomFunction::ResetToUsbBoot,
            steps: VecDeque::new(),
            due_ps: None,
        });
        Ok(())
    }

    /// Makes the watchdog reset everything after half of the time that the boot ROM intends, due to
    /// erratum E1 (the boot ROM's source, `runtime.c`).
    pub(crate) fn reboot_by_watchdog(&mut self, milliseconds: u32) -> Option<()> {
        self.power.let_watchdog_reset_all();
        let now_ps = self.clock.now_ps();
        for (register, value) in [
            (WATCHDOG_CTRL, 0),
            (WATCHDOG_TICK, TICK_OF_12),
            (WATCHDOG_LOAD, milliseconds * 1_000),
            (WATCHDOG_CTRL, WATCHDOG_ENABLE),
        ] {
            self.watchdog.write(register, value, now_ps, CRYSTAL_HZ)?;
        }
        self.refresh();
        Some(())
    }

    // ---- time ----

    /// Makes a function of the boot ROM end after some cycles.
    fn wait(&mut self, function: RomFunction, cycles: u64) {
        let wait_ps = periods_ps(cycles, self.clock.hz());
        self.rom_calls.running = Some(Running {
            function,
            steps: VecDeque::new(),
            due_ps: Some(self.clock.now_ps() + wait_ps),
        });
    }

    /// Sets up the SSI for the boot ROM's loader, as the ROM's functions do.
    pub(crate) fn ssi_for_boot_loader(&mut self) {
        self.ssi.connect();
        self.ssi.set_serial();
        self.memory.flash.exit_continuous();
    }

    /// Starts a function of the boot ROM that erases and programs the flash.
    pub(crate) fn run(&mut self, function: RomFunction, steps: VecDeque<Step>) {
        // The ROM drives chip select by software, and leaves it high.
        self.ssi.deselect_by_hand();
        self.rom_calls.running = Some(Running {
            function,
            due_ps: Some(self.sent_ps(steps.front())),
            steps,
        });
    }

    /// Time at which all bits of a step that starts now have been sent.
    fn sent_ps(&self, step: Option<&Step>) -> u64 {
        let cycles = step.map_or(0, Step::bits) * u64::from(self.ssi.divider());
        self.clock.now_ps() + periods_ps(cycles, self.clock.hz())
    }

    /// Continues the running function, if a step is due.
    pub(super) fn service_rom(&mut self, now_ps: u64) {
        let Some(mut running) = self.rom_calls.running.take() else {
            return;
        };
        if running.function == RomFunction::ResetToUsbBoot || !self.is_due(&running, now_ps) {
            self.rom_calls.running = Some(running);
            return;
        }
        if running.due_ps.is_none() {
            running.due_ps = Some(self.sent_ps(running.steps.front()));
        } else if let Some(step) = running.steps.pop_front() {
            let flash = &mut self.memory.flash;
            flash.enable_write();
            flash.begin(step.kind, step.address, step.page, now_ps);
            running.due_ps = None;
        }
        let goes_on = running.due_ps.is_none() || !running.steps.is_empty();
        self.rom_calls.running = goes_on.then_some(running);
        self.has_new_code |= !goes_on;
    }

    fn is_due(&self, running: &Running, now_ps: u64) -> bool {
        match running.due_ps {
            Some(due_ps) => due_ps <= now_ps,
            None => !self.memory.flash.is_busy(),
        }
    }
}

/// Larger erase unit that `flash_range_erase` may use; `None` where it is larger than the flash.
fn erased_block(block_size: u32, command: u32) -> Result<Option<FlashOperationKind>, Refusal> {
    if !block_size.is_power_of_two() || block_size < SECTOR as u32 {
        return Err(Refusal::Misuse(
            "calls flash_range_erase with a block size that is no power of two from 4096 on",
        ));
    }
    if block_size > SIZE as u32 {
        return Ok(None);
    }
    // The argument is a byte; the upper bits of the register are ignored.
    let kind = FlashOperationKind::of(command as u8);
    let is_right = |kind: &FlashOperationKind| {
        *kind != FlashOperationKind::ProgramPage && kind.bytes() == block_size
    };
    kind.filter(is_right).map(Some).ok_or(Refusal::Misuse(
        "calls flash_range_erase with a command that does not erase its block size: 20h erases 4 \
         KiB, 52h 32 KiB, D8h 64 KiB",
    ))
}
