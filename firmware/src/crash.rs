//! Data that a run keeps for the next one, in memory that no reset clears: the cause of its end, which
//! [`palpate_procedure::boot`] evaluates with the chip's reset flags; and the energy in the coil, with
//! which the coil's manager continues its account.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use palpate_node::coil::EnergyWords;
use palpate_procedure::boot::{self, Boot, NO_RECORD, RecordWords};

use crate::board::reset;

pub use palpate_procedure::boot::End;

#[repr(transparent)]
struct RecordCell(UnsafeCell<MaybeUninit<RecordWords>>);

// SAFETY: written at the end of a run, with interrupts off, and at its start before they are on;
// `forget` is called from one task, and other code that writes in between ends the run.
unsafe impl Sync for RecordCell {}

/// The kept crash record. An exported symbol, so that a test finds it.
#[unsafe(export_name = "CRASH_RECORD")]
#[unsafe(link_section = ".uninit.crash")]
static KEPT: RecordCell = RecordCell(UnsafeCell::new(MaybeUninit::uninit()));

fn read() -> RecordWords {
    // SAFETY: any bits are valid words of a record; the pointer is to a static.
    unsafe { KEPT.0.get().cast::<RecordWords>().read_volatile() }
}

fn write(words: RecordWords) {
    // SAFETY: see `RecordCell`.
    unsafe { KEPT.0.get().cast::<RecordWords>().write_volatile(words) };
}

struct EnergyCell(UnsafeCell<MaybeUninit<EnergyWords>>);

// SAFETY: read at the start, before the tasks; then written by one task, and read by none.
unsafe impl Sync for EnergyCell {}

#[unsafe(link_section = ".uninit.energy")]
static ENERGY: EnergyCell = EnergyCell(UnsafeCell::new(MaybeUninit::uninit()));

/// Returns the energy in the coil that the previous run kept.
pub fn kept_energy() -> EnergyWords {
    // SAFETY: every pattern of bits is two words; the pointer is to a static.
    unsafe { ENERGY.0.get().cast::<EnergyWords>().read_volatile() }
}

/// Keeps the energy in the coil. A reset between its two words leaves an invalid pair.
pub fn keep_energy(words: EnergyWords) {
    // SAFETY: see `EnergyCell`.
    unsafe { ENERGY.0.get().cast::<EnergyWords>().write_volatile(words) };
}

/// Keeps the cause of this run's end for the next run.
pub fn keep(end: &End<'_>) {
    write(boot::record(end, &read(), reset::uptime_ms()));
}

/// Returns the boot cause of this run. Call it once, before interrupts are on.
pub fn boot() -> Boot {
    let (boot, keep) = Boot::judge(reset::flags(), &read());
    write(keep);
    boot
}

/// Ends a streak of crashes: this run has lasted long enough.
pub fn forget() {
    write(NO_RECORD);
}
