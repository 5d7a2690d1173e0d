//! The supervisor: feeds the watchdog when all others live, and shows that on the LED.

use rtic_monotonics::rp2040::prelude::*;

use crate::board::pins;
use crate::supervision::{CHECK_INS, PERIOD_MS};
use crate::{Mono, app, crash};

/// Polls between two changes of the LED: it blinks once a second.
const BLINK: u32 = 50;
/// Polls after which a run has lasted, and a crash is not the next of a streak: 10 s.
const LASTED: u32 = 1_000;

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
        if polls.is_multiple_of(BLINK) {
            pins::set(pins::LED, (polls / BLINK).is_multiple_of(2));
        }
        Mono::delay(PERIOD_MS.millis()).await;
    }
}
