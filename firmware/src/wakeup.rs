//! Wake-up of a waiting task by an event, or by the next millisecond without one.
//!
//! Deadlines are checked on waking. A wait with a deadline in the timer queue took 1,500 instructions,
//! mostly in critical sections. Here one pulse per millisecond serves all waits, and costs nothing while
//! a sample arrives in each millisecond.

use core::sync::atomic::{AtomicBool, Ordering};

use rtic_sync::signal::{Signal, SignalReader};

/// The wakeup of one task.
pub struct Wakeup {
    signal: Signal<()>,
    /// An event has woken the task since the last pulse.
    called: AtomicBool,
}

/// Signals that a sample was passed on.
pub static SAMPLES: Wakeup = Wakeup::new();

/// Receiver of the signal, for the woken task.
pub type Sleeper = SignalReader<'static, ()>;

impl Wakeup {
    /// Creates a wakeup without an event.
    pub const fn new() -> Self {
        Self {
            signal: Signal::new(),
            called: AtomicBool::new(false),
        }
    }

    /// Takes the sleeper; `None` if it was already taken.
    pub fn take(&'static self) -> Option<Sleeper> {
        self.signal.try_take_reader()
    }

    /// Signals an event.
    pub fn call(&self) {
        self.called.store(true, Ordering::Relaxed);
        self.signal.writer().write(());
    }

    /// Signals the end of a millisecond: wakes the task if no event has.
    pub fn pulse(&self) {
        if !self.called.load(Ordering::Relaxed) {
            self.signal.writer().write(());
        }
        self.called.store(false, Ordering::Relaxed);
    }
}
