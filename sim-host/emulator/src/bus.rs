//! The processor's bus: what lies at which address, and what is wired to what.

use std::sync::Arc;

use ldc161x_sim::{ExternalClock, Time};
use rp2040_emu::bus::ppb::Ppb;
use rp2040_emu::core::{CoreBus, Nvic};

use crate::adc::Adc;
use crate::board::Options;
use crate::bridge::{BridgeInputs, InputSource};
use crate::clocks::{Clocks, FASTEST_AT_START_HZ};
use crate::coil::EmulatedCoil;
use crate::dma::Dma;
use crate::gpio::{Gpio, function};
use crate::i2c::I2c;
use crate::image::{FLASH_SIZE, Image};
use crate::interrupts::Interrupts;
use crate::plant::{Plant, PlantConditions};
use crate::power::{Power, block};
use crate::pwm::Pwm;
use crate::rtt;
use crate::sio::Sio;
use crate::stop::Stop;
use crate::time::Clock;
use crate::timer::Timer;
use crate::trace::{Signal, SignalValue, Trace};
use crate::watchdog::Watchdog;
use crate::wire::Wire;
use crate::xip::Cache;

pub(crate) const RAM: u32 = 0x2000_0000;
/// Four banks of 64 KiB and two of 4 KiB (datasheet 2.6.2).
pub(crate) const RAM_SIZE: usize = 264 * 1024;
/// Waiting time of an access through the APB bridge. The datasheet gives no number; guess.
const APB_CYCLES: u32 = 3;
/// The processor's clock while nothing else is set: the ring oscillator.
const BOOT_HZ: f64 = 6.5e6;

/// Pins by their role, as docs/firmware.md wires them.
mod pin {
    pub(super) const SDA: usize = 4;
    pub(super) const SCL: usize = 5;
    pub(super) const INTB: usize = 7;
    pub(super) const SD: usize = 8;
    pub(super) const SECOND_INTB: usize = 9;
    pub(super) const SECOND_SD: usize = 10;
    pub(super) const IN1: usize = 16;
    pub(super) const IN2: usize = 17;
    pub(super) const SLEEP: usize = 18;
    pub(super) const FAULT: usize = 19;
    pub(super) const LIMIT: usize = 20;
    pub(super) const CLKIN: usize = 21;
    pub(super) const LED: usize = 25;
}

/// The PWM slices of the coil and of the edge counters.
const COIL_SLICE: usize = 0;
const EDGE_SLICE: usize = 3;
const SECOND_EDGE_SLICE: usize = 4;

/// How often the plant receives the coil's mean current since the last time, while there is any: every
/// two periods of the bridge, over which the ripple averages out. How often the bus polls what changes
/// slowly meanwhile, in such times; and how often while there is no current.
const TELLS_PS: u64 = 32_000_000;
const TELLS_IN_A_LOOK: u64 = 4;
const LOOKS_PS: u64 = 1_000_000_000;
/// Conversions that fill the ring of memory behind the ADC whatever its size: where no interrupt reads
/// each of them, only the last ones are made.
const LAST_CONVERSIONS: u64 = 16;

/// Interrupt numbers (datasheet 2.3.2).
mod line {
    pub(super) const TIMER: u32 = 0;
    pub(super) const PWM_WRAP: u32 = 4;
    pub(super) const IO_BANK0: u32 = 13;
    pub(super) const I2C0: u32 = 23;
}

/// Everything but the processor's core.
#[derive(Clone)]
pub(crate) struct SystemBus<P> {
    flash: Arc<[u8]>,
    ram: Vec<u8>,
    pub(crate) cache: Cache,
    pub(crate) ppb: Ppb,
    /// The core's own controller, which stays empty: [`Interrupts`] does its work.
    idle: Nvic,
    pub(crate) interrupts: Interrupts,
    pub(crate) clock: Clock,
    pub(crate) pc: u32,
    /// Cycles that the present instruction waits for memory.
    pub(crate) stall: u32,
    pub(crate) stop: Option<Stop>,
    pub(crate) event: bool,
    pub(crate) parked: bool,
    pub(crate) next_event_ps: u64,
    serviced_ps: u64,
    sys_hz: f64,
    pub(crate) watchdog_fired: bool,
    sio: Sio,
    pub(crate) gpio: Gpio,
    clocks: Clocks,
    power: Power,
    timer: Timer,
    watchdog: Watchdog,
    pub(crate) pwm: Pwm,
    adc: Adc,
    dma: Dma,
    i2c: I2c,
    pub(crate) wire: Wire<P>,
    shut_down: [bool; 2],
    clkin_hz: Option<f64>,
    pub(crate) bridge: BridgeInputs,
    pub(crate) coil: EmulatedCoil,
    /// What the plant last said of coil and supply.
    conditions: PlantConditions,
    /// When the plant last received the current.
    reported_ps: u64,
    /// Results on their way into memory: when, where, what.
    converting: Option<(u64, u16)>,
    pub(crate) trace: Option<Trace>,
    /// Up to when the pulses are traced.
    traced_ps: u64,
}

