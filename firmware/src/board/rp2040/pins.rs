//! Pins of the Raspberry Pi Pico. For the wiring see docs/firmware.md.

#![allow(unsafe_code)]

use palpate_node::board::Clkin;
use palpate_node::converter::CONVERTERS;
use rp2040_pac::{IO_BANK0, PADS_BANK0, PWM, SIO};

use super::clocks;

/// Pin of SDA, the I2C data.
pub const SDA: usize = 4;
/// Pin of SCL, the I2C clock.
pub const SCL: usize = 5;
/// INTB of a converter: low while a result waits.
pub struct IntbLine {
    /// Pin number.
    pub pin: usize,
    /// PWM slice that counts its edges, on input B.
    slice: usize,
}

impl IntbLine {
    /// Returns the index of the register of INTR, INTE or INTS for this pin, and the bit of its falling
    /// edge.
    #[inline(always)]
    pub const fn falling(&self) -> (usize, u32) {
        // At most 3, so the index is always within the four registers.
        ((self.pin / 8) & 3, 1 << (4 * (self.pin % 8) + 2))
    }

    /// Returns the slice, one of the eight.
    #[inline(always)]
    pub const fn slice(&self) -> usize {
        self.slice & 7
    }
}

/// INTB of the first and the second converter.
pub const INTB_LINES: [IntbLine; CONVERTERS] =
    [IntbLine { pin: 7, slice: 3 }, IntbLine { pin: 9, slice: 4 }];
/// Shutdown of the first and the second converter: high shuts down.
pub const SHUTDOWN: [usize; CONVERTERS] = [8, 10];
/// Pin of the H-bridge's first input.
pub const IN1: usize = 16;
/// Pin of the H-bridge's second input.
pub const IN2: usize = 17;
/// Enable of the H-bridge: low switches it off.
pub const BRIDGE_ENABLE: usize = 18;
/// Fault output of the H-bridge: low on a fault.
pub const BRIDGE_FAULT: usize = 19;
/// Output that selects the current limit of the H-bridge: low reduces the limit, for the test of the
/// limit.
pub const BRIDGE_LIMIT: usize = 20;
/// Pin of CLKIN, the clock of the converters.
pub const CLKIN: usize = 21;
/// Pin of the LED.
pub const LED: usize = 25;
/// Analogue inputs: coil current, thermistor, supply, and a third of VSYS, which a Pico connects to ADC
/// input 3. `control` reads them, in the order of its ring.
pub const ANALOGUE: [usize; 4] = [26, 27, 28, 29];
/// The PWM slice of the bridge: IN1 is its output A, IN2 its output B (datasheet 4.5.2). `control` has
/// slice 1; slices 3 and 4 count the edges of INTB.
pub const COIL_SLICE: usize = 0;

/// Pad register PADS: input on, Schmitt trigger, 4 mA.
pub(super) const INPUT: u32 = 1 << 6 | 1 << 1 | 1 << 4;
/// Pad register PADS: pull-up.
pub(super) const PULL_UP: u32 = 1 << 3;
/// Pad register PADS: pull-down.
const PULL_DOWN: u32 = 1 << 2;
/// Pad register PADS: output driver off, input off, for analogue use.
pub(super) const ANALOGUE_PAD: u32 = 1 << 7;
/// Register PWM.CSR: count falling edges of input B.
const COUNT_FALLING: u32 = 3 << 4 | 1;

/// Function of a pin (datasheet 2.19.2).
#[derive(Clone, Copy)]
pub enum Function {
    /// I2C block.
    I2c = 3,
    /// PWM slice.
    Pwm = 4,
    /// Processor (SIO).
    Sio = 5,
    /// Clock output.
    Clock = 8,
}

fn io() -> &'static rp2040_pac::io_bank0::RegisterBlock {
    // SAFETY: each pin's register is written by its owner alone; INTR0 belongs to `engine`.
    unsafe { &*IO_BANK0::ptr() }
}

fn sio() -> &'static rp2040_pac::sio::RegisterBlock {
    // SAFETY: levels are changed through the set and clear registers, one pin at a time.
    unsafe { &*SIO::ptr() }
}

/// Highest pin number. All pin numbers in this file are at most this; limiting them to it lets the
/// compiler omit a panic path.
const LAST_PIN: usize = 29;

