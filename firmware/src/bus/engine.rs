//! The part of the I2C master that runs in interrupts.
//!
//! A transaction is a [`Job`]: its commands are put into the block's queue as there is room, its
//! bytes are collected, and an interrupt of lower priority reports its end to the master.
//!
//! One job can be kept ready: every falling edge of INTB then begins it at once, and its bytes wait
//! with the edge's time until the master takes them. Thus a frame is fetched within a microsecond
//! of the converter's call, whatever the tasks do, and the next one while they still work on the
//! last.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;

use embedded_hal::i2c::Operation;
use rp2040_pac::{I2C0, IO_BANK0, Interrupt, NVIC, PWM, TIMER};

use crate::board::pico;
use crate::coil::precedence::{self, TO_BEGIN, TO_SERVE};

/// Commands of the longest frame: STATUS, and MSB and LSB of four channels, each read twice, by
/// pointer, high byte and low byte.
pub const MAX_COMMANDS: usize = 54;
/// Bytes of the longest frame, rounded up.
pub const MAX_BYTES: usize = 36;
/// Frames that can wait for the master.
const FRAMES: usize = 4;

/// A command of the block: to read a byte, and to send STOP after it.
pub const READ: u16 = 1 << 8;
/// See [`READ`].
pub const STOP: u16 = 1 << 9;

/// Depth of the block's queues (RP2040 datasheet 4.3.2).
const DEPTH: usize = 16;
const TX_EMPTY: u32 = 1 << 4;
const RX_FULL: u32 = 1 << 2;
const TX_ABORT: u32 = 1 << 6;
const STOP_DETECTED: u32 = 1 << 9;
/// In TX_ABRT_SOURCE: lost arbitration, after which no STOP follows.
const ARBITRATION: u32 = 1 << 12;
/// INTR0: falling edge of GP7.
const EDGE: u32 = 1 << (4 * pico::INTB + 2);

/// The moment of an edge.
#[derive(Clone, Copy, Default)]
pub struct Stamp {
    /// The lower half of the microsecond timer.
    pub time_us: u32,
    /// When the transaction that it called for was over.
    pub ended_us: u32,
    /// Edges that the hardware has counted.
    pub edges: u16,
    /// There was an edge: its time is known.
    pub is_known: bool,
}

#[cfg(planted_defect = "late_stamp")]
impl Stamp {
    /// As if the edge had come when somebody looked.
    pub const fn taken_at(self, now_us: u32) -> Self {
        Self {
            time_us: now_us,
            ended_us: now_us,
            ..self
        }
    }
}

/// A transaction.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Job {
    length: u8,
    bytes: u8,
    commands: [u16; MAX_COMMANDS],
}

impl Job {
    /// A transaction without commands.
    pub const EMPTY: Self = Self {
        commands: [0; MAX_COMMANDS],
        length: 0,
        bytes: 0,
    };

    /// Adds a command; nothing if there is no room.
    pub fn push(&mut self, command: u16) -> Option<()> {
        *self.commands.get_mut(usize::from(self.length))? = command;
        self.length += 1;
        if command & READ != 0 {
            self.bytes += 1;
        }
        (usize::from(self.bytes) <= MAX_BYTES).then_some(())
    }

    /// Lets STOP follow the last command.
    pub fn stop(&mut self) -> Option<()> {
        let last = usize::from(self.length).checked_sub(1)?;
        *self.commands.get_mut(last)? |= STOP;
        Some(())
    }