impl<P: Plant> SystemBus<P> {
    pub(crate) fn new(image: &Image, options: Options, wire: Wire<P>) -> Self {
        let conditions = wire.chip.sensors().conditions();
        let mut bus = Self {
            flash: Arc::clone(&image.flash),
            ram: vec![options.ram_fill; RAM_SIZE],
            cache: Cache::new(options.miss_cycles),
            ppb: Ppb::new(),
            idle: Nvic::new(),
            interrupts: Interrupts::default(),
            clock: Clock::new(BOOT_HZ),
            pc: 0,
            stall: 0,
            stop: None,
            event: false,
            parked: false,
            next_event_ps: 0,
            serviced_ps: 0,
            sys_hz: BOOT_HZ,
            watchdog_fired: false,
            sio: Sio::default(),
            gpio: Gpio::new(),
            clocks: Clocks::new(options.crystal_hz, options.seed),
            power: Power::new(),
            timer: Timer::default(),
            watchdog: Watchdog::default(),
            pwm: Pwm::default(),
            adc: Adc::default(),
            dma: Dma::default(),
            i2c: I2c::new(options.scl_rise.as_ps()),
            wire,
            shut_down: [false; 2],
            clkin_hz: None,
            bridge: BridgeInputs::default(),
            trace: options.trace.then(Trace::default),
            traced_ps: 0,
            coil: EmulatedCoil::new(options.drive, options.seed, &conditions),
            conditions,
            reported_ps: 0,
            converting: None,
        };
        bus.gpio.drive(pin::INTB, true);
        bus.gpio.drive(pin::SECOND_INTB, true);
        bus.gpio.drive(pin::FAULT, true);
        bus.wire.chip.set_external_clock(None);
        bus.settle();
        bus
    }

    /// After the watchdog has reset the chip: memory, scratch registers and the outside remain.
    pub(crate) fn reset(&mut self) {
        let now_ps = self.clock.now_ps();
        self.trace_pulses(now_ps);
        self.run_coil(now_ps);
        self.i2c.reset(&mut self.wire);
        self.sio = Sio::default();
        self.gpio.reset();
        self.clocks.reset();
        self.power.after_watchdog();
        self.timer.reset(now_ps);
        self.watchdog.after_reset();
        self.pwm = Pwm::default();
        self.adc = Adc::default();
        self.dma = Dma::default();
        self.converting = None;
        self.interrupts = Interrupts::default();
        self.ppb = Ppb::new();
        self.cache.flush();
        self.watchdog_fired = false;
        self.parked = false;
        self.event = false;
        self.follow_clocks();
        self.settle();
    }

    /// Reads a word without any effect, for the harness.
    pub(crate) fn peek(&self, address: u32) -> u32 {
        (0..4).fold(0, |word, place| {
            word | u32::from(self.load(address + place)) << (8 * place)
        })
    }

    pub(crate) fn poke(&mut self, address: u32, value: u32) {
        for (place, byte) in (0..).zip(value.to_le_bytes()) {
            self.store(address + place, byte);
        }
    }

    #[inline]
    fn load(&self, address: u32) -> u8 {
        let (memory, offset) = match address >> 28 {
            1 => (&*self.flash, (address & 0xFF_FFFF) as usize % FLASH_SIZE),
            _ => (&*self.ram, address.wrapping_sub(RAM) as usize),
        };
        memory.get(offset).copied().unwrap_or(0)
    }

    #[inline]
    fn store(&mut self, address: u32, value: u8) {
        if let Some(byte) = self.ram.get_mut(address.wrapping_sub(RAM) as usize) {
            *byte = value;
        }
    }

    // ---- time ----

