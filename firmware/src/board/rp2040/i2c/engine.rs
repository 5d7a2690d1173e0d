//! The part of the I2C master and of the edge readers that runs in interrupts.
//!
//! A transaction is a [`Job`]: its commands are put into the block's queue as there is room, its
//! bytes are collected, and an interrupt of lower priority reports its end.
//!
//! Each converter's edge reader has a job of its own: every falling edge of that converter's INTB
//! begins it at once, or as soon as the bus is free, and its bytes wait with the edge's time until
//! the reader takes them. Thus a frame is fetched within a microsecond of the converter's call,
//! whatever the tasks do, and the next one while they still work on the last.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;

use palpate_node::converter::{CONVERTERS, MOST_FRAME_BYTES};
use rp2040_pac::{I2C0, IO_BANK0, Interrupt, NVIC, PWM, TIMER};

use crate::board::pins;
use crate::board::rp2040::control::precedence::{self, TO_BEGIN, TO_SERVE};

/// Commands of the longest frame: by register pointer, high byte and low byte.
const MAX_COMMANDS: usize = MOST_FRAME_BYTES / 2 * 3;
/// Bytes of the longest frame, in whole words.
const MAX_BYTES: usize = MOST_FRAME_BYTES.next_multiple_of(4);
/// Frames that can wait for their reader.
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

/// A transaction.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Job {
    length: u8,
    bytes: u8,
    address: u8,
    commands: [u16; MAX_COMMANDS],
}

impl Job {
    /// Without commands.
    const EMPTY: Self = Self::to(0);

    /// A transaction with a target, without commands yet.
    pub const fn to(address: u8) -> Self {
        Self {
            length: 0,
            bytes: 0,
            address,
            commands: [0; MAX_COMMANDS],
        }
    }

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

    /// Number of commands.
    pub const fn length(&self) -> usize {
        self.length as usize
    }
}

/// What came of a transaction.
#[derive(Clone, Copy)]
pub struct Outcome {
    /// Room for the bytes; see [`Self::bytes`].
    pub bytes: [u8; MAX_BYTES],
    /// How many were read.
    pub count: u8,
    /// The edge that began it, if one did.
    pub stamp: Stamp,
    /// Why it was aborted, by the block's own bits; 0 if it was not.
    pub cause: u32,
}

impl Outcome {
    /// The bytes that were read.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.count.into()).unwrap_or_default()
    }

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

/// What runs on the bus.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Runs {
    Nothing,
    /// The frame of a converter.
    Frame(usize),
    /// The transaction of a master.
    Single,
    /// The bus is being freed: the block is in its reset or has no pins, and what is called for meanwhile waits.
    Recovery,
}

/// The frames of one converter.
#[repr(C)]
struct Reader {
    /// Edges begin its job.
    is_on: bool,
    /// There is an edge that came while the bus was taken: `late`.
    is_late: bool,
    /// Places in `frames`: of the oldest, and how many wait.
    first: usize,
    waiting: usize,
    last_edge_us: u32,
    /// How long after its edge the job may begin, in microseconds.
    latest_us: u32,
    late: Stamp,
    job: Job,
    frames: [Outcome; FRAMES],
}

impl Reader {
    const OFF: Self = Self {
        is_on: false,
        is_late: false,
        first: 0,
        waiting: 0,
        last_edge_us: 0,
        latest_us: u32::MAX,
        late: Outcome::NONE.stamp,
        job: Job::EMPTY,
        frames: [Outcome::NONE; FRAMES],
    };

    fn can_begin(&self) -> bool {
        self.is_late && self.is_on && self.waiting < FRAMES
    }

    /// What the edge called for would be overwritten while it is read.
    #[inline(never)]
    fn pass_over(&mut self) {
        let slot = (self.first + self.waiting) % FRAMES;
        if let Some(outcome) = self.frames.get_mut(slot) {
            *outcome = Outcome {
                stamp: Stamp {
                    // Never: so long after its edge that no frame is in time.
                    ended_us: self.late.time_us.wrapping_sub(1),
                    ..self.late
                },
                count: self.job.bytes,
                ..Outcome::NONE
            };
            self.waiting += 1;
        }
        NVIC::pend(Interrupt::PIO0_IRQ_0);
    }
}