    /// Whether it has these commands, the STOP after the last aside.
    fn is(&self, operations: &[Operation<'_>]) -> bool {
        let mut own = self.commands.iter().take(self.length());
        let mut next_is = |command: u16| own.next().is_some_and(|own| own & !STOP == command);
        for operation in operations {
            let same = match operation {
                Operation::Write(bytes) => bytes.iter().all(|&byte| next_is(u16::from(byte))),
                Operation::Read(buffer) => buffer.iter().all(|_| next_is(READ)),
            };
            if !same {
                return false;
            }
        }
        own.next().is_none()
    }

    /// Number of commands.
    pub const fn length(&self) -> usize {
        self.length as usize
    }
}

/// What came of a transaction.
#[derive(Clone, Copy)]
pub struct Outcome {
    /// The bytes read.
    pub bytes: [u8; MAX_BYTES],
    /// How many.
    pub count: u8,
    /// The edge that began it, if one did.
    pub stamp: Stamp,
    /// Why it was aborted, by the block's own bits; 0 if it was not.
    pub cause: u32,
}

impl Outcome {
    const NONE: Self = Self {
        bytes: [0; MAX_BYTES],
        count: 0,
        stamp: Stamp {
            time_us: 0,
            ended_us: 0,
            edges: 0,
            is_known: false,
        },
        cause: 0,
    };
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Runs {
    Nothing,
    Ahead,
    Single,
}

/// What every interrupt needs comes first: the processor reaches it in one instruction.
#[repr(C)]
struct Engine {
    runs: Runs,
    is_ahead: bool,
    single_is_over: bool,
    next: usize,
    /// Places in `frames`: of the oldest, and how many wait.
    first: usize,
    waiting: usize,
    since_us: u32,
    edges: u32,
    last_edge_us: u32,
    /// There is an edge that came while the bus was taken: `late`.
    is_late: bool,
    late: Stamp,
    /// How long after its edge the job may begin, in microseconds.
    latest_us: u32,
    /// The job that edges begin, if there is one.
    ahead: Job,
    /// The job that the master began itself.
    single: Job,
    single_outcome: Outcome,
    frames: [Outcome; FRAMES],
}

struct Shared(UnsafeCell<Engine>);

// SAFETY: it is reached through `with`, which no interrupt can divide, and from the two handlers,
// which have the same, highest priority and so never divide one another.
unsafe impl Sync for Shared {}

static ENGINE: Shared = Shared(UnsafeCell::new(Engine {
    ahead: Job::EMPTY,
    is_ahead: false,
    single: Job::EMPTY,
    single_outcome: Outcome::NONE,
    single_is_over: false,
    frames: [Outcome::NONE; FRAMES],
    first: 0,
    waiting: 0,
    runs: Runs::Nothing,
    next: 0,
    since_us: 0,
    is_late: false,
    late: Outcome::NONE.stamp,
    latest_us: u32::MAX,
    edges: 0,
    last_edge_us: 0,
}));

/// Lets a task work on the engine while no interrupt can.
#[inline(always)]
fn with<T>(work: impl FnOnce(&mut Engine) -> T) -> T {
    cortex_m::interrupt::free(|_| {
        // SAFETY: no interrupt comes between, and no task holds the engine beyond this call.
        work(unsafe { &mut *ENGINE.0.get() })
    })
}

#[inline(always)]
fn i2c() -> &'static rp2040_pac::i2c0::RegisterBlock {
    // SAFETY: the block belongs to this module and, while nothing runs, to `recovery`.
    unsafe { &*I2C0::ptr() }
}

#[inline(always)]
fn now_us() -> u32 {
    // SAFETY: reading the raw timer has no effect on it.
    unsafe { (*TIMER::ptr()).timerawl().read().bits() }
}

/// Commands that the block has room for.
#[inline(always)]
fn room() -> usize {
    DEPTH.saturating_sub(i2c().ic_txflr().read().bits() as usize)
}

/// The transaction that runs: what it sends, how far it is, what came of it.
struct Transfer<'a> {
    job: &'a Job,
    next: &'a mut usize,
    outcome: &'a mut Outcome,
}

impl Transfer<'_> {
    /// Puts commands into the block while it has room.
    #[inline(always)]
    fn feed(&mut self, room: usize) {
        let length = self.job.length();
        let end = length.min(*self.next + room);
        for &command in self.job.commands.get(*self.next..end).unwrap_or_default() {
            // SAFETY: any command of eleven bits may be written.
            i2c()
                .ic_data_cmd()
                .write(|w| unsafe { w.bits(u32::from(command)) });
        }
        *self.next = end;
        let more = if end < length { TX_EMPTY } else { 0 };
        let mask = more | RX_FULL | TX_ABORT | STOP_DETECTED;
        // SAFETY: any mask may be written.
        i2c().ic_intr_mask().write(|w| unsafe { w.bits(mask) });
    }

    fn is_sent(&self) -> bool {
        *self.next >= self.job.length()
    }

    /// Takes the bytes that the block has.
    fn drain(&mut self) {
        let waiting = i2c().ic_rxflr().read().bits() as usize;
        let begin = usize::from(self.outcome.count);
        // No more than were asked for, so there is room.
        let end = (begin + waiting).min(MAX_BYTES);
        for place in self.outcome.bytes.get_mut(begin..end).unwrap_or_default() {
            *place = i2c().ic_data_cmd().read().bits() as u8;
        }
        self.outcome.count = end as u8;
    }
}