    /// Does everything that is due, and finds out when something is due next.
    pub(crate) fn service(&mut self) {
        let now_ps = self.clock.now_ps();
        self.timer.service(now_ps, self.serviced_ps);
        self.i2c.service(now_ps, &mut self.wire);
        self.run_chip(now_ps);
        if self.trace.is_some() {
            let latch_ps = self.pwm.next_event(self.serviced_ps, self.sys_hz);
            self.trace_pulses(latch_ps.map_or(now_ps, |latch_ps| latch_ps.min(now_ps)));
        }
        if let Some(wrap_ps) = self.pwm.latches_by(COIL_SLICE, now_ps, self.sys_hz) {
            // With the old levels up to there.
            self.run_coil(wrap_ps);
        }
        self.pwm.service(self.serviced_ps, now_ps, self.sys_hz);
        self.serviced_ps = now_ps;
        self.run_coil(now_ps);
        if self.watchdog.expires(now_ps) {
            self.fire_watchdog();
        }
        self.settle();
    }

    fn fire_watchdog(&mut self) {
        if self.power.watchdog_resets_all() {
            self.watchdog_fired = true;
        } else {
            self.fail("a watchdog that does not reset everything");
        }
    }

    /// Runs the converter to its next changes of INTB, one by one.
    fn run_chip(&mut self, now_ps: u64) {
        let now = Time::from_ps(now_ps);
        while let Some(due) = self.wire.chip.next_event().filter(|&due| due <= now) {
            self.wire.chip.advance_to(due);
            self.follow_interrupt(due.as_ps());
        }
        while let Some(second) = &mut self.wire.second
            && let Some(due) = second.next_event().filter(|&due| due <= now)
        {
            second.advance_to(due);
            self.follow_second_interrupt();
        }
    }

    fn follow_second_interrupt(&mut self) {
        let second = self.wire.second.as_ref();
        let high = second.is_none_or(|chip| !chip.intb_is_low());
        if self.gpio.level(pin::SECOND_INTB) != high {
            if !high {
                self.pwm.falling_edge(SECOND_EDGE_SLICE);
            }
            self.gpio.drive(pin::SECOND_INTB, high);
        }
    }

    fn follow_interrupt(&mut self, now_ps: u64) {
        let high = !self.wire.chip.intb_is_low();
        if self.gpio.level(pin::INTB) != high {
            if !high {
                self.pwm.falling_edge(EDGE_SLICE);
                self.wire.falling_edge(now_ps);
            }
            self.gpio.drive(pin::INTB, high);
        }
    }

    /// Lets what depends on what was written follow: pins, clocks, coil, interrupts.
    fn settle(&mut self) {
        let now_ps = self.clock.now_ps();
        self.follow_interrupt(now_ps);
        self.follow_second_interrupt();
        self.follow_clkin();
        self.follow_shutdown();
        self.follow_plain_bus(now_ps);
        self.follow_bridge();
        self.follow_trace(now_ps);
        self.refresh();
    }

    /// The interrupt lines, and when something is due next.
    fn refresh(&mut self) {
        let now_ps = self.clock.now_ps();
        let lines = self.timer.lines() << line::TIMER
            | u32::from(self.gpio.line()) << line::IO_BANK0
            | u32::from(self.pwm.line()) << line::PWM_WRAP
            | u32::from(self.i2c.line()) << line::I2C0;
        self.interrupts.drive(lines, self.ppb.active);
        let due = [
            self.timer.next_event(now_ps),
            self.i2c.next_event(),
            self.wire.chip.next_event().map(Time::as_ps),
            self.wire
                .second
                .as_ref()
                .and_then(|chip| chip.next_event())
                .map(Time::as_ps),
            self.pwm.next_event(now_ps, self.sys_hz),
            self.watchdog.next_event(),
            Some(self.coil_due_ps()),
        ];
        self.next_event_ps = due.into_iter().flatten().min().unwrap_or(u64::MAX);
    }

    fn follow_clocks(&mut self) {
        let now_ps = self.clock.now_ps();
        let is_fast = self.clocks.sys_hz() > Some(FASTEST_AT_START_HZ);
        if is_fast && !self.power.is_raised(now_ps) {
            self.fail("a system clock above 133 MHz without a settled core voltage of 1.15 V");
        }
        match self.clocks.sys_hz() {
            Some(hz) if hz != self.sys_hz => {
                self.pwm.advance(now_ps, self.sys_hz);
                self.sys_hz = hz;
                self.clock.set_frequency(hz);
                self.i2c.set_clock(hz);
            }
            Some(_) => {}
            None => self.fail("a system clock that stands or is too fast"),
        }
        self.timer.set_tick(now_ps, self.tick_ps());
    }

    /// Length of the microsecond tick, if there is one.
    fn tick_ps(&self) -> Option<f64> {
        let cycles = self.watchdog.tick_cycles()?;
        let hz = self.clocks.ref_hz();
        (hz > 0.0).then(|| f64::from(cycles) * 1e12 / hz)
    }

