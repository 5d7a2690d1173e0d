//! Priority between the coil's interrupt, until it has written its levels, and the converter bus.
//!
//! The bus interrupts have the higher priority, since they take a time stamp. All bus work that can be
//! deferred waits while the coil's interrupt runs or is about to start: a level written after the PWM
//! wraps takes effect one period late. A transaction then starts up to six microseconds later.

#![allow(unsafe_code)]

use core::sync::atomic::{AtomicBool, Ordering, compiler_fence};

use cortex_m::peripheral::NVIC;
use rp2040_pac::{Interrupt, PWM};

use super::timing::{CONTROL_SLICE, CYCLES};

/// Cycles from the check in [`must_wait`] until the bus engine has started a transaction.
pub const TO_BEGIN: u32 = 360;
/// Cycles from the check in [`must_wait`] until the bus engine has moved the bytes of a frame.
pub const TO_SERVE: u32 = 400;

/// Cycles after the control slice's wrap by which the coil's interrupt has called [`begin`] or is still
/// pending. They cover its entry, and a bus interrupt that was entered just before, up to that bus
/// interrupt's check in [`must_wait`].
const BEGUN: u32 = 140;
const CONTROL: Interrupt = Interrupt::PWM_IRQ_WRAP;

/// The coil's interrupt is enabled and runs once per period.
static IS_ON: AtomicBool = AtomicBool::new(false);
/// The coil's interrupt has started and has not written its levels.
static IS_BUSY: AtomicBool = AtomicBool::new(false);
/// The bus engine waits for the coil's interrupt.
static IS_AWAITED: AtomicBool = AtomicBool::new(false);

/// Records that the coil's interrupt is enabled or disabled.
pub fn set_on(on: bool) {
    IS_ON.store(on, Ordering::Relaxed);
    if !on {
        release();
    }
}

/// Records that the coil's interrupt has started.
#[inline(always)]
pub fn begin() {
    IS_BUSY.store(true, Ordering::Relaxed);
}

/// Records that the levels are written.
#[inline(always)]
pub fn end() {
    // The levels must be written first: a bus interrupt may follow the next store at once.
    compiler_fence(Ordering::SeqCst);
    IS_BUSY.store(false, Ordering::Relaxed);
    // Read only after `IS_BUSY` is cleared: a check of the bus engine that comes later does not wait.
    if IS_AWAITED.load(Ordering::Relaxed) {
        release();
    }
}

#[inline(never)]
fn release() {
    IS_AWAITED.store(false, Ordering::Relaxed);
    // Clears the flag before the bus interrupt is unmasked, since that interrupt may set it again.
    compiler_fence(Ordering::SeqCst);
    // SAFETY: this restores the usual state: the interrupt is masked only while its work is deferred.
    unsafe { NVIC::unmask(Interrupt::I2C0_IRQ) };
    NVIC::pend(Interrupt::I2C0_IRQ);
}

/// Returns whether the bus engine must defer work of `cycles`. If so, I2C0_IRQ is masked and is
/// triggered when the wait ends. Only the bus interrupts, and tasks that mask them, may call it.
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
