//! The board: the processor's core with all of its surroundings, stepped through time.

mod boot_loader;
pub(crate) mod bridge;
pub(crate) mod coil;
pub(crate) mod converters;
pub(crate) mod flash;
mod options;
pub(crate) mod pins;
pub(crate) mod plant;
#[cfg(test)]
mod tests;
pub(crate) mod wire;

use std::ops::Range;

pub use boot_loader::Uf2Error;
pub use options::{Options, SecondSensors};

use boot_loader::BootLoader;
use ldc161x_sim::{Chip, Settings, Time};
use palpate_sim::electrical::{Circuit, Totals};
use rp2040_emu::core::CortexM0Plus;

use crate::board::bridge::BridgeInputs;
use crate::board::coil::BridgeCircuit;
use crate::board::flash::Flash;
use crate::board::pins::pin;
use crate::board::plant::Plant;
use crate::board::wire::{LineFault, Wire, WireLog};
use crate::image::profile::Profile;
use crate::image::rtt;
use crate::image::{Image, VECTORS};
use crate::rp2040::bus::{BOOT_HZ, SystemBus};
use crate::rp2040::gpio::function;
use crate::rp2040::interrupts::HARD_FAULT;
use crate::rp2040::pwm::LevelTimes;
use crate::stop::Stop;
use crate::trace::Trace;
use crate::usb::UsbHost;

/// Cycles of an exception entry without wait states (Cortex-M0+ TRM; the RP2040 has no jitter
/// suppression).
const ENTRY_CYCLES: u64 = 16;
const WFI: u32 = 0xBF30;
/// Duration of boot ROM and second stage, from a reset to the image's first instruction, with the
/// ring oscillator as after power on. Guess.
const BOOT: Time = Time::from_ms(2);
/// Number of the boot ROM's attempts to find a second stage before it starts its loader (RP2040
/// datasheet 2.8.1: half a second in total; the ROM's source, `bootrom_main.c`).
const BOOT_ATTEMPTS: u32 = 128;
/// Duration of one attempt, which reads and sums 252 bytes, with the ring oscillator as after power
/// on: it depends on the clock that it finds.
const BOOT_ATTEMPT: Time = Time::from_ms(4);

/// Number of resets since the board's first power on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetCount {
    /// Resets by the watchdog, requested or not.
    pub watchdog: u32,
    /// Resets by a loss of power.
    pub power: u32,
}

/// An emulated Raspberry Pi Pico with a converter and a plant. A clone is a snapshot.
///
/// Equal images, options and calls give equal runs, to the bit.
pub struct EmulatedBoard<P> {
    core: CortexM0Plus,
    bus: SystemBus<P>,
    image: Image,
    resets: ResetCount,
    instructions: u64,
    asleep_ps: u64,
    profile: Option<Box<Profile>>,
    boot_loader: Option<BootLoader>,
}

impl<P: Plant> Clone for EmulatedBoard<P> {
    fn clone(&self) -> Self {
        let mut board = Self {
            core: CortexM0Plus::new(),
            bus: self.bus.clone(),
            image: self.image.clone(),
            resets: self.resets,
            instructions: self.instructions,
            asleep_ps: self.asleep_ps,
            profile: self.profile.clone(),
            boot_loader: self.boot_loader.clone(),
        };
        let (from, to) = (&self.core.regs, &mut board.core.regs);
        to.r = from.r;
        (to.xpsr, to.primask, to.control) = (from.xpsr, from.primask, from.control);
        (to.msp, to.psp) = (from.msp, from.psp);
        board.core.cycles = self.core.cycles;
        if self.core.is_halted() {
            board.core.halt();
        }
        board
    }
}

