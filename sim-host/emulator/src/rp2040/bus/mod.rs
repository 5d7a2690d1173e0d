//! The processor's bus: decodes addresses and forwards reads and writes to the blocks.

pub(crate) mod flash;
mod rom;
mod schedule;
mod wiring;

use rp2040_emu::bus::ppb::Ppb;
use rp2040_emu::core::{CoreBus, Nvic};

use crate::board::Options;
use crate::board::coil::EmulatedCoil;
use crate::board::flash::Flash;
use crate::board::pins::pin;
use crate::board::plant::Plant;
use crate::board::wire::Wire;
use crate::image::Image;
use crate::rp2040::adc::Adc;
use crate::rp2040::base;
use crate::rp2040::clocks::{Clocks, FASTEST_AT_START_HZ, Pll};
use crate::rp2040::dma::Dma;
use crate::rp2040::gpio::{Gpio, function};
use crate::rp2040::i2c::I2c;
use crate::rp2040::memory::Memory;
use crate::rp2040::power::{Power, block};
use crate::rp2040::private::Private;
use crate::rp2040::pwm::Pwm;
use crate::rp2040::rom_calls::RomCalls;
use crate::rp2040::sio::Sio;
use crate::rp2040::ssi::Ssi;
use crate::rp2040::timer::Timer;
use crate::rp2040::watchdog::Watchdog;
use crate::stop::Stop;
use crate::time::Clock;
use crate::trace::Trace;
use crate::usb::{self, Usb};

/// Wait cycles at the APB bridge of a read and of a write: one for the access's second cycle, plus
/// one for a read and two for a write (datasheet 2.1.3).
const APB_READ_CYCLES: u32 = 2;
const APB_WRITE_CYCLES: u32 = 3;
/// The instructions ISB and DSB.
const ISB: [u16; 2] = [0xF3BF, 0x8F6F];
const DSB: [u16; 2] = [0xF3BF, 0x8F4F];
/// The processor's clock after a reset, Hz: the ring oscillator.
pub(crate) const BOOT_HZ: f64 = 6.5e6;

/// Everything except the processor's core.
#[derive(Clone)]
pub(crate) struct SystemBus<P> {
    pub(crate) memory: Memory,
    pub(crate) private: Private,
    pub(crate) clock: Clock,
    /// Address of the present instruction; `stall` counts this instruction's wait cycles for memory
    /// and registers.
    pc: u32,
    pub(crate) stall: u32,
    pub(crate) stop: Option<Stop>,
    pub(crate) next_event_ps: u64,
    /// Whether code may have changed: in flash, or in RAM around a call of the ROM.
    has_new_code: bool,
    ssi: Ssi,
    pub(crate) rom_calls: RomCalls,
    sio: Sio,
    pub(crate) gpio: Gpio,
    clocks: Clocks,
    power: Power,
    pub(crate) timer: Timer,
    pub(crate) watchdog: Watchdog,
    pub(crate) pwm: Pwm,
    adc: Adc,
    dma: Dma,
    pub(crate) i2c: I2c,
    pub(crate) usb: Usb,
    pub(crate) wire: Wire<P>,
    pub(crate) coil: EmulatedCoil,
    pub(crate) trace: Option<Trace>,
}

impl<P: Plant> SystemBus<P> {
    pub(crate) fn new(image: &Image, options: Options, wire: Wire<P>) -> Self {
        let conditions = wire.converters.first.sensors().conditions();
        let flash = Flash::new(&image.flash, options.flash_times, options.seed);
        let mut bus = Self {
            memory: Memory::new(flash, options.miss_cycles),
            private: Private::new(),
            clock: Clock::new(BOOT_HZ),
            pc: 0,
            stall: 0,
            stop: None,
            next_event_ps: 0,
            has_new_code: false,
            ssi: Ssi::new(),
            rom_calls: RomCalls::default(),
            sio: Sio::default(),
            gpio: Gpio::new(),
            clocks: Clocks::new(options.crystal_hz, options.seed),
            power: Power::new(),
            timer: Timer::default(),
            watchdog: Watchdog::default(),
            pwm: Pwm::new(BOOT_HZ),
            adc: Adc::default(),
            dma: Dma::default(),
            i2c: I2c::new(options.scl_rise.as_ps()),
            usb: Usb::new(),
            wire,
            coil: EmulatedCoil::new(options.drive, options.seed, conditions),
            trace: options.trace.then(Trace::default),
        };
        bus.enter_quad_xip();
        bus.connect();
        bus.settle();
        bus
    }

