//! The instrument's task: runs `palpate_node::instrument` on samples, commands and time.

use core::task::Poll;

use heapless::spsc::Consumer;
use palpate_node::acquisition::Sampled;
use palpate_node::coil::CoilManager;
use palpate_node::converter::{CONVERTERS, ConverterState};
use palpate_node::instrument::{Hardware, Identity, Instrument, Usage};
use palpate_node::supervision::Task;
use palpate_procedure::Limits;
use palpate_procedure::boot::Boot;
use palpate_wire::Record;
use palpate_wire::code::{Board, Chip};
use palpate_wire::record::Hello;
use rtic::Mutex;
use rtic_monotonics::rp2040::prelude::*;

use crate::board::coil::PicoCoil;
use crate::board::{self, ASLEEP_US};
use crate::link::{Inbox, Outbox, log};
use crate::supervision::CHECK_INS;
use crate::wakeup::Sleeper;
use crate::{Mono, app};

/// Samples of a converter that are taken before it turns to everything else.
const AT_ONCE: usize = 4;
/// Bytes of commands that are taken in a turn: two of the longest frames.
const COMMAND_BYTES: usize = 212;
/// How long the converters may take to wake, to say who they are and to show what releases their
/// interrupt lines; an absent one is known after 5 ms.
const IDENTITY_MS: u64 = 60;

/// What the task owns.
pub struct Channels {
    /// To the PC.
    outbox: Outbox,
    /// From the PC.
    inbox: Inbox,
    /// From the converters' tasks.
    samples: Samples,
    /// A sample has come, or a millisecond has passed.
    arrived: Sleeper,
}

/// Samples of both converters.
type Samples = [Consumer<'static, Sampled>; CONVERTERS];

impl Channels {
    /// The ways to the PC, those of the samples, and what wakes the task.
    pub fn new((outbox, inbox): (Outbox, Inbox), samples: Samples, arrived: Sleeper) -> Self {
        Self {
            outbox,
            inbox,
            samples,
            arrived,
        }
    }
}

/// What is known of this run when it begins.
pub struct Run {
    /// Why it began.
    pub boot: Boot,
    /// Its number.
    pub boot_id: u32,
    /// The clocks run as planned.
    pub clocks_run: bool,
}

/// Takes what comes, for ever.
pub async fn instrument(cx: app::instrument::Context<'_>) {
    let Channels {
        outbox,
        inbox,
        samples,
        arrived,
    } = cx.local.channels;
    let mut hardware = PicoHardware {
        coil: cx.shared.coil,
        converters: cx.shared.converters,
        outbox,
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
        work(instrument, &mut hardware, samples, inbox);
        wait(arrived).await;
    }
}

fn work(
    instrument: &mut Instrument,
    hardware: &mut impl Hardware,
    samples: &mut Samples,
    inbox: &mut Inbox,
) {
    let mut stepped = false;
    for (converter, samples) in (0_u8..).zip(samples) {
        for _ in 0..AT_ONCE {
            let Some(sampled) = samples.dequeue() else {
                break;
            };
            instrument.sampled(hardware, converter, &sampled);
            stepped = true;
        }
    }
    if let Some(received) = inbox.receive(COMMAND_BYTES) {
        instrument.received(hardware, &received);
        stepped = true;
    }
    instrument.poll(hardware, stepped);
}

/// Waits for a sample or a millisecond without, but lets the supervisor have its turn even if one
/// waits already.
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
            unit: 0,
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
        limits: Limits::REFERENCE,
    }
}

/// What the instrument drives: the tasks' shared state, and the way to the PC.
struct PicoHardware<'a, C, S> {
    coil: C,
    converters: S,
    outbox: &'a mut Outbox,
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

    fn send(&mut self, at_us: u64, record: &Record) {
        if let Record::Sample(_) = record {
            defmt::debug!("procedure has {} us", at_us);
        }
        self.outbox.send(at_us, record);
    }

    fn usage(&mut self) -> Usage {
        Usage {
            asleep_us: Some(ASLEEP_US.get()),
            stack_bytes: board::stack_used(),
            logs_dropped: log::dropped(),
        }
    }
}

/// A decimal number from the build; 0 if it is none.
const fn decimal(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => 0,
    }
}

/// A hexadecimal number from the build; 0 if it is none.
const fn hexadecimal(text: &str) -> u32 {
    match u32::from_str_radix(text, 16) {
        Ok(number) => number,
        Err(_) => 0,
    }
}
