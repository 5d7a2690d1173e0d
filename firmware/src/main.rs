//! The firmware of the palpate tactile sensor: the list of what is wired to what.
//!
//! Priorities, from the most urgent: the two interrupts of the converter's bus and that of the
//! coil's PWM, outside of RTIC (`bus::engine`, `coil::period`); `frame_over`, sensing and coil;
//! instrument and supervisor; idle.
//! See docs/firmware.md.

#![no_std]
#![no_main]

mod board;
mod bus;
mod coil;
mod crash;
mod link;
#[cfg(any(planted_defect = "panic", planted_defect = "fed_by_idle"))]
mod planted;
mod report;
mod safe;
mod supervision;
mod tasks;
mod wakeup;

use rtic_monotonics::rp2040_timer_monotonic;
use wakeup::Wakeup;

rp2040_timer_monotonic!(Mono);

/// The second stage of the boot loader, for the flash of a Raspberry Pi Pico.
#[allow(unsafe_code)]
#[unsafe(link_section = ".boot2")]
#[used]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

/// A sample has been handed on.
static SAMPLES: Wakeup = Wakeup::new();

/// Something without which nothing can go on is taken already. It never is: `init` runs once.
fn halt() -> ! {
    safe::bridge_off();
    loop {
        cortex_m::asm::nop();
    }
}

#[rtic::app(device = rp2040_pac, dispatchers = [SW0_IRQ, SW1_IRQ])]
mod app {
    use heapless::spsc::Queue;
    use ldc161x::{Address, AsyncLdc161x, Model};
    use palpate_node::acquisition::Sampled;
    use palpate_procedure::Actions;
    use rtic_monotonics::rp2040::Priority;

    use crate::board::{pico::Board, sleep, vectors};
    use crate::bus::{self, Master};
    use crate::supervision::Watchdog;
    use crate::tasks::*;
    use crate::wakeup::Sleeper;
    use crate::{Mono, SAMPLES, crash, halt, link, safe};

    /// Samples that can wait for the instrument.
    const WAITING: usize = 8;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        sensing: Sensing,
        instrument: Instrument,
        arrived: Sleeper,
        watchdog: Watchdog,
    }

    #[init(local = [queue: Queue<Sampled, WAITING> = Queue::new()])]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        safe::bridge_off();
        let boot = crash::boot();
        let board = Board::init(cx.device);
        // Beside the upper tasks: above them it would hold the coil's interrupt back.
        Mono::start(board.timer, &board.resets, const { Priority::new(2) });
        vectors::move_to_memory(&cx.core.SCB, &mut cx.core.NVIC);
        let (outbox, inbox) = link::set_up(board.boot_id);
        let (producer, consumer) = cx.local.queue.split();
        let (Some(master), Some(arrived)) = (Master::take(Address::AddrLow.bits()), SAMPLES.take())
        else {
            halt()
        };
        let sensing = Sensing {
            driver: AsyncLdc161x::new(master, Model::Ldc1614, Address::AddrLow),
            samples: producer,
            release: None,
            drives: None,
            not_taken: 0,
        };
        let instrument = Instrument {
            outbox,
            inbox,
            samples: consumer,
            boot,
            boot_id: board.boot_id,
            clocks_run: board.clocks_run,
            procedure: None,
            actions: Actions::new(),
            standing: [None; 2],
            latched: None,
            conditions_due_us: 0,
            last_conditions: (0, 0),
        };
        // Each task is spawned for the first time, which cannot fail.
        let _ = sensing::spawn();
        let _ = coil::spawn();
        let _ = instrument::spawn();
        let _ = supervisor::spawn();
        let local = Local {
            sensing,
            instrument,
            arrived,
            watchdog: Watchdog::start(board.watchdog, board.clocks_run),
        };
        (Shared {}, local)
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            sleep();
        }
    }

    /// A transaction is over; pended by the engine. Not above the tasks that it calls: the coil's
    /// interrupt would have to wait for it.
    #[task(binds = PIO0_IRQ_0, priority = 2)]
    fn frame_over(_: frame_over::Context) {
        bus::wake();
    }

    extern "Rust" {
        #[task(local = [sensing], priority = 2)]
        async fn sensing(cx: sensing::Context);
        #[task(priority = 2)]
        async fn coil(cx: coil::Context);
        #[task(local = [instrument, arrived], priority = 1)]
        async fn instrument(cx: instrument::Context);
        #[task(local = [watchdog], priority = 1)]
        async fn supervisor(cx: supervisor::Context);
    }
}