/// What every interrupt needs comes first: the processor reaches it in one instruction.
#[repr(C)]
struct Engine {
    runs: Runs,
    next: usize,
    since_us: u32,
    /// The target that the block is set to.
    address: u8,
    /// Whose transaction the single one is, whether it waits for the bus, and whether it is over.
    owner: usize,
    single_waits: bool,
    single_is_over: bool,
    readers: [Reader; CONVERTERS],
    /// The transaction that a master began itself.
    single: Job,
    single_outcome: Outcome,
}

struct Shared(UnsafeCell<Engine>);

// SAFETY: it is reached through `with`, which no interrupt can divide, and from the two handlers,
// which have the same, highest priority and so never divide one another.
unsafe impl Sync for Shared {}

static ENGINE: Shared = Shared(UnsafeCell::new(Engine {
    runs: Runs::Nothing,
    next: 0,
    since_us: 0,
    address: 0,
    owner: 0,
    single_waits: false,
    single_is_over: false,
    readers: [const { Reader::OFF }; CONVERTERS],
    single: Job::EMPTY,
    single_outcome: Outcome::NONE,
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
        for slot in self.outcome.bytes.get_mut(begin..end).unwrap_or_default() {
            *slot = i2c().ic_data_cmd().read().bits() as u8;
        }
        self.outcome.count = end as u8;
    }
}

impl Engine {
    #[inline(always)]
    fn transfer(&mut self) -> Transfer<'_> {
        let next = &mut self.next;
        if let Runs::Frame(converter) = self.runs
            && let Some(reader) = self.readers.get_mut(converter)
            && let slot = (reader.first + reader.waiting) % FRAMES
            && let Some(outcome) = reader.frames.get_mut(slot)
        {
            return Transfer {
                job: &reader.job,
                next,
                outcome,
            };
        }
        Transfer {
            job: &self.single,
            next,
            outcome: &mut self.single_outcome,
        }
    }

    #[inline(always)]
    fn start(&mut self, runs: Runs, stamp: Stamp) {
        self.runs = runs;
        self.next = 0;
        self.since_us = now_us();
        let before = self.address;
        let mut transfer = self.transfer();
        let address = transfer.job.address;
        if address != before {
            set_target(address);
        }
        transfer.outcome.count = 0;
        transfer.outcome.cause = 0;
        transfer.outcome.stamp = stamp;
        // A STOP of an earlier, aborted transaction may have come since.
        let _ = i2c().ic_clr_stop_det().read().bits();
        transfer.feed(room());
        self.address = address;
    }

    fn serve(&mut self) {
        if self.runs == Runs::Recovery {
            return;
        }
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
            Runs::Frame(converter) => {
                if let Some(reader) = self.readers.get_mut(converter) {
                    reader.waiting += 1;
                }
            }
            _ => self.single_is_over = true,
        }
        self.runs = Runs::Nothing;
        NVIC::pend(Interrupt::PIO0_IRQ_0);
        self.catch_up();
    }

    /// Begins with what waits, if it can: first the frame whose edge is known and oldest, then the
    /// transaction of a master, then a frame without an edge.
    #[inline(never)]
    fn catch_up(&mut self) {
        if self.runs != Runs::Nothing {
            return;
        }
        let frame = self.frame_that_waits();
        let is_known = |converter: usize| {
            let reader = self.readers.get(converter);
            reader.is_some_and(|reader| reader.late.is_known)
        };
        let single = self.single_waits && !frame.is_some_and(is_known);
        if frame.is_none() && !single || precedence::must_wait(TO_BEGIN) {
            return;
        }
        match frame {
            Some(converter) if !single => self.begin_frame(converter),
            _ => {
                self.single_waits = false;
                self.start(Runs::Single, Stamp::default());
            }
        }
    }

    /// The converter whose frame waits, and waits longest.
    #[inline(always)]
    fn frame_that_waits(&self) -> Option<usize> {
        let [first, second] = &self.readers;
        match (first.can_begin(), second.can_begin()) {
            (false, false) => None,
            (true, false) => Some(0),
            (false, true) => Some(1),
            (true, true) if !first.late.is_known => Some(1),
            (true, true) if !second.late.is_known => Some(0),
            (true, true) => {
                let later_us = second.late.time_us.wrapping_sub(first.late.time_us);
                Some(usize::from(later_us > u32::MAX / 2))
            }
        }
    }

    #[inline(always)]
    fn begin_frame(&mut self, converter: usize) {
        let Some(reader) = self.readers.get_mut(converter) else {
            return;
        };
        reader.is_late = false;
        let late = reader.late;
        let late_us = now_us().wrapping_sub(late.time_us);
        if late.is_known && late_us > reader.latest_us {
            reader.pass_over();
        } else {
            self.start(Runs::Frame(converter), late);
        }
    }

    #[inline(always)]
    fn edge(&mut self, converter: usize, stamp: Stamp) {
        if let Some(reader) = self.readers.get_mut(converter) {
            reader.last_edge_us = stamp.time_us;
            reader.is_late = true;
            reader.late = stamp;
        }
        self.catch_up();
    }
}

