//! The part of the I2C master and of the edge readers that runs in interrupts.
//!
//! A transaction is a [`Job`]: its commands are put into the block's queue as there is room, its
//! bytes are collected, and an interrupt of lower priority reports its end.
//!
//! Each converter's edge reader has a job of its own: every falling edge of that converter's INTB
//! begins it at once, or as soon as the bus is free, and its bytes wait with the edge's time until
//! the reader takes them. Thus a frame is fetched within a microsecond of the converter's call,
//! whatever the tasks do, and the next one while they still work on the last.
//!
//! Where two converters share the bus they take turns: a frame then has several parts, each a
//! transaction of its own, and after each part or transaction the other converter goes first.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;

use palpate_node::acquisition::MOST_PARTS;
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
/// In an outcome's cause: there is one.
const IS_ABORTED: u32 = 1 << 31;

/// A byte takes nine periods; at 160 kHz each is 6.25 us. A bus whose edges are slow still works: at 400 kHz
/// as set, a rise of 3 us makes it 182 kHz.
const BYTE_US: u32 = 57;
/// What a master and its interrupts need besides.
const MARGIN_US: u32 = 200;
/// No transaction may take longer.
const LONGEST_US: u32 = 5_000;

/// From the transaction's own start; it is polled when a pulse comes, every millisecond. A register takes
/// three commands and five bytes on the wire: address, pointer, address, and two of data.
pub const fn deadline_us(commands: usize) -> u32 {
    let bytes = commands as u32 * 5 / 3 + 2;
    let deadline_us = bytes * BYTE_US + MARGIN_US;
    if deadline_us < LONGEST_US {
        deadline_us
    } else {
        LONGEST_US
    }
}

/// The moment of an edge.
#[derive(Clone, Copy, Default)]
pub struct Stamp {
    /// The lower half of the microsecond timer.
    pub time_us: u32,
    /// Edges that the hardware has counted.
    pub edges: u16,
    /// There was an edge: its time is known.
    pub is_known: bool,
}

/// Commands, and the bytes that they read.
#[derive(Clone, Copy, Default)]
struct Extent {
    commands: u8,
    bytes: u8,
}

/// A transaction, or several one after the other.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Job {
    length: u8,
    bytes: u8,
    address: u8,
    /// The first transaction, and each later one.
    first: Extent,
    later: Extent,
    /// How long one of them may take.
    deadline_us: u32,
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
            first: Extent {
                commands: 0,
                bytes: 0,
            },
            later: Extent {
                commands: 0,
                bytes: 0,
            },
            deadline_us: 0,
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

    /// Ends it as one transaction; nothing if it has no commands.
    pub fn stop(&mut self) -> Option<()> {
        self.first = Extent {
            commands: self.length,
            bytes: self.bytes,
        };
        self.deadline_us = deadline_us(self.length.into());
        let last = usize::from(self.length).checked_sub(1)?;
        *self.commands.get_mut(last)? |= STOP;
        Some(())
    }

    /// Ends it as so many transactions of a frame: each after the first reads two registers.
    pub fn stop_parts(&mut self, parts: u8) -> Option<()> {
        const PART: Extent = Extent {
            commands: 6,
            bytes: 4,
        };
        self.stop()?;
        self.later = PART;
        for _ in 1..parts {
            self.first.commands = self.first.commands.checked_sub(PART.commands)?;
            self.first.bytes = self.first.bytes.checked_sub(PART.bytes)?;
            let after = usize::from(self.length.checked_sub(self.first.commands)?);
            let last = usize::from(self.length).checked_sub(after + 1)?;
            *self.commands.get_mut(last)? |= STOP;
        }
        Some(())
    }

    /// Number of commands.
    pub const fn length(&self) -> usize {
        self.length as usize
    }
}

