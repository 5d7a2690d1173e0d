//! What the last run died of: kept in memory that no start clears.

#![allow(unsafe_code)]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use heapless::String;
use palpate_wire::code::ResetCause;
use palpate_wire::record::Crash;
use rp2040_pac::{PSM, TIMER, VREG_AND_CHIP_RESET, WATCHDOG};

/// Length of the part of a file's name that is kept.
const NAME: usize = 48;
/// Says that what lies there was written by this firmware.
const MAGIC: u32 = 0x5061_6C70;

/// What ends a run.
pub enum Cause<'a> {
    /// A panic, and where.
    Panic {
        /// The source file.
        file: &'a str,
        /// The line in it.
        line: u32,
    },
    /// A hard fault, and where.
    HardFault {
        /// Of the instruction.
        program_counter: u32,
        /// Where it would have returned to.
        link_register: u32,
    },
}

/// As it lies in memory.
#[derive(Clone, Copy)]
#[repr(C)]
struct Kept {
    magic: u32,
    is_fault: u32,
    streak: u32,
    line: u32,
    program_counter: u32,
    link_register: u32,
    uptime_ms: u32,
    name: [u8; NAME],
    check: u32,
}

struct Place(UnsafeCell<MaybeUninit<Kept>>);

// SAFETY: written at the end of a run, with interrupts off, and read at its start before they are
// on.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".uninit.crash")]
static KEPT: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

impl Kept {
    /// A sum that memory without a record does not have by chance.
    fn sum(&self) -> u32 {
        let words = [
            self.magic,
            self.is_fault,
            self.streak,
            self.line,
            self.program_counter,
            self.link_register,
            self.uptime_ms,
        ];
        let mix = |sum: u32, word: u32| sum.rotate_left(5) ^ word.wrapping_mul(0x9E37_79B9);
        let sum = words.into_iter().fold(0, mix);
        self.name
            .iter()
            .fold(sum, |sum, &byte| mix(sum, u32::from(byte)))
    }

    fn read() -> Option<Self> {
        // SAFETY: every pattern of bits is a valid `Kept`; the pointer is to a static.
        let kept = unsafe { KEPT.0.get().cast::<Self>().read_volatile() };
        (kept.magic == MAGIC && kept.check == kept.sum()).then_some(kept)
    }

    fn write(self) {
        // SAFETY: see `Place`.
        unsafe { KEPT.0.get().cast::<Self>().write_volatile(self) };
    }
}

/// Keeps the cause for the next run.
pub fn keep(cause: Cause<'_>) {
    let streak = Kept::read().map_or(0, |kept| kept.streak);
    let mut kept = Kept {
        magic: MAGIC,
        is_fault: 0,
        streak: streak.saturating_add(1),
        line: 0,
        program_counter: 0,
        link_register: 0,
        // SAFETY: reading the raw timer has no effect on it.
        uptime_ms: unsafe { (*TIMER::ptr()).timerawl().read().bits() } / 1_000,
        name: [0; NAME],
        check: 0,
    };
    match cause {
        Cause::Panic { file, line } => {
            kept.line = line;
            let end = file.as_bytes();
            let end = end.get(end.len().saturating_sub(NAME)..).unwrap_or(end);
            for (place, &byte) in kept.name.iter_mut().zip(end) {
                *place = byte;
            }
        }
        Cause::HardFault {
            program_counter,
            link_register,
        } => {
            kept.is_fault = 1;
            kept.program_counter = program_counter;
            kept.link_register = link_register;
        }
    }
    kept.check = kept.sum();
    kept.write();
}

/// Why this run began, and what the last one died of.
pub struct Beginning {
    /// Why.
    pub cause: ResetCause,
    /// What the last run died of, if it did.
    pub crash: Option<Crash>,
    /// Runs in a row that ended by a panic, a fault or a hang.
    pub streak: u8,
}

impl Beginning {
    /// Reads it from registers and memory, and makes sure that a watchdog resets everything.
    pub fn read() -> Self {
        // SAFETY: only this function uses these registers, before interrupts are on.
        let (reason, chip) = unsafe {
            (*PSM::ptr()).wdsel().write(|w| w.bits(0x1_FFFC));
            let reason = (*WATCHDOG::ptr()).reason().read();
            let chip = (*VREG_AND_CHIP_RESET::ptr()).chip_reset().read();
            (reason, chip)
        };
        let kept = Kept::read();
        let forced = reason.force().bit_is_set();
        let cause = match &kept {
            Some(kept) if forced && kept.line == 0 && kept.is_fault == 1 => ResetCause::HardFault,
            Some(kept) if forced && kept.magic == MAGIC => ResetCause::Panic,
            _ if forced => ResetCause::Software,
            _ if reason.timer().bit_is_set() => ResetCause::Watchdog,
            _ if chip.had_psm_restart().bit_is_set() => ResetCause::Debugger,
            _ if chip.had_run().bit_is_set() => ResetCause::Pin,
            _ => ResetCause::PowerOn,
        };
        let streak = match (cause, &kept) {
            (ResetCause::Watchdog, kept) => count_hang(kept.as_ref()),
            (_, Some(kept)) if forced => kept.streak,
            _ => {
                forget();
                0
            }
        };
        Self {
            cause,
            crash: kept.filter(|_| forced).map(|kept| record(&kept, cause)),
            streak: u8::try_from(streak).unwrap_or(u8::MAX),
        }
    }

    /// Whether the last run ended of itself, and the bridge has to stay off until it is armed.
    pub const fn is_crash(&self) -> bool {
        matches!(
            self.cause,
            ResetCause::Watchdog | ResetCause::Panic | ResetCause::HardFault
        )
    }
}

/// A hang keeps nothing of itself: it is counted by the run that follows.
fn count_hang(kept: Option<&Kept>) -> u32 {
    let streak = kept.map_or(0, |kept| kept.streak).saturating_add(1);
    let mut hang = Kept {
        magic: MAGIC,
        is_fault: 0,
        streak,
        line: 0,
        program_counter: 0,
        link_register: 0,
        uptime_ms: 0,
        name: [0; NAME],
        check: 0,
    };
    hang.check = hang.sum();
    hang.write();
    streak
}

fn record(kept: &Kept, cause: ResetCause) -> Crash {
    let mut file = String::new();
    for &byte in kept.name.iter().take_while(|&&byte| byte != 0) {
        // A name of 48 bytes fits; what is not ASCII is not shown.
        let _ = file.push(if byte.is_ascii() {
            char::from(byte)
        } else {
            '?'
        });
    }
    Crash {
        cause,
        streak: u8::try_from(kept.streak).unwrap_or(u8::MAX).max(1),
        file,
        line: kept.line,
        program_counter: kept.program_counter,
        link_register: kept.link_register,
        uptime_ms: kept.uptime_ms,
    }
}

/// The run has lasted: what the last one died of is not the first of a streak any more.
pub fn forget() {
    // SAFETY: see `Place`; this is called from one task only.
    unsafe { KEPT.0.get().cast::<u32>().write_volatile(0) };
}