/// Selects the function of a pin.
pub fn set_function(pin: usize, function: Function) {
    // SAFETY: the number is one of the field's, and no override is set.
    unsafe {
        io().gpio(pin.min(LAST_PIN))
            .gpio_ctrl()
            .write(|w| w.bits(function as u32))
    };
}

pub(super) fn set_pad(pin: usize, bits: u32) {
    // SAFETY: any pad setting within the eight bits is allowed; the pin is the caller's.
    unsafe {
        (*PADS_BANK0::ptr())
            .gpio(pin.min(LAST_PIN))
            .write(|w| w.bits(bits))
    };
}

/// Returns the level of a pin.
#[inline(always)]
pub fn is_high(pin: usize) -> bool {
    sio().gpio_in().read().bits() >> pin & 1 == 1
}

/// Sets the level of an output.
pub fn set(pin: usize, high: bool) {
    // SAFETY: only this pin's bit is written.
    unsafe {
        if high {
            sio().gpio_out_set().write(|w| w.bits(1 << pin));
        } else {
            sio().gpio_out_clr().write(|w| w.bits(1 << pin));
        }
    }
}

/// Pulls a pin low, or releases it.
pub fn open_drain(pin: usize, low: bool) {
    set(pin, false);
    // SAFETY: only this pin's bit is written.
    unsafe {
        if low {
            sio().gpio_oe_set().write(|w| w.bits(1 << pin));
        } else {
            sio().gpio_oe_clr().write(|w| w.bits(1 << pin));
        }
    }
}

pub(super) fn output(pin: usize, high: bool) {
    set(pin, high);
    // SAFETY: only this pin's bit is written.
    unsafe { sio().gpio_oe_set().write(|w| w.bits(1 << pin)) };
    set_pad(pin, INPUT | PULL_DOWN);
    set_function(pin, Function::Sio);
}

pub(super) fn input(pin: usize, pull: u32) {
    open_drain(pin, false);
    set_pad(pin, INPUT | pull);
    set_function(pin, Function::Sio);
}

pub(super) fn set_up_converter_pins() {
    // The converter stays in shutdown until it is started, so none of its lines changes before.
    for pin in SHUTDOWN {
        output(pin, true);
    }
    for pin in [SDA, SCL] {
        input(pin, PULL_UP);
        set_function(pin, Function::I2c);
    }
    set_pad(CLKIN, INPUT | PULL_DOWN);
    set_function(CLKIN, Function::Clock);
    for line in &INTB_LINES {
        // Routes INTB to its edge counter; the interrupt reads the pad itself, with any pin function.
        input(line.pin, PULL_UP);
        set_function(line.pin, Function::Pwm);
        let (register, edge) = line.falling();
        // SAFETY: within the fields; the slice counts nothing else. INTR and INTE: the falling edges of
        // these pins alone.
        unsafe {
            let slice = (*PWM::ptr()).ch(line.slice());
            slice.top().write(|w| w.bits(0xFFFF));
            slice.csr().write(|w| w.bits(COUNT_FALLING));
            io().intr(register).write(|w| w.bits(u32::MAX));
            io().proc0_inte(register).write(|w| w.bits(edge));
        }
    }
}

/// Sets the clock of the converters. If this clock is already set, it continues without a gap.
pub fn set_clkin(clkin: Clkin) {
    // SAFETY: CLK_GPOUT0 is used for nothing else.
    let clocks = unsafe { &*rp2040_pac::CLOCKS::ptr() };
    clocks::send_out(clocks, clkin.divisor());
}

/// Returns the pin of a converter's INTB.
pub fn intb(converter: usize) -> usize {
    let line = INTB_LINES.get(converter);
    line.map_or(LAST_PIN, |line| line.pin)
}

/// Shuts a converter down, or lets it wake.
pub fn shut_down(converter: usize, off: bool) {
    if let Some(pin) = SHUTDOWN.get(converter) {
        set(*pin, off);
    }
}

/// INTB of a converter, read to find out what releases it.
pub struct IntbPin(pub usize);

impl embedded_hal::digital::ErrorType for IntbPin {
    type Error = core::convert::Infallible;
}

impl embedded_hal::digital::InputPin for IntbPin {
    fn is_high(&mut self) -> Result<bool, Self::Error> {
        Ok(is_high(self.0))
    }

    fn is_low(&mut self) -> Result<bool, Self::Error> {
        Ok(!is_high(self.0))
    }
}
