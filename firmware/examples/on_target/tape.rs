//! Events of the procedure as words, and checksums of its actions.

use ldc161x::{Channel, Freshness, Reading, Word};
use palpate_node::board::LIMITS;
use palpate_procedure::event::Conditions;
use palpate_procedure::units::{Ampere, Celsius};
use palpate_procedure::{
    Action, Actions, BoardInfo, Conversion, Duration, Event, Instant, Link, Procedure, Scan,
};
use palpate_wire::code::{self, Chip, ResetCause};
use palpate_wire::record::{CoilTest, Hello};
use palpate_wire::{
    Command, CommandDecoder, Frame, Header, MINOR_VERSION, Message, Record, SCHEMA_HASH, encode,
};

use crate::arithmetic::Sum;

/// Kind of an event: tick.
pub const TICK: u32 = 0;
/// Kind of an event: scan.
pub const SCAN: u32 = 1;
/// Kind of an event: command.
pub const COMMAND: u32 = 2;
/// Kind of an event: conditions.
pub const CONDITIONS: u32 = 3;
/// Kind of an event: result of a coil test.
pub const COIL_TESTED: u32 = 4;

/// Number of words of the longest event, a command with one byte per word.
pub const WORDS: usize = 300;

/// Content of the answer after start-up, before any request.
pub const READY: u32 = 0x5EAD_D00D;

/// Boot id of both procedures, on the target and on the PC.
pub const BOOT: u32 = 7;

/// Returns the board description for both procedures, on the target and on the PC.
pub fn board() -> BoardInfo {
    BoardInfo {
        boot_id: BOOT,
        hello: Hello {
            minor_version: MINOR_VERSION,
            schema_hash: SCHEMA_HASH,
            firmware_major: 0,
            firmware_minor: 1,
            firmware_patch: 0,
            commit: 0,
            dirty: false,
            simulated: true,
            board: code::Board::Native,
            unit: 0,
            reset_cause: ResetCause::PowerOn,
            chip: Chip::Ldc161x,
            second_chip: Chip::Absent,
            configuration_crc: 0,
        },
        crash: None,
        channels: [0b1111, 0],
        coil: true,
        storage: false,
        crashes: 0,
        limits: LIMITS,
    }
}

/// Reader of words in order.
struct Words<'w>(core::slice::Iter<'w, u32>);

impl Words<'_> {
    fn word(&mut self) -> Option<u32> {
        self.0.next().copied()
    }

    fn time(&mut self) -> Option<u64> {
        let low = self.word()?;
        Some(u64::from(low) | u64::from(self.word()?) << 32)
    }

    /// Reads a number that may be absent.
    fn number(&mut self) -> Option<Option<f32>> {
        let is_there = self.word()? != 0;
        let number = f32::from_bits(self.word()?);
        Some(is_there.then_some(number))
    }
}

/// Passes an event to the procedure. Returns a checksum over the resulting actions, written to
/// `actions`; `None` if the words are invalid.
pub fn step(procedure: &mut Procedure, actions: &mut Actions, words: &[u32]) -> Option<u32> {
    let mut words = Words(words.iter());
    let now = Instant::from_ticks(words.time()?);
    let (scanned, frame);
    let event = match words.word()? {
        TICK => Event::Tick,
        SCAN => {
            scanned = scan(&mut words)?;
            Event::Scan(&scanned)
        }
        COMMAND => {
            frame = command(&mut words)?;
            Event::Command(Link::Probe, &frame)
        }
        CONDITIONS => Event::Conditions(Conditions {
            temperature: words.number()?.map(Celsius),
            supply_v: words.number()?,
            ..Conditions::default()
        }),
        COIL_TESTED => Event::CoilTested(coil_test(&mut words)?),
        _ => return None,
    };
    procedure.step_into(now, &event, actions);
    Some(sum(actions))
}

fn command(words: &mut Words<'_>) -> Option<Frame<Command>> {
    let mut decoder = CommandDecoder::new();
    loop {
        if let Some(frame) = decoder.push(words.word()? as u8) {
            return frame.ok();
        }
    }
}

fn coil_test(words: &mut Words<'_>) -> Option<CoilTest> {
    Some(CoilTest {
        resistance_ohm: f32::from_bits(words.word()?),
        inductance_h: f32::from_bits(words.word()?),
        lost: f32::from_bits(words.word()?),
        zero_v: f32::from_bits(words.word()?),
        supply_v: f32::from_bits(words.word()?),
        limited_to_a: words.number()?,
    })
}

fn scan(words: &mut Words<'_>) -> Option<Scan> {
    let middle = Instant::from_ticks(words.time()?);
    let window = Duration::from_ticks(words.word()?.into());
    let (lost, gap) = (words.word()?, words.word()? != 0);
    let current = words.number()?.map(Ampere);
    let bits = words.word()?;
    let frequency_hz = f64::from_bits(words.time()?);
    let reading = Reading {
        channel: Channel::Zero,
        word: Word::from_registers((bits >> 16) as u16, bits as u16),
        frequency_hz,
        sigma_hz: f32::from_bits(words.word()?),
        above_quarter_reference: false,
        freshness: Freshness::default(),
        agrees: None,
        after_gap: false,
    };
    let offset = Duration::from_ticks(0);
    Some(Scan {
        sensor: 0,
        middle,
        window,
        conversions: [Conversion { reading, offset }].into_iter().collect(),
        lost,
        gap,
        current,
        // The simulated bench whose events were recorded has no ripple.
        ripple: None,
        account: None,
    })
}

/// Returns a checksum over actions; records are included as sent.
pub fn sum(actions: &Actions) -> u32 {
    let mut sum = Sum::NEW;
    for action in actions {
        match action {
            Action::SafeState => sum.word(1),
            Action::Current(line) => {
                sum.word(2);
                sum.word(line.start_us as u32);
                sum.number(line.from_a);
                sum.number(line.to_a);
                sum.number(line.over_s);
            }
            Action::ConfigureSensors { channels, rate } => {
                sum.word(3);
                sum.word((*channels).into());
                sum.number(rate.0);
            }
            Action::SeekDrive { sensor } => {
                sum.word(9);
                sum.word((*sensor).into());
            }
            Action::TestCoil => sum.word(4),
            Action::TraceCurrent { interval } => {
                sum.word(5);
                sum.number(interval.0);
            }
            Action::CorrectCurrent(correction) => {
                sum.word(6);
                for (current_a, change_a) in correction.points() {
                    sum.number(current_a);
                    sum.number(change_a);
                }
            }
            Action::Record { at, record, .. } => {
                let header = Header {
                    boot_id: BOOT,
                    sequence: 0,
                    time_us: at.as_ticks(),
                    dropped: 0,
                };
                let mut buffer = [0; Record::MAX_FRAME];
                for &byte in encode(&header, record, &mut buffer)
                    .unwrap_or_default()
                    .iter()
                {
                    sum.word(byte.into());
                }
            }
            // The recording has no such actions.
            Action::Storage(_) | Action::Restart(_) | Action::Locate(_) => sum.word(7),
        }
    }
    sum.0
}
