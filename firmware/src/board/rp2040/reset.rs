//! Reset cause from the chip's own flags, and resets through the watchdog, which resets every block that
//! it can.

#![allow(unsafe_code)]

use palpate_procedure::boot::ResetFlags;
use rp2040_pac::{PSM, TIMER, VREG_AND_CHIP_RESET, WATCHDOG};

use crate::supervision::WATCHDOG_US;

/// Mark in a watchdog scratch register that this firmware started the watchdog; the register keeps its
/// value in a watchdog reset.
const OWN_WATCHDOG: u32 = 0x5061_6C70;
/// Mask of the blocks that a watchdog reset resets: all except the two oscillators.
const ALL_STAGES: u32 = 0x1_FFFC;

/// Reads the reset flags and makes a watchdog reset reset all blocks. Call it once, before interrupts
/// are on.
pub fn flags() -> ResetFlags {
    // SAFETY: nothing else uses these registers yet.
    let (sequence, watchdog, chip) = unsafe {
        (
            &*PSM::ptr(),
            &*WATCHDOG::ptr(),
            &*VREG_AND_CHIP_RESET::ptr(),
        )
    };
    // SAFETY: within the field of 17 bits.
    sequence.wdsel().write(|w| unsafe { w.bits(ALL_STAGES) });
    let reason = watchdog.reason().read();
    let chip = chip.chip_reset().read();
    ResetFlags {
        forced: reason.force().bit_is_set(),
        timed_out: reason.timer().bit_is_set(),
        is_own_watchdog: watchdog.scratch0().read().bits() == OWN_WATCHDOG,
        debugger: chip.had_psm_restart().bit_is_set(),
        pin: chip.had_run().bit_is_set(),
    }
}

/// Returns the time since boot, in milliseconds, from the lower half of the microsecond timer.
pub fn uptime_ms() -> u32 {
    // SAFETY: reading the raw timer has no effect on it.
    let timer = unsafe { &*TIMER::ptr() };
    timer.timerawl().read().bits() / 1_000
}

/// Switches the bridge off and resets the chip into its boot loader, which receives an image over USB
/// and starts it.
pub fn restart_into_boot_loader() -> ! {
    // SAFETY: this run ends here.
    let mark = unsafe { &*WATCHDOG::ptr() }.scratch0();
    // Clears the mark: the boot loader starts the new image through the watchdog, and that reset is not
    // one of this firmware's.
    // SAFETY: any word may be kept there.
    mark.write(|w| unsafe { w.bits(0) });
    rp2040_hal::rom_data::reset_to_usb_boot(0, 0)
}

/// Resets the chip.
pub fn restart() -> ! {
    // SAFETY: this run ends here.
    let watchdog = unsafe { &*WATCHDOG::ptr() };
    loop {
        watchdog.ctrl().write(|w| w.trigger().set_bit());
    }
}

/// Watchdog, fed while every task checks in.
pub struct Watchdog(WATCHDOG);

impl Watchdog {
    /// Starts the watchdog if the clocks run. Without them the processor is too slow to feed it, and the
    /// coil is never driven. The watchdog keeps counting while a debugger stops the processor: a coil
    /// must not stay on at a breakpoint.
    pub fn start(registers: WATCHDOG, clocks_run: bool) -> Self {
        let watchdog = Self(registers);
        if !clocks_run {
            return watchdog;
        }
        let mark = watchdog.0.scratch0();
        // SAFETY: any word may be kept there.
        mark.write(|w| unsafe { w.bits(OWN_WATCHDOG) });
        watchdog.feed();
        watchdog.0.ctrl().write(|w| {
            let w = w.pause_dbg0().clear_bit().pause_dbg1().clear_bit();
            w.pause_jtag().clear_bit().enable().set_bit()
        });
        watchdog
    }

    /// Restarts the count of [`WATCHDOG_US`]. The watchdog counts two per microsecond (erratum
    /// RP2040-E1).
    pub fn feed(&self) {
        const { assert!(2 * WATCHDOG_US < 1 << 24) };
        let load = self.0.load();
        // SAFETY: within the field of 24 bits.
        load.write(|w| unsafe { w.load().bits(2 * WATCHDOG_US) });
    }
}