    fn follow_clkin(&mut self) {
        let routed = self.gpio.function(pin::CLKIN) == function::CLOCK;
        let hz = if routed {
            self.clocks.output_hz()
        } else {
            None
        };
        if hz != self.clkin_hz {
            self.clkin_hz = hz;
            let chip = &mut self.wire.chip;
            chip.advance_to(self.clock.now());
            chip.set_external_clock(hz.map(ExternalClock::exact));
            if let Some(second) = &mut self.wire.second {
                second.advance_to(self.clock.now());
                second.set_external_clock(hz.map(ExternalClock::exact));
            }
        }
    }

    fn follow_shutdown(&mut self) {
        let levels = [pin::SD, pin::SECOND_SD].map(|pin| self.gpio.level(pin));
        let before = std::mem::replace(&mut self.shut_down, levels);
        if levels == before {
            return;
        }
        let now = self.clock.now();
        let ([first, second], [first_was, second_was]) = (levels, before);
        if first != first_was {
            self.wire.chip.advance_to(now);
            self.wire.chip.set_shutdown(first);
            self.follow_interrupt(now.as_ps());
        }
        if let Some(chip) = &mut self.wire.second
            && second != second_was
        {
            chip.advance_to(now);
            chip.set_shutdown(second);
            self.follow_second_interrupt();
        }
    }

    fn follow_plain_bus(&mut self, now_ps: u64) {
        let is_plain = |pin| self.gpio.function(pin) == function::SIO;
        let levels = (is_plain(pin::SCL) && is_plain(pin::SDA)).then(|| {
            (
                !self.gpio.pulls_low(pin::SCL),
                !self.gpio.pulls_low(pin::SDA),
            )
        });
        self.wire.plain(now_ps, levels);
        let outside_sda = !self.wire.sda_is_low(now_ps);
        let outside_scl = self.wire.scl_low_until(now_ps).is_none();
        for (pin, high) in [(pin::SDA, outside_sda), (pin::SCL, outside_scl)] {
            if self.gpio.level(pin) != high || !is_driven(&self.gpio, pin) {
                self.gpio.drive(pin, high);
            }
        }
    }

    fn follow_bridge(&mut self) {
        let source = |pin, output| match self.gpio.function(pin) {
            function::PWM => InputSource::Pwm(output),
            _ => InputSource::Level(self.gpio.level(pin)),
        };
        let inputs = BridgeInputs {
            awake: self.gpio.level(pin::SLEEP),
            limit_low: self.gpio.pulls_low(pin::LIMIT),
            sources: [source(pin::IN1, 0), source(pin::IN2, 1)],
        };
        if inputs != self.bridge {
            let now_ps = self.clock.now_ps();
            self.run_coil(now_ps);
            self.coil.follow(&self.conditions, inputs.limit_low);
            self.bridge = inputs;
        }
    }

    /// When the coil has to be looked at again: not before the present of its circuit, for which it
    /// may be late where the bridge has just been woken.
    fn coil_due_ps(&self) -> u64 {
        let idle = self.coil.is_idle(&self.bridge);
        let due_ps = self.reported_ps + if idle { LOOKS_PS } else { TELLS_PS };
        due_ps.max(self.coil.now_ps())
    }

    /// Lets the coil's circuit, the converter and the way into memory come to a time, and tells the
    /// plant of the periods that have passed.
    pub(crate) fn run_coil(&mut self, now_ps: u64) {
        loop {
            let due_ps = self.coil_due_ps();
            if due_ps > now_ps {
                break;
            }
            self.run_circuit(due_ps);
            self.trace_current(due_ps);
        }
        self.run_circuit(now_ps);
    }

    fn run_circuit(&mut self, now_ps: u64) {
        let wave = self.pwm.wave(COIL_SLICE, self.sys_hz);
        self.skip_conversions(now_ps);
        let coil_c = self.conditions.coil_c;
        while let Some(conversion) = self.adc.next() {
            if let Some((done_ps, code)) = self.converting
                && done_ps <= now_ps
            {
                self.converting = None;
                self.store_result(code);
            }
            if conversion.sampled_ps > now_ps {
                break;
            }
            self.coil
                .advance(conversion.sampled_ps, &self.bridge, &wave);
            match self.coil.convert(conversion.input, coil_c) {
                Some(code) => self.converting = Some((conversion.done_ps, code)),
                None => self.fail("a conversion of an input that nothing is wired to"),
            }
            self.adc.advance(1);
        }
        self.coil.advance(now_ps, &self.bridge, &wave);
        let faults = self.coil.circuit().is_limiting() || self.coil.drive().bridge_faults;
        if self.gpio.level(pin::FAULT) == faults {
            self.gpio.drive(pin::FAULT, !faults);
        }
    }