    /// Cuts and restores the board's power: contents of the flash and the outside stay.
    pub(crate) fn cycle_power(&mut self) {
        self.memory.flash.cycle_power(self.clock.now_ps());
        self.reset();
        self.memory.forget_ram();
        self.clocks.reset(false);
        self.follow_clocks();
        self.power = Power::new();
        self.watchdog = Watchdog::default();
        self.rom_calls = RomCalls::default();
        self.wire.converters.cycle_power(self.clock.now());
        self.settle();
    }

    /// Whether code may have changed since the last call.
    pub(crate) fn take_new_code(&mut self) -> bool {
        self.memory.flash.take_changed() | std::mem::take(&mut self.has_new_code)
    }

    /// State after a watchdog reset of the chip: memory, scratch registers and the outside stay.
    pub(crate) fn reset(&mut self) {
        let now_ps = self.clock.now_ps();
        self.trace_pulses(now_ps);
        self.run_coil(now_ps);
        self.memory.cache.flush();
        // The flash acts on the bytes already sent; the rest of a command does not arrive.
        self.memory.flash.deselect(now_ps);
        self.ssi = Ssi::new();
        self.rom_calls = RomCalls {
            usb_boot: self.rom_calls.usb_boot,
            ..RomCalls::default()
        };
        self.follow_flash();
        self.private = Private::new();
        self.sio = Sio::default();
        self.gpio.reset();
        self.clocks.reset(!self.power.watchdog_resets_ring());
        self.power.after_watchdog();
        self.timer.reset(now_ps);
        self.watchdog.after_reset();
        self.pwm.reset();
        self.adc = Adc::default();
        self.dma = Dma::default();
        self.i2c.reset(&mut self.wire);
        self.usb.reset(now_ps);
        self.follow_clocks();
        self.settle();
    }

    /// Whether the chip restarts when the core's supply falls to a voltage. The run stops if the
    /// chip does not restart although the voltage is too low: the processor's behaviour is then
    /// unknown.
    pub(crate) fn restarts_at(&mut self, core_v: f64) -> bool {
        if self.power.detects(core_v) {
            return true;
        }
        if self.clock.hz() > FASTEST_AT_START_HZ && Power::is_too_low(core_v) {
            self.fail("a processor above 133 MHz with less than 1.15 V");
        }
        false
    }

    pub(crate) const fn adc_mut(&mut self) -> &mut Adc {
        &mut self.adc
    }

    fn fail(&mut self, what: &'static str) {
        let pc = self.pc;
        self.stop.get_or_insert(Stop::UnmodelledUse { what, pc });
    }

    /// Charges one memory access of the core.
    #[inline]
    pub(crate) fn charge_access(&mut self, address: u32) {
        if Memory::is_flash(address) {
            self.charge_flash(address);
        }
    }

    #[inline]
    fn charge_flash(&mut self, address: u32) {
        if self.memory.closed.is_some() {
            self.read_closed_flash();
        }
        self.stall += self.memory.wait(address);
    }

    // ---- registers ----

    fn read_register(&mut self, address: u32) -> u32 {
        self.charge_register(address, APB_READ_CYCLES);
        let offset = address & 0xFFF;
        let value = match address >> 28 {
            0x0 => self.read_request(address),
            0x1 => self.read_controller(address),
            0x4 => self.read_apb(base::of(address), offset),
            0x5 => self.read_ahb(address),
            0xD => self.gpio.read_sio(offset).or_else(|| self.sio.read(offset)),
            0xE => self.private.read(address & 0xF_FFFF),
            _ => None,
        };
        if value.is_none() {
            self.stop_unmodelled(address, None);
        }
        value.unwrap_or(0)
    }

