//! Instrument task: runs `palpate_node::instrument` on samples, commands and time.

use core::task::Poll;

use heapless::spsc::{Consumer, Producer};
use palpate_node::acquisition::Sampled;
use palpate_node::board::LIMITS;
use palpate_node::coil::CoilManager;
use palpate_node::converter::{CONVERTERS, ConverterState};
use palpate_node::instrument::{Hardware, Identity, Instrument, Usage};
use palpate_node::link::BYTES_A_TURN;
use palpate_node::supervision::Task;
use palpate_procedure::Link;
use palpate_procedure::boot::Boot;
use palpate_procedure::storage::{StorageOrder, StorageReport};
use palpate_wire::Record;
use palpate_wire::code::{Board, Chip, RebootTarget};
use palpate_wire::record::Hello;
use rtic::Mutex;
use rtic_monotonics::rp2040::prelude::*;

use super::supervisor;
use crate::board::coil::PicoCoil;
use crate::board::{self, ASLEEP_US, reset, usb};
use crate::crash::{self, End};
use crate::link::{Inboxes, Outboxes, log, reset_interface};
use crate::supervision::CHECK_INS;
use crate::wakeup::Sleeper;
use crate::{Mono, app};

/// Maximum number of samples of a converter that are processed before other work gets a turn.
const AT_ONCE: usize = 4;
/// Time in milliseconds in which the converters must wake, identify themselves and show what releases
/// their interrupt lines; an absent one is known after 5 ms.
const IDENTITY_MS: u64 = 60;

/// Queues and links of the task.
pub struct Channels {
    /// Records to the PCs.
    outboxes: Outboxes,
    /// Commands from the PCs.
    inboxes: Inboxes,
    /// Samples from the converter tasks.
    samples: Samples,
    /// Orders and reports of the storage.
    storage: StorageClient,
    /// Wakes on a sample or after a millisecond.
    arrived: Sleeper,
}

/// Queues to and from the storage task.
pub struct StorageClient {
    /// Orders to the storage.
    pub orders: Producer<'static, StorageOrder>,
    /// Reports from the storage.
    pub reports: Consumer<'static, StorageReport>,
}