impl<P: Plant> EmulatedBoard<P> {
    /// A board that is flashed with `image` and powered now, with a converter of the settings
    /// `chip`. The firmware sets the converter's clock input, whatever the settings say.
    #[must_use]
    pub fn new(image: &Image, plant: P, chip: Settings, options: Options) -> Self {
        let second = options.second_converter.clone().map(|sensors| {
            let mut second = Chip::new(chip, sensors);
            second.set_shutdown(true);
            second.set_address_pin(true);
            second.set_shutdown(false);
            second.set_external_clock(None);
            second
        });
        let chip = Chip::new(chip, plant);
        let wire = Wire::new(chip, second, options.record, options.trace);
        let mut board = Self {
            core: CortexM0Plus::new(),
            bus: SystemBus::new(image, options, wire),
            image: image.clone(),
            resets: ResetCount::default(),
            instructions: 0,
            asleep_ps: 0,
            profile: None,
            boot_loader: None,
        };
        board.start();
        board
    }

    /// Runs boot ROM and second stage: they find the flash and start its image, or the loader.
    fn start(&mut self) {
        if let Some(profile) = &mut self.profile {
            profile.interrupted();
        }
        let cycles = self.core.cycles;
        self.core = CortexM0Plus::new();
        self.core.cycles = cycles;
        self.boot_loader = None;
        self.bus.boot_delay(self.by_the_ring(BOOT));
        self.bus.check_direct_boot();
        if let Some(disabled_interfaces) = self.bus.rom_calls.usb_boot.take() {
            self.start_boot_loader(disabled_interfaces);
        } else if self.finds_second_stage() {
            self.start_image();
        } else {
            self.start_boot_loader(0);
        }
    }

    /// Duration of a part of the boot ROM at the present clock, given its duration `usual` with the
    /// ring oscillator as after power on.
    fn by_the_ring(&self, usual: Time) -> Time {
        let times = BOOT_HZ / self.bus.clock.hz();
        Time::from_ps((usual.as_ps() as f64 * times) as u64)
    }

    /// Searches for the second stage. An erase that a reset has interrupted continues, and the
    /// flash does not answer until its end.
    fn finds_second_stage(&mut self) -> bool {
        let mut attempts = 1;
        while !self.bus.has_second_stage() && attempts < BOOT_ATTEMPTS {
            self.bus.boot_delay(self.by_the_ring(BOOT_ATTEMPT));
            attempts += 1;
        }
        self.bus.has_second_stage()
    }

    /// Last part of the second stage: stack and entry from the vector table.
    fn start_image(&mut self) {
        self.bus.enter_quad_xip();
        self.bus.private.ppb.vtor = VECTORS;
        let stack = self.bus.memory.word(VECTORS);
        self.core.regs.msp = stack;
        self.core.regs.set_sp(stack);
        self.core
            .regs
            .set_pc(self.bus.memory.word(VECTORS + 4) & !1);
    }

    fn start_boot_loader(&mut self, disabled_interfaces: u32) {
        self.bus.set_boot_loader_clock();
        self.boot_loader = Some(BootLoader::new(disabled_interfaces));
    }

    fn reset_by_watchdog(&mut self) {
        self.resets.watchdog += 1;
        self.bus.reset();
        self.start();
    }

    /// Cuts the board's power and restores it at once. The RAM is lost, a running erase or program
    /// stays half done, and the board starts as at its first power on. Flash, time and the outside
    /// of the board continue.
    pub fn cycle_power(&mut self) {
        self.resets.power += 1;
        self.bus.cycle_power();
        self.start();
    }

    /// Lets the core's supply dip to a voltage, V. If the chip's brown-out detection sees the dip,
    /// the chip restarts as after a power cut. Otherwise the chip continues, or the run stops if
    /// the voltage is too low for it.
    pub fn dip_core_voltage(&mut self, to_v: f64) {
        if self.bus.restarts_at(to_v) {
            self.cycle_power();
        }
    }

    // ---- time ----

    /// Time since power on.
    #[must_use]
    pub fn now(&self) -> Time {
        self.bus.clock.now()
    }

