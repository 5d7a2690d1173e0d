//! The coil's task: a thousand times a second the pulse width that the course wants.

use rtic_monotonics::rp2040::prelude::*;

use crate::supervision::{Task, check_in};
use crate::{Mono, app};

/// Drives and measures.
pub async fn coil(cx: app::coil::Context<'_>) {
    let mut next = Mono::now();
    loop {
        check_in(Task::Coil);
        cx.local.coil.update(Mono::now().as_ticks());
        #[cfg(planted_defect = "panic")]
        crate::planted::panic_if_asked(Task::Coil);
        next += 1.millis();
        Mono::delay_until(next).await;
    }
}
