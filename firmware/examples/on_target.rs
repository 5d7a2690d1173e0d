//! The model's and the procedure's arithmetic on the processor, beside a PC's: `system-tests` runs
//! this image on the emulated board and the same lines on the PC, and compares bits.
//!
//! It is built as the firmware is: same profile, same memory, same routines of the processor.
//! A word alone in `MAILBOX` is the number of a function, whose sum it leaves in `ANSWER`; more of
//! them are an event of the procedure, of whose actions it leaves a sum there.

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
// Its vector table.
use rp2040_pac as _;
use tape::WORDS;

/// Read and written by a debug probe, as all that follow: the length of an event, 0 for none, and
/// its words.
#[unsafe(no_mangle)]
static MAILBOX: [AtomicU32; 1 + WORDS] = [const { AtomicU32::new(0) }; 1 + WORDS];
#[unsafe(no_mangle)]
static ANSWER: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    // Not on the stack, which has room for a step of the procedure only.
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

/// In a frame of its own, so that what making takes of the stack is free again.
#[inline(never)]
fn make(slot: &mut Option<Procedure>) {
    *slot = Some(Procedure::new(tape::board()));
}

#[inline(never)]
fn sum_of(function: u32) -> Option<u32> {
    let (_, check) = arithmetic::CHECKS.get(function as usize)?;
    Some(arithmetic::sum(*check))
}

/// Nothing here may panic; what does is seen by its silence.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
