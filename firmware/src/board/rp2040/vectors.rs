//! Vector table in RAM: fetching a vector from flash may take a microsecond.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;
use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::{NVIC, SCB};
use rp2040_pac::Interrupt;

use super::control;
use super::i2c::engine;

/// Number of vectors in the table: those of the processor itself and of the 32 interrupts.
const VECTORS: usize = 48;
/// Number of the processor's own vectors.
const EXCEPTIONS: usize = 16;
/// Priority of the control interrupt, the second of four: below the bus interrupts, which defer their
/// work for it where they can (`control::precedence`), and above all tasks of RTIC.
const CONTROL_PRIORITY: u8 = 0x40;
/// Address at which the linker places the table in flash.
const FLASH: *const usize = 0x1000_0100 as *const usize;

/// Aligned as VTOR requires (ARMv6-M architecture, B3.2.5).
#[repr(C, align(256))]
struct Table(UnsafeCell<[usize; VECTORS]>);

// SAFETY: it is written once, before any interrupt is enabled.
unsafe impl Sync for Table {}

static TABLE: Table = Table(UnsafeCell::new([0; VECTORS]));

/// Moves the table to RAM, with the two handlers of the converter bus in it. Both get the highest
/// priority, above every task, so they never interrupt each other.
pub fn move_to_memory(scb: &SCB, nvic: &mut NVIC) {
    // SAFETY: no interrupt is enabled yet; the table in flash has 48 words; the handlers have the type
    // of functions in a vector table.
    unsafe {
        let table = &mut *TABLE.0.get();
        for (index, vector) in table.iter_mut().enumerate() {
            *vector = FLASH.add(index).read();
        }
        let handlers: [(Interrupt, unsafe extern "C" fn()); 2] = [
            (Interrupt::IO_IRQ_BANK0, engine::on_edge),
            (Interrupt::I2C0_IRQ, engine::on_i2c),
        ];
        for (interrupt, handler) in handlers {
            if let Some(vector) = table.get_mut(EXCEPTIONS + interrupt as usize) {
                *vector = handler as usize;
            }
            nvic.set_priority(interrupt, 0);
        }
        if let Some(vector) = table.get_mut(EXCEPTIONS + Interrupt::PWM_IRQ_WRAP as usize) {
            let handler: unsafe extern "C" fn() = control::on_period;
            *vector = handler as usize;
        }
        nvic.set_priority(Interrupt::PWM_IRQ_WRAP, CONTROL_PRIORITY);
        scb.vtor.write(TABLE.0.get() as u32);
        cortex_m::asm::dsb();
        NVIC::unmask(Interrupt::IO_IRQ_BANK0);
        NVIC::unmask(Interrupt::I2C0_IRQ);
        NVIC::unmask(Interrupt::PWM_IRQ_WRAP);
    }
}

/// Interrupts that no critical section of a task masks: those of the converter bus and of the coil. They
/// share data with tasks only through the shorter critical sections of `engine` and `control`.
const NEVER_MASKED: u32 = 1 << Interrupt::IO_IRQ_BANK0 as u32
    | 1 << Interrupt::I2C0_IRQ as u32
    | 1 << Interrupt::PWM_IRQ_WRAP as u32;

/// Masks every other enabled interrupt; returns which were enabled.
#[inline(never)]
fn mask() -> u32 {
    // Disables all interrupts while it masks some: an interrupt that was just masked cannot be taken
    // after that.
    cortex_m::interrupt::free(|_| {
        // SAFETY: masking interrupts cannot break an assumption of other code.
        let nvic = unsafe { &*NVIC::PTR };
        let enabled = nvic.iser.first().map_or(0, |iser| iser.read()) & !NEVER_MASKED;
        if let Some(icer) = nvic.icer.first() {
            // SAFETY: masking interrupts cannot break an assumption of other code.
            unsafe { icer.write(enabled) };
        }
        cortex_m::asm::dsb();
        enabled
    })
}

/// Unmasks the interrupts that were enabled before [`mask`].
fn unmask(enabled: u32) {
    // Needed because the compiler does not relate a write to the NVIC to the data that the critical
    // section protects.
    compiler_fence(Ordering::SeqCst);
    // SAFETY: these were enabled when the section began.
    let nvic = unsafe { &*NVIC::PTR };
    if let Some(iser) = nvic.iser.first() {
        // SAFETY: these were enabled when the section began.
        unsafe { iser.write(enabled) };
    }
}

struct Section;
critical_section::set_impl!(Section);

// SAFETY: between acquire and release only the interrupts of `NEVER_MASKED` run. Their handlers take no
// critical section and use no data that only a critical section protects. Only one core runs.
unsafe impl critical_section::Impl for Section {
    unsafe fn acquire() -> u32 {
        mask()
    }

    unsafe fn release(enabled: u32) {
        unmask(enabled);
    }
}
