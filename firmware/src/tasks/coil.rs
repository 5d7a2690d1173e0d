//! The coil's task: looks after its drive a thousand times a second. It is also the pulse of the
//! tasks that wait.

use rtic_monotonics::rp2040::prelude::*;

use crate::coil::{LOOK_US, look};
use crate::supervision::{Task, check_in};
use crate::{Mono, SAMPLES, app, bus};

/// Looks.
pub async fn coil(_: app::coil::Context<'_>) {
    let mut next = Mono::now();
    loop {
        check_in(Task::Coil);
        look(Mono::now().as_ticks());
        #[cfg(planted_defect = "panic")]
        crate::planted::panic_if_asked(Task::Coil);
        #[cfg(planted_defect = "fed_by_idle")]
        crate::planted::stall_if_asked().await;
        bus::pulse();
        SAMPLES.pulse();
        next += LOOK_US.micros();
        Mono::delay_until(next).await;
    }
}
