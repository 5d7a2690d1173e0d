//! Boot cause, from the processor's reset flags and the record that the last run left in memory. A
//! record that cannot be read is a fault.

use heapless::String;
use palpate_wire::code::{FaultCode, ResetCause};
use palpate_wire::crc32;
use palpate_wire::record::Crash;

/// Number of words of the crash record.
pub const RECORD_WORDS: usize = 20;

/// Crash record in memory, in words, which no reset clears:
///
/// | words | content |
/// |---|---|
/// | 0 | "Palp" |
/// | 1 | kind: a count of crashes, a panic, a hard fault, a requested restart |
/// | 2 | consecutive crashes; a requested restart keeps them |
/// | 3 to 6 | line, program counter, link register, time since boot in ms |
/// | 7 to 18 | end of the source file's name, padded with zeros |
/// | 19 | CRC-32C over the words before it, least significant byte first |
pub type RecordWords = [u32; RECORD_WORDS];

/// Content of the record's memory when there is no crash record.
pub const NO_RECORD: RecordWords = [0; RECORD_WORDS];

const MAGIC: u32 = 0x5061_6C70;
/// Number of bytes of the source file's name that the crash record holds.
const NAME: usize = 48;
/// Number of bytes of the crash record that its CRC covers: all but the last word.
const CHECKED: usize = 4 * (RECORD_WORDS - 1);

/// End of a run.
#[derive(Clone, Copy, Debug)]
pub enum End<'a> {
    /// A panic, with its location.
    Panic {
        /// Source file.
        file: &'a str,
        /// Line in the file.
        line: u32,
    },
    /// A hard fault, with its location.
    HardFault {
        /// Address of the instruction.
        program_counter: u32,
        /// Return address.
        link_register: u32,
    },
    /// A requested restart.
    Asked,
}

/// The processor's reset flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetFlags {
    /// A reset through the watchdog was requested.
    pub forced: bool,
    /// The watchdog was not fed.
    pub timed_out: bool,
    /// The firmware started the watchdog: it sets a mark when it does. A boot loader, which sets no
    /// mark, also restarts the processor through the watchdog, after it has written an image.
    pub is_own_watchdog: bool,
    /// A debug probe requested the reset.
    pub debugger: bool,
    /// The reset pin was pulled.
    pub pin: bool,
}

impl ResetFlags {
    /// Returns whether the firmware reset itself, on purpose or because its watchdog was not fed.
    const fn is_by_firmware(self) -> bool {
        self.forced || (self.timed_out && self.is_own_watchdog)
    }
}

/// Boot cause of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Boot {
    /// Reset cause.
    pub cause: ResetCause,
    /// Crash of the last run, if it left a record of one.
    pub crash: Option<Crash>,
    /// Number of consecutive runs that ended in a panic, a fault, a hang or an unknown way before they
    /// had lasted long enough. A requested restart neither counts nor ends the streak.
    pub streak: u8,
}

/// Kind of a record.
#[derive(Clone, Copy, PartialEq, Eq)]
enum WordKind {
    /// Number of consecutive crashed runs, up to the present one.
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

/// A record read from memory.
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

    /// Returns `None` unless every bit is as written: a CRC of 32 bits detects any five changed bits,
    /// and accepts random words once in 2^32 times.
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
            // A name of 48 bytes fits; non-ASCII bytes become question marks.
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

/// Returns the record of a run that ends; `before` is the present content of the memory.
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
        // A requested restart neither counts as a crash nor ends a streak: only a run that lasts long
        // enough ends it.
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
    /// Returns the boot cause, and the new content of the memory. The new content holds at most a count,
    /// so that a later boot does not report this crash again.
    pub fn judge(flags: ResetFlags, words: &RecordWords) -> (Self, RecordWords) {
        let kept = Kept::read(words);
        let cause = cause(flags, kept.as_ref());
        let counted = kept.as_ref().map_or(0, |kept| kept.streak);
        let crash = kept.and_then(|kept| match cause {
            ResetCause::Panic | ResetCause::HardFault => Some(kept.crash(cause)),
            _ => None,
        });
        let streak = match cause {
            // A panic or hard fault was already counted when its record was written.
            ResetCause::Panic | ResetCause::HardFault => counted.max(1),
            // A run that ends this way writes no record, so it is counted here.
            ResetCause::Watchdog | ResetCause::Unexplained => counted.saturating_add(1),
            ResetCause::Software if flags.is_by_firmware() => counted,
            // This includes the boot loader's start of a new image, which has not crashed yet.
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

/// Returns the fault that this reset cause raises at start-up.
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
        // A forced reset without a record is unexplained: the firmware writes its cause beforehand.
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