/// Samples of both converters.
type Samples = [Consumer<'static, Sampled>; CONVERTERS];

impl Channels {
    /// Queues of the instrument task.
    pub fn new(
        (outboxes, inboxes): (Outboxes, Inboxes),
        samples: Samples,
        storage: StorageClient,
        arrived: Sleeper,
    ) -> Self {
        Self {
            outboxes,
            inboxes,
            samples,
            storage,
            arrived,
        }
    }
}

/// Facts of this run, known at its start.
pub struct Run {
    /// Boot cause and crash record.
    pub boot: Boot,
    /// Boot id.
    pub boot_id: u32,
    /// Unique number of the flash memory.
    pub unit: u64,
    /// All clocks run as configured.
    pub clocks_run: bool,
}

/// Task loop.
pub async fn instrument(cx: app::instrument::Context<'_>) {
    let Channels {
        outboxes,
        inboxes,
        samples,
        storage: StorageClient { orders, reports },
        arrived,
    } = cx.local.channels;
    let mut hardware = PicoHardware {
        coil: cx.shared.coil,
        converters: cx.shared.converters,
        outboxes,
        orders,
    };
    let instrument = cx.local.instrument;
    for _ in 0..IDENTITY_MS {
        CHECK_INS.check_in(Task::Instrument);
        if Instrument::is_ready(&mut hardware) {
            break;
        }
        Mono::delay(1.millis()).await;
    }
    instrument.begin(&mut hardware, identity(cx.local.run));
    loop {
        CHECK_INS.check_in(Task::Instrument);
        work(instrument, &mut hardware, samples, inboxes);
        if let Some(report) = reports.dequeue() {
            instrument.stored(&mut hardware, &report);
        }
        if hardware.outboxes.has_usb_frames() {
            usb::call();
        }
        wait(arrived).await;
    }
}

fn work(
    instrument: &mut Instrument,
    hardware: &mut impl Hardware,
    samples: &mut Samples,
    inboxes: &mut Inboxes,
) {
    let mut stepped = false;
    // Until the instrument has started, input stays in the queues.
    if !instrument.has_begun() {
        return instrument.poll(hardware, stepped);
    }
    for (converter, samples) in (0_u8..).zip(samples) {
        for _ in 0..AT_ONCE {
            let Some(sampled) = samples.dequeue() else {
                break;
            };
            instrument.sampled(hardware, converter, &sampled);
            stepped = true;
        }
    }
    for link in Link::ALL {
        if let Some(received) = inboxes.receive(link, BYTES_A_TURN) {
            instrument.received(hardware, link, &received);
            stepped = true;
        }
    }
    if let Some(target) = reset_interface::take_asked()
        && !instrument.asked_to_restart(hardware, target)
    {
        reset_interface::ask(target);
    }
    instrument.poll(hardware, stepped);
}

/// Waits for a sample or for a millisecond without one. Yields to the supervisor even if a sample is
/// already waiting.
async fn wait(arrived: &mut Sleeper) {
    let mut yielded = false;
    core::future::poll_fn(|context| {
        if core::mem::replace(&mut yielded, true) {
            return Poll::Ready(());
        }
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
    arrived.wait().await;
}

fn identity(run: &mut Run) -> Identity {
    Identity {
        boot_id: run.boot_id,
        hello: Hello {
            minor_version: 0,
            schema_hash: 0,
            firmware_major: decimal(env!("CARGO_PKG_VERSION_MAJOR")),
            firmware_minor: decimal(env!("CARGO_PKG_VERSION_MINOR")),
            firmware_patch: decimal(env!("CARGO_PKG_VERSION_PATCH")),
            commit: hexadecimal(env!("PALPATE_COMMIT")),
            dirty: hexadecimal(env!("PALPATE_DIRTY")) != 0,
            simulated: false,
            board: Board::Pico,
            unit: run.unit,
            reset_cause: run.boot.cause,
            chip: Chip::Absent,
            second_chip: Chip::Absent,
            configuration_crc: 0,
        },
        boot: Boot {
            cause: run.boot.cause,
            streak: run.boot.streak,
            crash: run.boot.crash.take(),
        },
        clocks_run: run.clocks_run,
        storage: true,
        limits: LIMITS,
    }
}

/// Hardware for the instrument: shared state of the tasks, and links to the PC.
struct PicoHardware<'a, C, S> {
    coil: C,
    converters: S,
    outboxes: &'a mut Outboxes,
    orders: &'a mut Producer<'static, StorageOrder>,
}

impl<C, S> Hardware for PicoHardware<'_, C, S>
where
    C: Mutex<T = Option<CoilManager<PicoCoil>>>,
    S: Mutex<T = [ConverterState; CONVERTERS]>,
{
    type Coil = PicoCoil;

    fn now_us(&self) -> u64 {
        Mono::now().as_ticks()
    }

    fn with_coil<T>(&mut self, work: impl FnOnce(&mut CoilManager<PicoCoil>) -> T) -> Option<T> {
        self.coil.lock(|coil| coil.as_mut().map(work))
    }

    fn with_converters<T>(
        &mut self,
        work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T,
    ) -> T {
        self.converters.lock(work)
    }

    fn send(&mut self, to: Option<Link>, at_us: u64, record: &Record) {
        if let Record::Sample(_) = record {
            defmt::debug!("procedure has {} us", at_us);
        }
        self.outboxes.send(to, at_us, record);
    }

    fn order(&mut self, order: StorageOrder) {
        // The queue has space, since the storage has reported the end of its last order.
        let _ = self.orders.enqueue(order);
    }

    fn restart(&mut self, target: RebootTarget) {
        crash::keep(&End::Asked);
        match target {
            RebootTarget::BootLoader => reset::restart_into_boot_loader(),
            _ => reset::restart(),
        }
    }

    fn locate(&mut self, for_us: u64) {
        supervisor::locate(for_us);
    }

    fn usage(&mut self) -> Usage {
        Usage {
            asleep_us: Some(ASLEEP_US.get()),
            stack_bytes: board::stack_used(),
            logs_dropped: log::dropped(),
        }
    }
}

/// Parses a decimal number from the build; 0 if it is not one.
const fn decimal(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => 0,
    }
}

/// Parses a hexadecimal number from the build; 0 if it is not one.
const fn hexadecimal(text: &str) -> u32 {
    match u32::from_str_radix(text, 16) {
        Ok(number) => number,
        Err(_) => 0,
    }
}
