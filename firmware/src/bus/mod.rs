//! The I2C master: behind `embedded-hal-async`, with a deadline for everything.

pub mod engine;
pub mod recovery;

use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_async::i2c::{ErrorType, I2c, Operation, SevenBitAddress};
use rtic_monotonics::rp2040::prelude::*;

use crate::Mono;
use crate::board::pico;
use crate::supervision::{self, Task};
use crate::wakeup::{Sleeper, Wakeup};
use engine::{Job, Outcome, READ, Ready, Stamp};

/// Bit 0 of TX_ABRT_SOURCE: the address was not acknowledged; bit 3: a byte after it.
const ADDRESS: u32 = 1 << 0;
/// See [`ADDRESS`].
const DATA: u32 = 1 << 3;
/// See [`ADDRESS`]: another master, or a wire that is held low.
const ARBITRATION: u32 = 1 << 12;

/// A byte takes nine periods of 2.5 us; a transaction may take twice its length, and what a
/// master and its interrupts need besides.
const BYTE_US: u32 = 45;
const MARGIN_US: u32 = 200;
/// No transaction may take longer.
const LONGEST_US: u32 = 5_000;

/// The signal that something on the bus is over.
static OVER: Wakeup = Wakeup::new();
/// Transactions wait for an edge of INTB.
static ON_EDGES: AtomicBool = AtomicBool::new(false);
/// How long no edge may come, in microseconds.
static SILENCE_US: AtomicU32 = AtomicU32::new(10_000);

/// What a transfer can fail of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum BusError {
    /// The address, or a byte after it, was not acknowledged.
    NotAcknowledged {
        /// It was the address.
        address: bool,
    },
    /// SDA was low where it had to be high.
    Arbitration,
    /// It took too long; the bus was freed then.
    Timeout,
    /// SDA is held low, and nine clocks did not free it.
    DataStuck,
    /// SCL is held low.
    ClockStuck,
    /// No edge of INTB came in time.
    Silent,
    /// The edges of INTB come at another pace than planned.
    Pace,
    /// The transaction has more commands than any frame, or none.
    Length,
    /// The block aborted for another reason.
    Aborted,
}

impl embedded_hal::i2c::Error for BusError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NotAcknowledged { address: true } => {
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)
            }
            Self::NotAcknowledged { address: false } => {
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data)
            }
            Self::Arbitration => ErrorKind::ArbitrationLoss,
            Self::DataStuck | Self::ClockStuck => ErrorKind::Bus,
            _ => ErrorKind::Other,
        }
    }
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("I2C transfer failed")
    }
}

impl BusError {
    fn of(cause: u32) -> Option<Self> {
        match cause {
            0 => None,
            _ if cause & ADDRESS != 0 => Some(Self::NotAcknowledged { address: true }),
            _ if cause & DATA != 0 => Some(Self::NotAcknowledged { address: false }),
            _ if cause & ARBITRATION != 0 => Some(Self::Arbitration),
            _ => Some(Self::Aborted),
        }
    }
}

/// From now on a transaction waits for an edge of INTB, and is repeated at every later one ahead of
/// its request. The first one after this call is the one that is repeated. One that would begin later
/// than `latest_us` after its edge is not begun, and reads nothing but zeros.
pub fn read_on_edges(silence_us: u32, latest_us: u32) {
    engine::rest();
    engine::set_latest(latest_us);
    SILENCE_US.store(silence_us, Ordering::Relaxed);
    ON_EDGES.store(true, Ordering::Relaxed);
}

/// Transactions begin at once again.
pub fn read_at_once() {
    ON_EDGES.store(false, Ordering::Relaxed);
    engine::rest();
}

/// Tells the master that something is over; for the interrupt that the engine pends.
pub fn wake() {
    OVER.call();
}

/// A millisecond has passed, in which the deadline of a transaction may have.
pub fn pulse() {
    OVER.pulse();
}

/// The master.
pub struct Master {
    over: Sleeper,
    address: u8,
}

/// The edge of the frame that was read last.
static STAMP: critical_section::Mutex<core::cell::Cell<Stamp>> =
    critical_section::Mutex::new(core::cell::Cell::new(Stamp {
        time_us: 0,
        ended_us: 0,
        edges: 0,
        is_known: false,
    }));

/// The edge of the frame that was read last.
pub fn last_stamp() -> Stamp {
    critical_section::with(|section| STAMP.borrow(section).get())
}

impl Master {
    /// The master, for one target. Nothing if it was taken already.
    pub fn take(address: u8) -> Option<Self> {
        recovery::set_up(address);
        Some(Self {
            over: OVER.take()?,
            address,
        })
    }