    /// Runs for a duration.
    ///
    /// # Errors
    /// [`Stop`] where the emulation cannot continue.
    pub fn run_for(&mut self, time: Time) -> Result<(), Stop> {
        let end_ps = (self.now() + time).as_ps();
        while self.bus.clock.now_ps() < end_ps {
            self.step(end_ps);
            self.goes_on()?;
        }
        Ok(())
    }

    /// Runs until a condition is true; it is checked after every instruction.
    ///
    /// # Errors
    /// [`Stop::TimedOut`] after the limit, or where the emulation cannot continue.
    pub fn run_until(
        &mut self,
        limit: Time,
        mut is_true: impl FnMut(&Self) -> bool,
    ) -> Result<(), Stop> {
        let end_ps = (self.now() + limit).as_ps();
        while !is_true(self) {
            if self.bus.clock.now_ps() >= end_ps {
                return Err(Stop::TimedOut);
            }
            self.step(end_ps);
            self.goes_on()?;
        }
        Ok(())
    }

    fn step(&mut self, end_ps: u64) {
        if self.bus.private.interrupts.any() {
            self.take_interrupt();
        }
        let mut begin_ps = self.bus.clock.now_ps();
        let is_waiting = self.core.is_halted() || self.bus.private.parked;
        if is_waiting || self.is_in_boot_loader() {
            self.bus.sleep(end_ps);
            self.asleep_ps += self.bus.clock.now_ps() - begin_ps;
            begin_ps = self.bus.clock.now_ps();
        } else {
            let waited = self.fetch();
            self.execute(waited);
        }
        if self.bus.clock.now_ps() >= self.bus.next_event_ps {
            self.service();
        }
        if let Some(profile) = &mut self.profile {
            profile.pending(
                self.bus.private.interrupts.pending(),
                Time::from_ps(begin_ps),
            );
        }
        if self.bus.watchdog.has_fired {
            self.reset_by_watchdog();
        }
    }

    /// The reason to stop, if there is one. A step that returned it would copy it each time.
    #[inline]
    fn goes_on(&self) -> Result<(), Stop> {
        if let Some(stop) = self.bus.stop {
            return Err(stop);
        }
        Ok(())
    }

    fn service(&mut self) {
        self.bus.service();
        if self.bus.take_new_code() {
            self.core.invalidate_decode_cache_all();
        }
        if self
            .bus
            .memory
            .flash
            .has_lost_power(self.bus.clock.now_ps())
        {
            self.cycle_power();
        }
    }

    /// Advances time by the wait cycles of the next instruction's fetch, processes the events in
    /// that time, and returns these cycles. The instruction takes effect afterwards.
    #[inline]
    fn fetch(&mut self) -> u64 {
        self.bus.stall = 0;
        self.bus.charge_access(self.core.regs.pc());
        let waited = u64::from(self.bus.stall);
        if waited > 0 {
            self.bus.clock.advance(waited);
            if self.bus.clock.now_ps() >= self.bus.next_event_ps {
                self.service();
            }
        }
        waited
    }

    fn execute(&mut self, waited: u64) {
        let pc = self.core.regs.pc();
        self.bus.stall = 0;
        let active = self.bus.private.ppb.active;
        let exception = self.core.regs.ipsr();
        let cycles = u64::from(self.core.step(&mut self.bus)) + u64::from(self.bus.stall);
        self.instructions += 1;
        self.bus.clock.advance(cycles);
        if let Some(profile) = &mut self.profile {
            profile.executed(pc, waited + cycles, exception);
            if self.bus.private.ppb.active < active {
                profile.returned();
            }
        }
        if self.bus.private.ppb.active != active {
            // A handler has returned: a line that is still high interrupts again.
            self.bus.next_event_ps = 0;
        }
    }

    /// Wakes a waiting core, and enters the handler of the most urgent interrupt.
    fn take_interrupt(&mut self) {
        self.bus.private.parked = false;
        if self.core.is_halted() && !self.is_locked_up() {
            self.core.wake();
        }
        if self.core.is_halted() || self.core.regs.primask & 1 == 1 {
            return;
        }
        if let Some(exception) = self.bus.private.take() {
            self.enter(exception);
        }
    }