/// Sets the block's target, which it takes while it is disabled only (RP2040 datasheet 4.3.17).
#[inline(never)]
fn set_target(address: u8) {
    // SAFETY: nothing runs; the address has seven bits.
    unsafe {
        i2c().ic_enable().write(|w| w.bits(0));
        i2c().ic_tar().write(|w| w.bits(u32::from(address)));
        i2c().ic_enable().write(|w| w.bits(1));
    }
}

/// IO_IRQ_BANK0: INTB of a converter has fallen.
pub unsafe extern "C" fn on_edge() {
    let time_us = now_us();
    for (converter, line) in pins::INTB_LINES.iter().enumerate() {
        let (register, edge) = line.falling();
        // SAFETY: reading counter and flags changes nothing; INTR is cleared by this handler alone.
        let edges = unsafe {
            let flags = (*IO_BANK0::ptr()).intr(register);
            if flags.read().bits() & edge == 0 {
                continue;
            }
            flags.write(|w| w.bits(edge));
            (*PWM::ptr()).ch(line.slice()).ctr().read().bits() as u16
        };
        let stamp = Stamp {
            time_us,
            ended_us: time_us,
            edges,
            is_known: true,
        };
        // SAFETY: see `Shared`.
        unsafe { (*ENGINE.0.get()).edge(converter, stamp) }
    }
}

/// I2C0_IRQ: the block wants something.
pub unsafe extern "C" fn on_i2c() {
    // SAFETY: see `Shared`.
    unsafe { (*ENGINE.0.get()).serve() }
}

/// What is over for each converter: its single transaction, and a frame at least.
pub struct Over {
    /// The transaction of its master.
    pub single: bool,
    /// A frame of its reader.
    pub frame: bool,
}

/// What is over for a converter.
pub fn over(converter: usize) -> Over {
    with(|engine| Over {
        single: engine.single_is_over && engine.owner == converter,
        frame: engine
            .readers
            .get(converter)
            .is_some_and(|reader| reader.waiting > 0),
    })
}

/// Lets a transaction of a converter's master begin as soon as the bus is free. `false` if that of the
/// other's is not over, or not taken.
#[inline(never)]
pub fn submit(converter: usize, job: &Job) -> bool {
    with(|engine| {
        let is_taken = engine.single_waits
            || engine.single_is_over && engine.owner != converter
            || engine.runs == Runs::Single;
        if is_taken {
            return false;
        }
        engine.single = *job;
        engine.owner = converter;
        engine.single_waits = true;
        engine.single_is_over = false;
        engine.catch_up();
        true
    })
}

/// Since when the transaction of a converter's master runs; nothing while it waits for the bus.
pub fn runs_since_us(converter: usize) -> Option<u32> {
    with(|engine| {
        (engine.runs == Runs::Single && engine.owner == converter).then_some(engine.since_us)
    })
}

