//! I2C: a master for `embedded-hal-async`, and a reader of frames on the edges of INTB. Every operation
//! has a time limit.

pub mod engine;
pub mod recovery;
mod timing;

use embedded_hal_async::i2c::{ErrorType, I2c, Operation, SevenBitAddress};
use ldc161x::FrameRequest;
use palpate_node::acquisition::Fetch;
use palpate_node::converter::{CONVERTERS, EdgeDeadlines, EdgeFrame, EdgeReader, TransferError};
use palpate_node::supervision::Task;
use rtic_monotonics::rp2040::prelude::*;

use crate::Mono;
use crate::board::pins;
use crate::supervision::CHECK_INS;
use crate::wakeup::{Sleeper, Wakeup};
use engine::{Job, READ, Stamp, TransferOutcome};
use recovery::{CLOCK_STUCK, DATA_STUCK, FREED};

/// TX_ABRT_SOURCE bit 0: the address was not acknowledged.
const ADDRESS: u32 = 1 << 0;
/// TX_ABRT_SOURCE bit 3: a data byte was not acknowledged.
const DATA: u32 = 1 << 3;
/// TX_ABRT_SOURCE: arbitration lost to another master or to a wire that is held low.
const ARBITRATION: u32 = 1 << 12;

/// Longest time in microseconds for which a transaction waits for the bus: ten times the longest run
/// time of a transaction.
const LONGEST_WAIT_US: u32 = 50_000;

/// I2C addresses of the converters.
const ADDRESSES: [SevenBitAddress; CONVERTERS] = [0x2A, 0x2B];
/// Task of each converter, which checks in while it waits for the bus.
const TASKS: [Task; CONVERTERS] = [Task::Sensing, Task::SecondSensing];

/// Signals the end of a converter's transaction.
static SINGLE: [Wakeup; CONVERTERS] = [const { Wakeup::new() }; CONVERTERS];
/// Signals the end of a converter's frame.
static FRAME: [Wakeup; CONVERTERS] = [const { Wakeup::new() }; CONVERTERS];

/// Wakes the tasks whose transaction or frame has ended; called by the interrupt that the engine pends.
pub fn wake() {
    for ((converter, single), frame) in SINGLE.iter().enumerate().zip(&FRAME) {
        let over = engine::over(converter);
        if over.single {
            single.call();
        }
        if over.frame {
            frame.call();
        }
    }
}

/// Called every millisecond: wakes the tasks that wait for the bus, which check the time limit of the
/// running transaction.
pub fn pulse() {
    for wakeup in SINGLE.iter().chain(&FRAME) {
        wakeup.pulse();
    }
}

/// Sets the bus up. Call it once, at start-up.
pub fn set_up() {
    recovery::set_up();
}

/// Takes master and edge reader of a converter; `None` if they were already taken.
pub fn take(converter: usize) -> Option<(Master, Edges)> {
    let task = *TASKS.get(converter)?;
    let address = *ADDRESSES.get(converter)?;
    let master = Master {
        over: SINGLE.get(converter)?.take()?,
        converter,
        task,
    };
    let edges = Edges {
        over: FRAME.get(converter)?.take()?,
        converter,
        task,
        address,
        deadline_us: engine::deadline_us(0),
        silence_us: 0,
        known_us: 0,
    };
    Some((master, edges))
}

/// Converts the cause of an aborted transaction to an error.
fn aborted(cause: u32) -> Result<(), TransferError> {
    match cause {
        0 => Ok(()),
        _ if cause & FREED != 0 => Err(TransferError::Timeout),
        _ if cause & DATA_STUCK != 0 => Err(TransferError::DataStuck),
        _ if cause & CLOCK_STUCK != 0 => Err(TransferError::ClockStuck),
        _ if cause & ADDRESS != 0 => Err(TransferError::NotAcknowledged { address: true }),
        _ if cause & DATA != 0 => Err(TransferError::NotAcknowledged { address: false }),
        _ if cause & ARBITRATION != 0 => Err(TransferError::Arbitration),
        _ => Err(TransferError::Aborted),
    }
}

fn now_us() -> u32 {
    Mono::now().as_ticks() as u32
}

fn passed_us(since_us: u32) -> u32 {
    now_us().wrapping_sub(since_us)
}

// ---- master ----

/// I2C master for the task of one converter. Transactions of different tasks are serialised.
pub struct Master {
    over: Sleeper,
    converter: usize,
    task: Task,
}

impl Master {
    /// Waits for the end of a transaction or for the next millisecond.
    async fn wait(&mut self) {
        CHECK_INS.check_in(self.task);
        self.over.wait().await;
    }
}

