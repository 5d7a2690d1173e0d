//! Clocks: 120 MHz from the crystal for everything, 48 MHz for the ADC, and the LDC's own.

#![allow(unsafe_code)]

use rp2040_pac::{CLOCKS, PLL_SYS, PLL_USB, RESETS, WATCHDOG, XOSC, pll_sys};

use super::wait;

/// XOSC: 1 to 15 MHz, and the word that enables it (datasheet 2.16.7).
const CRYSTAL_ON: u32 = 0x00FA_BAA0;
/// 1 ms in units of 256 periods of 12 MHz (2.16.3).
const CRYSTAL_START: u32 = 47;
const CRYSTAL_MHZ: u32 = 12;
/// The ring oscillator after a reset, typically (2.17.1); 1.8 to 12 MHz.
const RING_MHZ: u32 = 6;
/// CTRL: enabled, and with an even duty for odd divisors.
const ENABLE: u32 = 1 << 11;
const EVEN_DUTY: u32 = 1 << 12;
/// CLK_GPOUT0_CTRL.AUXSRC: clk_sys.
const FROM_SYSTEM: u32 = 6 << 5;

/// What a PLL is set to: the crystal times `feedback` over the two divisors.
struct Setting {
    feedback: u32,
    first: u32,
    second: u32,
}

/// 12 MHz * 120 / (6 * 2) = 120 MHz, with the oscillator at 1440 MHz.
const SYSTEM: Setting = Setting {
    feedback: 120,
    first: 6,
    second: 2,
};
/// 12 MHz * 120 / (6 * 5) = 48 MHz.
const CONVERTER: Setting = Setting {
    feedback: 120,
    first: 6,
    second: 5,
};

/// Brings the clocks up. `false` if one does not run: the processor then goes on with what does.
pub fn set_up(
    resets: &RESETS,
    clocks: &CLOCKS,
    crystal: &XOSC,
    system: &PLL_SYS,
    converter: &PLL_USB,
    watchdog: &WATCHDOG,
) -> bool {
    // SAFETY: every value is within its field; the order is the datasheet's (2.15.6, 2.16.3,
    // 2.18.3), and nothing but this processor uses a clock yet.
    unsafe {
        // Onto the ring oscillator, which always runs, while the others are changed.
        clocks.clk_sys_ctrl().write(|w| w.bits(0));
        if !wait(|| clocks.clk_sys_selected().read().bits() == 1) {
            return false;
        }
        clocks.clk_ref_ctrl().write(|w| w.bits(0));
        if !wait(|| clocks.clk_ref_selected().read().bits() == 1) {
            return false;
        }
        crystal.startup().write(|w| w.bits(CRYSTAL_START));
        crystal.ctrl().write(|w| w.bits(CRYSTAL_ON));
        if !wait(|| crystal.status().read().stable().bit_is_set()) {
            return false;
        }
        clocks.clk_ref_ctrl().write(|w| w.bits(2));
        if !wait(|| clocks.clk_ref_selected().read().bits() == 1 << 2) {
            return false;
        }
        resets
            .reset()
            .modify(|_, w| w.pll_sys().set_bit().pll_usb().set_bit());
        resets
            .reset()
            .modify(|_, w| w.pll_sys().clear_bit().pll_usb().clear_bit());
        let done = || {
            let done = resets.reset_done().read();
            done.pll_sys().bit_is_set() && done.pll_usb().bit_is_set()
        };
        if !wait(done) || !lock(system, &SYSTEM) || !lock(converter, &CONVERTER) {
            return false;
        }
        clocks.clk_sys_ctrl().write(|w| w.bits(1));
        if !wait(|| clocks.clk_sys_selected().read().bits() == 1 << 1) {
            return false;
        }
        clocks.clk_peri_ctrl().write(|w| w.bits(ENABLE));
        clocks.clk_adc_ctrl().write(|w| w.bits(ENABLE));
        watchdog.tick().write(|w| w.bits(1 << 9 | CRYSTAL_MHZ));
    }
    true
}

/// Lets the timer count where [`set_up`] has failed: without it no task would wait, and nothing be
/// reported. Its microseconds are as good as what it counts.
pub fn count_what_runs(clocks: &CLOCKS, watchdog: &WATCHDOG) {
    let is_crystal = clocks.clk_ref_selected().read().bits() == 1 << 2;
    let mhz = if is_crystal { CRYSTAL_MHZ } else { RING_MHZ };
    // SAFETY: within the field.
    unsafe { watchdog.tick().write(|w| w.bits(1 << 9 | mhz)) };
}

fn lock(pll: &pll_sys::RegisterBlock, setting: &Setting) -> bool {
    // SAFETY: every value is within its field; see `set_up`.
    unsafe {
        pll.cs().write(|w| w.bits(1));
        pll.fbdiv_int().write(|w| w.bits(setting.feedback));
        // Oscillator on, dividers off until it is locked.
        pll.pwr().write(|w| w.bits(1 << 3));
        if !wait(|| pll.cs().read().lock().bit_is_set()) {
            return false;
        }
        pll.prim()
            .write(|w| w.bits(setting.first << 16 | setting.second << 12));
        pll.pwr().write(|w| w.bits(0));
    }
    true
}

/// Sends the processor's clock, divided, to the LDC's CLKIN.
pub fn send_out(clocks: &rp2040_pac::clocks::RegisterBlock, divisor: u32) {
    // SAFETY: every value is within its field; the output is stopped while its divisor changes.
    unsafe {
        clocks.clk_gpout0_ctrl().write(|w| w.bits(0));
        clocks.clk_gpout0_div().write(|w| w.bits(divisor << 8));
        clocks
            .clk_gpout0_ctrl()
            .write(|w| w.bits(ENABLE | EVEN_DUTY | FROM_SYSTEM));
    }
}
