//! Blocking transactions of the I2C block.

use rp2040_pac::{I2C0, RESETS};

use crate::timing::{CONTROL, HIGH, HOLD, LOW, SPIKE};
use crate::waiting::{now_us, wait};

/// I2C address of the converter when its ADDR pin is low.
const ADDRESS: u32 = 0x2A;
/// Bit of a command to the I2C block: read a byte.
const READ: u32 = 1 << 8;
/// Bit of a command: send STOP after the byte.
const STOP: u32 = 1 << 9;
/// Bit of a command: send a repeated START before the byte.
const RESTART: u32 = 1 << 10;
/// Raw interrupt bit of the I2C block: the transaction was aborted.
const ABORT: u32 = 1 << 6;
/// Raw interrupt bit: a STOP was sent.
const STOPPED: u32 = 1 << 9;
/// Maximum number of bytes of a transaction: the depth of the block's queues.
const QUEUE: usize = 16;
/// Time limit of a transaction, in microseconds; one of 16 bytes takes 0.4 ms.
const DEADLINE_US: u32 = 5_000;
/// Bit in a segment's first byte: the segment reads; the other bits are the number of bytes.
const READS: u8 = 0x80;

/// Outcome of a request.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ReplyCode {
    Done = 0,
    NotUnderstood = 1,
    NotAcknowledged = 2,
    TimedOut = 3,
    NoEdge = 4,
}

fn i2c() -> &'static rp2040_pac::i2c0::RegisterBlock {
    // SAFETY: one core, no interrupts.
    unsafe { &*I2C0::ptr() }
}

/// Resets the I2C block and sets it up.
pub fn set_up() {
    // SAFETY: values are within their fields; nothing else uses the block.
    unsafe {
        let resets = &*RESETS::ptr();
        resets.reset().modify(|_, w| w.i2c0().set_bit());
        resets.reset().modify(|_, w| w.i2c0().clear_bit());
        wait(|| resets.reset_done().read().i2c0().bit_is_set());
        i2c().ic_con().write(|w| w.bits(CONTROL));
        i2c().ic_tar().write(|w| w.bits(ADDRESS));
        i2c().ic_fs_spklen().write(|w| w.bits(SPIKE));
        i2c().ic_fs_scl_lcnt().write(|w| w.bits(LOW));
        i2c().ic_fs_scl_hcnt().write(|w| w.bits(HIGH));
        i2c().ic_sda_hold().write(|w| w.bits(HOLD));
        i2c().ic_intr_mask().write(|w| w.bits(0));
        i2c().ic_enable().write(|w| w.bits(1));
    }
}

fn command(bits: u32) {
    // SAFETY: any command of eleven bits may be written.
    i2c().ic_data_cmd().write(|w| unsafe { w.bits(bits) });
}

/// Executes one transaction of segments, each after its own START: `0x80 + n` reads n bytes, `n` with n
/// bytes writes them. `None` if the segments are invalid. Passes the bytes read to `take`.
pub fn run(mut segments: &[u8], mut take: impl FnMut(u8)) -> Option<ReplyCode> {
    let mut commands = [0; QUEUE];
    let mut count = 0;
    while let Some((&head, rest)) = segments.split_first() {
        let length = usize::from(head & !READS);
        let (bytes, after) = if head & READS != 0 {
            (None, rest)
        } else {
            (Some(rest.get(..length)?), rest.get(length..)?)
        };
        for index in 0..length {
            let start = if index == 0 && count > 0 { RESTART } else { 0 };
            let byte = bytes.map_or(Some(READ), |bytes| {
                bytes.get(index).map(|&byte| byte.into())
            });
            *commands.get_mut(count)? = byte? | start;
            count += 1;
        }
        segments = after;
    }
    let last = commands.get_mut(count.checked_sub(1)?)?;
    *last |= STOP;
    let _ = i2c().ic_clr_intr().read().bits();
    for &bits in commands.iter().take(count) {
        command(bits);
    }
    let begin = now_us();
    loop {
        let raised = i2c().ic_raw_intr_stat().read().bits();
        while i2c().ic_rxflr().read().bits() > 0 {
            take(i2c().ic_data_cmd().read().bits() as u8);
        }
        if raised & ABORT != 0 {
            wait(|| i2c().ic_raw_intr_stat().read().bits() & STOPPED != 0);
            let _ = i2c().ic_clr_intr().read().bits();
            return Some(ReplyCode::NotAcknowledged);
        }
        if raised & STOPPED != 0 {
            return Some(ReplyCode::Done);
        }
        if now_us().wrapping_sub(begin) > DEADLINE_US {
            set_up();
            return Some(ReplyCode::TimedOut);
        }
    }
}

/// Reads two bytes and resets the block after `bits` bits of the transaction, as a reset of the
/// processor would.
pub fn cut_off(bits: u8) {
    let _ = i2c().ic_clr_intr().read().bits();
    command(0x7E);
    command(READ | RESTART);
    command(READ | STOP);
    let begin = now_us();
    // A bit on the bus takes 2.5 us.
    while now_us().wrapping_sub(begin) < u32::from(bits) * 5 / 2 {}
    set_up();
}
