//! Image for `palpate bring-up`: executes requests of the PC on the converter's pins, one after the
//! other, over channel 0 of the debug probe in both directions. The PC decides which properties of the
//! silicon to measure, and how.
//!
//! A request is its length, a letter and its data. An answer is its length, an outcome (0 done, 1 not
//! understood, 2 not acknowledged, 3 timed out, 4 no edge) and its data. Numbers of several bytes are
//! little-endian.
//!
//! | request | with | answer |
//! |---|---|---|
//! | `?` | | name and version of the image |
//! | `T` | segments of one transaction, each after a START: `n` and n bytes to write, or `0x80 + n` to read n | what was read |
//! | `E` | number of edges, time limit in ms, segments to transfer after each edge | number of edges, time of the first and of the last edge in us (four bytes each), what was last read |
//! | `A` | time limit in ms: waits until INTB is low | |
//! | `I`, `W` | | level of INTB, of SDA |
//! | `S` | level of SD | |
//! | `C` | divisor of 200 MHz for CLKIN, 5 to 20 | |
//! | `D` | ms to wait | |
//! | `X` | bits after which a read is cut off | |
//! | `L` | pulses of SCL, and a STOP | |
//! | `B` | requests, each with its length, done one after the other | their answers without outcomes |

#![no_std]
#![no_main]
#![allow(unsafe_code)]

#[path = "../src/board/rp2040/clocks.rs"]
mod clocks;
#[path = "../src/board/rp2040/code_in_memory.rs"]
mod code_in_memory;
#[path = "bring_up/pins.rs"]
mod pins;
#[path = "../src/board/rp2040/routines.rs"]
mod routines;
#[path = "../src/board/rp2040/second_stage.rs"]
mod second_stage;
#[path = "../src/board/rp2040/i2c/timing.rs"]
mod timing;
#[path = "bring_up/transfer.rs"]
mod transfer;
#[path = "bring_up/waiting.rs"]
mod waiting;

use cortex_m_rt::entry;
use palpate_node::board::Clkin;
use rp2040_pac::Peripherals;
use rtt_target::{DownChannel, UpChannel};

use transfer::ReplyCode;
use waiting::{now_us, pause, wait};

/// Bytes of the longest request and answer, without the length byte.
const LONGEST: usize = 64;

/// Critical section of a program without interrupts.
struct Alone;
critical_section::set_impl!(Alone);

// SAFETY: one core, and no interrupt is ever enabled.
unsafe impl critical_section::Impl for Alone {
    unsafe fn acquire() -> u32 {
        0
    }

    unsafe fn release(_: u32) {}
}

#[entry]
fn main() -> ! {
    let channels = rtt_target::rtt_init! {
        up: { 0: { size: 256, name: "answers" } }
        down: { 0: { size: 256, name: "requests" } }
    };
    let (mut up, mut down) = (channels.up.0, channels.down.0);
    // SAFETY: called once, and nothing else has been set up.
    let mut device = unsafe { Peripherals::steal() };
    pins::set_up(&device);
    clocks::set_up(
        &mut device.RESETS,
        &device.CLOCKS,
        device.XOSC,
        device.PLL_SYS,
        device.PLL_USB,
        &mut device.VREG_AND_CHIP_RESET,
        &device.WATCHDOG,
    );
    device.RESETS.reset().modify(|_, w| w.timer().clear_bit());
    wait(|| device.RESETS.reset_done().read().timer().bit_is_set());
    clocks::send_out(&device.CLOCKS, Clkin::SINGLE.divisor());
    transfer::set_up();
    let mut request = [0; LONGEST];
    loop {
        let length = receive(&mut down, &mut request);
        let mut answer = Answer::new();
        if let Some((kind, rest)) = request.get(..length).and_then(<[u8]>::split_first) {
            let outcome = match kind {
                b'B' => serve_all(rest, &mut answer),
                kind => serve(*kind, rest, &mut answer),
            };
            let outcome = outcome.unwrap_or(ReplyCode::NotUnderstood);
            answer.send(outcome, &mut up);
        }
    }
}

/// Waits for a whole request and returns its length.
fn receive(down: &mut DownChannel, request: &mut [u8; LONGEST]) -> usize {
    let mut byte = || {
        let mut one = [0];
        while down.read(&mut one) == 0 {}
        let [byte] = one;
        byte
    };
    let length = usize::from(byte());
    for slot in 0..length {
        let byte = byte();
        if let Some(free) = request.get_mut(slot) {
            *free = byte;
        }
    }
    length.min(LONGEST)
}