    fn write_register(&mut self, address: u32, value: u32) {
        self.trace_pulses(self.clock.now_ps());
        self.charge_register(address, APB_WRITE_CYCLES);
        let offset = address & 0xFFF;
        let done = match address >> 28 {
            0x0 => {
                let done = self.write_request(address, value);
                self.follow_flash();
                self.accept(done)
            }
            0x1 => self.write_controller(address, value),
            0x4 => self.write_alias(address, value),
            0x5 => self.write_ahb(address, value),
            0xD => {
                let pin = self.gpio.write_sio(offset, value);
                pin.or_else(|| self.sio.write(offset, value))
            }
            0xE => self.private.write(address & 0xF_FFFF, value),
            _ => None,
        };
        if done.is_none() {
            self.stop_unmodelled(address, Some(value));
        }
        self.settle();
    }

    /// Charges the wait cycles of a register access, and checks that its block is out of reset.
    fn charge_register(&mut self, address: u32, apb_cycles: u32) {
        if address >> 28 == 0x4 {
            self.stall += apb_cycles;
        }
        if self.power.is_in_reset(address) {
            let pc = self.pc;
            self.stop.get_or_insert(Stop::InReset { address, pc });
        }
    }

    fn stop_unmodelled(&mut self, address: u32, written: Option<u32>) {
        let pc = self.pc;
        self.stop.get_or_insert(Stop::Unmodelled {
            address,
            pc,
            written,
        });
    }

    fn read_ahb(&mut self, address: u32) -> Option<u32> {
        let (base, view, offset) = parts(address);
        match (base, view) {
            (base::DMA, 0) => self.dma.read(offset),
            (base::USB_MEMORY, 0) => {
                self.check_usb_clock();
                self.usb.read_memory(offset)
            }
            (base::USB, _) => {
                self.check_usb_clock();
                let value = self.usb.read(offset);
                self.refresh();
                value
            }
            _ => None,
        }
    }

    fn write_ahb(&mut self, address: u32, value: u32) -> Option<()> {
        let (base, view, offset) = parts(address);
        match (base, view) {
            (base::DMA, 0) => self.dma.write(offset, value),
            (base::USB, _) => {
                self.check_usb_clock();
                self.usb.write(view, offset, value, self.clock.now_ps())
            }
            _ => None,
        }
    }

    /// Writes one, two or four bytes of the USB controller's memory.
    fn write_usb_memory(&mut self, address: u32, value: &[u8]) {
        self.charge_register(address, 0);
        self.check_usb_clock();
        let now_ps = self.clock.now_ps();
        let written = self.usb.write_memory(address & 0xFFF, value, now_ps);
        if written.is_none() {
            self.fail("an access beyond the USB controller's memory");
        }
    }

    /// Checks the USB controller's clock of 48 MHz (datasheet 2.15.1).
    fn check_usb_clock(&mut self) {
        if self.clocks.usb_hz().is_none() {
            self.fail("a USB controller without 48 MHz at clk_usb");
        }
    }

    fn read_apb(&mut self, base: u32, offset: u32) -> Option<u32> {
        let now_ps = self.clock.now_ps();
        match base {
            base::CLOCKS | base::XOSC | base::PLL_SYS | base::PLL_USB | base::ROSC => {
                self.clocks.read(base, offset, now_ps)
            }
            base::RESETS => self.power.read_resets(offset),
            base::PSM => self.power.read_sequence(offset),
            base::VREG_AND_CHIP_RESET => self.power.read_regulator(offset, now_ps),
            base::IO_BANK0 => self.gpio.read_bank(offset),
            base::PADS_BANK0 => self.gpio.read_pads(offset),
            base::IO_QSPI => self.ssi.read_pins(offset),
            base::PADS_QSPI => self.ssi.read_pads(offset),
            base::I2C0 => {
                let value = self.i2c.read(offset);
                self.refresh();
                value
            }
            base::ADC => {
                self.run_coil(now_ps);
                self.adc.read(offset)
            }
            base::PWM => {
                // The firmware waits by the count until a result of the ADC is in memory.
                self.run_coil(now_ps);
                self.pwm.read(offset, now_ps)
            }
            base::TIMER => self.timer.read(offset, now_ps),
            base::WATCHDOG => self.watchdog.read(offset),
            _ => None,
        }
    }

