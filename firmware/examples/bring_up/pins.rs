//! Pins of the converter, and those of the bridge, which stay off. The numbers are those of
//! docs/firmware.md.

use rp2040_pac::{IO_BANK0, PADS_BANK0, Peripherals, SIO};

use crate::waiting::{pause, wait};

const SDA: usize = 4;
const SCL: usize = 5;
const INTB: usize = 7;
const SHUTDOWN: usize = 8;
const BRIDGE: [usize; 3] = [16, 17, 18];
const CLKIN: usize = 21;

/// Pad register PADS: input on, Schmitt trigger, 4 mA; one of the two pulls is added.
const PAD: u32 = 1 << 6 | 1 << 4 | 1 << 1;
const PULL_UP: u32 = 1 << 3;
const PULL_DOWN: u32 = 1 << 2;
/// Pin function (RP2040 datasheet 2.19.2): I2C block.
const I2C: u32 = 3;
/// Pin function: level set by the processor (SIO).
const PROCESSOR: u32 = 5;
/// Pin function: clock output.
const CLOCK: u32 = 8;
/// Bit of register INTR0: a falling edge of INTB has occurred.
const EDGE: u32 = 1 << (4 * INTB + 2);
/// Half a period of the SCL pulses that free the bus, in microseconds.
const HALF_PULSE_US: u32 = 5;

fn sio() -> &'static rp2040_pac::sio::RegisterBlock {
    // SAFETY: one core, no interrupts; levels change by set and clear registers.
    unsafe { &*SIO::ptr() }
}

fn give(pin: usize, pull: u32, function: u32) {
    // SAFETY: any pad setting and any function of the two blocks is allowed; pins are below 30.
    unsafe {
        (*PADS_BANK0::ptr())
            .gpio(pin.min(29))
            .write(|w| w.bits(PAD | pull));
        (*IO_BANK0::ptr())
            .gpio(pin.min(29))
            .gpio_ctrl()
            .write(|w| w.bits(function));
    }
}

fn set(pin: usize, high: bool) {
    // SAFETY: only this pin's bit is written.
    unsafe {
        if high {
            sio().gpio_out_set().write(|w| w.bits(1 << pin));
        } else {
            sio().gpio_out_clr().write(|w| w.bits(1 << pin));
        }
    }
}

fn drive(pin: usize, on: bool) {
    // SAFETY: only this pin's bit is written.
    unsafe {
        if on {
            sio().gpio_oe_set().write(|w| w.bits(1 << pin));
        } else {
            sio().gpio_oe_clr().write(|w| w.bits(1 << pin));
        }
    }
}

fn is_high(pin: usize) -> bool {
    sio().gpio_in().read().bits() >> pin & 1 == 1
}

/// Takes the blocks out of reset and sets the function of every pin. The bridge is off, the converter in
/// shutdown.
pub fn set_up(device: &Peripherals) {
    let resets = &device.RESETS;
    resets
        .reset()
        .modify(|_, w| w.io_bank0().clear_bit().pads_bank0().clear_bit());
    wait(|| {
        let done = resets.reset_done().read();
        done.io_bank0().bit_is_set() && done.pads_bank0().bit_is_set()
    });
    for pin in BRIDGE {
        set(pin, false);
        drive(pin, true);
        give(pin, PULL_DOWN, PROCESSOR);
    }
    set(SHUTDOWN, true);
    drive(SHUTDOWN, true);
    give(SHUTDOWN, PULL_DOWN, PROCESSOR);
    give(INTB, PULL_UP, PROCESSOR);
    give(CLKIN, 0, CLOCK);
    for pin in [SDA, SCL] {
        give(pin, PULL_UP, I2C);
    }
}

/// Sets the converter's shutdown pin.
pub fn shut_down(high: bool) {
    set(SHUTDOWN, high);
}

/// Returns the level of INTB.
pub fn interrupt_is_high() -> bool {
    is_high(INTB)
}

/// Returns the level of SDA.
pub fn data_is_high() -> bool {
    is_high(SDA)
}

/// Returns whether INTB has fallen since [`forget_edge`].
pub fn edge_came() -> bool {
    // SAFETY: reading changes nothing.
    unsafe { (*IO_BANK0::ptr()).intr(0).read().bits() & EDGE != 0 }
}

/// Clears the recorded edge of INTB.
pub fn forget_edge() {
    // SAFETY: clears this edge only.
    unsafe { (*IO_BANK0::ptr()).intr(0).write(|w| w.bits(EDGE)) };
}

/// Sends `count` pulses of SCL with SDA released, and a STOP.
pub fn pulse(count: u8) {
    for pin in [SDA, SCL] {
        set(pin, false);
        drive(pin, false);
        give(pin, PULL_UP, PROCESSOR);
    }
    let low = |pin: usize, low: bool| {
        drive(pin, low);
        pause(HALF_PULSE_US);
    };
    for _ in 0..count {
        low(SCL, true);
        low(SCL, false);
    }
    low(SCL, true);
    low(SDA, true);
    low(SCL, false);
    low(SDA, false);
    for pin in [SDA, SCL] {
        give(pin, PULL_UP, I2C);
    }
}