    /// Waits for the end of a transaction, or for the next pulse.
    async fn wait(&mut self) {
        supervision::check_in(Task::Sensing);
        self.over.wait().await;
    }

    async fn single(&mut self, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let job = job(operations).ok_or(BusError::Length)?;
        let deadline_us = deadline_us(job.length());
        let begin_us = now_us();
        while !engine::submit(&job) {
            if passed(begin_us) > LONGEST_US {
                return Err(self.give_up());
            }
            self.wait().await;
        }
        let begin_us = now_us();
        loop {
            if let Some(result) = engine::take_single(|outcome| read_out(outcome, operations)) {
                return result;
            }
            if passed(begin_us) > deadline_us {
                return Err(self.give_up());
            }
            self.wait().await;
        }
    }

    async fn on_edge(
        &mut self,
        length: usize,
        operations: &mut [Operation<'_>],
    ) -> Result<(), BusError> {
        let deadline_us = deadline_us(length);
        let silence_us = SILENCE_US.load(Ordering::Relaxed);
        let begin_us = now_us();
        loop {
            if let Some(result) = engine::take_frame(|outcome| read_out(outcome, operations)) {
                return result;
            }
            match engine::runs_since_us() {
                Some(since_us) if passed(since_us) > deadline_us => return Err(self.give_up()),
                Some(_) => {}
                None if passed(begin_us) > silence_us => return Err(BusError::Silent),
                None => {
                    if !pico::is_high(pico::INTB) && passed(engine::last_edge().0) > deadline_us {
                        engine::begin_without_edge();
                    }
                }
            }
            self.wait().await;
        }
    }

    /// Frees the bus; the error is what is the matter with it.
    fn give_up(&mut self) -> BusError {
        match recovery::clear(self.address) {
            Ok(()) => BusError::Timeout,
            Err(error) => error,
        }
    }
}

/// From the frame's own length, 5 ms at most; it is looked at when a pulse comes, every millisecond.
const fn deadline_us(commands: usize) -> u32 {
    let deadline_us = commands as u32 * BYTE_US + MARGIN_US;
    if deadline_us < LONGEST_US {
        deadline_us
    } else {
        LONGEST_US
    }
}

fn now_us() -> u32 {
    Mono::now().as_ticks() as u32
}

fn passed(since_us: u32) -> u32 {
    now_us().wrapping_sub(since_us)
}

impl ErrorType for Master {
    type Error = BusError;
}

impl I2c for Master {
    async fn transaction(
        &mut self,
        _: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), BusError> {
        #[cfg(planted_defect = "write_dropped")]
        if let [Operation::Write([_, _, _])] = operations {
            return Ok(());
        }
        if !ON_EDGES.load(Ordering::Relaxed) {
            return self.single(operations).await;
        }
        match engine::ready(operations) {
            Ready::This(length) => self.on_edge(length, operations).await,
            Ready::Another => self.single(operations).await,
            Ready::Nothing => {
                let job = job(operations).ok_or(BusError::Length)?;
                engine::keep_ready(&job);
                self.on_edge(job.length(), operations).await
            }
        }
    }
}

/// Hands out what a transaction read.
fn read_out(outcome: &Outcome, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
    if let Some(error) = BusError::of(outcome.cause) {
        return Err(error);
    }
    #[cfg(planted_defect = "words_swapped")]
    let outcome = &swapped(outcome);
    critical_section::with(|section| STAMP.borrow(section).set(outcome.stamp));
    let mut bytes = outcome.bytes.iter();
    for operation in operations {
        if let Operation::Read(buffer) = operation {
            for (place, byte) in buffer.iter_mut().zip(&mut bytes) {
                *place = *byte;
            }
        }
    }
    Ok(())
}

#[cfg(planted_defect = "words_swapped")]
fn swapped(outcome: &Outcome) -> Outcome {
    let mut swapped = *outcome;
    if let ([first, second, third, fourth, ..], true) = (&mut swapped.bytes, outcome.stamp.is_known)
    {
        core::mem::swap(first, third);
        core::mem::swap(second, fourth);
    }
    swapped
}

/// The commands of a transaction; the block sends a repeated START by itself where reading and
/// writing alternate. Nothing if it is longer than any frame, or empty.
fn job(operations: &[Operation<'_>]) -> Option<Job> {
    let mut job = Job::EMPTY;
    for operation in operations {
        match operation {
            Operation::Write(bytes) => {
                bytes
                    .iter()
                    .try_for_each(|&byte| job.push(u16::from(byte)))?;
            }
            Operation::Read(buffer) => buffer.iter().try_for_each(|_| job.push(READ))?,
        }
    }
    job.stop()?;
    Some(job)
}
