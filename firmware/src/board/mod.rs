//! Boards: clocks, pins and the devices on them, named by their role.

pub mod clocks;
mod float;
mod hot;
mod memory;
pub mod pico;
pub mod vectors;

/// The processor's clock in megahertz.
pub const CORE_MHZ: u32 = 120;

/// Looks at a condition until it holds, but no longer than 100 000 times: 10 ms at 120 MHz and
/// more before the clocks are up. Whether it held.
///
/// What is waited for at start-up is hardware that either answers within microseconds or is
/// broken; going on without it ends in a fault that is reported, waiting for ever does not.
pub fn wait(mut holds: impl FnMut() -> bool) -> bool {
    for _ in 0..100_000 {
        if holds() {
            return true;
        }
    }
    false
}

/// Sleeps until an interrupt comes, and counts the time. The interrupt runs after it was counted.
#[allow(unsafe_code)]
pub fn sleep() {
    // SAFETY: reading the raw timer has no effect on it.
    let timer = unsafe { &*rp2040_pac::TIMER::ptr() };
    cortex_m::interrupt::free(|_| {
        let begin_us = timer.timerawl().read().bits();
        cortex_m::asm::wfi();
        let end_us = timer.timerawl().read().bits();
        crate::report::ASLEEP_US.add(end_us.wrapping_sub(begin_us));
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
    let is_paint = |place: &usize| unsafe { bottom.add(*place).read_volatile() } == PAINT;
    let untouched = (0..words).take_while(is_paint).count();
    ((words - untouched) * size_of::<u32>()) as u32
}
