//! The converter for the tests: registers, edges, words (datasheet SNOSCY9A, 7.6).

use palpate_cli::failure::Failure;

use super::link::{Link, RequestOutcome};

/// Register addresses; of channel 0 where each channel has its own.
pub(super) mod register {
    pub(crate) const DATA_MSB: u8 = 0x00;
    pub(crate) const DATA_LSB: u8 = 0x01;
    pub(crate) const RCOUNT: u8 = 0x08;
    pub(crate) const RCOUNT_1: u8 = 0x09;
    pub(crate) const SETTLECOUNT: u8 = 0x10;
    pub(crate) const CLOCK_DIVIDERS: u8 = 0x14;
    pub(crate) const STATUS: u8 = 0x18;
    pub(crate) const ERROR_CONFIG: u8 = 0x19;
    pub(crate) const CONFIG: u8 = 0x1A;
    pub(crate) const MUX_CONFIG: u8 = 0x1B;
    pub(crate) const DRIVE_CURRENT: u8 = 0x1E;
    pub(crate) const MANUFACTURER: u8 = 0x7E;
}

/// CONFIG: channel 0, drive as written, no amplitude correction, CLKIN.
pub(super) const ACTIVE: u16 = 0x1601;
/// CONFIG: sleep.
pub(super) const SLEEP: u16 = 1 << 13;
/// CONFIG.RP_OVERRIDE_EN: drive as written; without it the converter finds the drive itself.
pub(super) const OWN_DRIVE: u16 = 1 << 12;
/// ERROR_CONFIG: conversion errors in DATA, INTB at a result.
pub(super) const REPORTS: u16 = 0xF801;
/// MUX_CONFIG: one channel, deglitch filter of 10 MHz.
pub(super) const MUX: u16 = 0x020D;
/// MUX_CONFIG: channels 0 and 1 alternately.
pub(super) const SCAN: u16 = 1 << 15;
/// STATUS: a result is ready (READY), and a result of channel 0 is unread (UNREAD).
pub(super) const READY: u16 = 1 << 6;
pub(super) const UNREAD: u16 = 1 << 3;
/// Longest wait for an edge, ms.
const EDGE_MS: u8 = 100;

/// The clock that the image divides for CLKIN, Hz.
const CORE_HZ: f64 = 200e6;

/// Segments of a transaction that reads STATUS, then DATA: both release INTB in any chip.
const FRAME: [u8; 9] = [
    1,
    register::STATUS,
    0x82,
    1,
    register::DATA_MSB,
    0x82,
    1,
    register::DATA_LSB,
    0x82,
];

/// Edges of INTB, with the last reading.
#[derive(Clone, Debug)]
pub(super) struct Edges {
    /// Time from the first to the last edge, s.
    pub(super) length_s: f64,
    pub(super) count: u32,
    /// DATA at the last edge, with its flags.
    pub(super) word: u32,
}

impl Edges {
    /// Time between two edges, s.
    pub(super) fn period_s(&self) -> f64 {
        self.length_s / f64::from(self.count.saturating_sub(1).max(1))
    }
}

/// Configuration of channel 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setup {
    pub(super) rcount: u16,
    pub(super) drive: u16,
    pub(super) divider: u8,
    pub(super) mux: u16,
    pub(super) reports: u16,
    /// FIN_DIVIDER field.
    pub(super) input_divider: u16,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            rcount: 1_000,
            drive: 0xA000,
            divider: 6,
            mux: MUX,
            reports: REPORTS,
            input_divider: 1,
        }
    }
}

impl Setup {
    /// Frequency of the reference, Hz.
    pub(super) fn reference_hz(&self) -> f64 {
        CORE_HZ / f64::from(self.divider)
    }
}

/// A step that runs without waiting for the PC.
#[derive(Clone, Copy, Debug)]
pub(super) enum Op {
    /// Waits until INTB is low.
    Interrupt,
    /// Reads a register.
    Read(u8),
    /// Writes a register.
    Write(u8, u16),
    /// Reads whether INTB is high.
    Level,
    /// Waits for this number of milliseconds.
    Pause(u8),
}

impl Op {
    fn request(self) -> Vec<u8> {
        match self {
            Self::Interrupt => vec![b'A', EDGE_MS],
            Self::Read(register) => vec![b'T', 1, register, 0x82],
            Self::Write(register, value) => {
                let [high, low] = value.to_be_bytes();
                vec![b'T', 3, register, high, low]
            }
            Self::Level => vec![b'I'],
            Self::Pause(ms) => vec![b'D', ms],
        }
    }

    /// Length of the answer, bytes.
    const fn length(self) -> usize {
        match self {
            Self::Interrupt | Self::Write(..) | Self::Pause(_) => 0,
            Self::Read(_) => 2,
            Self::Level => 1,
        }
    }
}

/// The converter behind a link.
pub(super) struct Converter(pub(super) Link);

impl Converter {
    fn done(&mut self, kind: u8, rest: &[u8]) -> Result<Vec<u8>, Failure> {
        match self.0.ask(kind, rest)? {
            (RequestOutcome::Done, answer) => Ok(answer),
            (RequestOutcome::NotAcknowledged, _) => Err(Failure::Refused(
                "the converter does not acknowledge: check its supply, SD, ADDR and the bus".into(),
            )),
            (RequestOutcome::NoEdge, _) => Err(Failure::Refused(
                "no edge on INTB: check INTB's wire, CLKIN and the sensor".into(),
            )),
            (outcome, _) => Err(Failure::Refused(format!("the board: {outcome:?}"))),
        }
    }

