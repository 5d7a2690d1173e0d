//! A way for bytes to a board and back.

use std::io;
use std::time::{Duration, Instant};

/// A way to a board, open. It opens again by [`reopen`](Self::reopen) after a read or write has failed.
pub(crate) trait Transport {
    /// The time by which waits go, since any moment: the board's own where it is emulated.
    fn now(&self) -> Duration;

    /// Sends all bytes.
    ///
    /// # Errors
    /// If the board is gone.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// What has come; waits for it, if need be, for so long at most.
    ///
    /// # Errors
    /// If the board is gone.
    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>>;

    /// What has come of the board's log since the last call, as defmt encodes it. A way without logs has
    /// nothing.
    fn take_log(&mut self) -> Vec<u8> {
        Vec::new()
    }

    /// Opens it anew.
    ///
    /// # Errors
    /// If the board is not there yet.
    fn reopen(&mut self) -> io::Result<()>;

    /// Whether it is a recording, which takes no commands and has an end.
    fn is_recording(&self) -> bool {
        false
    }

    /// The emulated board at its other end, if it is one of this program.
    fn emulated(&mut self) -> Option<&mut crate::board::emulated::PluggedBoard> {
        None
    }
}

/// This computer's clock, for the ways that go by it.
pub(super) struct Clock(Instant);

impl Clock {
    pub(super) fn start() -> Self {
        Self(Instant::now())
    }

    pub(super) fn now(&self) -> Duration {
        self.0.elapsed()
    }
}
