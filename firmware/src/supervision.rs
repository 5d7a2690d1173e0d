//! The watchdog, fed only when every task has checked in.

use core::sync::atomic::{AtomicBool, Ordering};

/// From the last feeding to the reset. With the boot ROM's time the bridge is off within 60 ms of
/// a hang; the outputs themselves fall with the reset.
pub const WATCHDOG_US: u32 = 40_000;
/// How often the supervisor polls. Every task has to check in between two polls.
pub const PERIOD_MS: u64 = 10;

/// Tasks that are supervised. The supervisor itself feeds, and so needs no place here.
#[derive(Clone, Copy)]
pub enum Task {
    /// Reads the converter.
    Sensing,
    /// Drives the coil.
    Coil,
    /// Does what the instrument does.
    Instrument,
}

const TASKS: usize = 3;

static RECEIVED: [AtomicBool; TASKS] = [const { AtomicBool::new(false) }; TASKS];

/// A task lives.
pub fn check_in(task: Task) {
    if let Some(received) = RECEIVED.get(task as usize) {
        received.store(true, Ordering::Relaxed);
    }
}

/// Whether all tasks have checked in since the last time that they had.
pub fn all_have_checked_in() -> bool {
    if !RECEIVED
        .iter()
        .all(|received| received.load(Ordering::Relaxed))
    {
        return false;
    }
    for received in &RECEIVED {
        received.store(false, Ordering::Relaxed);
    }
    true
}

/// The hardware behind it.
pub struct Watchdog(rp2040_pac::WATCHDOG);

#[allow(unsafe_code)]
impl Watchdog {
    /// Starts it, where the clocks run: without them the processor is too slow to feed it, and the
    /// coil is never driven. It counts two a microsecond (erratum RP2040-E1), and runs on while a
    /// debugger stops the processor: a coil must not stay on at a breakpoint.
    pub fn start(registers: rp2040_pac::WATCHDOG, clocks_run: bool) -> Self {
        let watchdog = Self(registers);
        if !clocks_run {
            return watchdog;
        }
        crate::crash::mark_watchdog();
        watchdog.feed();
        // SAFETY: only enables it; the pauses stay off.
        watchdog.0.ctrl().write(|w| unsafe { w.bits(1 << 30) });
        watchdog
    }

    /// Gives it another [`WATCHDOG_US`].
    pub fn feed(&self) {
        // SAFETY: 24 bits hold 80 000.
        self.0.load().write(|w| unsafe { w.bits(2 * WATCHDOG_US) });
    }
}
