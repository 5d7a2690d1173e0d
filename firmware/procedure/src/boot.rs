//! Why a run began: from the processor's reset flags, and the record that the last run left in
//! memory. Whatever cannot be read is a fault.

use heapless::String;
use palpate_wire::code::{FaultCode, ResetCause};
use palpate_wire::crc32;
use palpate_wire::record::Crash;

/// Words of the record.
pub const RECORD_WORDS: usize = 20;

/// The record as it lies in memory, in words, which no start clears:
///
/// | words | content |
/// |---|---|
/// | 0 | "Palp" |
/// | 1 | what it says: a count of crashes, a panic, a hard fault, an end that was asked for |
/// | 2 | crashes in a row; an end that was asked for keeps them |
/// | 3 to 6 | line, program counter, link register, time since the start in ms |
/// | 7 to 18 | the end of the source file's name, filled up with zeros |
/// | 19 | CRC-32C over the words before it, least significant byte first |
pub type RecordWords = [u32; RECORD_WORDS];

/// What memory holds when there is nothing to say.
pub const NO_RECORD: RecordWords = [0; RECORD_WORDS];

const MAGIC: u32 = 0x5061_6C70;
/// Bytes of the file's name.
const NAME: usize = 48;
/// Bytes under the CRC.
const CHECKED: usize = 4 * (RECORD_WORDS - 1);

/// What ends a run.
#[derive(Clone, Copy, Debug)]
pub enum End<'a> {
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
    /// It was asked for.
    Asked,
}

/// The processor's reset flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetFlags {
    /// A reset through the watchdog was asked for.
    pub forced: bool,
    /// The watchdog was not fed.
    pub timed_out: bool,
    /// That watchdog was the firmware's: it leaves a mark when it starts one. A boot loader restarts
    /// the processor through the watchdog too, after it has written an image.
    pub is_own_watchdog: bool,
    /// A debug probe asked for it.
    pub debugger: bool,
    /// The reset pin was pulled.
    pub pin: bool,
}

impl ResetFlags {
    /// Whether the firmware reset itself, on purpose or because its watchdog was not fed.
    const fn is_by_firmware(self) -> bool {
        self.forced || (self.timed_out && self.is_own_watchdog)
    }
}

/// Why a run began.
#[derive(Clone, Debug, PartialEq)]
pub struct Boot {
    /// Why.
    pub cause: ResetCause,
    /// What the last run died of, if it did and could say so.
    pub crash: Option<Crash>,
    /// Runs in a row that ended by a panic, a fault, a hang or in an unknown way, before they lasted.
    /// A new start that was asked for neither counts nor ends it.
    pub streak: u8,
}

/// What a record says.
#[derive(Clone, Copy, PartialEq, Eq)]
enum WordKind {
    /// How many runs in a row have crashed, up to the present one.
    Count,
    Panic,
    HardFault,
    Asked,
}

impl WordKind {
    const fn from_number(number: u32) -> Option<Self> {
        Some(match number {
            1 => Self::Count,
            2 => Self::Panic,
            3 => Self::HardFault,
            4 => Self::Asked,
            _ => return None,
        })
    }

    const fn number(self) -> u32 {
        match self {
            Self::Count => 1,
            Self::Panic => 2,
            Self::HardFault => 3,
            Self::Asked => 4,
        }
    }
}

/// A record that was read.
struct Kept {
    kind: WordKind,
    streak: u32,
    line: u32,
    program_counter: u32,
    link_register: u32,
    uptime_ms: u32,
    name: [u8; NAME],
}

impl Kept {
    const fn new(kind: WordKind, streak: u32) -> Self {
        Self {
            kind,
            streak,
            line: 0,
            program_counter: 0,
            link_register: 0,
            uptime_ms: 0,
            name: [0; NAME],
        }
    }

    /// Nothing unless every bit of it is as it was written: a CRC of 32 bits finds any five of them
    /// changed, and passes one in 2^32 of words at random.
    fn read(words: &RecordWords) -> Option<Self> {
        let &[
            MAGIC,
            kind,
            streak,
            line,
            program_counter,
            link_register,
            uptime_ms,
            ref name @ ..,
            check,
        ] = words
        else {
            return None;
        };
        if check != check_of(words) {
            return None;
        }
        let mut kept = Self {
            line,
            program_counter,
            link_register,
            uptime_ms,
            ..Self::new(WordKind::from_number(kind)?, streak)
        };
        for (bytes, word) in kept.name.chunks_exact_mut(4).zip(name) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Some(kept)
    }

    fn words(&self) -> RecordWords {
        let mut words = NO_RECORD;
        let [
            magic,
            kind,
            streak,
            line,
            program_counter,
            link_register,
            uptime_ms,
            name @ ..,
            _,
        ] = &mut words;
        *magic = MAGIC;
        *kind = self.kind.number();
        *streak = self.streak;
        *line = self.line;
        *program_counter = self.program_counter;
        *link_register = self.link_register;
        *uptime_ms = self.uptime_ms;
        let (quadruples, _) = self.name.as_chunks::<4>();
        for (word, bytes) in name.iter_mut().zip(quadruples) {
            *word = bytes
                .iter()
                .rev()
                .fold(0, |word, &byte| word << 8 | u32::from(byte));
        }
        let check = check_of(&words);
        if let Some(last) = words.last_mut() {
            *last = check;
        }
        words
    }