impl Engine {
    #[inline(always)]
    fn transfer(&mut self) -> Transfer<'_> {
        let place = (self.first + self.waiting) % FRAMES;
        let next = &mut self.next;
        match (self.runs, self.frames.get_mut(place)) {
            (Runs::Ahead, Some(outcome)) => Transfer {
                job: &self.ahead,
                next,
                outcome,
            },
            _ => Transfer {
                job: &self.single,
                next,
                outcome: &mut self.single_outcome,
            },
        }
    }

    #[inline(always)]
    fn start(&mut self, runs: Runs, stamp: Stamp) {
        self.runs = runs;
        self.next = 0;
        self.since_us = now_us();
        let mut transfer = self.transfer();
        transfer.outcome.count = 0;
        transfer.outcome.cause = 0;
        transfer.outcome.stamp = stamp;
        // A STOP of an earlier, aborted transaction may have come since.
        let _ = i2c().ic_clr_stop_det().read().bits();
        transfer.feed(room());
    }

    fn serve(&mut self) {
        if self.runs == Runs::Nothing {
            // SAFETY: no transaction runs, so no interrupt of the block is needed.
            i2c().ic_intr_mask().write(|w| unsafe { w.bits(0) });
            self.catch_up();
            return;
        }
        if precedence::must_wait(TO_SERVE) {
            return;
        }
        let mut transfer = self.transfer();
        let raised = i2c().ic_raw_intr_stat().read().bits();
        if raised & TX_ABORT != 0 {
            let cause = i2c().ic_tx_abrt_source().read().bits();
            let _ = i2c().ic_clr_tx_abrt().read().bits();
            *transfer.next = transfer.job.length();
            transfer.outcome.cause = cause | 1 << 31;
            if cause & ARBITRATION != 0 {
                self.finish();
                return;
            }
        } else {
            transfer.drain();
            if !transfer.is_sent() {
                transfer.feed(room());
            }
        }
        if raised & STOP_DETECTED != 0 {
            let _ = i2c().ic_clr_stop_det().read().bits();
            let is_read = transfer.outcome.count >= transfer.job.bytes;
            if transfer.is_sent() && (is_read || transfer.outcome.cause != 0) {
                transfer.outcome.stamp.ended_us = now_us();
                self.finish();
            }
        }
    }

    fn finish(&mut self) {
        // SAFETY: the transaction has ended, so no interrupt of the block is needed.
        i2c().ic_intr_mask().write(|w| unsafe { w.bits(0) });
        match self.runs {
            Runs::Ahead => self.waiting += 1,
            _ => self.single_is_over = true,
        }
        self.runs = Runs::Nothing;
        NVIC::pend(Interrupt::PIO0_IRQ_0);
        self.catch_up();
    }

    /// Begins with the edge that had to wait, if it can.
    #[inline(never)]
    fn catch_up(&mut self) {
        if self.is_ahead
            && self.runs == Runs::Nothing
            && self.waiting < FRAMES
            && self.is_late
            && !precedence::must_wait(TO_BEGIN)
        {
            self.is_late = false;
            let late_us = now_us().wrapping_sub(self.late.time_us);
            if self.late.is_known && late_us > self.latest_us {
                self.pass_over();
            } else {
                self.start(Runs::Ahead, self.late);
            }
        }
    }

    /// What the edge called for would be overwritten while it is read.
    #[inline(never)]
    fn pass_over(&mut self) {
        let place = (self.first + self.waiting) % FRAMES;
        if let Some(outcome) = self.frames.get_mut(place) {
            *outcome = Outcome {
                stamp: Stamp {
                    // Never: so long after its edge that no frame is in time.
                    ended_us: self.late.time_us.wrapping_sub(1),
                    ..self.late
                },
                ..Outcome::NONE
            };
            self.waiting += 1;
        }
        NVIC::pend(Interrupt::PIO0_IRQ_0);
    }

    fn edge(&mut self, stamp: Stamp) {
        self.edges = self.edges.wrapping_add(1);
        self.last_edge_us = stamp.time_us;
        self.is_late = true;
        self.late = stamp;
        self.catch_up();
    }
}

/// IO_IRQ_BANK0: INTB has fallen.
pub unsafe extern "C" fn on_edge() {
    // SAFETY: reading timer and counter changes nothing; INTR0 is cleared by this handler alone.
    let stamp = unsafe {
        let time_us = now_us();
        (*IO_BANK0::ptr()).intr(0).write(|w| w.bits(EDGE));
        let edges = (*PWM::ptr()).ch(pico::EDGE_SLICE).ctr().read().bits() as u16;
        Stamp {
            time_us,
            ended_us: time_us,
            edges,
            is_known: true,
        }
    };
    // SAFETY: see `Shared`.
    unsafe { (*ENGINE.0.get()).edge(stamp) }
}