    /// Without the control interrupt the firmware does not read each result: those that others will
    /// overwrite are not made.
    fn skip_conversions(&mut self, now_ps: u64) {
        let waiting = self.adc.sampled_by(now_ps);
        if self.pwm.interrupts() || waiting <= LAST_CONVERSIONS {
            return;
        }
        let skipped = waiting - LAST_CONVERSIONS;
        if self.adc.feeds_dma() {
            // At most a second's, at 500 000 a second.
            self.dma.skip(skipped as u32);
        }
        self.adc.advance(skipped);
    }

    fn store_result(&mut self, code: u16) {
        if !self.adc.feeds_dma() {
            return;
        }
        if let Some(place) = self.dma.next() {
            let [low, high] = code.to_le_bytes();
            self.store(place, low);
            self.store(place + 1, high);
        }
    }

    fn trace_current(&mut self, now_ps: u64) {
        self.reported_ps = now_ps;
        if let Some((mean_a, ripple_a)) = self.coil.current_since() {
            let now = Time::from_ps(now_ps);
            self.wire.chip.advance_to(now);
            // The plant's time is still that of the last report.
            let plant = self.wire.chip.sensors_mut();
            plant.set_current(mean_a, ripple_a);
            plant.advance_to(now);
        }
        let idle = self.coil.is_idle(&self.bridge);
        if idle || (now_ps / TELLS_PS).is_multiple_of(TELLS_IN_A_LOOK) {
            self.conditions = self.wire.chip.sensors().conditions();
            self.coil.follow(&self.conditions, self.bridge.limit_low);
        }
    }

    fn follow_trace(&mut self, now_ps: u64) {
        let Some(trace) = &mut self.trace else {
            return;
        };
        for change in self.wire.changes.iter_mut().flat_map(|all| all.drain(..)) {
            trace.push(change);
        }
        for (signal, pin) in [(Signal::Sda, pin::SDA), (Signal::Scl, pin::SCL)] {
            if self.i2c.is_off_the_wires() {
                trace.is(now_ps, signal, SignalValue::Level(self.gpio.level(pin)));
            } else {
                trace.leave(signal);
            }
        }
        for (signal, pin) in [
            (Signal::Intb, pin::INTB),
            (Signal::Shutdown, pin::SD),
            (Signal::Sleep, pin::SLEEP),
            (Signal::Fault, pin::FAULT),
            (Signal::Led, pin::LED),
        ] {
            trace.is(now_ps, signal, SignalValue::Level(self.gpio.level(pin)));
        }
        trace.is(
            now_ps,
            Signal::Current,
            SignalValue::Real(self.coil.circuit().current_a()),
        );
        self.trace_pulses(now_ps);
    }

    /// The bridge's inputs up to a time. Called before anything changes them, and afterwards.
    fn trace_pulses(&mut self, until_ps: u64) {
        let Some(trace) = &mut self.trace else {
            return;
        };
        for (signal, pin, channel_b) in [
            (Signal::In1, pin::IN1, false),
            (Signal::In2, pin::IN2, true),
        ] {
            let level = self.gpio.level(pin);
            let edges = match self.gpio.function(pin) {
                function::PWM => {
                    let between = (self.traced_ps, until_ps);
                    self.pwm.edges(COIL_SLICE, channel_b, between, self.sys_hz)
                }
                _ => vec![(until_ps, level)],
            };
            for (at_ps, high) in edges {
                trace.is(at_ps, signal, SignalValue::Level(high));
            }
        }
        self.traced_ps = until_ps;
    }

    // ---- registers ----

    fn fail(&mut self, what: &'static str) {
        let pc = self.pc;
        self.stop.get_or_insert(Stop::NotFollowed { what, pc });
    }

    fn check_reset(&mut self, address: u32) {
        let block = match address >> 14 << 14 {
            0x4001_4000 => block::IO_BANK0,
            0x4001_C000 => block::PADS_BANK0,
            0x4002_8000 => block::PLL_SYS,
            0x4002_C000 => block::PLL_USB,
            0x4004_4000 => block::I2C0,
            0x4004_C000 => block::ADC,
            0x4005_0000 => block::PWM,
            0x4005_4000 => block::TIMER,
            0x5000_0000 => block::DMA,
            _ => 0,
        };
        if self.power.in_reset & block != 0 {
            let pc = self.pc;
            self.stop.get_or_insert(Stop::InReset { address, pc });
        }
    }