/// Lets a master see the outcome of its transaction, once that is over.
#[inline(always)]
pub fn take_single<T>(converter: usize, work: impl FnOnce(&Outcome) -> T) -> Option<T> {
    let is_over = with(|engine| engine.single_is_over && engine.owner == converter);
    if !is_over {
        return None;
    }
    // SAFETY: nothing writes to it until the next single transaction begins, which `submit` does not
    // allow before this one is taken.
    let done = work(unsafe { &(*ENGINE.0.get()).single_outcome });
    with(|engine| engine.single_is_over = false);
    Some(done)
}

/// Lets every edge of a converter begin this job, which may begin so long after its edge.
#[inline(never)]
pub fn read_on_edges(converter: usize, job: &Job, latest_us: u32) {
    with_reader(converter, |reader| {
        reader.job = *job;
        reader.latest_us = latest_us;
        reader.is_on = true;
        reader.waiting = 0;
    });
    with(Engine::catch_up);
}

fn with_reader<T>(converter: usize, work: impl FnOnce(&mut Reader) -> T) -> Option<T> {
    with(|engine| engine.readers.get_mut(converter).map(work))
}

/// Lets edges of a converter begin nothing any more, and forgets what waits.
#[inline(never)]
pub fn rest(converter: usize) {
    with_reader(converter, |reader| {
        reader.is_on = false;
        reader.is_late = false;
        reader.waiting = 0;
    });
}

/// The block will be reset: what ran is lost, and nothing begins before [`go_on`].
#[inline(never)]
pub fn forget() {
    with(|engine| {
        engine.runs = Runs::Recovery;
        // SAFETY: nothing runs any more, and an interrupt would come again and again.
        i2c().ic_intr_mask().write(|w| unsafe { w.bits(0) });
        engine.address = 0;
        engine.single_waits = false;
        engine.single_is_over = false;
    });
}

/// The block can be used again: begins with what waits.
#[inline(never)]
pub fn go_on() {
    with(|engine| {
        engine.runs = Runs::Nothing;
        engine.catch_up();
    });
}

/// Lets a reader see its oldest frame that waits, and then forgets that.
#[inline(always)]
pub fn take_frame<T>(converter: usize, work: impl FnOnce(&Outcome) -> T) -> Option<T> {
    let first = with_reader(converter, |reader| {
        (reader.waiting > 0).then_some(reader.first)
    })??;
    // SAFETY: the engine writes to no frame that waits.
    let reader = unsafe { (&raw const (*ENGINE.0.get()).readers).cast::<Reader>() };
    // SAFETY: the converter is one of the array's, since it has a reader; see above.
    let frames = unsafe { &(*reader.add(converter)).frames };
    let done = frames.get(first).map(work);
    release_frame(converter);
    done
}

/// The oldest frame was taken.
#[inline(never)]
fn release_frame(converter: usize) {
    with_reader(converter, |reader| {
        reader.first = (reader.first + 1) % FRAMES;
        reader.waiting = reader.waiting.saturating_sub(1);
    });
    with(Engine::catch_up);
}

/// Since when the frame of a converter is being read, if it is.
#[inline(never)]
pub fn reads_since_us(converter: usize) -> Option<u32> {
    with(|engine| (engine.runs == Runs::Frame(converter)).then_some(engine.since_us))
}

/// Time of a converter's last edge.
#[inline(never)]
pub fn last_edge_us(converter: usize) -> u32 {
    with_reader(converter, |reader| reader.last_edge_us).unwrap_or_default()
}

/// INTB of a converter is low and no edge is known: takes this for an edge of now. An edge can be
/// missed while the bus is being recovered.
#[inline(never)]
pub fn begin_without_edge(converter: usize) {
    with(|engine| {
        let runs = engine.runs == Runs::Frame(converter);
        if let Some(reader) = engine.readers.get_mut(converter)
            && !runs
            && !reader.is_late
            && reader.waiting == 0
        {
            reader.is_late = true;
            reader.late = Stamp::default();
            engine.catch_up();
        }
    });
}
