//! Connections of the pins on the board: converters, bridge and traces.

use ldc161x_sim::Time;

use crate::board::bridge::{BridgeInputs, InputSource};
use crate::board::pins::{COIL_SLICE, EDGE_SLICE, SECOND_EDGE_SLICE, pin};
use crate::board::plant::Plant;
use crate::rp2040::gpio::function;
use crate::trace::{Signal, SignalValue};

use super::SystemBus;

/// Number of conversions that fill the ring buffer behind the ADC, whatever its size. If no
/// interrupt reads each result, only this many of the last conversions are made.
const LAST_CONVERSIONS: u64 = 16;

impl<P: Plant> SystemBus<P> {
    /// Drives the external pins at the start.
    pub(super) fn connect(&mut self) {
        for pin in [pin::INTB, pin::SECOND_INTB, pin::FAULT] {
            self.gpio.drive(pin, true);
        }
    }

    /// Passes the pins' levels to the external parts, and the external levels to the pins.
    pub(super) fn follow_pins(&mut self) {
        let now_ps = self.clock.now_ps();
        self.follow_interrupt(now_ps);
        self.follow_second_interrupt();
        self.follow_clkin();
        self.follow_shutdown();
        self.follow_plain_bus(now_ps);
        self.follow_bridge(now_ps);
        self.follow_trace(now_ps);
    }

    // ---- converters ----

    /// Runs the converters to their next changes of INTB, one by one.
    pub(super) fn run_converters(&mut self, now_ps: u64) {
        let now = Time::from_ps(now_ps);
        while let Some(due) = self.wire.converters.first.next_event()
            && due <= now
        {
            self.wire.converters.first.advance_to(due);
            self.follow_interrupt(due.as_ps());
        }
        while let Some(second) = &mut self.wire.converters.second
            && let Some(due) = second.next_event()
            && due <= now
        {
            second.advance_to(due);
            self.follow_second_interrupt();
        }
    }

    fn follow_interrupt(&mut self, now_ps: u64) {
        let [high, _] = self.wire.converters.intb();
        if self.drive_interrupt(pin::INTB, EDGE_SLICE, high) {
            self.wire.falling_edge(now_ps);
        }
    }

    fn follow_second_interrupt(&mut self) {
        let [_, high] = self.wire.converters.intb();
        self.drive_interrupt(pin::SECOND_INTB, SECOND_EDGE_SLICE, high);
    }

    /// Drives a pin whose falling edges a PWM slice counts, if the pin is its input B (2.19.2);
    /// returns whether the pin falls.
    fn drive_interrupt(&mut self, pin: usize, slice: usize, high: bool) -> bool {
        if self.gpio.level(pin) == high {
            return false;
        }
        let counts = self.gpio.function(pin) == function::PWM && self.gpio.is_input(pin);
        if counts && !high {
            self.pwm.falling_edge(slice);
        }
        self.gpio.drive(pin, high);
        !high
    }

    fn follow_clkin(&mut self) {
        let is_connected = self.gpio.function(pin::CLKIN) == function::CLOCK;
        let hz = self.clocks.output_hz().filter(|_| is_connected);
        self.wire.converters.set_clock(self.clock.now(), hz);
    }

    fn follow_shutdown(&mut self) {
        let now = self.clock.now();
        let levels = [pin::SD, pin::SECOND_SD].map(|pin| self.gpio.level(pin));
        let [first, second] = self.wire.converters.set_shutdown(now, levels);
        if first {
            self.follow_interrupt(now.as_ps());
        }
        if second {
            self.follow_second_interrupt();
        }
    }

    /// Passes the levels of SDA and SCL to the bus while they are plain pins.
    fn follow_plain_bus(&mut self, now_ps: u64) {
        let gpio = &self.gpio;
        let is_plain = [pin::SCL, pin::SDA].map(|pin| gpio.function(pin) == function::SIO);
        let levels =
            (is_plain == [true; 2]).then(|| (!gpio.pulls_low(pin::SCL), !gpio.pulls_low(pin::SDA)));
        self.wire.plain(now_ps, levels);
        let outside_sda = !self.wire.sda_is_low(now_ps);
        let outside_scl = self.wire.scl_low_until(now_ps).is_none();
        for (pin, high) in [(pin::SDA, outside_sda), (pin::SCL, outside_scl)] {
            if self.gpio.level(pin) != high || self.gpio.pulls_low(pin) {
                self.gpio.drive(pin, high);
            }
        }
    }

