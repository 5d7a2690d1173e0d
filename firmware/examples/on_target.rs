//! Arithmetic of the model and of the procedure on the processor, for comparison with a PC:
//! `system-tests` runs this image on the emulated board and the same code on the PC, and compares bits.
//!
//! It is built like the firmware: same profile, same memory map, same arithmetic routines. If `MAILBOX`
//! holds a single word, that is the number of a function, and the image writes the function's checksum
//! to `ANSWER`. Several words are an event of the procedure, and the image writes a checksum of the
//! resulting actions.

#![no_std]
#![no_main]
#![allow(unsafe_code)]

#[path = "on_target/arithmetic.rs"]
mod arithmetic;
#[path = "../src/board/rp2040/code_in_memory.rs"]
mod code_in_memory;
#[path = "../src/board/rp2040/float.rs"]
mod float;
#[path = "../src/board/rp2040/routines.rs"]
mod routines;
#[path = "../src/board/rp2040/second_stage.rs"]
mod second_stage;
#[path = "on_target/tape.rs"]
mod tape;

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::entry;
use palpate_procedure::{Actions, Procedure};
// Linked because it provides the vector table.
use rp2040_pac as _;
use tape::WORDS;

/// Read and written by a debug probe, like the statics that follow: the length of an event, 0 for none,
/// and its words.
#[unsafe(no_mangle)]
static MAILBOX: [AtomicU32; 1 + WORDS] = [const { AtomicU32::new(0) }; 1 + WORDS];
#[unsafe(no_mangle)]
static ANSWER: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    // A static, since the stack has no space for the procedure itself, only for one of its steps.
    static mut PROCEDURE: Option<Procedure> = None;
    static mut ACTIONS: Actions = Actions::new();
    static mut EVENT: [u32; WORDS] = [0; WORDS];
    make(PROCEDURE);
    ANSWER.store(tape::READY, Ordering::Relaxed);
    loop {
        let length = MAILBOX[0].load(Ordering::Relaxed) as usize;
        if length == 0 {
            continue;
        }
        for (word, slot) in EVENT.iter_mut().zip(&MAILBOX[1..]) {
            *word = slot.load(Ordering::Relaxed);
        }
        let answer = match (EVENT.get(..length), PROCEDURE.as_mut()) {
            (Some(&[function]), _) => sum_of(function),
            (Some(event), Some(procedure)) => tape::step(procedure, ACTIONS, event),
            _ => None,
        };
        ANSWER.store(answer.unwrap_or_default(), Ordering::Relaxed);
        MAILBOX[0].store(0, Ordering::Relaxed);
    }
}

/// Creates the procedure. A function of its own, so that its stack frame is free again afterwards.
#[inline(never)]
fn make(slot: &mut Option<Procedure>) {
    *slot = Some(Procedure::new(tape::board()));
}

#[inline(never)]
fn sum_of(function: u32) -> Option<u32> {
    let (_, check) = arithmetic::CHECKS.get(function as usize)?;
    Some(arithmetic::sum(*check))
}

/// Nothing here may panic; a panic shows as a missing answer.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