/// What came of a transaction.
#[derive(Clone, Copy)]
pub struct TransferOutcome {
    /// Room for the bytes; see [`Self::bytes`].
    pub bytes: [u8; MAX_BYTES],
    /// How many were read.
    pub count: u8,
    /// The edge that began it, if one did.
    pub stamp: Stamp,
    /// When each part of the frame was over.
    pub ended_us: [u32; MOST_PARTS],
    /// Why it was aborted, by the block's own bits; 0 if it was not.
    pub cause: u32,
}

impl TransferOutcome {
    /// The bytes that were read.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.count.into()).unwrap_or_default()
    }

    const NONE: Self = Self {
        bytes: [0; MAX_BYTES],
        count: 0,
        stamp: Stamp {
            time_us: 0,
            edges: 0,
            is_known: false,
        },
        ended_us: [0; MOST_PARTS],
        cause: 0,
    };
}

/// What runs on the bus.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Runs {
    Nothing,
    /// The frame of a converter.
    Frame(usize),
    /// The transaction of a converter's master.
    Single(usize),
    /// The bus is being freed: the block is in its reset or has no pins, what is called for meanwhile waits, and
    /// what ran will have failed.
    Recovery,
}

/// The transaction that a converter's master began.
#[repr(C)]
struct Single {
    /// It waits for the bus.
    waits: bool,
    is_over: bool,
    job: Job,
    outcome: TransferOutcome,
}

impl Single {
    const NONE: Self = Self {
        waits: false,
        is_over: false,
        job: Job::EMPTY,
        outcome: TransferOutcome::NONE,
    };
}

/// The frames of one converter.
#[repr(C)]
struct Reader {
    /// Edges begin its job.
    is_on: bool,
    /// There is an edge that came while the bus was taken: `late`.
    is_late: bool,
    /// The next part of its frame, and the command with which that begins: 0 before the frame has begun.
    part: usize,
    next: usize,
    /// Places in `frames`: of the oldest, and how many wait.
    first: usize,
    waiting: usize,
    last_edge_us: u32,
    /// How long after its edge each part may begin, in microseconds.
    latest_us: [u32; MOST_PARTS],
    late: Stamp,
    job: Job,
    frames: [TransferOutcome; FRAMES],
}

impl Reader {
    const OFF: Self = Self {
        is_on: false,
        is_late: false,
        part: 0,
        next: 0,
        first: 0,
        waiting: 0,
        last_edge_us: 0,
        latest_us: [u32::MAX; MOST_PARTS],
        late: TransferOutcome::NONE.stamp,
        job: Job::EMPTY,
        frames: [TransferOutcome::NONE; FRAMES],
    };

    /// Whether its frame can go on or begin; in the second case whether its edge is known.
    #[inline(always)]
    fn can_begin(&self, is_known: bool) -> bool {
        if self.next > 0 {
            return is_known;
        }
        self.is_late && self.is_on && self.waiting < FRAMES && self.late.is_known == is_known
    }

    #[inline(always)]
    fn slot(&self) -> usize {
        (self.first + self.waiting) % FRAMES
    }

    /// Prepares the next part of its frame. `false` if what it reads would be overwritten meanwhile: the
    /// frame is over then.
    #[inline(always)]
    fn prepare(&mut self) -> bool {
        let slot = self.slot();
        let Some(outcome) = self.frames.get_mut(slot) else {
            return false;
        };
        if self.next == 0 {
            self.is_late = false;
            outcome.count = 0;
            outcome.cause = 0;
            outcome.stamp = self.late;
        }
        let stamp = outcome.stamp;
        let latest_us = self.latest_us.get(self.part).copied().unwrap_or_default();
        if !stamp.is_known || now_us().wrapping_sub(stamp.time_us) <= latest_us {
            return true;
        }
        self.pass_over();
        false
    }

    /// What the edge called for would be overwritten while it is read.
    #[inline(never)]
    fn pass_over(&mut self) {
        let slot = self.slot();
        if let Some(outcome) = self.frames.get_mut(slot) {
            // Never: so long after its edge that no frame is in time.
            let never_us = outcome.stamp.time_us.wrapping_sub(1);
            *outcome = TransferOutcome {
                stamp: outcome.stamp,
                ended_us: [never_us; MOST_PARTS],
                count: self.job.bytes,
                ..TransferOutcome::NONE
            };
        }
        self.is_whole();
        NVIC::pend(Interrupt::PIO0_IRQ_0);
    }

