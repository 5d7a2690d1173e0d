//! The I2C block and its pins: set up, and freed when something holds a wire.

#![allow(unsafe_code)]

use cortex_m::asm::delay;
use rp2040_pac::{I2C0, RESETS};

use crate::board::pico::{self, Function};
use crate::board::{CORE_MHZ, wait};
use crate::bus::BusError;

/// IC_CON: master, fast mode, repeated STARTs, no target.
const CONTROL: u32 = 0x65;
/// Spikes up to 50 ns are filtered (I2C specification, table 10): six clocks.
const SPIKE: u32 = 6;
/// SCL low: the count plus one clock is 1.375 us, at least 1.3 us whatever its fall takes.
const LOW: u32 = 164;
/// SCL high: the count plus the filter and seven clocks (datasheet 4.3.14.2). With a low time of
/// 165 clocks and a rise of [`RISE`] clocks the period is 300 clocks of 120 MHz, 400 kHz.
const HIGH: u32 = 300 - (LOW + 1) - RISE - SPIKE - 7;
/// Rise of SCL in clocks: 150 ns, with 2.2 kiloohm and 80 pF. A faster one makes the bus faster
/// than 400 kHz by up to 6 %; a slower one makes it slower.
const RISE: u32 = 18;
/// SDA changes 300 ns after SCL falls.
const HOLD: u32 = 36;
/// Half a period of the pulses that free the bus: 100 kHz.
const HALF_PULSE: u32 = 5 * CORE_MHZ;
const PULSES: u32 = 9;
/// How long a wire may take to be free.
const SETTLE: u32 = 20 * CORE_MHZ;

/// Sets the block up from reset, for one target address.
pub fn set_up(address: u8) {
    // SAFETY: no transaction runs: the block is in reset or was just taken out of it, and the
    // caller resets the engine. Values are within the fields.
    unsafe {
        let resets = &*RESETS::ptr();
        resets.reset().modify(|_, w| w.i2c0().set_bit());
        resets.reset().modify(|_, w| w.i2c0().clear_bit());
        wait(|| resets.reset_done().read().i2c0().bit_is_set());
        let i2c = &*I2C0::ptr();
        i2c.ic_con().write(|w| w.bits(CONTROL));
        i2c.ic_tar().write(|w| w.bits(u32::from(address)));
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

/// Frees the bus: a target that was cut off within a byte lets go of SDA after nine clocks at
/// most, and a STOP ends what it took part in (I2C specification 3.1.16).
pub fn clear(address: u8) -> Result<(), BusError> {
    crate::bus::engine::forget();
    set_up(address);
    pico::open_drain(pico::SDA, false);
    pico::open_drain(pico::SCL, false);
    pico::set_function(pico::SDA, Function::Sio);
    pico::set_function(pico::SCL, Function::Sio);
    delay(HALF_PULSE);
    let result = pulse_until_free();
    pico::set_function(pico::SDA, Function::I2c);
    pico::set_function(pico::SCL, Function::I2c);
    result
}

fn pulse_until_free() -> Result<(), BusError> {
    if !pico::is_high(pico::SCL) {
        return Err(BusError::ClockStuck);
    }
    for _ in 0..PULSES {
        if pico::is_high(pico::SDA) {
            break;
        }
        pulse();
    }
    // STOP: SDA rises while SCL is high.
    pico::open_drain(pico::SCL, true);
    delay(HALF_PULSE);
    pico::open_drain(pico::SDA, true);
    delay(HALF_PULSE);
    pico::open_drain(pico::SCL, false);
    delay(HALF_PULSE);
    pico::open_drain(pico::SDA, false);
    delay(SETTLE);
    if !pico::is_high(pico::SDA) {
        return Err(BusError::DataStuck);
    }
    Ok(())
}

fn pulse() {
    pico::open_drain(pico::SCL, true);
    delay(HALF_PULSE);
    pico::open_drain(pico::SCL, false);
    delay(HALF_PULSE);
}
