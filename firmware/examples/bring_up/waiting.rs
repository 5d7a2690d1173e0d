//! Bounded waits.

/// Polls a condition until it holds, 100 000 times at most.
pub(crate) fn wait(mut holds: impl FnMut() -> bool) -> bool {
    (0..100_000).any(|_| holds())
}

/// Returns the lower half of the microsecond timer.
pub(crate) fn now_us() -> u32 {
    // SAFETY: reading the raw timer has no effect on it.
    unsafe { (*rp2040_pac::TIMER::ptr()).timerawl().read().bits() }
}

/// Waits for a number of microseconds.
pub(crate) fn pause(us: u32) {
    let begin = now_us();
    while now_us().wrapping_sub(begin) < us {}
}
