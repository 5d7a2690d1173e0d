//! The defmt logger, on its own channel.
//!
//! It uses no critical section, so a message may be interrupted. A task that logs during another task's
//! message loses its own message, which is counted. So logging delays only the task that logs.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

use rtt_target::UpChannel;

use super::up_channel::write_whole;

/// Bytes of the longest log message that is sent.
const LONGEST: usize = 128;

struct Log {
    channel: Option<UpChannel>,
    encoder: defmt::Encoder,
    message: [u8; LONGEST],
    length: usize,
}

struct Shared(UnsafeCell<Log>);

// SAFETY: only the task that has raised `DEPTH` from 0 to 1 reaches it: a task that interrupts a
// message finds `DEPTH` raised, and ends its own message before the interrupted one goes on.
unsafe impl Sync for Shared {}

static LOG: Shared = Shared(UnsafeCell::new(Log {
    channel: None,
    encoder: defmt::Encoder::new(),
    message: [0; LONGEST],
    length: 0,
}));
static DEPTH: AtomicU32 = AtomicU32::new(0);
static DROPPED: AtomicU32 = AtomicU32::new(0);

/// Returns the number of dropped messages.
pub fn dropped() -> u32 {
    DROPPED.load(Ordering::Relaxed)
}

/// Sets the channel of the log.
pub fn set_channel(channel: UpChannel) {
    // SAFETY: called once, at start-up, before any task logs.
    unsafe { (*LOG.0.get()).channel = Some(channel) };
}

fn put(bytes: &[u8]) {
    // SAFETY: called by the encoder, under `DEPTH` 1.
    let log = unsafe { &mut *LOG.0.get() };
    for &byte in bytes {
        if let Some(slot) = log.message.get_mut(log.length) {
            *slot = byte;
        }
        log.length += 1;
    }
}

fn count_dropped() {
    DROPPED.store(
        DROPPED.load(Ordering::Relaxed).wrapping_add(1),
        Ordering::Relaxed,
    );
}

#[defmt::global_logger]
struct Logger;

// SAFETY: `acquire` and `release` nest like the interrupts that log, and only the outermost pair
// reaches the log.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // A task that interrupts between this load and the store leaves `DEPTH` as it was.
        let depth = DEPTH.load(Ordering::Relaxed) + 1;
        DEPTH.store(depth, Ordering::Relaxed);
        if depth > 1 {
            count_dropped();
            return;
        }
        // The log is accessed only between this point and its release below.
        compiler_fence(Ordering::SeqCst);
        // SAFETY: see `Shared`.
        unsafe {
            (*LOG.0.get()).length = 0;
            let encoder = &raw mut (*LOG.0.get()).encoder;
            (*encoder).start_frame(put);
        }
    }

    unsafe fn flush() {}

    unsafe fn release() {
        if DEPTH.load(Ordering::Relaxed) == 1 {
            // SAFETY: see `Shared`.
            unsafe {
                let encoder = &raw mut (*LOG.0.get()).encoder;
                (*encoder).end_frame(put);
                let log = &mut *LOG.0.get();
                let message = log.message.get(..log.length);
                let sent = match (&mut log.channel, message) {
                    (Some(channel), Some(message)) => write_whole(channel, message),
                    _ => false,
                };
                if !sent {
                    count_dropped();
                }
            }
        }
        compiler_fence(Ordering::SeqCst);
        DEPTH.store(
            DEPTH.load(Ordering::Relaxed).saturating_sub(1),
            Ordering::Relaxed,
        );
    }

    unsafe fn write(bytes: &[u8]) {
        if DEPTH.load(Ordering::Relaxed) == 1 {
            // SAFETY: see `Shared`.
            unsafe {
                let encoder = &raw mut (*LOG.0.get()).encoder;
                (*encoder).write(bytes, put);
            }
        }
    }
}

defmt::timestamp!("{=u64:us}", {
    use rtic_monotonics::rp2040::prelude::*;
    crate::Mono::now().as_ticks()
});
