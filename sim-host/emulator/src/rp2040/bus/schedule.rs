//! Time on the bus: processes due events and finds the next one.

use ldc161x_sim::Time;

use crate::board::pins::COIL_SLICE;
use crate::board::plant::Plant;
use crate::rp2040::clocks::FASTEST_AT_START_HZ;

use super::SystemBus;

/// The processor's clock in the boot ROM's loader, Hz: the frequency that USB needs.
const BOOT_LOADER_HZ: f64 = 48e6;

/// Interrupt numbers (datasheet 2.3.2).
mod line {
    pub(super) const TIMER: u32 = 0;
    pub(super) const PWM_WRAP: u32 = 4;
    pub(super) const USBCTRL: u32 = 5;
    pub(super) const IO_BANK0: u32 = 13;
    pub(super) const I2C0: u32 = 23;
}

impl<P: Plant> SystemBus<P> {
    /// Processes all due events, and finds the time of the next one.
    pub(crate) fn service(&mut self) {
        let now_ps = self.clock.now_ps();
        self.service_flash(now_ps);
        self.timer.service(now_ps);
        self.i2c.service(now_ps, &mut self.wire);
        if let Some(problem) = self.usb.service(now_ps) {
            self.fail(problem);
        }
        self.run_converters(now_ps);
        self.service_pwm(now_ps);
        self.run_coil(now_ps);
        if self.watchdog.expires(now_ps) {
            if self.power.watchdog_resets_all() {
                self.watchdog.has_fired = true;
            } else {
                self.fail("a watchdog that does not reset everything");
            }
        }
        self.settle();
    }

    /// Ends due operations of the flash, and continues the boot ROM's function that waits for them.
    fn service_flash(&mut self, now_ps: u64) {
        let flash = self.memory.flash.next_event();
        let due_ps = flash.into_iter().chain(self.rom_calls.next_event()).min();
        if due_ps.is_some_and(|due_ps| due_ps <= now_ps) {
            self.memory.flash.service(now_ps);
            self.service_rom(now_ps);
            self.follow_flash();
        }
    }

    /// Applies new PWM levels at the wrap. Coil and trace use the old levels up to it.
    fn service_pwm(&mut self, now_ps: u64) {
        if self.trace.is_some() {
            let due_ps = self.pwm.due_ps().unwrap_or(now_ps);
            self.trace_pulses(due_ps.min(now_ps));
        }
        if let Some(wrap_ps) = self.pwm.latches_by(COIL_SLICE, now_ps) {
            self.run_coil(wrap_ps);
        }
        self.pwm.service(now_ps);
    }

    /// Propagates a write: to pins, coil and interrupts.
    pub(super) fn settle(&mut self) {
        self.follow_pins();
        self.refresh();
    }

    /// Updates the interrupt lines, and the time of the next event.
    pub(super) fn refresh(&mut self) {
        let now_ps = self.clock.now_ps();
        let lines = self.timer.lines() << line::TIMER
            | u32::from(self.gpio.line()) << line::IO_BANK0
            | u32::from(self.pwm.line()) << line::PWM_WRAP
            | u32::from(self.usb.line()) << line::USBCTRL
            | u32::from(self.i2c.line()) << line::I2C0;
        self.private.drive(lines);
        let due = [
            self.timer.next_event(now_ps),
            self.i2c.next_event(),
            self.usb.next_event(),
            self.wire.converters.next_event(),
            self.pwm.next_event(now_ps),
            self.watchdog.next_event(),
            self.memory.flash.next_event(),
            self.rom_calls.next_event(),
            Some(self.coil.report_ps()),
        ];
        self.next_event_ps = due.iter().flatten().min().copied().unwrap_or(u64::MAX);
    }

