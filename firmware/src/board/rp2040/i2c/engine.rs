//! The part of the I2C master and of the edge readers that runs in interrupts.
//!
//! A transaction is a [`Job`]: its commands are written to the block's queue as space becomes free, its
//! bytes are collected, and an interrupt of lower priority reports its end.
//!
//! Each converter's edge reader has its own job. Every falling edge of that converter's INTB starts the
//! job at once, or as soon as the bus is free. Its bytes are queued with the edge's time until the
//! reader takes them. So reading a frame starts within a microsecond of the edge, even while the tasks
//! still process the previous frame.
//!
//! Two converters on one bus take turns: a frame then has several parts, each in its own transaction,
//! and after each part or transaction the other converter goes first.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;

use palpate_node::acquisition::MOST_PARTS;
use palpate_node::converter::{CONVERTERS, MOST_FRAME_BYTES};
use rp2040_pac::{I2C0, IO_BANK0, Interrupt, NVIC, PWM, TIMER};

use crate::board::pins;
use crate::board::rp2040::control::precedence::{self, TO_BEGIN, TO_SERVE};

/// Number of commands of the longest frame, three per register: pointer, high byte and low byte.
const MAX_COMMANDS: usize = MOST_FRAME_BYTES / 2 * 3;
/// Size in bytes of a buffer for the longest frame, in whole words.
const MAX_BYTES: usize = MOST_FRAME_BYTES.next_multiple_of(4);
/// Number of frames that can wait for their reader.
const FRAMES: usize = 4;

/// Bit of a command to the I2C block: read a byte.
pub const READ: u16 = 1 << 8;
/// Bit of a command to the I2C block: send STOP after the byte.
pub const STOP: u16 = 1 << 9;

/// Depth of the I2C block's two queues (RP2040 datasheet 4.3.2).
const DEPTH: usize = 16;
/// Interrupt bit of the I2C block: the queue of commands has space.
const TX_EMPTY: u32 = 1 << 4;
/// Interrupt bit of the I2C block: received bytes wait.
const RX_FULL: u32 = 1 << 2;
/// Interrupt bit of the I2C block: the transaction was aborted.
const TX_ABORT: u32 = 1 << 6;
/// Interrupt bit of the I2C block: a STOP was sent.
const STOP_DETECTED: u32 = 1 << 9;
/// Bit of register TX_ABRT_SOURCE: arbitration lost; no STOP follows.
const ARBITRATION: u32 = 1 << 12;
/// Bit of an outcome's `cause`, added by the engine: the transaction was aborted.
const IS_ABORTED: u32 = 1 << 31;

/// Time in microseconds that the limit allows per byte: nine clock periods of 6.25 us, at 160 kHz. It
/// allows slow edges: at the 400 kHz setting, a rise time of 3 us gives 182 kHz.
const BYTE_US: u32 = 57;
/// Time in microseconds that the limit allows in addition, for the master and its interrupts.
const MARGIN_US: u32 = 200;
/// Upper bound of the time limit of any transaction, in microseconds.
const LONGEST_US: u32 = 5_000;

/// Returns the time limit of a transaction in microseconds, counted from its start. The limit is checked
/// every millisecond. A register takes three commands and five bytes on the wire: address, pointer,
/// address, and two data bytes.
pub const fn deadline_us(commands: usize) -> u32 {
    let bytes = commands as u32 * 5 / 3 + 2;
    let deadline_us = bytes * BYTE_US + MARGIN_US;
    if deadline_us < LONGEST_US {
        deadline_us
    } else {
        LONGEST_US
    }
}

/// Time and count of an edge.
#[derive(Clone, Copy, Default)]
pub struct Stamp {
    /// Time of the edge: the lower half of the microsecond timer.
    pub time_us: u32,
    /// Number of edges that the hardware has counted.
    pub edges: u16,
    /// The edge was seen and its time is known.
    pub is_known: bool,
}

/// Number of commands of a transaction, and number of bytes that they read.
#[derive(Clone, Copy, Default)]
struct Extent {
    commands: u8,
    bytes: u8,
}