    /// The next part of its frame.
    #[inline(always)]
    fn extent(&self) -> Extent {
        if self.next == 0 {
            self.job.first
        } else {
            self.job.later
        }
    }

    /// A part of its frame is over, up to this command.
    #[inline(always)]
    fn part_is_over(&mut self, end: usize) {
        let (slot, part) = (self.slot(), self.part);
        let Some(outcome) = self.frames.get_mut(slot) else {
            return;
        };
        if let Some(ended_us) = outcome.ended_us.get_mut(part) {
            *ended_us = now_us();
        }
        if self.is_on && outcome.cause == 0 && end < self.job.length() {
            self.part += 1;
            self.next = end;
        } else {
            self.is_whole();
        }
    }

    /// Its frame is over, and waits.
    fn is_whole(&mut self) {
        self.part = 0;
        self.next = 0;
        self.waiting += usize::from(self.is_on);
    }
}

/// What every interrupt needs comes first: the processor reaches it in one instruction.
#[repr(C)]
struct Engine {
    runs: Runs,
    /// The next command, the end of the transaction's commands, and how many bytes it has read by then.
    next: usize,
    end: usize,
    bytes: u8,
    /// The target that the block is set to.
    address: u8,
    since_us: u32,
    deadline_us: u32,
    /// The converter that had the bus last: the other one goes first.
    last: usize,
    /// What ran when recovery began.
    cut: Runs,
    readers: [Reader; CONVERTERS],
    singles: [Single; CONVERTERS],
}

struct Shared(UnsafeCell<Engine>);

// SAFETY: it is reached through `with`, which no interrupt can divide, and from the two handlers,
// which have the same, highest priority and so never divide one another.
unsafe impl Sync for Shared {}