    /// A write through one of the four views of a register: plain, xor, set, clear (datasheet
    /// 2.1.2).
    fn write_alias(&mut self, address: u32, value: u32) -> Option<()> {
        let (base, offset) = (base::of(address), address & 0xFFF);
        let value = match address >> 12 & 0b11 {
            0 => value,
            1 => self.read_apb(base, offset)? ^ value,
            2 => self.read_apb(base, offset)? | value,
            _ => self.read_apb(base, offset)? & !value,
        };
        self.write_apb(base, offset, value)
    }

    fn write_apb(&mut self, base: u32, offset: u32, value: u32) -> Option<()> {
        let now_ps = self.clock.now_ps();
        match base {
            base::CLOCKS | base::XOSC | base::PLL_SYS | base::PLL_USB | base::ROSC => {
                self.clocks.write(base, offset, value, now_ps)?;
                self.follow_clocks();
                if self.clocks.uses_unsettled(now_ps) {
                    self.fail("a clock from a crystal or a PLL that has not settled");
                }
            }
            base::RESETS => {
                let entered = self.power.write_resets(offset, value)?;
                self.reset_blocks(entered);
                self.follow_clocks();
            }
            base::PSM => self.power.write_sequence(offset, value)?,
            base::VREG_AND_CHIP_RESET => {
                self.power.write_regulator(offset, value, now_ps)?;
                if self.power.detection_is_too_high(now_ps) {
                    self.fail("a brown-out detection that the regulator's own voltage sets off");
                }
                self.follow_clocks();
            }
            base::IO_BANK0 => self.gpio.write_bank(offset, value)?,
            base::PADS_BANK0 => self.gpio.write_pads(offset, value)?,
            base::IO_QSPI => self.write_select(offset, value)?,
            base::PADS_QSPI => self.ssi.write_pads(offset, value)?,
            base::I2C0 => self.write_i2c(offset, value, now_ps)?,
            base::ADC => {
                let clock_hz = self.clocks.adc_hz();
                self.adc.write(offset, value, now_ps, clock_hz)?;
            }
            base::PWM => {
                self.run_coil(now_ps);
                self.pwm.write(offset, value, now_ps)?;
            }
            base::TIMER => self.timer.write(offset, value)?,
            base::WATCHDOG => {
                let ref_hz = self.clocks.ref_hz();
                self.watchdog.write(offset, value, now_ps, ref_hz)?;
                self.follow_clocks();
            }
            _ => return None,
        }
        Some(())
    }

    fn write_i2c(&mut self, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        let has_pins = [pin::SDA, pin::SCL]
            .iter()
            .all(|&pin| self.gpio.function(pin) == function::I2C);
        if offset == 0x10 && !has_pins {
            self.fail("a transfer of an I2C block that has no pins");
        }
        self.i2c.write(offset, value, now_ps, &mut self.wire)
    }

    fn reset_blocks(&mut self, entered: u32) {
        let enters = |block| entered & block != 0;
        if enters(block::I2C0) {
            self.i2c.reset(&mut self.wire);
        }
        if enters(block::IO_BANK0) {
            self.gpio.reset_io();
        }
        if enters(block::PADS_BANK0) {
            self.gpio.reset_pads();
        }
        if enters(block::IO_QSPI) {
            self.memory.flash.deselect(self.clock.now_ps());
            self.ssi.reset_pins();
            self.follow_flash();
        }
        if enters(block::PADS_QSPI) {
            self.ssi.reset_pads();
        }
        if enters(block::PWM) {
            self.pwm.reset();
        }
        if enters(block::ADC) {
            self.adc = Adc::default();
        }
        if enters(block::DMA) {
            self.dma = Dma::default();
        }
        if enters(block::USB) {
            self.usb.reset(self.clock.now_ps());
        }
        if enters(block::TIMER) {
            self.timer.reset(self.clock.now_ps());
        }
        if enters(block::PLL_SYS) {
            self.clocks.pll_sys = Pll::new();
        }
        if enters(block::PLL_USB) {
            self.clocks.pll_usb = Pll::new();
        }
    }
}

