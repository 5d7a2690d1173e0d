//! Boards: clocks, pins and the devices on them, named by their role.

pub mod clocks;
mod float;
mod memory;
pub mod pico;
pub mod vectors;

// Copies the code that runs from memory there, as the start-up code does with data. It runs before
// that, with neither stack nor variables.
#[allow(unsafe_code)]
mod hot {
    core::arch::global_asm!(
        // Beside the code that calls it: in flash, which needs no copying.
        ".section .Reset, \"ax\", %progbits",
        ".global __pre_init",
        ".type __pre_init, %function",
        ".thumb_func",
        "__pre_init:",
        // The ring oscillator, which the processor starts with, at 52 MHz (14 to 96) instead of
        // 6.5: divided by 2 (datasheet 2.17.8). Copying takes 20 ms so.
        "ldr r0, =0x40060010",
        "ldr r1, =0xAA2",
        "str r1, [r0]",
        "ldr r0, =__hot_begin",
        "ldr r1, =__hot_end",
        "ldr r2, =__hot_load",
        "1: cmp r0, r1",
        "bhs 2f",
        "ldm r2!, {{r3, r4, r5, r6}}",
        "stm r0!, {{r3, r4, r5, r6}}",
        "b 1b",
        "2: bx lr",
        ".ltorg",
        ".text",
    );
}

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
///
/// From memory, since interrupts wait for its end.
#[allow(unsafe_code)]
#[unsafe(link_section = ".data.idle")]
#[inline(never)]
pub fn sleep_in_memory() {
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