    fn crash(&self, cause: ResetCause) -> Crash {
        let mut file = String::new();
        for &byte in self.name.iter().take_while(|&&byte| byte != 0) {
            // A name of 48 bytes fits; what is not ASCII is not shown.
            let shown = if byte.is_ascii() { byte } else { b'?' };
            let _ = file.push(char::from(shown));
        }
        Crash {
            cause,
            streak: count(self.streak).max(1),
            file,
            line: self.line,
            program_counter: self.program_counter,
            link_register: self.link_register,
            uptime_ms: self.uptime_ms,
        }
    }
}

/// The record of a run that ends now. `before` is what memory holds.
pub fn record(end: &End<'_>, before: &RecordWords, uptime_ms: u32) -> RecordWords {
    let before = Kept::read(before).map_or(0, |kept| kept.streak);
    let streak = before.saturating_add(1);
    let mut kept = match *end {
        End::Panic { line, .. } => Kept {
            line,
            ..Kept::new(WordKind::Panic, streak)
        },
        End::HardFault {
            program_counter,
            link_register,
        } => Kept {
            program_counter,
            link_register,
            ..Kept::new(WordKind::HardFault, streak)
        },
        // A run that lasts ends a streak, and no other.
        End::Asked => Kept::new(WordKind::Asked, before),
    };
    kept.uptime_ms = uptime_ms;
    if let End::Panic { file, .. } = end {
        let file = file.as_bytes();
        let tail = file.get(file.len().saturating_sub(NAME)..).unwrap_or(file);
        for (slot, &byte) in kept.name.iter_mut().zip(tail) {
            *slot = byte;
        }
    }
    kept.words()
}

impl Boot {
    /// Why this run began, and what memory is to hold from now on: a record is read once, so that
    /// it is never taken for that of a later crash.
    pub fn judge(flags: ResetFlags, words: &RecordWords) -> (Self, RecordWords) {
        let kept = Kept::read(words);
        let cause = cause(flags, kept.as_ref());
        let counted = kept.as_ref().map_or(0, |kept| kept.streak);
        let crash = kept.and_then(|kept| match cause {
            ResetCause::Panic | ResetCause::HardFault => Some(kept.crash(cause)),
            _ => None,
        });
        let streak = match cause {
            // Counted when the record was written.
            ResetCause::Panic | ResetCause::HardFault => counted.max(1),
            // Those keep nothing of themselves.
            ResetCause::Watchdog | ResetCause::Unexplained => counted.saturating_add(1),
            ResetCause::Software if flags.is_by_firmware() => counted,
            // The boot loader starts what it has written, and that has not crashed yet.
            _ => 0,
        };
        let boot = Self {
            cause,
            crash,
            streak: count(streak),
        };
        let keep = if streak == 0 {
            NO_RECORD
        } else {
            Kept::new(WordKind::Count, streak).words()
        };
        (boot, keep)
    }
}

/// The fault that a start for this reason begins with.
pub const fn fault(cause: ResetCause) -> Option<FaultCode> {
    Some(match cause {
        ResetCause::Watchdog => FaultCode::Watchdog,
        ResetCause::Panic => FaultCode::Panic,
        ResetCause::HardFault => FaultCode::HardFault,
        ResetCause::Unexplained => FaultCode::CrashUnreadable,
        _ => return None,
    })
}

fn cause(flags: ResetFlags, kept: Option<&Kept>) -> ResetCause {
    let written = match kept.map(|kept| kept.kind) {
        Some(WordKind::Panic) => Some(ResetCause::Panic),
        Some(WordKind::HardFault) => Some(ResetCause::HardFault),
        Some(WordKind::Asked) => Some(ResetCause::Software),
        Some(WordKind::Count) | None => None,
    };
    if flags.is_by_firmware() {
        // The firmware asks for a reset only after it has written why.
        let silent = if flags.forced {
            ResetCause::Unexplained
        } else {
            ResetCause::Watchdog
        };
        written.unwrap_or(silent)
    } else if flags.timed_out {
        ResetCause::Software
    } else if flags.debugger {
        ResetCause::Debugger
    } else if flags.pin {
        ResetCause::Pin
    } else {
        ResetCause::PowerOn
    }
}

fn check_of(words: &RecordWords) -> u32 {
    let mut bytes = [0; CHECKED];
    for (slot, word) in bytes.chunks_exact_mut(4).zip(words) {
        slot.copy_from_slice(&word.to_le_bytes());
    }
    crc32(&bytes)
}

fn count(streak: u32) -> u8 {
    u8::try_from(streak).unwrap_or(u8::MAX)
}