impl ErrorType for Master {
    type Error = TransferError;
}

impl I2c for Master {
    async fn transaction(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), TransferError> {
        let job = job(address, operations).ok_or(TransferError::Length)?;
        let asked_us = now_us();
        engine::submit(self.converter, &job);
        loop {
            let result = engine::take_single(self.converter, |outcome| {
                aborted(outcome.cause)?;
                hand_out(outcome, operations);
                Ok(())
            });
            if let Some(result) = result {
                return result;
            }
            recovery::clear_overdue();
            if passed_us(asked_us) > LONGEST_WAIT_US && engine::withdraw(self.converter) {
                return Err(TransferError::Timeout);
            }
            self.wait().await;
        }
    }
}

/// Copies the bytes of a transaction to its read operations.
fn hand_out(outcome: &TransferOutcome, operations: &mut [Operation<'_>]) {
    let mut bytes = outcome.bytes().iter();
    for operation in operations {
        if let Operation::Read(buffer) = operation {
            for (slot, byte) in buffer.iter_mut().zip(&mut bytes) {
                *slot = *byte;
            }
        }
    }
}

/// Returns the commands of a transaction, or `None` if it is empty or longer than any frame. The block
/// itself sends a repeated START where reading and writing alternate.
fn job(address: SevenBitAddress, operations: &[Operation<'_>]) -> Option<Job> {
    let mut job = Job::to(address);
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

// ---- edge reader ----

/// Reader of a converter's frames on its edges.
pub struct Edges {
    over: Sleeper,
    converter: usize,
    task: Task,
    address: SevenBitAddress,
    deadline_us: u32,
    silence_us: u32,
    /// Time of the last known edge, or of the start of reading.
    known_us: u32,
}

impl EdgeReader for Edges {
    fn start(&mut self, request: &FrameRequest, deadlines: EdgeDeadlines) {
        let mut job = Job::to(self.address);
        for pointer in request.pointers() {
            for command in [u16::from(pointer), READ, READ] {
                // There is space for the longest frame.
                let _ = job.push(command);
            }
        }
        let _ = job.stop_parts(deadlines.parts);
        self.deadline_us = engine::deadline_us(job.length());
        self.silence_us = deadlines.silence_us;
        self.known_us = now_us();
        engine::read_on_edges(self.converter, &job, deadlines.latest_begin_us);
    }

    async fn next(&mut self) -> Result<EdgeFrame, TransferError> {
        let asked_us = now_us();
        loop {
            if let Some(result) = engine::take_frame(self.converter, frame) {
                if let Ok(EdgeFrame {
                    fetch: Some(of), ..
                }) = &result
                {
                    self.known_us = of.edge_us as u32;
                }
                return result;
            }
            recovery::clear_overdue();
            if !engine::reads(self.converter) {
                if passed_us(self.known_us) > self.silence_us {
                    self.known_us = now_us();
                    return Err(TransferError::Silent);
                }
                let edge_us = engine::last_edge_us(self.converter);
                let is_low = !pins::is_high(pins::intb(self.converter));
                // Waits after the last frame, so that other transactions get their turn.
                let rests = passed_us(edge_us) <= self.deadline_us
                    || passed_us(asked_us) <= self.deadline_us;
                if is_low && !rests {
                    engine::begin_without_edge(self.converter);
                }
            }
            CHECK_INS.check_in(self.task);
            self.over.wait().await;
        }
    }

    fn stop(&mut self) {
        engine::rest(self.converter);
    }
}

/// Returns the outcome of a read as a frame with its edge.
fn frame(outcome: &TransferOutcome) -> Result<EdgeFrame, TransferError> {
    aborted(outcome.cause)?;
    Ok(EdgeFrame {
        // There is space for the longest frame.
        bytes: heapless::Vec::from_slice(outcome.bytes()).unwrap_or_default(),
        fetch: outcome.stamp.is_known.then(|| fetch(outcome)),
    })
}

/// Returns the times at which a frame was read.
fn fetch(outcome: &TransferOutcome) -> Fetch {
    let Stamp { time_us, edges, .. } = outcome.stamp;
    Fetch {
        edge_us: extended(time_us),
        ended_us: outcome.ended_us.map(|at_us| at_us.wrapping_sub(time_us)),
        edges,
    }
}

/// Extends the lower half of a recent time to 64 bits.
fn extended(low_us: u32) -> u64 {
    let now_us = Mono::now().as_ticks();
    now_us - u64::from((now_us as u32).wrapping_sub(low_us))
}