    fn read_register(&mut self, address: u32) -> u32 {
        let found = match address >> 28 {
            0x4 => {
                self.stall += APB_CYCLES;
                self.check_reset(address);
                self.read_apb(address & !0x3FFF, address & 0xFFF)
            }
            0x5 if address >> 12 & 0xF == 0 => {
                self.check_reset(address);
                self.dma.read(address & 0xFFF)
            }
            0xD => {
                let offset = address & 0xFFF;
                self.gpio.read_sio(offset).or_else(|| self.sio.read(offset))
            }
            0xE => self.read_private(address & 0xF_FFFF),
            _ => None,
        };
        let pc = self.pc;
        found.unwrap_or_else(|| {
            self.stop.get_or_insert(Stop::Unmodelled {
                address,
                pc,
                written: None,
            });
            0
        })
    }

    fn read_apb(&mut self, base: u32, offset: u32) -> Option<u32> {
        let now_ps = self.clock.now_ps();
        match base {
            0x4000_8000 => self.clocks.read(offset),
            0x4000_C000 => self.power.read_resets(offset),
            0x4001_0000 => self.power.read_sequence(offset),
            0x4001_4000 => self.gpio.read_bank(offset),
            0x4001_C000 => self.gpio.read_pads(offset),
            0x4002_4000 => self.clocks.read_crystal(offset, now_ps),
            0x4002_8000 => self.clocks.read_pll(false, offset, now_ps),
            0x4002_C000 => self.clocks.read_pll(true, offset, now_ps),
            0x4004_4000 => {
                let value = self.i2c.read(offset);
                self.refresh();
                value
            }
            0x4004_C000 => self.adc.read(offset),
            0x4005_0000 => self.pwm.read(offset, now_ps, self.sys_hz),
            0x4005_4000 => self.timer.read(offset, now_ps),
            0x4005_8000 => self.watchdog.read(offset),
            0x4006_0000 => self.clocks.read_ring(offset),
            0x4006_4000 => self.power.read_regulator(offset, now_ps),
            _ => None,
        }
    }

    fn write_register(&mut self, address: u32, value: u32) {
        self.trace_pulses(self.clock.now_ps());
        let done = match address >> 28 {
            0x4 => {
                self.stall += APB_CYCLES;
                self.check_reset(address);
                self.write_alias(address, value)
            }
            0x5 if address >> 12 & 0xF == 0 => {
                self.check_reset(address);
                self.dma.write(address & 0xFFF, value)
            }
            0xD => {
                let offset = address & 0xFFF;
                let pin = self.gpio.write_sio(offset, value);
                pin.or_else(|| self.sio.write(offset, value))
            }
            0xE => self.write_private(address & 0xF_FFFF, value),
            _ => None,
        };
        if done.is_none() {
            let pc = self.pc;
            self.stop.get_or_insert(Stop::Unmodelled {
                address,
                pc,
                written: Some(value),
            });
        }
        self.settle();
    }