/// I2C0_IRQ: the block wants something.
pub unsafe extern "C" fn on_i2c() {
    // SAFETY: see `Shared`.
    unsafe { (*ENGINE.0.get()).serve() }
}

/// Begins a transaction. `false` if another one runs.
#[inline(never)]
pub fn submit(job: &Job) -> bool {
    if runs_since_us().is_some() {
        return false;
    }
    // SAFETY: the single job is looked at while it runs only, and the master, which alone calls
    // this, waits for its end before the next.
    unsafe { (&raw mut (*ENGINE.0.get()).single).write(*job) };
    with(|engine| {
        if engine.runs != Runs::Nothing {
            return false;
        }
        engine.single_is_over = false;
        engine.start(Runs::Single, Stamp::default());
        true
    })
}

/// Lets the master look at the outcome of the transaction that was begun, once it is over.
#[inline(always)]
pub fn take_single<T>(look: impl FnOnce(&Outcome) -> T) -> Option<T> {
    let is_over = with(|engine| core::mem::take(&mut engine.single_is_over));
    // SAFETY: nothing writes to it until the next single job begins, which the caller does.
    is_over.then(|| look(unsafe { &(*ENGINE.0.get()).single_outcome }))
}

/// Keeps a transaction ready for edges, unless one is already.
#[inline(never)]
pub fn keep_ready(job: &Job) {
    if with(|engine| engine.is_ahead) {
        return;
    }
    // SAFETY: nothing looks at it while none is kept ready.
    unsafe { (&raw mut (*ENGINE.0.get()).ahead).write(*job) };
    with(|engine| {
        engine.is_ahead = true;
        engine.waiting = 0;
        engine.catch_up();
    });
}

/// Sets how long after its edge the job that is kept ready may begin.
pub fn set_latest(latest_us: u32) {
    with(|engine| engine.latest_us = latest_us);
}

/// What is kept ready for edges.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Ready {
    /// The transaction in question, with its number of commands.
    This(usize),
    /// Another one.
    Another,
    /// None.
    Nothing,
}

/// Whether the transaction of these operations is kept ready.
#[inline(always)]
pub fn ready(operations: &[Operation<'_>]) -> Ready {
    if !with(|engine| engine.is_ahead) {
        return Ready::Nothing;
    }
    // SAFETY: nothing writes to the job that is kept ready but `keep_ready`, which the caller, the
    // master, calls itself.
    let ahead = unsafe { &(*ENGINE.0.get()).ahead };
    if ahead.is(operations) {
        Ready::This(ahead.length())
    } else {
        Ready::Another
    }
}

/// Keeps nothing ready any more, and forgets what waits.
#[inline(never)]
pub fn rest() {
    with(|engine| {
        engine.is_ahead = false;
        engine.waiting = 0;
        engine.is_late = false;
        engine.single_is_over = false;
    });
}

/// The block was reset: what ran is lost.
#[inline(never)]
pub fn forget() {
    with(|engine| engine.runs = Runs::Nothing);
    rest();
}

/// Lets the master look at the oldest frame that waits, and then forgets it.
#[inline(always)]
pub fn take_frame<T>(look: impl FnOnce(&Outcome) -> T) -> Option<T> {
    let first = with(|engine| (engine.waiting > 0).then_some(engine.first))?;
    // SAFETY: the place is within the ring, and the engine writes to no frame that waits.
    let frame = unsafe {
        let frames: *const Outcome = (&raw const (*ENGINE.0.get()).frames).cast();
        &*frames.add(first)
    };
    let seen = look(frame);
    release_frame();
    Some(seen)
}

/// The oldest frame was taken.
#[inline(never)]
fn release_frame() {
    with(|engine| {
        engine.first = (engine.first + 1) % FRAMES;
        engine.waiting = engine.waiting.saturating_sub(1);
        engine.catch_up();
    });
}

/// Since when something runs, if something does.
#[inline(never)]
pub fn runs_since_us() -> Option<u32> {
    with(|engine| (engine.runs != Runs::Nothing).then_some(engine.since_us))
}

/// Time of the last edge and how many there were.
#[inline(never)]
pub fn last_edge() -> (u32, u32) {
    with(|engine| (engine.last_edge_us, engine.edges))
}

/// INTB is low, nothing runs, and no edge is known: takes this for an edge of now. An edge can be
/// missed while the bus is being recovered.
#[inline(never)]
pub fn begin_without_edge() {
    with(|engine| {
        if engine.runs == Runs::Nothing && !engine.is_late && engine.waiting == 0 {
            engine.is_late = true;
            engine.late = Stamp::default();
            engine.catch_up();
        }
    });
}