static ENGINE: Shared = Shared(UnsafeCell::new(Engine {
    runs: Runs::Nothing,
    next: 0,
    end: 0,
    bytes: 0,
    address: 0,
    since_us: 0,
    deadline_us: 0,
    last: 0,
    cut: Runs::Nothing,
    readers: [const { Reader::OFF }; CONVERTERS],
    singles: [const { Single::NONE }; CONVERTERS],
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
    end: usize,
    outcome: &'a mut TransferOutcome,
}

impl Transfer<'_> {
    /// Puts commands into the block while it has room.
    #[inline(always)]
    fn feed(&mut self, room: usize) {
        let end = self.end.min(*self.next + room);
        for &command in self.job.commands.get(*self.next..end).unwrap_or_default() {
            // SAFETY: any command of eleven bits may be written.
            i2c()
                .ic_data_cmd()
                .write(|w| unsafe { w.bits(u32::from(command)) });
        }
        *self.next = end;
        let more = if end < self.end { TX_EMPTY } else { 0 };
        let mask = more | RX_FULL | TX_ABORT | STOP_DETECTED;
        // SAFETY: any mask may be written.
        i2c().ic_intr_mask().write(|w| unsafe { w.bits(mask) });
    }

    fn is_sent(&self) -> bool {
        *self.next >= self.end
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
    /// What runs; nothing while nothing does.
    #[inline(always)]
    fn transfer(&mut self) -> Option<Transfer<'_>> {
        let (next, end) = (&mut self.next, self.end);
        let (job, outcome) = match self.runs {
            Runs::Frame(converter) => {
                let reader = self.readers.get_mut(converter)?;
                let slot = reader.slot();
                (&reader.job, reader.frames.get_mut(slot)?)
            }
            Runs::Single(converter) => {
                let single = self.singles.get_mut(converter)?;
                (&single.job, &mut single.outcome)
            }
            Runs::Nothing | Runs::Recovery => return None,
        };
        Some(Transfer {
            job,
            next,
            end,
            outcome,
        })
    }

    /// Begins with a transaction, whose outcome is prepared.
    #[inline(always)]
    fn start(&mut self, runs: Runs, next: usize, extent: Extent, bytes: u8) {
        self.note_edges();
        self.runs = runs;
        self.next = next;
        self.end = next + usize::from(extent.commands);
        self.bytes = bytes + extent.bytes;
        self.since_us = now_us();
        let before = self.address;
        let Some(mut transfer) = self.transfer() else {
            return;
        };
        let (address, deadline_us) = (transfer.job.address, transfer.job.deadline_us);
        if address != before {
            set_target(address);
        }
        // A STOP of an earlier, aborted transaction may have come since.
        let _ = i2c().ic_clr_stop_det().read().bits();
        transfer.feed(room());
        self.address = address;
        self.deadline_us = deadline_us;
    }

    fn serve(&mut self) {
        let (runs, bytes) = (self.runs, self.bytes);
        if matches!(runs, Runs::Recovery) {
            return;
        }
        if matches!(runs, Runs::Nothing) {
            // SAFETY: no transaction runs, so no interrupt of the block is needed.
            i2c().ic_intr_mask().write(|w| unsafe { w.bits(0) });
            self.catch_up();
            return;
        }
        if precedence::must_wait(TO_SERVE) {
            return;
        }
        let Some(mut transfer) = self.transfer() else {
            return;
        };
        let raised = i2c().ic_raw_intr_stat().read().bits();
        if raised & TX_ABORT != 0 {
            let cause = i2c().ic_tx_abrt_source().read().bits();
            let _ = i2c().ic_clr_tx_abrt().read().bits();
            *transfer.next = transfer.end;
            transfer.outcome.cause = cause | IS_ABORTED;
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
            let is_read = transfer.outcome.count >= bytes;
            if transfer.is_sent() && (is_read || transfer.outcome.cause != 0) {
                self.finish();
            }
        }
    }

    /// A transaction is over.
    fn finish(&mut self) {
        // SAFETY: the transaction has ended, so no interrupt of the block is needed.
        i2c().ic_intr_mask().write(|w| unsafe { w.bits(0) });
        match self.runs {
            Runs::Frame(converter) => {
                if let Some(reader) = self.readers.get_mut(converter) {
                    reader.part_is_over(self.end);
                }
            }
            Runs::Single(converter) => {
                if let Some(single) = self.singles.get_mut(converter) {
                    single.is_over = true;
                }
            }
            Runs::Nothing | Runs::Recovery => {}
        }
        self.runs = Runs::Nothing;
        NVIC::pend(Interrupt::PIO0_IRQ_0);
        self.note_edges();
        self.catch_up();
    }

    /// Begins with what waits, if it can.
    #[inline(never)]
    fn catch_up(&mut self) {
        while matches!(self.runs, Runs::Nothing) {
            let Some(next) = self.next_in_turn() else {
                return;
            };
            if precedence::must_wait(TO_BEGIN) {
                return;
            }
            match next {
                Runs::Frame(converter) => self.begin_frame(converter),
                Runs::Single(converter) => self.begin_single(converter),
                Runs::Nothing | Runs::Recovery => return,
            }
        }
    }

    /// What is next: a frame whose edge is known, the transaction of a master, a frame without an edge;
    /// of two alike that of the converter that did not have the bus last.
    #[inline(always)]
    fn next_in_turn(&self) -> Option<Runs> {
        let [first, second] = &self.readers;
        let in_turn = |of_first: bool, of_second: bool| match (of_first, of_second) {
            (false, false) => None,
            (true, true) => Some(usize::from(self.last == 0)),
            (_, of_second) => Some(usize::from(of_second)),
        };
        if let Some(converter) = in_turn(first.can_begin(true), second.can_begin(true)) {
            return Some(Runs::Frame(converter));
        }
        let [one, other] = &self.singles;
        if let Some(converter) = in_turn(one.waits, other.waits) {
            return Some(Runs::Single(converter));
        }
        in_turn(first.can_begin(false), second.can_begin(false)).map(Runs::Frame)
    }

    #[inline(always)]
    fn begin_frame(&mut self, converter: usize) {
        let Some(reader) = self.readers.get_mut(converter) else {
            return;
        };
        if !reader.prepare() {
            return;
        }
        let (next, extent) = (reader.next, reader.extent());
        let slot = reader.slot();
        let read = reader.frames.get(slot).map_or(0, |outcome| outcome.count);
        self.last = converter;
        self.start(Runs::Frame(converter), next, extent, read);
    }

    #[inline(never)]
    fn begin_single(&mut self, converter: usize) {
        let Some(single) = self.singles.get_mut(converter) else {
            return;
        };
        single.waits = false;
        single.outcome.count = 0;
        single.outcome.cause = 0;
        let extent = single.job.first;
        self.last = converter;
        self.start(Runs::Single(converter), 0, extent, 0);
    }

    /// Takes the time of an edge that has come during an interrupt of the bus, which may last three
    /// microseconds: it is not to wait until that has ended.
    #[inline(always)]
    fn note_edges(&mut self) {
        if NVIC::is_pending(Interrupt::IO_IRQ_BANK0) {
            self.take_late_edges();
        }
    }

    #[inline(never)]
    fn take_late_edges(&mut self) {
        self.take_edges(false);
    }

    /// Takes the edges of INTB that have come, and begins with a frame at once if it may and nothing runs:
    /// nothing else waits then, but for what waits for the coil's interrupt.
    #[inline(always)]
    fn take_edges(&mut self, at_once: bool) {
        let time_us = now_us();
        for (converter, line) in pins::INTB_LINES.iter().enumerate() {
            let (register, edge) = line.falling();
            // SAFETY: reading counter and flags changes nothing; INTR is cleared here alone.
            let edges = unsafe {
                let flags = (*IO_BANK0::ptr()).intr(register);
                if flags.read().bits() & edge == 0 {
                    continue;
                }
                flags.write(|w| w.bits(edge));
                (*PWM::ptr()).ch(line.slice()).ctr().read().bits() as u16
            };
            // Low until the converter is read: high again, it was a disturbance of the wire.
            if pins::is_high(line.pin) && !self.serves(converter) {
                continue;
            }
            if let Some(reader) = self.readers.get_mut(converter) {
                reader.last_edge_us = time_us;
                reader.is_late = true;
                reader.late = Stamp {
                    time_us,
                    edges,
                    is_known: true,
                };
                let is_free = matches!(self.runs, Runs::Nothing) && reader.next == 0;
                if at_once && is_free && reader.can_begin(true) && !precedence::must_wait(TO_BEGIN)
                {
                    self.begin_frame(converter);
                }
            }
        }
    }

    /// Whether a transaction with a converter runs, which may release its INTB.
    fn serves(&self, converter: usize) -> bool {
        self.runs == Runs::Frame(converter) || self.runs == Runs::Single(converter)
    }

    /// Whether what runs has run for longer than it may.
    fn is_overdue(&self) -> bool {
        matches!(self.runs, Runs::Frame(_) | Runs::Single(_))
            && now_us().wrapping_sub(self.since_us) > self.deadline_us
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
    // SAFETY: see `Shared`.
    let engine = unsafe { &mut *ENGINE.0.get() };
    engine.take_edges(true);
    engine.catch_up();
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
    with(|engine| {
        let single = engine.singles.get(converter);
        let reader = engine.readers.get(converter);
        Over {
            single: single.is_some_and(|single| single.is_over),
            frame: reader.is_some_and(|reader| reader.waiting > 0),
        }
    })
}

/// Lets the transaction of a converter's master begin when its turn comes. Its last one was taken.
#[inline(never)]
pub fn submit(converter: usize, job: &Job) {
    with(|engine| {
        if let Some(single) = engine.singles.get_mut(converter) {
            single.job = *job;
            single.waits = true;
            single.is_over = false;
        }
    });
    call();
}

/// Lets the interrupt begin with what waits: a task that did would hold back the time stamp of an edge.
fn call() {
    NVIC::pend(Interrupt::I2C0_IRQ);
}

/// Takes the transaction of a converter's master back if it waits still; whether it did.
#[inline(never)]
pub fn withdraw(converter: usize) -> bool {
    with(|engine| {
        let single = engine.singles.get_mut(converter);
        single.is_some_and(|single| core::mem::replace(&mut single.waits, false))
    })
}

/// Begins recovery if what runs on the bus has run for longer than it may, whose ever it is: nothing
/// begins until [`end_recovery`]. Whether it has.
#[inline(never)]
pub fn begin_recovery() -> bool {
    with(|engine| {
        let is_overdue = engine.is_overdue();
        if is_overdue {
            engine.cut = engine.runs;
            engine.runs = Runs::Recovery;
            // SAFETY: nothing runs any more, and an interrupt would come again and again.
            i2c().ic_intr_mask().write(|w| unsafe { w.bits(0) });
        }
        is_overdue
    })
}

/// The block was reset and the bus freed, or not: what ran has failed of this cause, and what waits goes
/// on.
#[inline(never)]
pub fn end_recovery(cause: u32) {
    with(|engine| {
        engine.address = 0;
        engine.runs = engine.cut;
        if let Some(transfer) = engine.transfer() {
            transfer.outcome.cause = cause | IS_ABORTED;
        }
        engine.finish();
    });
}

/// Lets a master see the outcome of its transaction, once that is over.
#[inline(always)]
pub fn take_single<T>(converter: usize, work: impl FnOnce(&TransferOutcome) -> T) -> Option<T> {
    let is_over = with(|engine| {
        let single = engine.singles.get(converter);
        single.is_some_and(|single| single.is_over)
    });
    if !is_over {
        return None;
    }
    // SAFETY: nothing writes to it until the converter's next single transaction begins, which its master
    // submits after this one is taken.
    let single = unsafe { (&raw const (*ENGINE.0.get()).singles).cast::<Single>() };
    // SAFETY: the converter is one of the array's, since it has a transaction; see above.
    let done = work(unsafe { &(*single.add(converter)).outcome });
    with(|engine| {
        if let Some(single) = engine.singles.get_mut(converter) {
            single.is_over = false;
        }
    });
    Some(done)
}

/// Lets every edge of a converter begin this job, each part of which may begin so long after its edge.
#[inline(never)]
pub fn read_on_edges(converter: usize, job: &Job, latest_us: [u32; MOST_PARTS]) {
    // An edge whose converter has been read since calls for nothing.
    let is_low = !pins::is_high(pins::intb(converter));
    with_reader(converter, |reader| {
        reader.job = *job;
        reader.latest_us = latest_us;
        reader.is_on = true;
        reader.is_late &= is_low;
        reader.part = 0;
        reader.next = 0;
        reader.waiting = 0;
    });
    call();
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
        reader.part = 0;
        reader.next = 0;
        reader.waiting = 0;
    });
}

/// Lets a reader see its oldest frame that waits, and then forgets that.
#[inline(always)]
pub fn take_frame<T>(converter: usize, work: impl FnOnce(&TransferOutcome) -> T) -> Option<T> {
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
    let was_full = with_reader(converter, |reader| {
        let was_full = reader.waiting >= FRAMES;
        reader.first = (reader.first + 1) % FRAMES;
        reader.waiting = reader.waiting.saturating_sub(1);
        was_full
    });
    // The next one may have waited for room.
    if was_full == Some(true) {
        call();
    }
}

/// Whether the frame of a converter is being read.
#[inline(never)]
pub fn reads(converter: usize) -> bool {
    with(|engine| {
        let reader = engine.readers.get(converter);
        engine.runs == Runs::Frame(converter) || reader.is_some_and(|reader| reader.next > 0)
    })
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
            && reader.next == 0
            && !reader.is_late
            && reader.waiting == 0
        {
            reader.is_late = true;
            reader.late = Stamp::default();
        }
    });
    call();
}