    /// Whether the core is locked up: a fault within the fault handler.
    fn is_locked_up(&self) -> bool {
        let last = self.core.regs.pc().wrapping_sub(2);
        self.core.is_halted()
            && self.core.regs.ipsr() == HARD_FAULT
            && self.bus.memory.word(last) & 0xFFFF != WFI
    }

    /// Exception entry (ARMv6-M architecture, B1.5.6); the core crate's own entry has no
    /// preemption.
    fn enter(&mut self, exception: u32) {
        use rp2040_emu::core::CoreBus;
        self.bus.stall = 0;
        let in_handler = self.core.regs.ipsr() != 0;
        let regs = &mut self.core.regs;
        regs.sync_sp_to_banked();
        let on_process = !in_handler && regs.control & 0b10 != 0;
        let stack = if on_process { regs.psp } else { regs.msp };
        let frame = (stack & !0b111) - 32;
        let padded = u32::from(stack & 0b100 != 0) << 9;
        let words = [
            regs.r[0],
            regs.r[1],
            regs.r[2],
            regs.r[3],
            regs.r[12],
            regs.r[14],
            regs.pc(),
            regs.xpsr & !(1 << 9) | padded,
        ];
        *(if on_process {
            &mut regs.psp
        } else {
            &mut regs.msp
        }) = frame;
        regs.r[14] = match (in_handler, on_process) {
            (true, _) => 0xFFFF_FFF1,
            (false, true) => 0xFFFF_FFFD,
            (false, false) => 0xFFFF_FFF9,
        };
        regs.xpsr = regs.xpsr & !0x1FF | exception;
        regs.control &= !0b10;
        regs.sync_sp_from_banked();
        for (index, word) in (0..).zip(words) {
            self.bus.write32(frame + 4 * index, word);
        }
        self.bus.private.ppb.mark_active(exception as u16);
        let vector = self.bus.read32(self.bus.private.ppb.vtor + 4 * exception);
        self.core.regs.set_pc(vector & !1);
        self.core.cycles += ENTRY_CYCLES;
        let cycles = ENTRY_CYCLES + u64::from(self.bus.stall);
        self.bus.clock.advance(cycles);
        if let Some(profile) = &mut self.profile {
            profile.entered(exception, cycles, self.bus.clock.now());
        }
    }

    // ---- the debug probe ----

    /// Reads a result from the ADC's FIFO, as a debug probe does when it shows the ADC's registers.
    pub fn read_adc_fifo(&mut self) -> u16 {
        self.bus.run_coil(self.bus.clock.now_ps());
        self.bus.adc_mut().take_from_fifo()
    }

    fn control_block(&self) -> Option<u32> {
        self.image.symbol("_SEGGER_RTT")
    }

    /// Reads the bytes that the firmware has sent on a channel, as a debug probe does.
    pub fn read_channel(&mut self, channel: u32) -> Vec<u8> {
        self.control_block()
            .map(|block| rtt::read(&mut self.bus.memory, block, channel))
            .unwrap_or_default()
    }

    /// Writes bytes to a channel of the firmware; returns how many fitted.
    pub fn write_channel(&mut self, channel: u32, bytes: &[u8]) -> usize {
        self.control_block().map_or(0, |block| {
            rtt::write(&mut self.bus.memory, block, channel, bytes)
        })
    }

    /// A word of memory.
    #[must_use]
    pub fn peek(&self, address: u32) -> u32 {
        self.bus.memory.word(address)
    }

    /// Changes a word of memory.
    pub fn poke(&mut self, address: u32, value: u32) {
        self.bus.memory.set_word(address, value);
        self.core
            .invalidate_decode_cache_entries(&[address, address + 2]);
    }

    /// The image, with its symbols.
    #[must_use]
    pub const fn image(&self) -> &Image {
        &self.image
    }