    // ---- coil ----

    fn follow_bridge(&mut self, now_ps: u64) {
        let source = |pin, output| match self.gpio.function(pin) {
            function::PWM => InputSource::Pwm(output),
            _ => InputSource::Level(self.gpio.level(pin)),
        };
        let inputs = BridgeInputs {
            awake: self.gpio.level(pin::SLEEP),
            limit_low: self.gpio.pulls_low(pin::LIMIT),
            sources: [source(pin::IN1, 0), source(pin::IN2, 1)],
        };
        if inputs != self.coil.inputs() {
            self.run_coil(now_ps);
            self.coil.set_inputs(inputs);
        }
    }

    /// Runs the coil's circuit with the ADC and its DMA to a time, and reports the current to the
    /// plant.
    pub(crate) fn run_coil(&mut self, now_ps: u64) {
        loop {
            let report_ps = self.coil.report_ps();
            if report_ps > now_ps {
                break;
            }
            self.run_circuit(report_ps);
            self.coil.report(report_ps, &mut self.wire.converters.first);
        }
        self.run_circuit(now_ps);
    }

    fn run_circuit(&mut self, now_ps: u64) {
        let wave = self.pwm.wave(COIL_SLICE);
        self.skip_conversions(now_ps);
        while let Some(sampled_ps) = self.adc.next_ps() {
            if let Some(code) = self.adc.take_result(now_ps) {
                self.store_result(code);
            }
            if sampled_ps > now_ps {
                break;
            }
            self.coil.advance(sampled_ps, &wave);
            self.check_analogue();
            match self.coil.convert(self.adc.next_input()) {
                Some(code) => self.adc.sample(code),
                None => {
                    self.adc.skip(1);
                    self.fail("a conversion of an input that is not connected");
                }
            }
        }
        self.coil.advance(now_ps, &wave);
        let high = !self.coil.has_fault();
        if self.gpio.level(pin::FAULT) != high {
            self.gpio.drive(pin::FAULT, high);
        }
    }

    /// Checks that an analogue input has neither digital drivers nor pulls (4.9, erratum
    /// RP2040-E6).
    fn check_analogue(&mut self) {
        if !pin::ANALOGUE.iter().all(|&pin| self.gpio.is_analogue(pin)) {
            self.fail("an analogue voltage at a pad with a digital driver or a pull");
        }
    }

    /// Skips conversions that the firmware would not read: unless the control interrupt is on, it does
    /// not read each result, and later ones overwrite it.
    fn skip_conversions(&mut self, now_ps: u64) {
        let waiting = self.adc.sampled_by(now_ps);
        let are_read = self.pwm.interrupts() || !self.adc.feeds_dma();
        if are_read || waiting <= LAST_CONVERSIONS {
            return;
        }
        let skipped = waiting - LAST_CONVERSIONS;
        // Fits in 32 bits: at most one second of conversions, at 500 000 per second.
        self.dma.skip(skipped as u32);
        self.adc.skip(skipped);
    }

    /// Stores a result in the FIFO, and from there in memory. If the FIFO always requests, DMA
    /// would copy a result hundreds of times until the next one; here it makes as many copies as
    /// fill any ring buffer.
    fn store_result(&mut self, code: u16) {
        self.adc.put_into_fifo(code);
        for _ in 0..LAST_CONVERSIONS {
            if !self.adc.asks_dma() {
                return;
            }
            let Some(address) = self.dma.next() else {
                return;
            };
            let code = self.adc.take_from_fifo();
            self.memory.set_half_word(address, code);
        }
    }

    // ---- trace ----

    fn follow_trace(&mut self, now_ps: u64) {
        let Some(trace) = &mut self.trace else {
            return;
        };
        for change in self.wire.changes.iter_mut().flat_map(|all| all.drain(..)) {
            trace.push(change);
        }
        trace.sample_pins(now_ps, &self.gpio, self.i2c.is_off_the_wires());
        let current_a = self.coil.circuit().current_a();
        trace.is(now_ps, Signal::Current, SignalValue::Real(current_a));
        trace.sample_pulses(now_ps, &self.gpio, &self.pwm);
    }

    /// Traces the bridge's inputs up to a time, before they change.
    pub(super) fn trace_pulses(&mut self, until_ps: u64) {
        if let Some(trace) = &mut self.trace {
            trace.sample_pulses(until_ps, &self.gpio, &self.pwm);
        }
    }
}