/// One transaction, or several in sequence.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Job {
    length: u8,
    bytes: u8,
    address: u8,
    /// Extent of the first transaction; `later` is that of each later one.
    first: Extent,
    later: Extent,
    /// Time limit of one transaction.
    deadline_us: u32,
    commands: [u16; MAX_COMMANDS],
}

impl Job {
    /// A job without commands.
    const EMPTY: Self = Self::to(0);

    /// Creates a transaction with a target and no commands.
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

    /// Adds a command; `None` if there is no space.
    pub fn push(&mut self, command: u16) -> Option<()> {
        *self.commands.get_mut(usize::from(self.length))? = command;
        self.length += 1;
        if command & READ != 0 {
            self.bytes += 1;
        }
        (usize::from(self.bytes) <= MAX_BYTES).then_some(())
    }

    /// Ends the job as one transaction; `None` if it has no commands.
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

    /// Ends the job as `parts` transactions of a frame: each after the first reads two registers.
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

    /// Returns the number of commands.
    pub const fn length(&self) -> usize {
        self.length as usize
    }
}

/// Result of a transaction.
#[derive(Clone, Copy)]
pub struct TransferOutcome {
    /// Buffer for the bytes; see [`Self::bytes`].
    pub bytes: [u8; MAX_BYTES],
    /// Number of bytes read.
    pub count: u8,
    /// The edge that started the transaction, if one did.
    pub stamp: Stamp,
    /// End time of each part of the frame.
    pub ended_us: [u32; MOST_PARTS],
    /// Reason for the abort, as the bits of TX_ABRT_SOURCE; 0 if the transaction was not aborted.
    pub cause: u32,
}

impl TransferOutcome {
    /// Returns the bytes that were read.
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

/// Current user of the bus.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Runs {
    Nothing,
    /// Frame of a converter.
    Frame(usize),
    /// Transaction of a converter's master.
    Single(usize),
    /// The bus is being recovered: the block is in reset or disconnected from its pins. New requests
    /// wait, and the interrupted transaction fails.
    Recovery,
}

/// Transaction of a converter's master.
#[repr(C)]
struct Single {
    /// The transaction waits for the bus.
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

/// Frame queue of one converter.
#[repr(C)]
struct Reader {
    /// Edges of INTB start the job.
    is_on: bool,
    /// `late` is an edge that came while the bus was in use.
    is_late: bool,
    /// Next part of the frame; `next` is its first command, 0 before the frame has started.
    part: usize,
    next: usize,
    /// Index of the oldest waiting frame in `frames`; `waiting` is the number of waiting frames.
    first: usize,
    waiting: usize,
    last_edge_us: u32,
    /// Latest start of each part after its edge, in microseconds.
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

    /// Returns whether a frame of this converter may take the bus next. `is_known` asks for frames whose
    /// edge is known, otherwise for those without a known edge. A frame that has started counts as known.
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

    /// Prepares the next part of this converter's frame. Returns `false` if the results would be
    /// overwritten during the read: the frame then ends.
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

