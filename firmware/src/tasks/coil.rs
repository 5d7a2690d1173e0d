//! The coil's task: a thousand times a second the pulse width that the course wants, and the
//! current that comes of it. It is also the pulse of the tasks that wait.

use rtic_monotonics::rp2040::prelude::*;

use crate::coil::{MEASURED_AFTER_US, STEP_US};
use crate::supervision::{Task, check_in};
use crate::{Mono, SAMPLES, app, bus};

/// Drives and measures.
pub async fn coil(cx: app::coil::Context<'_>) {
    let mut next = Mono::now();
    loop {
        check_in(Task::Coil);
        cx.local.coil.set(Mono::now().as_ticks());
        #[cfg(planted_defect = "panic")]
        crate::planted::panic_if_asked(Task::Coil);
        #[cfg(planted_defect = "fed_by_idle")]
        crate::planted::stall_if_asked().await;
        Mono::delay_until(next + MEASURED_AFTER_US.micros()).await;
        cx.local.coil.measure();
        bus::pulse();
        SAMPLES.pulse();
        next += STEP_US.micros();
        Mono::delay_until(next).await;
    }
}