/// Block, view and offset of a register on the AHB-Lite bus.
const fn parts(address: u32) -> (u32, u32, u32) {
    (base::of(address), address >> 12 & 0b11, address & 0xFFF)
}

impl<P: Plant> CoreBus for SystemBus<P> {
    fn read8(&mut self, addr: u32) -> u8 {
        if Memory::contains(addr) {
            self.charge_access(addr);
            return self.memory.byte(addr);
        }
        let shift = 8 * (addr & 0b11);
        (self.read_register(addr & !0b11) >> shift) as u8
    }

    fn read16(&mut self, addr: u32) -> u16 {
        if Memory::contains(addr) {
            self.charge_access(addr);
            let read = self.memory.half_word(addr);
            // An ISB would make the core forget all decoded instructions, so it gets a DSB, which
            // takes as long. The board forgets them where code may have changed.
            let is_isb =
                addr == self.pc.wrapping_add(2) && [self.memory.half_word(self.pc), read] == ISB;
            return if is_isb { DSB[1] } else { read };
        }
        let shift = 8 * (addr & 0b10);
        (self.read_register(addr & !0b11) >> shift) as u16
    }

    #[inline]
    fn read32(&mut self, addr: u32) -> u32 {
        if let Some(word) = self.memory.ram_word(addr) {
            return word;
        }
        if Memory::contains(addr) {
            self.charge_access(addr);
            return self.memory.word(addr);
        }
        self.read_register(addr)
    }

    fn write8(&mut self, addr: u32, val: u8) {
        if Memory::is_ram(addr) {
            self.memory.set_byte(addr, val);
        } else if usb::is_memory(addr) {
            self.write_usb_memory(addr, &val.to_le_bytes());
        } else {
            self.fail("a write of a byte to a register");
        }
    }

    fn write16(&mut self, addr: u32, val: u16) {
        if Memory::is_ram(addr) {
            self.memory.set_half_word(addr, val);
        } else if usb::is_memory(addr) {
            self.write_usb_memory(addr, &val.to_le_bytes());
        } else {
            self.fail("a write of a half-word to a register");
        }
    }

    #[inline]
    fn write32(&mut self, addr: u32, val: u32) {
        if let Some(bytes) = self.memory.ram_word_mut(addr) {
            bytes.copy_from_slice(&val.to_le_bytes());
        } else if usb::is_memory(addr) {
            self.write_usb_memory(addr, &val.to_le_bytes());
        } else {
            self.write_register(addr, val);
        }
    }

    #[inline]
    fn set_active_pc(&mut self, pc: u32) {
        self.pc = pc;
    }

    #[inline]
    fn bus_fault(&self) -> bool {
        false
    }

    fn bus_fault_addr(&self) -> u32 {
        0
    }

    fn clear_bus_fault(&mut self) {}

    #[inline]
    fn ppb(&self, _: usize) -> &Ppb {
        &self.private.ppb
    }

    fn ppb_mut(&mut self, _: usize) -> &mut Ppb {
        &mut self.private.ppb
    }

    #[inline]
    fn nvic(&self, _: usize) -> &Nvic {
        &self.private.idle
    }

    fn nvic_mut(&mut self, _: usize) -> &mut Nvic {
        &mut self.private.idle
    }

    fn active_core(&self) -> usize {
        0
    }

    fn event_flag(&self, _: usize) -> bool {
        self.private.event
    }

    fn consume_event_flag(&mut self, _: usize) -> bool {
        std::mem::take(&mut self.private.event)
    }

    fn set_wfe_waiting(&mut self, _: usize, val: bool) {
        self.private.parked = val;
    }

    fn signal_sev(&mut self) {
        self.private.event = true;
    }
}

#[cfg(test)]
mod tests {
    use ldc161x_sim::{Chip, Time};

    use super::*;
    use crate::board::plant::Still;
    use crate::rp2040::memory::RAM;