    /// Updates all counters of clocks after a change of the clock tree.
    pub(super) fn follow_clocks(&mut self) {
        let now_ps = self.clock.now_ps();
        match self.clocks.sys_hz() {
            Some(hz) => self.set_sys_clock(now_ps, hz),
            None => self.fail("a system clock that stands or is too fast"),
        }
        let tick_ps = self.watchdog.tick_ps(self.clocks.ref_hz());
        self.timer.set_tick(now_ps, tick_ps);
        if self.usb.is_attached() && self.clocks.usb_hz().is_none() {
            self.fail("a USB device whose clk_usb is not 48 MHz any more");
        }
    }

    fn set_sys_clock(&mut self, now_ps: u64, hz: f64) {
        if hz > FASTEST_AT_START_HZ && !self.power.is_raised(now_ps) {
            self.fail("a system clock above 133 MHz without a settled core voltage of 1.15 V");
        }
        if hz != self.clock.hz() {
            self.clock.set_frequency(hz);
            self.pwm.set_clock(now_ps, hz);
            self.i2c.set_clock(hz);
        }
    }

    /// Advances time without an instruction, to the next event or to a time.
    pub(crate) fn sleep(&mut self, until_ps: u64) {
        let until_ps = self.next_event_ps.min(until_ps);
        let cycles = self.clock.cycles_until(until_ps).max(1);
        self.clock.advance(cycles);
    }

    /// Switches the processor to the clock of the boot ROM's loader (2.8.1, USB step).
    pub(crate) fn set_boot_loader_clock(&mut self) {
        self.set_sys_clock(self.clock.now_ps(), BOOT_LOADER_HZ);
    }

    /// Advances through the boot ROM's time, in which no firmware runs.
    pub(crate) fn boot_delay(&mut self, delay: Time) {
        let end_ps = self.clock.now_ps() + delay.as_ps();
        while self.clock.now_ps() < end_ps {
            self.sleep(end_ps);
            self.service();
        }
    }
}

#[cfg(test)]
mod tests {
    use ldc161x_sim::Chip;
    use rp2040_emu::core::CoreBus;

    use super::*;
    use crate::board::Options;
    use crate::board::plant::Still;
    use crate::board::wire::Wire;
    use crate::image::Image;
    use crate::rp2040::base;
    use crate::rp2040::power::block;
    use crate::stop::Stop;

    /// Sets the core voltage, waits, and switches to the system PLL at a frequency given by its feedback.
    fn switched(voltage: u32, settling: Time, feedback: u32) -> Option<Stop> {
        let wire = Wire::new(
            Chip::new(Default::default(), Still::new([3e6; 4])),
            None,
            false,
            false,
        );
        let mut bus = SystemBus::new(&Image::empty(), Options::default(), wire);
        let writes = [
            (base::RESETS, block::ALL & !block::PLL_SYS),
            (base::XOSC + 12, 0),
            (base::XOSC, 0x00FA_BAA0),
            (base::PLL_SYS + 8, feedback),
            (base::PLL_SYS + 12, 6 << 16 | 1 << 12),
            (base::PLL_SYS + 4, 0),
        ];
        for (address, value) in writes {
            bus.write32(address, value);
        }
        bus.boot_delay(Time::from_us(200));
        bus.write32(base::VREG_AND_CHIP_RESET, voltage << 4 | 1);
        bus.boot_delay(settling);
        bus.write32(base::CLOCKS + 0x3C, 1);
        bus.stop
    }

    #[test]
    fn a_clock_above_133_megahertz_needs_a_settled_core_voltage() {
        let settled = Time::from_us(1_001);
        assert_eq!(switched(0xC, settled, 100), None);
        // 132 MHz needs neither a voltage above 1.10 V nor a wait.
        assert_eq!(switched(0xB, Time::ZERO, 66), None);
        for (voltage, settling) in [(0xB, settled), (0xC, Time::from_us(999))] {
            let stop = switched(voltage, settling, 100);
            assert!(matches!(stop, Some(Stop::UnmodelledUse { .. })), "{stop:?}");
        }
    }
}
