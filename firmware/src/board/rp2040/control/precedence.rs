//! Who goes first: the coil's interrupt, until its levels are written, or the converter's bus.
//!
//! The bus's interrupts stand above that of the coil, since a time stamp is taken there. All that
//! can wait does so, when the coil's interrupt is under way or about to come: a level that is
//! written after the PWM's wrap comes a period late. A transaction then begins up to six
//! microseconds later.

#![allow(unsafe_code)]

use core::sync::atomic::{AtomicBool, Ordering, compiler_fence};

use cortex_m::peripheral::NVIC;
use rp2040_pac::{Interrupt, PWM};

use super::{CONTROL_SLICE, CYCLES};

/// Cycles that parts of the bus's engine take, from their question on: to begin a transaction, and
/// to move a frame's bytes.
pub const TO_BEGIN: u32 = 360;
/// See [`TO_BEGIN`].
pub const TO_SERVE: u32 = 400;

/// Cycles after which the coil's interrupt has said that it has begun, unless it is still pending:
/// its entry, and what the bus's own takes from its entry, just before, to the question.
const BEGUN: u32 = 140;
const CONTROL: Interrupt = Interrupt::PWM_IRQ_WRAP;

/// Whether the coil's interrupt runs at all, once a period.
static IS_ON: AtomicBool = AtomicBool::new(false);
/// It has begun, and its levels are not written.
static IS_BUSY: AtomicBool = AtomicBool::new(false);
/// The bus's engine waits for it.
static IS_AWAITED: AtomicBool = AtomicBool::new(false);

/// The coil's interrupt begins to run, or ends.
pub fn set_on(on: bool) {
    IS_ON.store(on, Ordering::Relaxed);
    if !on {
        release();
    }
}

/// The coil's interrupt has begun.
#[inline(always)]
pub fn begin() {
    IS_BUSY.store(true, Ordering::Relaxed);
}

/// Its levels are written.
#[inline(always)]
pub fn end() {
    // The levels are written to a register, and the bus's interrupt may come at once.
    compiler_fence(Ordering::SeqCst);
    IS_BUSY.store(false, Ordering::Relaxed);
    // In this order: who asks from now on need not wait.
    if IS_AWAITED.load(Ordering::Relaxed) {
        release();
    }
}

#[inline(never)]
fn release() {
    IS_AWAITED.store(false, Ordering::Relaxed);
    // Before the interrupt can wait anew.
    compiler_fence(Ordering::SeqCst);
    // SAFETY: it was enabled: it always is, but while it waits.
    unsafe { NVIC::unmask(Interrupt::I2C0_IRQ) };
    NVIC::pend(Interrupt::I2C0_IRQ);
}

/// Whether the bus's engine has to wait with what takes so many cycles. If so, I2C0_IRQ comes when it
/// need not any more, and not before. For its interrupts, and for tasks that hold them back.
#[inline(always)]
pub fn must_wait(cycles: u32) -> bool {
    if !IS_ON.load(Ordering::Relaxed) {
        return false;
    }
    // SAFETY: a register is read.
    let count = unsafe { (*PWM::ptr()).ch(CONTROL_SLICE).ctr().read().bits() };
    let is_near = !(BEGUN..=CYCLES - cycles).contains(&count);
    let waits = is_near || IS_BUSY.load(Ordering::Relaxed) || NVIC::is_pending(CONTROL);
    if waits {
        IS_AWAITED.store(true, Ordering::Relaxed);
        NVIC::mask(Interrupt::I2C0_IRQ);
    }
    waits
}
