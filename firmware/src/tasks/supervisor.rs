//! Supervisor task: feeds the watchdog while all other tasks check in, and shows that on the LED.

use core::sync::atomic::{AtomicU32, Ordering};

use rtic_monotonics::rp2040::prelude::*;

use crate::board::pins;
use crate::supervision::{CHECK_INS, PERIOD_MS};
use crate::{Mono, app, crash};

/// Number of the supervisor's polls between two changes of the LED, which then blinks once a second.
const BLINK: u32 = 50;
/// Number of polls, 10 s in total, after which a run has lasted long enough: a later crash does not
/// continue a streak.
const LASTED: u32 = 1_000;

/// Number of polls between two changes of the LED while it flickers, ten times a second.
const FLICKER: u32 = 5;

/// Remaining number of polls for which the LED flickers to identify this board.
static LOCATED: AtomicU32 = AtomicU32::new(0);

/// Lets the LED flicker for `for_us` microseconds.
pub fn locate(for_us: u64) {
    let polls = for_us / (1_000 * PERIOD_MS);
    LOCATED.store(u32::try_from(polls).unwrap_or(u32::MAX), Ordering::Relaxed);
}

/// Task loop.
pub async fn supervisor(cx: app::supervisor::Context<'_>) {
    let mut polls = 0_u32;
    loop {
        if CHECK_INS.all_alive() {
            cx.local.watchdog.feed();
        }
        polls = polls.wrapping_add(1);
        if polls == LASTED {
            crash::forget();
        }
        let located = LOCATED.load(Ordering::Relaxed);
        LOCATED.store(located.saturating_sub(1), Ordering::Relaxed);
        let half = if located > 0 { FLICKER } else { BLINK };
        if polls.is_multiple_of(half) {
            pins::set(pins::LED, (polls / half).is_multiple_of(2));
        }
        Mono::delay(PERIOD_MS.millis()).await;
    }
}