/// Answer under construction.
struct Answer {
    bytes: [u8; LONGEST],
    length: usize,
}

impl Answer {
    const fn new() -> Self {
        Self {
            bytes: [0; LONGEST],
            length: 2,
        }
    }

    fn push(&mut self, byte: u8) {
        if let Some(slot) = self.bytes.get_mut(self.length) {
            *slot = byte;
            self.length += 1;
        }
    }

    fn extend(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.push(byte);
        }
    }

    fn send(mut self, outcome: ReplyCode, up: &mut UpChannel) {
        let length = self.length as u8 - 1;
        for (slot, byte) in self.bytes.iter_mut().zip([length, outcome as u8]) {
            *slot = byte;
        }
        let mut left = self.bytes.get(..self.length).unwrap_or_default();
        while !left.is_empty() {
            let written = up.write(left);
            left = left.get(written..).unwrap_or_default();
        }
    }
}

/// Executes several requests without waiting for the PC between them, until one fails.
fn serve_all(mut requests: &[u8], answer: &mut Answer) -> Option<ReplyCode> {
    while let Some((&length, after)) = requests.split_first() {
        let length = usize::from(length);
        let (&kind, rest) = after.get(..length)?.split_first()?;
        match serve(kind, rest, answer)? {
            ReplyCode::Done => requests = after.get(length..)?,
            failed => return Some(failed),
        }
    }
    Some(ReplyCode::Done)
}

/// Executes a request; `None` if its kind or its data are invalid.
fn serve(kind: u8, rest: &[u8], answer: &mut Answer) -> Option<ReplyCode> {
    match (kind, rest) {
        (b'?', []) => answer.extend(b"palpate bring-up 2"),
        (b'T', segments) => return transfer::run(segments, |byte| answer.push(byte)),
        (b'E', [count, timeout_ms, segments @ ..]) => {
            return edges(*count, *timeout_ms, segments, answer);
        }
        (b'A', [timeout_ms]) => {
            if !within(*timeout_ms, || !pins::interrupt_is_high()) {
                return Some(ReplyCode::NoEdge);
            }
        }
        (b'I', []) => answer.push(pins::interrupt_is_high().into()),
        (b'S', [high]) => pins::shut_down(*high != 0),
        (b'C', [divisor @ 5..=20]) => {
            // SAFETY: no other code touches the clocks.
            let clocks = unsafe { &*rp2040_pac::CLOCKS::ptr() };
            clocks::send_out(clocks, (*divisor).into());
        }
        (b'D', [ms]) => pause(u32::from(*ms) * 1_000),
        (b'X', [bytes]) => transfer::cut_off(*bytes),
        (b'L', [pulses]) => {
            pins::pulse(*pulses);
            transfer::set_up();
        }
        (b'W', []) => answer.push(pins::data_is_high().into()),
        _ => return None,
    }
    Some(ReplyCode::Done)
}

/// Waits for `count` edges of INTB, and after each makes the transfer that releases INTB. Answers with
/// the number of edges, the times of the first and the last, and the bytes of the last transfer. An edge
/// that came before the request is ignored: the first awaited edge starts the count.
fn edges(count: u8, timeout_ms: u8, segments: &[u8], answer: &mut Answer) -> Option<ReplyCode> {
    let (mut first_us, mut last_us) = (0, 0);
    pins::forget_edge();
    match transfer::run(segments, |_| {})? {
        ReplyCode::Done => {}
        failed => return Some(failed),
    }
    let mut read = Answer::new();
    for seen in 0..=count {
        if !within(timeout_ms, pins::edge_came) {
            return Some(ReplyCode::NoEdge);
        }
        last_us = now_us();
        pins::forget_edge();
        if seen <= 1 {
            first_us = last_us;
        }
        read = Answer::new();
        match transfer::run(segments, |byte| read.push(byte))? {
            ReplyCode::Done => {}
            failed => return Some(failed),
        }
    }
    answer.push(count);
    answer.extend(&first_us.to_le_bytes());
    answer.extend(&last_us.to_le_bytes());
    answer.extend(read.bytes.get(2..read.length)?);
    Some(ReplyCode::Done)
}

/// Polls a condition until it holds, for at most `timeout_ms`.
fn within(timeout_ms: u8, holds: impl Fn() -> bool) -> bool {
    let begin = now_us();
    while !holds() {
        if now_us().wrapping_sub(begin) > u32::from(timeout_ms) * 1_000 {
            return false;
        }
    }
    true
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    pins::shut_down(true);
    loop {
        cortex_m::asm::nop();
    }
}
