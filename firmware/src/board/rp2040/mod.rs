//! Raspberry Pi Pico (RP2040): clocks, pins and the devices on them, named by their role.

mod clocks;
mod code_in_memory;
pub mod coil;
mod control;
pub mod flash;
mod float;
pub mod i2c;
pub mod pins;
pub mod reset;
mod routines;
pub mod safe;
mod second_stage;
pub mod usb;
pub mod vectors;

pub use pins::Board;
pub use reset::Watchdog;

use core::sync::atomic::{AtomicU32, Ordering};

use palpate_node::board::CORE_HZ;

/// Polls of a condition in 10 ms at the processor's full clock, twelve cycles each.
const POLLS: u32 = CORE_HZ / 100 / 12;

/// Polls a condition until it holds, for 10 ms at most and for longer before the clocks are up.
/// Whether it held.
///
/// What is waited for at start-up is hardware that either answers within microseconds or is
/// broken; going on without it ends in a fault that is reported, waiting for ever does not.
fn wait(mut holds: impl FnMut() -> bool) -> bool {
    for _ in 0..POLLS {
        if holds() {
            return true;
        }
    }
    false
}

/// A count that goes up, by one task alone.
pub struct Count(AtomicU32);

impl Count {
    const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Adds to it. Only the task that owns the count may.
    fn add(&self, number: u32) {
        let sum = self.0.load(Ordering::Relaxed).wrapping_add(number);
        self.0.store(sum, Ordering::Relaxed);
    }

    /// The count.
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Microseconds in which the processor slept; wraps. Counted by the idle task, which shares no lock
/// with others: it would have to wake up for it.
pub static ASLEEP_US: Count = Count::new();

/// Sleeps until an interrupt comes, and counts the time. The interrupt runs after it was counted.
#[allow(unsafe_code)]
pub fn sleep() {
    // SAFETY: reading the raw timer has no effect on it.
    let timer = unsafe { &*rp2040_pac::TIMER::ptr() };
    cortex_m::interrupt::free(|_| {
        let begin_us = timer.timerawl().read().bits();
        cortex_m::asm::wfi();
        let end_us = timer.timerawl().read().bits();
        ASLEEP_US.add(end_us.wrapping_sub(begin_us));
    });
}

/// Words that the start has painted the stack with (cortex-m-rt, feature `paint-stack`).
const PAINT: u32 = 0xCCCC_CCCC;

/// The greatest depth of the stack so far, in bytes.
#[allow(unsafe_code)]
pub fn stack_used() -> u32 {
    unsafe extern "C" {
        static mut _stack_end: u32;
        static mut _stack_start: u32;
    }
    let (bottom, top) = (&raw const _stack_end, &raw const _stack_start);
    let words = (top as usize - bottom as usize) / size_of::<u32>();
    // SAFETY: the words between the linker's two symbols are the stack, all of them readable.
    let is_paint = |index: &usize| unsafe { bottom.add(*index).read_volatile() } == PAINT;
    let untouched = (0..words).take_while(is_paint).count();
    ((words - untouched) * size_of::<u32>()) as u32
}
