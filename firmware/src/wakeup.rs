//! What a task waits for: that something has happened, or that a millisecond has passed without it.
//!
//! Deadlines are looked at on waking. A wait with a deadline in the queue of timers took the time
//! of 1,500 instructions, in critical sections most of it; here one pulse a millisecond serves all
//! waits, and costs nothing while a sample comes in each.

use core::sync::atomic::{AtomicBool, Ordering};

use rtic_sync::signal::{Signal, SignalReader};

/// The wakeup of one task.
pub struct Wakeup {
    signal: Signal<()>,
    /// Since the last pulse.
    called: AtomicBool,
}

/// For the task that is woken.
pub type Sleeper = SignalReader<'static, ()>;

impl Wakeup {
    /// Nothing has happened yet.
    pub const fn new() -> Self {
        Self {
            signal: Signal::new(),
            called: AtomicBool::new(false),
        }
    }

    /// The sleeper; nothing if it was taken already.
    pub fn take(&'static self) -> Option<Sleeper> {
        self.signal.try_take_reader()
    }

    /// Something has happened.
    pub fn call(&self) {
        self.called.store(true, Ordering::Relaxed);
        self.signal.writer().write(());
    }

    /// A millisecond has passed: wakes the task if nothing else has.
    pub fn pulse(&self) {
        if !self.called.load(Ordering::Relaxed) {
            self.signal.writer().write(());
        }
        self.called.store(false, Ordering::Relaxed);
    }
}