    /// The flash chip: contents, erase counts, operations.
    #[must_use]
    pub const fn flash(&self) -> &Flash {
        &self.bus.memory.flash
    }

    /// The flash chip, to inject faults or to replace its contents.
    pub const fn flash_mut(&mut self) -> &mut Flash {
        // The change takes effect before the instruction after the next one.
        self.bus.next_event_ps = 0;
        &mut self.bus.memory.flash
    }

    /// Program counter of the core.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.core.regs.pc()
    }

    /// Sets the program counter.
    pub fn set_pc(&mut self, pc: u32) {
        self.core.regs.set_pc(pc & !1);
        self.bus.private.parked = false;
        self.core.wake();
    }

    /// Number of the active exception, 0 for none.
    #[must_use]
    pub fn exception(&self) -> u32 {
        self.core.regs.ipsr()
    }

    // ---- external parts ----

    /// The second converter, to schedule faults and to read its record; `None` without one.
    pub const fn second_chip_mut(&mut self) -> Option<&mut Chip<SecondSensors>> {
        // A scheduled fault may be due at once.
        self.bus.next_event_ps = 0;
        self.bus.wire.converters.second.as_mut()
    }

    /// The converter.
    #[must_use]
    pub const fn chip(&self) -> &Chip<P> {
        &self.bus.wire.converters.first
    }

    /// The converter, to inject faults.
    pub const fn chip_mut(&mut self) -> &mut Chip<P> {
        // A scheduled fault may precede the next known event.
        self.bus.next_event_ps = 0;
        &mut self.bus.wire.converters.first
    }

    /// The plant.
    pub fn plant_mut(&mut self) -> &mut P {
        self.bus.wire.converters.first.sensors_mut()
    }

    /// Arms a fault of a wire for the next transaction.
    pub fn disturb(&mut self, fault: LineFault) {
        self.bus.wire.arm(fault);
    }

    /// Ends every fault of the wires.
    pub fn release(&mut self) {
        self.bus.wire.release();
        self.bus.next_event_ps = 0;
    }

    /// Whether a fault of a wire is active or armed.
    #[must_use]
    pub fn is_disturbed(&self) -> bool {
        self.bus.wire.is_disturbed(self.bus.clock.now_ps())
    }

    /// Whether the firmware drives the bus's wires as plain pins, to free the bus.
    #[must_use]
    pub fn bus_is_taken(&self) -> bool {
        let is_plain = |pin| self.bus.gpio.function(pin) == function::SIO;
        is_plain(pin::SDA) && is_plain(pin::SCL)
    }

    /// The host at the USB cable. The cable is unplugged until `plug`.
    #[must_use]
    pub const fn usb(&self) -> &UsbHost {
        &self.bus.usb.host
    }

    /// The host at the USB cable, to send it orders.
    pub const fn usb_mut(&mut self) -> &mut UsbHost {
        // Orders take effect with the next step.
        self.bus.next_event_ps = 0;
        &mut self.bus.usb.host
    }

    /// Latest time within a USB frame at which the firmware made a bulk IN packet available, among
    /// the packets that the host has read and times up to 998 us. From 800 us on the controller may
    /// hang (RP2040 erratum E15).
    #[must_use]
    pub const fn usb_latest_bulk(&self) -> Time {
        self.bus.usb.latest_bulk()
    }

    /// Number of setup packets that arrived while an earlier packet of endpoint 0 was available,
    /// which the controller then sends as the answer to the setup packet.
    #[must_use]
    pub const fn usb_answered_before(&self) -> u32 {
        self.bus.usb.answered_before()
    }

    /// Number of writes of the firmware to the control word of a USB buffer that stayed available:
    /// such a write undoes what the controller changes between the processor's read and its write.
    #[must_use]
    pub const fn usb_rewritten(&self) -> u32 {
        self.bus.usb.rewritten()
    }

    /// Levels at the bridge's pins.
    #[must_use]
    pub const fn bridge(&self) -> BridgeInputs {
        self.bus.coil.inputs()
    }

    /// Whether the LED is on.
    #[must_use]
    pub fn led_is_on(&self) -> bool {
        self.bus.gpio.level(pin::LED)
    }

    /// Longest interval between two feedings of the watchdog since the last call.
    pub const fn take_longest_unfed(&mut self) -> Time {
        Time::from_ps(self.bus.watchdog.take_longest_unfed_ps())
    }

    /// Coil current, A.
    #[must_use]
    pub const fn current_a(&self) -> f64 {
        self.bus.coil.circuit().current_a()
    }

    /// The circuit's sums up to now. The circuit itself advances only when its state is read, and
    /// may lag behind by part of a period.
    pub fn totals(&mut self) -> Totals {
        self.bus.run_coil(self.bus.clock.now_ps());
        self.bus.coil.circuit().totals()
    }

    /// Write times of the bridge's PWM levels since the last call.
    pub fn take_level_times(&mut self) -> LevelTimes {
        self.bus.pwm.take_level_times()
    }

    /// The coil's circuit, advanced to the present: otherwise it may lag behind.
    #[must_use]
    pub fn circuit(&mut self) -> &Circuit {
        self.bus.run_coil(self.bus.clock.now_ps());
        self.bus.coil.circuit()
    }

    /// The coil's circuit, to inject faults; the next reading of the plant restores the values of
    /// coil and supply.
    pub const fn circuit_mut(&mut self) -> &mut Circuit {
        self.bus.coil.circuit_mut()
    }

    /// Bridge and current measurement, to inject faults; the errors of the analog-to-digital
    /// converter stay as they are.
    pub const fn drive_mut(&mut self) -> &mut BridgeCircuit {
        self.bus.coil.drive_mut()
    }

    /// Record of the bus; `None` if it was not enabled.
    #[must_use]
    pub const fn wire_log(&self) -> Option<&WireLog> {
        self.bus.wire.log.as_ref()
    }

    /// Ends the trace and returns it; `None` if it was not enabled.
    pub fn take_trace(&mut self) -> Option<Trace> {
        self.bus.wire.changes = None;
        self.bus.trace.take()
    }

    // ---- counts ----

    /// Count of the microsecond timer, the image's clock.
    #[must_use]
    pub fn timer_us(&self) -> u64 {
        self.bus.timer.count(self.bus.clock.now_ps())
    }

    /// Frequencies of the processor and at the converter's CLKIN, Hz.
    #[must_use]
    pub fn frequencies_hz(&self) -> (f64, Option<f64>) {
        let clkin_hz = self.bus.wire.converters.clkin_hz();
        (self.bus.clock.hz(), clkin_hz)
    }

    /// Resets since power on.
    #[must_use]
    pub const fn resets(&self) -> ResetCount {
        self.resets
    }

    /// Number of instructions so far.
    #[must_use]
    pub const fn instructions(&self) -> u64 {
        self.instructions
    }

    /// Time for which the core has slept.
    #[must_use]
    pub fn time_asleep(&self) -> Time {
        Time::from_ps(self.asleep_ps)
    }

    /// Starts a profile of the processor's cycles, from zero. The cost of functions at shared
    /// addresses, such as soft floating point, is charged to their callers. The profile slows down
    /// every instruction; without it there is no cost.
    pub fn profile(&mut self, shared: &[Range<u32>]) {
        self.profile = Some(Box::new(Profile::new(&self.image, shared)));
    }

    /// Ends the profile and returns it.
    pub fn take_profile(&mut self) -> Option<Profile> {
        self.profile.take().map(|profile| *profile)
    }

    /// Hits and misses of the flash's cache; consecutive fetches from one line count once.
    #[must_use]
    pub const fn cache(&self) -> (u64, u64) {
        (self.bus.memory.cache.hits, self.bus.memory.cache.misses)
    }
}
