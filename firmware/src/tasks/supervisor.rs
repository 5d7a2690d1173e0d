//! The supervisor: feeds the watchdog when all others live, and shows that on the LED.

use rtic_monotonics::rp2040::prelude::*;

use crate::board::pico;
use crate::supervision::{PERIOD_MS, all_have_checked_in};
use crate::{Mono, app, crash};

/// Looks between two changes of the LED: it blinks once a second.
const BLINK: u32 = 50;
/// Looks after which a run has lasted, and a crash is not the next of a streak: 10 s.
const LASTED: u32 = 1_000;

/// Watches.
pub async fn supervisor(cx: app::supervisor::Context<'_>) {
    let mut looks = 0_u32;
    loop {
        let alive = all_have_checked_in();
        if alive || cfg!(planted_defect = "fed_by_idle") {
            cx.local.watchdog.feed();
        }
        looks = looks.wrapping_add(1);
        if looks == LASTED {
            crash::forget();
        }
        if looks.is_multiple_of(BLINK) {
            pico::set(pico::LED, (looks / BLINK).is_multiple_of(2));
        }
        Mono::delay(PERIOD_MS.millis()).await;
    }
}
