//! I2C block and its pins: set-up, and recovery when a wire is held low.

#![allow(unsafe_code)]

use cortex_m::asm::delay;
use palpate_node::board::cycles;
use rp2040_pac::{I2C0, RESETS};

use super::engine;
use super::timing::{CONTROL, HIGH, HOLD, LOW, SPIKE};
use crate::board::pins::{self, Function};
use crate::board::rp2040::wait;

/// Bit of an outcome's `cause` for a transaction that exceeded its time limit: the bus was freed. The
/// block itself does not use this bit or the two that follow.
pub const FREED: u32 = 1 << 20;
/// Bit of an outcome's `cause`, as [`FREED`]: SDA is stuck low.
pub const DATA_STUCK: u32 = 1 << 21;
/// Bit of an outcome's `cause`, as [`FREED`]: SCL is stuck low.
pub const CLOCK_STUCK: u32 = 1 << 22;

/// Half a period of the SCL pulses that free the bus, in cycles: 100 kHz.
const HALF_PULSE: u32 = cycles(5_000);
/// Largest number of these pulses: a target interrupted within a byte releases SDA after nine clocks at
/// most.
const PULSES: u32 = 9;
/// Longest settling time of a wire of the bus, in cycles: 20 us.
const SETTLE: u32 = cycles(20_000);

/// Sets the block up from reset, without a target address.
pub fn set_up() {
    // SAFETY: no transaction runs: the block is in reset or was just taken out of it, and the
    // engine knows that it is being recovered. Values are within the fields.
    unsafe {
        let resets = &*RESETS::ptr();
        resets.reset().modify(|_, w| w.i2c0().set_bit());
        resets.reset().modify(|_, w| w.i2c0().clear_bit());
        wait(|| resets.reset_done().read().i2c0().bit_is_set());
        let i2c = &*I2C0::ptr();
        i2c.ic_con().write(|w| w.bits(CONTROL));
        i2c.ic_fs_spklen().write(|w| w.bits(SPIKE));
        i2c.ic_fs_scl_lcnt().write(|w| w.bits(LOW));
        i2c.ic_fs_scl_hcnt().write(|w| w.bits(HIGH));
        i2c.ic_sda_hold().write(|w| w.bits(HOLD));
        i2c.ic_tx_tl().write(|w| w.bits(4));
        i2c.ic_rx_tl().write(|w| w.bits(7));
        i2c.ic_intr_mask().write(|w| w.bits(0));
        i2c.ic_enable().write(|w| w.bits(1));
    }
}

/// If the running transaction exceeds its time limit, frees the bus and lets the transaction fail. A
/// target that was interrupted within a byte releases SDA after nine clocks at most, and a STOP ends its
/// transaction (I2C specification 3.1.16).
pub fn clear_overdue() {
    if !engine::begin_recovery() {
        return;
    }
    set_up();
    pins::open_drain(pins::SDA, false);
    pins::open_drain(pins::SCL, false);
    pins::set_function(pins::SDA, Function::Sio);
    pins::set_function(pins::SCL, Function::Sio);
    delay(HALF_PULSE);
    let cause = pulse_until_free();
    pins::set_function(pins::SDA, Function::I2c);
    pins::set_function(pins::SCL, Function::I2c);
    engine::end_recovery(cause);
}

/// Sends pulses until the bus is free; returns the result as a cause.
fn pulse_until_free() -> u32 {
    if !pins::is_high(pins::SCL) {
        return CLOCK_STUCK;
    }
    for _ in 0..PULSES {
        if pins::is_high(pins::SDA) {
            break;
        }
        pulse();
    }
    // STOP: SDA rises while SCL is high.
    pins::open_drain(pins::SCL, true);
    delay(HALF_PULSE);
    pins::open_drain(pins::SDA, true);
    delay(HALF_PULSE);
    pins::open_drain(pins::SCL, false);
    delay(HALF_PULSE);
    pins::open_drain(pins::SDA, false);
    delay(SETTLE);
    if !pins::is_high(pins::SDA) {
        return DATA_STUCK;
    }
    FREED
}

fn pulse() {
    pins::open_drain(pins::SCL, true);
    delay(HALF_PULSE);
    pins::open_drain(pins::SCL, false);
    delay(HALF_PULSE);
}
