//! A planted defect, for tests of the tests: a panic in the task that a test names.

#![allow(unsafe_code, clippy::indexing_slicing)]

use crate::supervision::Task;

/// The number of the task that is to panic, from 1; a test writes it.
#[unsafe(no_mangle)]
static mut PLANTED_PANIC: u32 = 0;

/// Panics if this task is the one.
pub fn panic_if_asked(task: Task) {
    // SAFETY: a word that only a test's debug probe writes.
    let asked = unsafe { (&raw const PLANTED_PANIC).read_volatile() };
    if asked == task as u32 + 1 {
        // Of no address that a compiler could know: an index beyond the end.
        let numbers = [0_u32; 1];
        defmt::info!("{}", numbers[asked as usize]);
    }
}