    /// Ends a frame whose results would be overwritten during the read.
    #[inline(never)]
    fn pass_over(&mut self) {
        let slot = self.slot();
        if let Some(outcome) = self.frames.get_mut(slot) {
            // Marks every part as not read: its end time is so long after the edge that no frame with it
            // is in time.
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

    /// Returns the extent of the next part of this converter's frame.
    #[inline(always)]
    fn extent(&self) -> Extent {
        if self.next == 0 {
            self.job.first
        } else {
            self.job.later
        }
    }

    /// Ends a part of this converter's frame; `end` is the index of the first command after the part.
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

    /// Ends this converter's frame and queues it.
    fn is_whole(&mut self) {
        self.part = 0;
        self.next = 0;
        self.waiting += usize::from(self.is_on);
    }
}

/// The fields that every interrupt needs come first: the processor reaches them in one instruction.
#[repr(C)]
struct Engine {
    runs: Runs,
    /// Next command of the running transaction; `end` is the end of its commands, and `bytes` the number
    /// of bytes read when it ends.
    next: usize,
    end: usize,
    bytes: u8,
    /// Target address that the block is set to.
    address: u8,
    since_us: u32,
    deadline_us: u32,
    /// Converter that had the bus last: the other one goes first.
    last: usize,
    /// User of the bus when recovery began.
    cut: Runs,
    readers: [Reader; CONVERTERS],
    singles: [Single; CONVERTERS],
}

struct Shared(UnsafeCell<Engine>);

// SAFETY: accessed only in `with`, during which no interrupt runs, and in the two handlers, which have
// the same, highest priority and so never interrupt each other.
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

/// Gives a task access to the engine with all interrupts masked.
#[inline(always)]
fn with<T>(work: impl FnOnce(&mut Engine) -> T) -> T {
    cortex_m::interrupt::free(|_| {
        // SAFETY: no interrupt runs meanwhile, and no task keeps a reference beyond this call.
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

/// Returns the number of commands that the block's queue has space for.
#[inline(always)]
fn room() -> usize {
    DEPTH.saturating_sub(i2c().ic_txflr().read().bits() as usize)
}

/// Running transaction: its job, its progress and its outcome.
struct Transfer<'a> {
    job: &'a Job,
    next: &'a mut usize,
    end: usize,
    outcome: &'a mut TransferOutcome,
}

impl Transfer<'_> {
    /// Writes commands to the block while its queue has space.
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

    /// Reads the received bytes from the block.
    fn drain(&mut self) {
        let waiting = i2c().ic_rxflr().read().bits() as usize;
        let begin = usize::from(self.outcome.count);
        // There is space for all waiting bytes, since the block never receives more than was requested.
        let end = (begin + waiting).min(MAX_BYTES);
        for slot in self.outcome.bytes.get_mut(begin..end).unwrap_or_default() {
            *slot = i2c().ic_data_cmd().read().bits() as u8;
        }
        self.outcome.count = end as u8;
    }
}

impl Engine {
    /// Returns the running transaction; `None` while there is none.
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

    /// Starts a transaction whose outcome is already prepared.
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
        // Clears the flag of a STOP that an earlier, aborted transaction may have sent meanwhile.
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

    /// Ends the running transaction.
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

    /// Starts the waiting work, if the bus is free.
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

    /// Returns the next user of the bus: first a frame whose edge is known, then a master's transaction,
    /// then a frame without an edge. Between two of a kind, the converter that did not have the bus last
    /// goes first.
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

    /// Stamps an edge that came during a bus interrupt: the interrupt may last three microseconds, and
    /// the stamp must not wait for its end.
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

    /// Stamps pending edges of INTB. With `at_once`, also starts a frame if it may start and the bus is
    /// free: on a free bus, only work deferred for the coil's interrupt can be waiting.
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
            // INTB stays low until the converter is read. If it is high again, the edge was a
            // disturbance.
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

    /// Returns whether the running transaction is with this converter and may release its INTB.
    fn serves(&self, converter: usize) -> bool {
        self.runs == Runs::Frame(converter) || self.runs == Runs::Single(converter)
    }

    /// Returns whether the running transaction exceeds its time limit.
    fn is_overdue(&self) -> bool {
        matches!(self.runs, Runs::Frame(_) | Runs::Single(_))
            && now_us().wrapping_sub(self.since_us) > self.deadline_us
    }
}

/// Sets the block's target address, which it accepts only while it is disabled (RP2040 datasheet
/// 4.3.17).
#[inline(never)]
fn set_target(address: u8) {
    // SAFETY: nothing runs; the address has seven bits.
    unsafe {
        i2c().ic_enable().write(|w| w.bits(0));
        i2c().ic_tar().write(|w| w.bits(u32::from(address)));
        i2c().ic_enable().write(|w| w.bits(1));
    }
}

/// IO_IRQ_BANK0: handles a falling edge of INTB.
pub unsafe extern "C" fn on_edge() {
    // SAFETY: see `Shared`.
    let engine = unsafe { &mut *ENGINE.0.get() };
    engine.take_edges(true);
    engine.catch_up();
}

/// I2C0_IRQ: moves commands and bytes of the running transaction.
pub unsafe extern "C" fn on_i2c() {
    // SAFETY: see `Shared`.
    unsafe { (*ENGINE.0.get()).serve() }
}

/// Completed work of a converter.
pub struct Over {
    /// The transaction of its master has ended.
    pub single: bool,
    /// At least one frame of its reader is ready.
    pub frame: bool,
}

/// Returns the completed work of a converter.
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

/// Submits the transaction of a converter's master. Its previous outcome must have been taken.
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

/// Triggers the bus interrupt to start the waiting work: starting it from a task would delay the time
/// stamp of an edge.
fn call() {
    NVIC::pend(Interrupt::I2C0_IRQ);
}

/// Withdraws the transaction of a converter's master if it still waits; returns whether it did.
#[inline(never)]
pub fn withdraw(converter: usize) -> bool {
    with(|engine| {
        let single = engine.singles.get_mut(converter);
        single.is_some_and(|single| core::mem::replace(&mut single.waits, false))
    })
}

/// Starts recovery if the running transaction, of either converter, exceeds its time limit; nothing else
/// starts until [`end_recovery`]. Returns whether it did.
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

/// Ends recovery: the interrupted transaction fails with this cause, and waiting work continues. The
/// block was reset; `cause` says whether the bus is free.
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

/// Gives a master access to the outcome of its transaction; `None` until that has ended.
#[inline(always)]
pub fn take_single<T>(converter: usize, work: impl FnOnce(&TransferOutcome) -> T) -> Option<T> {
    let is_over = with(|engine| {
        let single = engine.singles.get(converter);
        single.is_some_and(|single| single.is_over)
    });
    if !is_over {
        return None;
    }
    // SAFETY: no code writes the outcome until the converter's next single transaction begins, which its
    // master submits after taking this outcome.
    let single = unsafe { (&raw const (*ENGINE.0.get()).singles).cast::<Single>() };
    // SAFETY: the index is within the array, since the converter has a transaction; see above.
    let done = work(unsafe { &(*single.add(converter)).outcome });
    with(|engine| {
        if let Some(single) = engine.singles.get_mut(converter) {
            single.is_over = false;
        }
    });
    Some(done)
}

/// Starts this job on every edge of a converter; `latest_us` is the latest start of each part after its
/// edge.
#[inline(never)]
pub fn read_on_edges(converter: usize, job: &Job, latest_us: [u32; MOST_PARTS]) {
    // If INTB is high, the converter has been read since its last edge, which then needs no frame.
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

/// Stops reading on the edges of a converter and discards waiting frames.
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

/// Gives a reader access to its oldest waiting frame, and then discards that frame.
#[inline(always)]
pub fn take_frame<T>(converter: usize, work: impl FnOnce(&TransferOutcome) -> T) -> Option<T> {
    let first = with_reader(converter, |reader| {
        (reader.waiting > 0).then_some(reader.first)
    })??;
    // SAFETY: the engine writes to no frame that waits.
    let reader = unsafe { (&raw const (*ENGINE.0.get()).readers).cast::<Reader>() };
    // SAFETY: the index is within the array, since the converter has a reader; see above.
    let frames = unsafe { &(*reader.add(converter)).frames };
    let done = frames.get(first).map(work);
    release_frame(converter);
    done
}

/// Discards the oldest frame.
#[inline(never)]
fn release_frame(converter: usize) {
    let was_full = with_reader(converter, |reader| {
        let was_full = reader.waiting >= FRAMES;
        reader.first = (reader.first + 1) % FRAMES;
        reader.waiting = reader.waiting.saturating_sub(1);
        was_full
    });
    // A frame may have waited for the space that this one leaves.
    if was_full == Some(true) {
        call();
    }
}

/// Returns whether a frame of the converter is being read.
#[inline(never)]
pub fn reads(converter: usize) -> bool {
    with(|engine| {
        let reader = engine.readers.get(converter);
        engine.runs == Runs::Frame(converter) || reader.is_some_and(|reader| reader.next > 0)
    })
}

/// Returns the time of a converter's last edge.
#[inline(never)]
pub fn last_edge_us(converter: usize) -> u32 {
    with_reader(converter, |reader| reader.last_edge_us).unwrap_or_default()
}

/// Treats a low INTB whose edge was not seen as an edge at the current time. An edge can be missed
/// during recovery of the bus.
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
