//! Raspberry Pi Pico (RP2040): clocks, pins and devices, named by role.

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
mod setup;
pub mod usb;
pub mod vectors;

pub use reset::Watchdog;
pub use setup::Board;

use core::sync::atomic::{AtomicU32, Ordering};

use palpate_node::board::CORE_HZ;

/// Number of polls in 10 ms at the processor's full clock; a poll takes twelve cycles.
const POLLS: u32 = CORE_HZ / 100 / 12;

/// Polls a condition for 10 ms, longer before the clocks are up; returns whether it was met.
///
/// Start-up hardware either answers within microseconds or is broken. Continuing without it leads to a
/// reported fault; waiting forever would not.
fn wait(mut holds: impl FnMut() -> bool) -> bool {
    for _ in 0..POLLS {
        if holds() {
            return true;
        }
    }
    false
}

/// Counter that only one task increments.
pub struct Count(AtomicU32);

impl Count {
    const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Adds to the count. Only the task that owns the count may call it.
    fn add(&self, number: u32) {
        let sum = self.0.load(Ordering::Relaxed).wrapping_add(number);
        self.0.store(sum, Ordering::Relaxed);
    }

    /// Returns the count.
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Time for which the processor slept, in microseconds; wraps. The idle task counts it without a lock,
/// for which other tasks would have to wait.
pub static ASLEEP_US: Count = Count::new();

/// Sleeps until an interrupt comes, and counts the time; the interrupt's handler runs after the
/// counting.
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

/// Word with which the start-up code fills the stack (cortex-m-rt, feature `paint-stack`).
const PAINT: u32 = 0xCCCC_CCCC;

/// Returns the greatest stack depth so far, in bytes.
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
