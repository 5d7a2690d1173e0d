//! The supervisor: feeds the watchdog when all others live, and shows that on the LED.

use core::sync::atomic::{AtomicU32, Ordering};

use rtic_monotonics::rp2040::prelude::*;

use crate::board::pins;
use crate::supervision::{CHECK_INS, PERIOD_MS};
use crate::{Mono, app, crash};

/// Polls between two changes of the LED: it blinks once a second.
const BLINK: u32 = 50;
/// Polls after which a run has lasted, and a crash is not the next of a streak: 10 s.
const LASTED: u32 = 1_000;

/// Polls between two changes while it flickers: ten times a second.
const FLICKER: u32 = 5;

/// Polls for which the LED has to flicker still, to show which board this is.
static LOCATED: AtomicU32 = AtomicU32::new(0);

/// Lets the LED flicker for so long, us.
pub fn locate(for_us: u64) {
    let polls = for_us / (1_000 * PERIOD_MS);
    LOCATED.store(u32::try_from(polls).unwrap_or(u32::MAX), Ordering::Relaxed);
}

/// Watches.
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
