//! Why this run began, and what the next one is to know of its end: the processor's flags, and
//! memory that no start clears. What they mean is decided in [`palpate_procedure::boot`].

#![allow(unsafe_code)]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use palpate_procedure::boot::{self, Boot, NO_RECORD, RecordWords, ResetFlags};
use rp2040_pac::{PSM, TIMER, VREG_AND_CHIP_RESET, WATCHDOG};

pub use palpate_procedure::boot::End;

/// In a scratch register of the watchdog, which outlives its resets: it was started by this firmware.
const OWN_WATCHDOG: u32 = 0x5061_6C70;

#[repr(transparent)]
struct Place(UnsafeCell<MaybeUninit<RecordWords>>);

// SAFETY: written at the end of a run, with interrupts off, and at its start before they are on;
// `forget` is called from one task, and what it may be interrupted by ends the run.
unsafe impl Sync for Place {}

/// Named, so that a test finds it.
#[unsafe(export_name = "CRASH_RECORD")]
#[unsafe(link_section = ".uninit.crash")]
static KEPT: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

fn read() -> RecordWords {
    // SAFETY: every pattern of bits is a record's words; the pointer is to a static.
    unsafe { KEPT.0.get().cast::<RecordWords>().read_volatile() }
}

fn write(words: RecordWords) {
    // SAFETY: see `Place`.
    unsafe { KEPT.0.get().cast::<RecordWords>().write_volatile(words) };
}

/// Keeps the cause for the next run.
pub fn keep(end: &End<'_>) {
    // SAFETY: reading the raw timer has no effect on it.
    let uptime_ms = unsafe { (*TIMER::ptr()).timerawl().read().bits() } / 1_000;
    write(boot::record(end, &read(), uptime_ms));
}

/// Reads why this run began, and makes sure that a watchdog resets everything. Once, before
/// interrupts are on.
pub fn boot() -> Boot {
    // SAFETY: only this function and `mark_watchdog` use these registers.
    let flags = unsafe {
        (*PSM::ptr()).wdsel().write(|w| w.bits(0x1_FFFC));
        let watchdog = &*WATCHDOG::ptr();
        let reason = watchdog.reason().read();
        let chip = (*VREG_AND_CHIP_RESET::ptr()).chip_reset().read();
        ResetFlags {
            forced: reason.force().bit_is_set(),
            timed_out: reason.timer().bit_is_set(),
            is_own_watchdog: watchdog.scratch0().read().bits() == OWN_WATCHDOG,
            debugger: chip.had_psm_restart().bit_is_set(),
            pin: chip.had_run().bit_is_set(),
        }
    };
    let (boot, keep) = Boot::judge(flags, &read());
    write(keep);
    boot
}

/// The watchdog is the firmware's from now on.
pub fn mark_watchdog() {
    // SAFETY: one register that nothing else uses.
    unsafe {
        (*WATCHDOG::ptr())
            .scratch0()
            .write(|w| w.bits(OWN_WATCHDOG));
    }
}

/// The run has lasted: what the last one died of is not the first of a streak any more.
pub fn forget() {
    write(NO_RECORD);
}
