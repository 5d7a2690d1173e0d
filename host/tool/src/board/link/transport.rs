//! Transport of bytes to a board and back.

use std::io;
use std::time::{Duration, Instant};

/// Longest wait for a board's answer. A board waits for a test of its coil before it answers, and
/// the server of a debug probe polls every 10 ms.
pub(super) const PATIENCE: Duration = Duration::from_secs(5);

/// An open connection to a board. [`reopen`](Self::reopen) opens it again after a failed read or
/// write.
pub(crate) trait Transport {
    /// Time that passes during waits, from an arbitrary zero; for the emulated board its own time.
    fn now(&self) -> Duration;

    /// Sends all bytes.
    ///
    /// # Errors
    /// If the board is gone.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Returns the received bytes; waits for them, `wait` at most.
    ///
    /// # Errors
    /// If the board is gone.
    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>>;

    /// Takes the board's log since the last call, as defmt frames; empty on a transport without
    /// logs.
    fn take_log(&mut self) -> Vec<u8> {
        Vec::new()
    }

    /// Longest time from the first question to the board's identity. After a reset a board
    /// enumerates on USB and tests its coil before it answers.
    fn patience(&self) -> Duration {
        PATIENCE
    }

    /// Opens the connection again.
    ///
    /// # Errors
    /// If the board is not available yet.
    fn reopen(&mut self) -> io::Result<()>;

    /// Whether this is a recording, which accepts no commands and has an end.
    fn is_recording(&self) -> bool {
        false
    }

    /// The emulated board of this program, if connected.
    fn emulated(&mut self) -> Option<&mut crate::board::emulated::PluggedBoard> {
        None
    }
}

/// This computer's clock, for transports in real time.
pub(super) struct Clock(Instant);

impl Clock {
    pub(super) fn start() -> Self {
        Self(Instant::now())
    }

    pub(super) fn now(&self) -> Duration {
        self.0.elapsed()
    }
}
