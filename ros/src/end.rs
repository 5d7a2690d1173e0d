//! The request to end: Ctrl-C, or the system's.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit code after a second request, as shells report it: 128 and the signal's number.
const INTERRUPTED: i32 = 130;
/// Longest delay of an answer to the request.
const TURN: Duration = Duration::from_millis(10);

static IS_ASKED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Handles the requests: the first asks, the second ends the program at once.
///
/// # Errors
/// If the system refuses.
pub fn catch() -> io::Result<()> {
    for signal in [SIGINT, SIGTERM] {
        // In this order, since the first handler tests the flag before the second sets it.
        flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&IS_ASKED))?;
        flag::register(signal, Arc::clone(&IS_ASKED))?;
    }
    palpate::library::set_check(is_asked);
    Ok(())
}

/// Whether the end was requested.
pub fn is_asked() -> bool {
    IS_ASKED.load(Ordering::Relaxed)
}

/// Requests the end.
pub fn ask() {
    IS_ASKED.store(true, Ordering::Relaxed);
}

/// Waits, or returns earlier when the end is requested.
pub fn wait(time: Duration) {
    let end = Instant::now() + time;
    while !is_asked() && Instant::now() < end {
        thread::sleep(TURN);
    }
}