    /// A write through one of the four views of a register: plain, exclusive or, set, clear
    /// (datasheet 2.1.2).
    fn write_alias(&mut self, address: u32, value: u32) -> Option<()> {
        let (base, offset) = (address & !0x3FFF, address & 0xFFF);
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
            0x4000_8000 => self.clocks.write(offset, value)?,
            0x4000_C000 => self.write_resets(offset, value)?,
            0x4001_0000 => self.power.write_sequence(offset, value)?,
            0x4001_4000 => self.gpio.write_bank(offset, value)?,
            0x4001_C000 => self.gpio.write_pads(offset, value)?,
            0x4002_4000 => self.clocks.write_crystal(offset, value, now_ps)?,
            0x4002_8000 => self.clocks.write_pll(false, offset, value, now_ps)?,
            0x4002_C000 => self.clocks.write_pll(true, offset, value, now_ps)?,
            0x4004_4000 => {
                let has_pins = [pin::SDA, pin::SCL]
                    .iter()
                    .all(|&pin| self.gpio.function(pin) == function::I2C);
                if offset == 0x10 && !has_pins {
                    self.fail("a transfer of an I2C block that has no pins");
                }
                self.i2c.write(offset, value, now_ps, &mut self.wire)?;
            }
            0x4004_C000 => self.write_adc(offset, value)?,
            0x4005_0000 => {
                self.run_coil(now_ps);
                self.pwm.write(offset, value, now_ps, self.sys_hz)?;
            }
            0x4005_4000 => self.timer.write(offset, value)?,
            0x4005_8000 => {
                let tick_ps = self.tick_ps();
                self.watchdog.write(offset, value, now_ps, tick_ps)?;
            }
            0x4006_0000 => self.clocks.write_ring(offset, value)?,
            0x4006_4000 => self.power.write_regulator(offset, value, now_ps)?,
            _ => return None,
        }
        if matches!(
            base,
            0x4000_8000
                | 0x4002_4000
                | 0x4002_8000
                | 0x4002_C000
                | 0x4005_8000
                | 0x4006_0000
                | 0x4006_4000
        ) {
            self.follow_clocks();
        }
        Some(())
    }

    fn write_resets(&mut self, offset: u32, value: u32) -> Option<()> {
        let before = self.power.in_reset;
        self.power.write_resets(offset, value)?;
        let entered = self.power.in_reset & !before;
        let now_ps = self.clock.now_ps();
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
        if enters(block::PWM) {
            self.pwm = Pwm::default();
        }
        if enters(block::ADC) {
            self.adc = Adc::default();
            self.converting = None;
        }
        if enters(block::DMA) {
            self.dma = Dma::default();
        }
        if enters(block::TIMER) {
            self.timer.reset(now_ps);
        }
        for (block, usb) in [(block::PLL_SYS, false), (block::PLL_USB, true)] {
            if enters(block) {
                self.clocks.reset_pll(usb);
            }
        }
        self.follow_clocks();
        Some(())
    }

    fn write_adc(&mut self, offset: u32, value: u32) -> Option<()> {
        let clock_hz = self.clocks.adc_hz();
        self.adc.write(offset, value, self.clock.now_ps(), clock_hz)
    }

    fn read_private(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0xED00 => 0x410C_C601,
            0xED04 => (63 - self.ppb.active.leading_zeros()).min(63) & 0x3F,
            0xED08 => self.ppb.vtor,
            0xED0C => 0xFA05_0000,
            0xED10 | 0xED24 => 0,
            0xED14 => 0x208,
            0xED1C => u32::from(self.ppb.shpr[7]) << 24,
            0xED20 => u32::from(self.ppb.shpr[10]) << 16 | u32::from(self.ppb.shpr[11]) << 24,
            _ => self.interrupts.read(offset.checked_sub(0xE000)?)?,
        })
    }

    fn write_private(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0xED08 => self.ppb.vtor = value & 0xFFFF_FF00,
            0xED1C => self.ppb.shpr[7] = (value >> 24) as u8 & 0xC0,
            0xED20 => {
                self.ppb.shpr[10] = (value >> 16) as u8 & 0xC0;
                self.ppb.shpr[11] = (value >> 24) as u8 & 0xC0;
            }
            // SLEEPONEXIT, SLEEPDEEP and SEVONPEND stay off.
            0xED10 if value == 0 => {}
            _ => self.interrupts.write(offset.checked_sub(0xE000)?, value)?,
        }
        Some(())
    }

    /// Lets time pass without an instruction, up to the next event or a time.
    pub(crate) fn sleep(&mut self, until_ps: u64) {
        let until_ps = self.next_event_ps.min(until_ps);
        let cycles = self.clock.cycles_until(until_ps).max(1);
        self.clock.advance(cycles);
    }

    /// The boot ROM's time, in which nothing of the firmware runs.
    pub(crate) fn boot_delay(&mut self, delay: Time) {
        let end_ps = self.clock.now_ps() + delay.as_ps();
        while self.clock.now_ps() < end_ps {
            self.sleep(end_ps);
            self.service();
        }
    }

    /// One memory access of the core or of an exception's entry.
    pub(crate) fn fetch_cost(&mut self, address: u32) {
        if address >> 28 == 1 {
            self.stall += self.cache.access(address & 0xFF_FFFF);
        }
    }

    pub(crate) fn timer_us(&self) -> u64 {
        self.timer.count(self.clock.now_ps())
    }

    /// For tests of the clock plan.
    pub(crate) fn frequencies_hz(&self) -> (f64, Option<f64>) {
        (self.sys_hz, self.clkin_hz)
    }

    pub(crate) fn bus_is_idle(&self) -> bool {
        self.i2c.is_idle()
    }
}

fn is_driven(gpio: &Gpio, pin: usize) -> bool {
    gpio.function(pin) != function::SIO || !gpio.pulls_low(pin)
}

/// Whether an address is memory, and whether the access goes through the flash's cache.
fn is_memory(address: u32) -> bool {
    matches!(address >> 28, 1) || (RAM..RAM + RAM_SIZE as u32).contains(&address)
}

impl<P: Plant> CoreBus for SystemBus<P> {
    fn read8(&mut self, addr: u32) -> u8 {
        if is_memory(addr) {
            self.fetch_cost(addr);
            return self.load(addr);
        }
        let shift = 8 * (addr & 0b11);
        (self.read_register(addr & !0b11) >> shift) as u8
    }