    /// A bus with 48 MHz from the system's PLL at 96 MHz, divided by two.
    fn bus() -> SystemBus<Still> {
        let chip = Chip::new(Default::default(), Still::new([3e6; 4]));
        let wire = Wire::new(chip, None, false, false);
        let mut bus = SystemBus::new(&Image::empty(), Options::default(), wire);
        let writes = [
            (
                base::RESETS,
                block::ALL & !block::PLL_USB & !block::USB & !block::IO_BANK0,
            ),
            (base::XOSC + 12, 0),
            (base::XOSC, 0x00FA_BAA0),
            (base::PLL_USB + 8, 64),
            (base::PLL_USB + 12, 4 << 16 | 4 << 12),
            (base::PLL_USB + 4, 0),
        ];
        for (address, value) in writes {
            bus.write32(address, value);
        }
        bus.boot_delay(Time::from_us(200));
        bus.write32(base::CLOCKS + 0x54, 1 << 11);
        bus.write32(base::CLOCKS + 0x58, 1 << 8);
        assert_eq!(bus.stop, None);
        bus
    }

    /// Attaches a device, plugs the cable, and waits for the bus reset.
    fn attach(bus: &mut SystemBus<Still>) {
        for (register, value) in [(0x74, 0b1001), (0x78, 0b1100), (0x40, 1), (0x4C, 1 << 16)] {
            bus.write32(base::USB + register, value);
        }
        bus.usb.host.plug();
        bus.service();
        bus.boot_delay(Time::from_ms(105));
    }

    #[test]
    fn the_core_fetches_a_dsb_for_an_isb_and_a_program_reads_what_is_there() {
        let mut bus = bus();
        let [first, second] = ISB.map(u32::from);
        bus.write32(RAM, second << 16 | first);
        bus.set_active_pc(RAM);
        assert_eq!([bus.read16(RAM), bus.read16(RAM + 2)], DSB);
        bus.set_active_pc(RAM + 4);
        assert_eq!([bus.read16(RAM), bus.read16(RAM + 2)], ISB);
    }

    #[test]
    fn a_usb_controller_in_reset_or_without_its_clock_ends_the_run() {
        let mut held = bus();
        held.write32(base::RESETS + 0x2000, block::USB);
        held.read32(base::USB_MEMORY);
        assert!(
            matches!(held.stop, Some(Stop::InReset { .. })),
            "{:?}",
            held.stop
        );
        for (register, value) in [(0x54, 0), (0x54, 1 << 11 | 3 << 5), (0x58, 2 << 8)] {
            let mut slow = bus();
            slow.write32(base::CLOCKS + register, value);
            assert_eq!(slow.stop, None);
            slow.write8(base::USB_MEMORY + 0x100, 1);
            assert!(
                matches!(slow.stop, Some(Stop::UnmodelledUse { .. })),
                "{register:#x}"
            );
        }
        let mut stopped = bus();
        attach(&mut stopped);
        stopped.write32(base::CLOCKS + 0x54, 0);
        assert!(matches!(stopped.stop, Some(Stop::UnmodelledUse { .. })));
    }

    #[test]
    fn a_clock_from_what_has_not_settled_ends_the_run() {
        const STARTUP_AFTER_RESET: u32 = 0xC4;
        let switch = |delay: u32, waits: Time| {
            let wire = Wire::new(
                Chip::new(Default::default(), Still::new([3e6; 4])),
                None,
                false,
                false,
            );
            let mut bus = SystemBus::new(&Image::empty(), Options::default(), wire);
            assert_eq!(bus.read32(base::XOSC + 12), STARTUP_AFTER_RESET);
            bus.write32(base::XOSC + 12, delay);
            bus.write32(base::XOSC, 0x00FA_BAA0);
            bus.boot_delay(waits);
            bus.write32(base::CLOCKS + 0x30, 2);
            bus.stop
        };
        assert_eq!(switch(STARTUP_AFTER_RESET, Time::from_us(4_190)), None);
        let early = switch(STARTUP_AFTER_RESET, Time::from_us(4_170));
        assert!(
            matches!(early, Some(Stop::UnmodelledUse { .. })),
            "{early:?}"
        );
        let mut bus = bus();
        bus.write32(base::PLL_USB + 4, 0x2D);
        bus.write32(base::PLL_USB + 4, 0);
        assert!(
            matches!(bus.stop, Some(Stop::UnmodelledUse { .. })),
            "not locked again: {:?}",
            bus.stop
        );
    }
}
