//! Coil task: polls the drive every millisecond and wakes waiting tasks.

use palpate_node::coil::POLL_US;
use palpate_node::supervision::Task;
use rtic::Mutex;
use rtic_monotonics::rp2040::prelude::*;

use crate::board::i2c;
use crate::supervision::CHECK_INS;
use crate::wakeup::SAMPLES;
use crate::{Mono, app};

/// Task loop.
pub async fn coil(mut cx: app::coil::Context<'_>) {
    let mut next = Mono::now();
    loop {
        CHECK_INS.check_in(Task::Coil);
        cx.shared.coil.lock(|coil| {
            if let Some(coil) = coil {
                coil.poll();
            }
        });
        i2c::pulse();
        SAMPLES.pulse();
        next += POLL_US.micros();
        Mono::delay_until(next).await;
    }
}