    /// Asks for the identity of the other end.
    pub(super) fn greet(&mut self) -> Result<(), Failure> {
        let name = self.done(b'?', &[])?;
        if name.starts_with(b"palpate bring-up 2") {
            return Ok(());
        }
        Err(Failure::Refused(
            "the board runs another version of the image bring_up: flash the one of this \
             version"
                .to_owned(),
        ))
    }

    /// Reads `count` bytes, starting at a register.
    pub(super) fn read_bytes(&mut self, register: u8, count: u8) -> Result<Vec<u8>, Failure> {
        self.done(b'T', &[1, register, 0x80 | count])
    }

    pub(super) fn read(&mut self, register: u8) -> Result<u16, Failure> {
        match self.read_bytes(register, 2)?[..] {
            [high, low] => Ok(u16::from_be_bytes([high, low])),
            _ => Err(Failure::Refused("a register of a wrong length".to_owned())),
        }
    }

    pub(super) fn write(&mut self, register: u8, value: u16) -> Result<(), Failure> {
        let [high, low] = value.to_be_bytes();
        self.done(b'T', &[3, register, high, low]).map(drop)
    }

    /// Writes only the upper half of a register, then stops.
    pub(super) fn write_half(&mut self, register: u8, high: u8) -> Result<(), Failure> {
        self.done(b'T', &[2, register, high]).map(drop)
    }

    /// Reads a register in any state of the bus; `None` if it fails.
    pub(super) fn try_read(&mut self, register: u8) -> Result<Option<u16>, Failure> {
        let (outcome, bytes) = self.0.ask(b'T', &[1, register, 0x82])?;
        Ok(match (outcome, &bytes[..]) {
            (RequestOutcome::Done, &[high, low]) => Some(u16::from_be_bytes([high, low])),
            _ => None,
        })
    }

    pub(super) fn pause_ms(&mut self, ms: u8) -> Result<(), Failure> {
        self.done(b'D', &[ms]).map(drop)
    }

    /// Runs several steps at once, since a PC is too slow to poll twice within one conversion.
    /// Returns the read values in order.
    pub(super) fn at_once<const N: usize>(&mut self, ops: &[Op]) -> Result<[u16; N], Failure> {
        let mut requests = Vec::new();
        for op in ops {
            let request = op.request();
            requests.push(request.len() as u8);
            requests.extend(request);
        }
        let answer = self.done(b'B', &requests)?;
        let mut read = [0; N];
        let mut places = read.iter_mut();
        let mut rest = answer.as_slice();
        for op in ops {
            let (of, after) = rest.split_at_checked(op.length()).unwrap_or_default();
            rest = after;
            if op.length() > 0
                && let Some(slot) = places.next()
            {
                *slot = of.iter().fold(0, |all, byte| all << 8 | u16::from(*byte));
            }
        }
        Ok(read)
    }

    pub(super) fn data_is_high(&mut self) -> Result<bool, Failure> {
        Ok(self.done(b'W', &[])?.first() == Some(&1))
    }

    /// Cuts a transaction off after `bits` bits.
    pub(super) fn cut_off(&mut self, bits: u8) -> Result<(), Failure> {
        self.done(b'X', &[bits]).map(drop)
    }

    /// Sends `count` pulses of SCL and a STOP.
    pub(super) fn pulses(&mut self, count: u8) -> Result<(), Failure> {
        self.done(b'L', &[count]).map(drop)
    }

    /// Resets the converter by its SD pin.
    pub(super) fn reset(&mut self) -> Result<(), Failure> {
        self.done(b'S', &[1])?;
        self.pause_ms(2)?;
        self.done(b'S', &[0])?;
        self.pause_ms(5)
    }

    /// Puts the converter to sleep and configures channel 0, without converting.
    pub(super) fn prepare(&mut self, setup: &Setup) -> Result<(), Failure> {
        self.write(register::CONFIG, ACTIVE | SLEEP)?;
        self.done(b'C', &[setup.divider])?;
        for (register, value) in [
            (register::RCOUNT, setup.rcount),
            (register::SETTLECOUNT, 0x40),
            (register::CLOCK_DIVIDERS, setup.input_divider << 12 | 1),
            (register::ERROR_CONFIG, setup.reports),
            (register::MUX_CONFIG, setup.mux),
            (register::DRIVE_CURRENT, setup.drive),
        ] {
            self.write(register, value)?;
        }
        Ok(())
    }

    /// Configures channel 0 and starts converting.
    pub(super) fn start(&mut self, setup: &Setup) -> Result<(), Failure> {
        self.prepare(setup)?;
        self.write(register::CONFIG, ACTIVE)
    }

    /// Waits for `count` edges, and reads STATUS and DATA after each.
    pub(super) fn edges(&mut self, count: u8) -> Result<Edges, Failure> {
        let mut request = vec![count, EDGE_MS];
        request.extend(FRAME);
        let answer = self.done(b'E', &request)?;
        let &[seen, a, b, c, d, e, f, g, h, _, _, w, x, y, z] = answer.as_slice() else {
            return Err(Failure::Refused("edges of a wrong length".to_owned()));
        };
        let first_us = u32::from_le_bytes([a, b, c, d]);
        let last_us = u32::from_le_bytes([e, f, g, h]);
        Ok(Edges {
            length_s: f64::from(last_us.wrapping_sub(first_us)) * 1e-6,
            count: seen.into(),
            word: u32::from_be_bytes([w, x, y, z]),
        })
    }

    /// Reads the words of `count` consecutive conversions.
    pub(super) fn words(&mut self, count: usize) -> Result<Vec<u32>, Failure> {
        (0..count).map(|_| Ok(self.edges(1)?.word)).collect()
    }
}