    fn read16(&mut self, addr: u32) -> u16 {
        if is_memory(addr) {
            self.fetch_cost(addr);
            return u16::from_le_bytes([self.load(addr), self.load(addr + 1)]);
        }
        let shift = 8 * (addr & 0b10);
        (self.read_register(addr & !0b11) >> shift) as u16
    }

    #[inline]
    fn read32(&mut self, addr: u32) -> u32 {
        let offset = addr.wrapping_sub(RAM) as usize;
        if let Some(bytes) = self.ram.get(offset..offset.wrapping_add(4)) {
            return bytes.try_into().map_or(0, u32::from_le_bytes);
        }
        if is_memory(addr) {
            self.fetch_cost(addr);
            return self.peek(addr);
        }
        self.read_register(addr)
    }

    fn write8(&mut self, addr: u32, val: u8) {
        if is_memory(addr) && addr >> 28 == 2 {
            self.store(addr, val);
        } else {
            self.fail("a write of a byte to a register");
        }
    }

    fn write16(&mut self, addr: u32, val: u16) {
        if is_memory(addr) && addr >> 28 == 2 {
            let [low, high] = val.to_le_bytes();
            self.store(addr, low);
            self.store(addr + 1, high);
        } else {
            self.fail("a write of a half-word to a register");
        }
    }

    #[inline]
    fn write32(&mut self, addr: u32, val: u32) {
        let offset = addr.wrapping_sub(RAM) as usize;
        if let Some(bytes) = self.ram.get_mut(offset..offset.wrapping_add(4)) {
            bytes.copy_from_slice(&val.to_le_bytes());
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
        &self.ppb
    }

    fn ppb_mut(&mut self, _: usize) -> &mut Ppb {
        &mut self.ppb
    }

    #[inline]
    fn nvic(&self, _: usize) -> &Nvic {
        &self.idle
    }

    fn nvic_mut(&mut self, _: usize) -> &mut Nvic {
        &mut self.idle
    }

    fn active_core(&self) -> usize {
        0
    }

    fn event_flag(&self, _: usize) -> bool {
        self.event
    }

    fn consume_event_flag(&mut self, _: usize) -> bool {
        std::mem::take(&mut self.event)
    }

    fn set_wfe_waiting(&mut self, _: usize, val: bool) {
        self.parked = val;
    }

    fn signal_sev(&mut self) {
        self.event = true;
    }
}

impl<P: Plant> rtt::Memory for SystemBus<P> {
    fn word(&self, address: u32) -> u32 {
        self.peek(address)
    }

    fn set_word(&mut self, address: u32, value: u32) {
        self.poke(address, value);
    }

    fn byte(&self, address: u32) -> u8 {
        self.load(address)
    }

    fn set_byte(&mut self, address: u32, value: u8) {
        self.store(address, value);
    }
}

#[cfg(test)]
mod tests {
    use ldc161x_sim::Chip;

    use super::*;
    use crate::plant::Still;

    /// Orders 1.15 V, lets a time pass, and switches to the system PLL at so many megahertz.
    fn switched(voltage: u32, settling: Time, feedback: u32) -> Option<Stop> {
        let wire = Wire::new(
            Chip::new(Default::default(), Still::new([3e6; 4])),
            None,
            false,
            false,
        );
        let mut bus = SystemBus::new(&Image::empty(), Options::default(), wire);
        let writes = [
            (0x4000_C000, block::ALL & !block::PLL_SYS),
            (0x4002_4000, 0x00FA_BAA0),
            (0x4002_8008, feedback),
            (0x4002_800C, 6 << 16 | 1 << 12),
            (0x4002_8004, 0),
            (0x4006_4000, voltage << 4 | 1),
        ];
        for (address, value) in writes {
            bus.write32(address, value);
        }
        bus.boot_delay(settling);
        bus.write32(0x4000_803C, 1);
        bus.stop
    }

    #[test]
    fn a_clock_above_133_megahertz_needs_a_settled_core_voltage() {
        let settled = Time::from_us(1_001);
        assert_eq!(switched(0xC, settled, 100), None);
        // 132 MHz, at 1.10 V and at once.
        assert_eq!(switched(0xB, Time::ZERO, 66), None);
        for (voltage, settling) in [(0xB, settled), (0xC, Time::from_us(999))] {
            let stop = switched(voltage, settling, 100);
            assert!(matches!(stop, Some(Stop::NotFollowed { .. })), "{stop:?}");
        }
    }
}
