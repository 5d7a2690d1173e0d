//! Ctrl-C as a request to end, for verbs that must complete something.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use palpate_cli::failure::Failure;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit code after a second Ctrl-C, as shells report it: 128 and the signal's number.
const INTERRUPTED: i32 = 130;

/// Function that says whether the program around this library asks to end waits for boards; unset in the tool.
static PROGRAM: OnceLock<fn() -> bool> = OnceLock::new();

/// Sets a function that is called about every 10 ms while a board is waited for. If it returns `true`,
/// the wait fails. Only the first call has an effect.
pub fn set_check(is_asked: fn() -> bool) {
    // A second check is ignored, as documented.
    let _ = PROGRAM.set(is_asked);
}

/// Fails if the program around this library asks to end.
pub(crate) fn go_on() -> Result<(), Failure> {
    match PROGRAM.get() {
        Some(is_asked) if is_asked() => Err(interrupted()),
        _ => Ok(()),
    }
}

fn interrupted() -> Failure {
    Failure::Refused("interrupted by Ctrl-C".to_owned())
}

/// Whether the end of the verb was requested.
#[derive(Clone, Debug)]
pub(crate) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Handles Ctrl-C and the system's request to end: the first request asks for the end, the
    /// second ends the program at once. Call this once the link is open: before, a single request
    /// must end a program that waits for a board or for cargo, and there is no work to complete.
    pub(crate) fn catch() -> io::Result<Self> {
        let is_asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // In this order, since the first handler tests the flag before the second sets it.
            flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&is_asked))?;
            flag::register(signal, Arc::clone(&is_asked))?;
        }
        Ok(Self(is_asked))
    }

    /// Creates a request that Ctrl-C does not set, for code that ends by itself.
    pub(crate) fn uncaught() -> Self {
        Self(Arc::default())
    }

    /// Requests the end, as Ctrl-C does.
    pub(crate) fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the end was requested.
    pub(crate) fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Fails if the end was requested.
    ///
    /// # Errors
    /// If the end was requested.
    pub(crate) fn go_on(&self) -> Result<(), Failure> {
        if self.is_asked() {
            return Err(interrupted());
        }
        Ok(())
    }
}
