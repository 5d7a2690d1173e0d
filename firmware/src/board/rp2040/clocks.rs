//! Clocks: 200 MHz from the crystal for the system, 48 MHz for ADC and USB, the clock of the LDC, and
//! the core voltage that 200 MHz needs.
//!
//! Crystal and PLLs use the typestates of `rp2040-hal`, so no step can be skipped. Each is polled with a
//! time limit here; the HAL's own set-up waits without one
//! (docs/decisions/0063-hal-and-own-registers.md).

use cortex_m::asm::delay;
use palpate_node::board::CORE_HZ;
use rp2040_hal::fugit::HertzU32;
use rp2040_hal::pll::{PLLConfig, PhaseLockedLoop, PhaseLockedLoopDevice};
use rp2040_hal::vreg::set_voltage;
use rp2040_hal::xosc::CrystalOscillator;
use rp2040_pac::vreg_and_chip_reset::vreg::VSEL_A;
use rp2040_pac::{CLOCKS, PLL_SYS, PLL_USB, RESETS, ROSC, VREG_AND_CHIP_RESET, WATCHDOG, XOSC};

use super::wait;

const CRYSTAL_MHZ: u32 = 12;
const CRYSTAL: HertzU32 = HertzU32::MHz(CRYSTAL_MHZ);
/// Typical frequency of the ring oscillator, in MHz, as the start-up code sets it (`code_in_memory`); a
/// chip may have 14 to 96 (2.17.1).
const RING_MHZ: u32 = 52;
/// Register ROSC.DIV: divide by 32 (2.17.8). After a watchdog reset the boot ROM runs from the ring
/// oscillator and tries 128 times to read its second stage from flash, which gives no data during an
/// erase. With this slow clock the tries last 554 ms at the fastest ring frequency, longer than an
/// erase, 400 ms at most (docs/decisions/0064-200-megahertz.md).
const RING_BY_32: u32 = 0xAA0;
/// Time in microseconds from setting the core voltage to switching to the clock that needs it. The SDK
/// waits 1 ms.
const VOLTAGE_SETTLES_US: u32 = 1_500;
/// Field BOD.VSEL: brown-out detection at 1.032 V (2.12.8). Two levels higher, it would lie within the
/// tolerances of regulator and detector.
const BROWN_OUT: u8 = 0b1101;
/// Register CLK_REF_SELECTED, one bit per source (2.15.7): the ring oscillator runs.
const REF_IS_RING: u32 = 1 << 0;
/// Register CLK_REF_SELECTED: the crystal runs.
const REF_IS_CRYSTAL: u32 = 1 << 2;
/// Register CLK_SYS_SELECTED: the reference clock runs.
const SYS_IS_REF: u32 = 1 << 0;
/// Register CLK_SYS_SELECTED: the auxiliary source, the system PLL, runs.
const SYS_IS_AUX: u32 = 1 << 1;

/// PLL of the system: 12 MHz * 100 / (6 * 1) = 200 MHz; VCO at 1200 MHz.
const SYSTEM: PLLConfig = pll(CORE_HZ, 6, 1);
/// PLL of ADC and USB: 12 MHz * 120 / (6 * 5) = 48 MHz; VCO at 1440 MHz.
const CONVERTER: PLLConfig = pll(48_000_000, 6, 5);

/// Returns the PLL setting for an output frequency and its two post-dividers. An output that is not a
/// whole multiple of the crystal frequency, or a VCO frequency out of range, does not compile (datasheet
/// 2.18.2).
const fn pll(output_hz: u32, post_div1: u8, post_div2: u8) -> PLLConfig {
    let oscillator_hz = output_hz * post_div1 as u32 * post_div2 as u32;
    assert!(oscillator_hz.is_multiple_of(CRYSTAL.raw()));
    assert!(oscillator_hz >= 750_000_000 && oscillator_hz <= 1_600_000_000);
    PLLConfig {
        vco_freq: HertzU32::from_raw(oscillator_hz),
        refdiv: 1,
        post_div1,
        post_div2,
    }
}

/// Starts all clocks. Returns `false` if one does not start: processor and timer then run from the
/// clocks that did.
#[allow(unsafe_code)]
pub fn set_up(
    resets: &mut RESETS,
    clocks: &CLOCKS,
    crystal: XOSC,
    system: PLL_SYS,
    converter: PLL_USB,
    regulator: &mut VREG_AND_CHIP_RESET,
    watchdog: &WATCHDOG,
) -> bool {
    let runs = start_crystal(clocks, crystal)
        .and_then(|()| raise_core_voltage(regulator))
        .and_then(|()| start_plls(resets, system, converter))
        .and_then(|()| distribute(clocks))
        .is_some();
    // Without the timer's tick no task could wait and no fault would be reported. The tick is as
    // accurate as the clock from which it is divided.
    let mhz = if clocks.clk_ref_selected().read().bits() == REF_IS_CRYSTAL {
        // SAFETY: no part runs from the ring oscillator any more; no other code writes this register.
        unsafe { (*ROSC::ptr()).div().write(|w| w.bits(RING_BY_32)) };
        CRYSTAL_MHZ
    } else {
        RING_MHZ
    };
    watchdog.tick().write(|w| {
        // SAFETY: within the field of nine bits.
        let w = unsafe { w.cycles().bits(mhz as u16) };
        w.enable().set_bit()
    });
    runs
}

