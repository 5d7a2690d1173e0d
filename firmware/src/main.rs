//! Firmware of the palpate tactile sensor: the wiring of tasks, resources and interrupts.
//!
//! Priorities, highest first: the two interrupts of the converter bus and that of the coil's PWM,
//! outside RTIC (`board::i2c::engine`, `board::control`); `frame_over`, sensing and coil; instrument,
//! supervisor and USB; the storage, in idle. See docs/firmware.md.

#![no_std]
#![no_main]

mod board;
mod crash;
mod link;
mod mono;
mod supervision;
mod tasks;
mod wakeup;

use mono::Mono;

/// Stops: a start-up resource was already taken. This never happens: `init` runs once.
fn halt() -> ! {
    board::safe::bridge_off();
    loop {
        core::hint::spin_loop();
    }
}

#[rtic::app(device = rp2040_pac, dispatchers = [SW0_IRQ, SW1_IRQ])]
mod app {
    use heapless::spsc::Queue;
    use palpate_node::acquisition::Sampled;
    use palpate_node::coil::CoilManager;
    use palpate_node::converter::{CONVERTERS, ConverterState};
    use palpate_node::instrument::Instrument;
    use palpate_procedure::storage::{StorageOrder, StorageReport};
    use rtic_monotonics::rp2040::Priority;

    use crate::board::coil::PicoCoil;
    use crate::board::{Board, Watchdog, i2c, safe, sleep, vectors};
    use crate::link::usb::{self as usb_link, UsbLink};
    use crate::tasks::*;
    use crate::wakeup::SAMPLES;
    use crate::{Mono, crash, halt, link};

    /// Number of samples of a converter that can wait for the instrument.
    const WAITING: usize = 8;

    #[shared]
    struct Shared {
        converters: [ConverterState; CONVERTERS],
        coil: Option<CoilManager<PicoCoil>>,
    }

    #[local]
    struct Local {
        first: Sensing,
        second: Sensing,
        channels: Channels,
        run: Run,
        instrument: Instrument,
        watchdog: Watchdog,
        usb: UsbLink,
        storage: StorageWork,
    }

    #[init(local = [
        queues: [Queue<Sampled, WAITING>; 2] = [const { Queue::new() }; 2],
        orders: Queue<StorageOrder, 2> = Queue::new(),
        reports: Queue<StorageReport, 2> = Queue::new(),
        usb_memory: usb_link::Memory = usb_link::Memory::new(),
    ])]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        safe::bridge_off();
        let boot = crash::boot();
        let board = Board::init(cx.device);
        // The timer's interrupt has the priority of the upper tasks: a higher one would delay the coil's
        // interrupt.
        Mono::start(board.timer, &board.resets, const { Priority::new(2) });
        vectors::move_to_memory(&cx.core.SCB, &mut cx.core.NVIC);
        let [first, second] = cx.local.queues.each_mut().map(Queue::split);
        let samples = [first.1, second.1];
        let (Some(first), Some(second), Some(arrived)) = (
            Sensing::take(0, first.0),
            Sensing::take(1, second.0),
            SAMPLES.take(),
        ) else {
            halt()
        };
        // The first spawn of each task cannot fail.
        let _ = sensing::spawn();
        let _ = second_sensing::spawn();
        let _ = coil::spawn();
        let _ = instrument::spawn();
        let _ = supervisor::spawn();
        let shared = Shared {
            converters: [ConverterState::new(); CONVERTERS],
            coil: board.supervisor.map(|of| CoilManager::new(PicoCoil, of)),
        };
        let (storage, client) = StorageWork::new(board.area, cx.local.orders, cx.local.reports);
        let (links, usb) = link::set_up(cx.local.usb_memory, board.usb, board.unit, board.boot_id);
        let local = Local {
            first,
            second,
            channels: Channels::new(links, samples, client, arrived),
            run: Run {
                boot,
                boot_id: board.boot_id,
                unit: board.unit,
                clocks_run: board.clocks_run,
            },
            instrument: Instrument::new(),
            watchdog: Watchdog::start(board.watchdog, board.clocks_run),
            usb,
            storage,
        };
        (shared, local)
    }

    /// Runs only when no task is ready, since a flash erase takes up to 0.4 s.
    #[idle(local = [storage])]
    fn idle(cx: idle::Context) -> ! {
        loop {
            if cx.local.storage.is_due() {
                storage(cx.local.storage);
            }
            sleep();
        }
    }

    #[task(binds = USBCTRL_IRQ, local = [usb], priority = 1)]
    fn usb(cx: usb::Context) {
        cx.local.usb.poll();
    }

    /// Runs after each transaction; pended by the engine. Its priority is not above that of the tasks
    /// that it wakes: the coil's interrupt would have to wait for it.
    #[task(binds = PIO0_IRQ_0, priority = 2)]
    fn frame_over(_: frame_over::Context) {
        i2c::wake();
    }

    extern "Rust" {
        #[task(local = [first], shared = [converters], priority = 2)]
        async fn sensing(cx: sensing::Context);
        #[task(local = [second], shared = [converters], priority = 2)]
        async fn second_sensing(cx: second_sensing::Context);
        #[task(shared = [coil], priority = 2)]
        async fn coil(cx: coil::Context);
        #[task(
            local = [channels, run, instrument],
            shared = [coil, converters],
            priority = 1
        )]
        async fn instrument(cx: instrument::Context);
        #[task(local = [watchdog], priority = 1)]
        async fn supervisor(cx: supervisor::Context);
    }
}
