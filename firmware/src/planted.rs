//! Planted defects, for tests of the tests: a panic in the task that a test names, and a task that
//! goes no further while a watchdog that looks at no task is fed.

#![allow(unsafe_code, clippy::indexing_slicing)]

#[cfg(planted_defect = "panic")]
pub use panic::panic_if_asked;
#[cfg(planted_defect = "fed_by_idle")]
pub use stall::stall_if_asked;

#[cfg(planted_defect = "panic")]
mod panic {
    use palpate_node::supervision::Task;

    /// The number of the task that is to panic, from 1; a test writes it.
    #[unsafe(no_mangle)]
    static mut PLANTED_PANIC: u32 = 0;

    /// Set before the panic, for a test to take the time from.
    #[unsafe(no_mangle)]
    static mut PLANTED_PANICS: u32 = 0;

    /// Panics if this task is the one.
    pub fn panic_if_asked(task: Task) {
        // SAFETY: a word that only a test's debug probe writes.
        let asked = unsafe { (&raw const PLANTED_PANIC).read_volatile() };
        if asked == task as u32 + 1 {
            // Of no address that a compiler could know: an index beyond the end.
            let numbers = [0_u32; 1];
            // SAFETY: as above.
            unsafe { (&raw mut PLANTED_PANICS).write_volatile(1) };
            defmt::info!("{}", numbers[asked as usize]);
        }
    }
}

#[cfg(planted_defect = "fed_by_idle")]
mod stall {
    /// A test sets it.
    #[unsafe(no_mangle)]
    static mut PLANTED_STALL: u32 = 0;

    /// Never comes back if a test wants it so.
    pub async fn stall_if_asked() {
        // SAFETY: a word that only a test's debug probe writes.
        if unsafe { (&raw const PLANTED_STALL).read_volatile() } != 0 {
            core::future::pending::<()>().await;
        }
    }
}