/// Polls a condition with a time limit; `None` if it does not hold in time.
fn within_time(holds: impl FnMut() -> bool) -> Option<()> {
    wait(holds).then_some(())
}

/// Switches from the ring oscillator, which always runs, to the crystal (2.15.6, 2.16.3).
fn start_crystal(clocks: &CLOCKS, crystal: XOSC) -> Option<()> {
    clocks.clk_sys_ctrl().write(|w| w.src().clk_ref());
    within_time(|| clocks.clk_sys_selected().read().bits() == SYS_IS_REF)?;
    clocks.clk_ref_ctrl().write(|w| w.src().rosc_clksrc_ph());
    within_time(|| clocks.clk_ref_selected().read().bits() == REF_IS_RING)?;
    let crystal = CrystalOscillator::new(crystal)
        .initialize(CRYSTAL, 1)
        .ok()?;
    within_time(|| crystal.await_stabilization().is_ok())?;
    clocks.clk_ref_ctrl().write(|w| w.src().xosc_clksrc());
    within_time(|| clocks.clk_ref_selected().read().bits() == REF_IS_CRYSTAL)
}

/// Sets the core voltage to 1.15 V, which clocks above 133 MHz need, waits until it has settled, and
/// enables the brown-out reset. Call it while the processor runs at the crystal's frequency.
#[allow(unsafe_code)]
fn raise_core_voltage(regulator: &mut VREG_AND_CHIP_RESET) -> Option<()> {
    set_voltage(regulator, VSEL_A::VOLTAGE1_15);
    delay(VOLTAGE_SETTLES_US * CRYSTAL_MHZ);
    within_time(|| regulator.vreg().read().rok().bit_is_set())?;
    // SAFETY: within the field of four bits.
    regulator
        .bod()
        .modify(|_, w| unsafe { w.vsel().bits(BROWN_OUT) });
    Some(())
}

fn start_plls(resets: &mut RESETS, system: PLL_SYS, converter: PLL_USB) -> Option<()> {
    resets
        .reset()
        .modify(|_, w| w.pll_sys().set_bit().pll_usb().set_bit());
    resets
        .reset()
        .modify(|_, w| w.pll_sys().clear_bit().pll_usb().clear_bit());
    // Waits here first, since the HAL waits for the end of this reset without a time limit.
    within_time(|| {
        let done = resets.reset_done().read();
        done.pll_sys().bit_is_set() && done.pll_usb().bit_is_set()
    })?;
    start_pll(resets, system, SYSTEM)?;
    start_pll(resets, converter, CONVERTER)
}

/// Switches the VCO on and keeps the dividers off until it has locked (2.18.3).
fn start_pll(
    resets: &mut RESETS,
    pll: impl PhaseLockedLoopDevice,
    setting: PLLConfig,
) -> Option<()> {
    let pll = PhaseLockedLoop::new(pll, CRYSTAL, setting).ok()?;
    let pll = pll.initialize(resets);
    let mut locked = None;
    within_time(|| {
        locked = pll.await_lock().ok();
        locked.is_some()
    })?;
    pll.get_locked(locked?);
    Some(())
}

/// Clocks processor and peripherals from the system PLL, and ADC and USB from the other PLL.
fn distribute(clocks: &CLOCKS) -> Option<()> {
    clocks
        .clk_sys_ctrl()
        .write(|w| w.auxsrc().clksrc_pll_sys().src().clksrc_clk_sys_aux());
    within_time(|| clocks.clk_sys_selected().read().bits() == SYS_IS_AUX)?;
    clocks
        .clk_peri_ctrl()
        .write(|w| w.auxsrc().clk_sys().enable().set_bit());
    clocks
        .clk_adc_ctrl()
        .write(|w| w.auxsrc().clksrc_pll_usb().enable().set_bit());
    clocks
        .clk_usb_ctrl()
        .write(|w| w.auxsrc().clksrc_pll_usb().enable().set_bit());
    Some(())
}

/// Outputs the divided processor clock on the CLKIN of both LDCs. If this divisor is already set, the
/// output continues without a gap. The duty cycle is 50 % for an odd divisor as well.
#[allow(unsafe_code)]
pub fn send_out(clocks: &rp2040_pac::clocks::RegisterBlock, divisor: u32) {
    let (control, division) = (clocks.clk_gpout0_ctrl(), clocks.clk_gpout0_div());
    let before = division.read().int().bits();
    if before == divisor && control.read().enable().bit_is_set() {
        return;
    }
    // The divider may change only after the output has stopped, which takes a few of its own periods
    // (2.15.3.2; the SDK's `clock_configure` waits for three).
    control.modify(|_, w| w.enable().clear_bit());
    delay(3 * before);
    // SAFETY: within the field of 24 bits.
    division.write(|w| unsafe { w.int().bits(divisor) });
    control.write(|w| w.auxsrc().clk_sys().dc50().set_bit());
    control.modify(|_, w| w.enable().set_bit());
}
