//! Ctrl-C as a request to end, for verbs that have something to complete.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use palpate_cli::failure::Failure;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit code of a program that a second Ctrl-C ends, as shells report it: 128 and the signal's number.
const INTERRUPTED: i32 = 130;

/// Whether the verb is to end.
#[derive(Clone, Debug)]
pub(crate) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on Ctrl-C, or the system's request to end, asks for the end; the second one ends the
    /// program at once. To be called when the link is open: until then nothing has to be completed, and one
    /// request ends a program that waits for a board, or for cargo.
    pub(crate) fn catch() -> io::Result<Self> {
        let is_asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // In this order: the first one finds it not asked yet.
            flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&is_asked))?;
            flag::register(signal, Arc::clone(&is_asked))?;
        }
        Ok(Self(is_asked))
    }

    /// One for which Ctrl-C does not ask: for what ends by itself.
    pub(crate) fn uncaught() -> Self {
        Self(Arc::default())
    }

    /// Asks for the end, as Ctrl-C does.
    pub(crate) fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the end was asked for.
    pub(crate) fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Ends what it is called in where the end was asked for.
    ///
    /// # Errors
    /// If it was.
    pub(crate) fn go_on(&self) -> Result<(), Failure> {
        if self.is_asked() {
            return Err(Failure::Refused("broken off by Ctrl-C".to_owned()));
        }
        Ok(())
    }
}
