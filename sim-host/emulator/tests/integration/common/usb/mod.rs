//! A PC at the board's USB port, beside the one at its debug probe.

pub(crate) mod control;
pub(crate) mod descriptors;
pub(crate) mod links;
pub(crate) mod restarts;
pub(crate) mod streams;

use std::sync::{Mutex, OnceLock};

use palpate_emulator::Time;
use palpate_emulator::usb::{ControlTransfer, TransferId, UsbState};
use palpate_wire::code::Outcome;
use palpate_wire::loss::{Account, Tally};
use palpate_wire::record::{Acknowledgement, Status};
use palpate_wire::{Command, Frame, Message, Record, RecordDecoder, Sequencer, encode};

use super::{RecordedBoard, coil};

/// Exception number of USBCTRL_IRQ.
pub(crate) const INTERRUPT: u32 = 16 + 5;
/// Longest time from plugging or a reset to an open port: 100 ms of debouncing, resets with their
/// recoveries, some twenty requests.
const ENUMERATION: Time = Time::from_ms(400);
/// Longest time from a start of the firmware to an open port.
const START: Time = Time::from_ms(800);

/// Data received by the serial port, and the sequence of the data sent.
#[derive(Clone)]
pub(crate) struct SerialPort {
    pub(crate) frames: Vec<Frame<Record>>,
    /// Number of frames that were cut, at either end.
    pub(crate) damaged: u32,
    pub(crate) account: Account,
    pending: Vec<u8>,
    sequencer: Sequencer,
}

impl SerialPort {
    const fn new() -> Self {
        Self {
            frames: Vec::new(),
            damaged: 0,
            account: Account::new(),
            pending: Vec::new(),
            sequencer: Sequencer::new(0),
        }
    }

    fn take(&mut self, bytes: &[u8]) {
        self.pending.extend_from_slice(bytes);
        while let Some(end) = self.pending.iter().position(|&byte| byte == 0) {
            let bytes: Vec<u8> = self.pending.drain(..=end).collect();
            for frame in RecordDecoder::new().frames(&bytes) {
                match frame {
                    Ok(frame) => {
                        self.account.take(&frame.header);
                        self.frames.push(frame);
                    }
                    Err(_) => self.damaged += 1,
                }
            }
        }
    }

    /// Loss account of the firmware's present run.
    pub(crate) fn tally(&self) -> Tally {
        *self.account.current().expect("a record has come by USB")
    }

    /// Drops all records but the last, and clears the loss account.
    pub(crate) fn forget(&mut self) {
        self.frames.drain(..self.frames.len().saturating_sub(1));
        self.damaged = 0;
        self.account = Account::new();
    }

    /// Restarts the loss account.
    pub(crate) fn begin_account(&mut self) {
        self.forget();
        if let Some(last) = self.frames.last() {
            self.account.take(&last.header);
        }
    }

    fn encode(&mut self, command: &Command, boot_id: u32) -> (u32, Vec<u8>) {
        self.sequencer.address(boot_id);
        let header = self.sequencer.stamp(0);
        let mut buffer = [0; Command::MAX_FRAME];
        let bytes = encode(&header, command, &mut buffer).unwrap();
        (header.sequence, bytes.to_vec())
    }
}

/// Number of missing records, and of those that the device reports as dropped.
pub(crate) fn missing(tally: &Tally) -> (u64, u64) {
    (tally.missing(), tally.dropped_by_device())
}

/// A board with a PC at each of its links.
#[derive(Clone)]
pub(crate) struct UsbBench {
    /// The board, with the PC at its probe.
    pub(crate) probe: RecordedBoard,
    /// The PC at its USB port.
    pub(crate) port: SerialPort,
}

/// A board that streams over both links, its USB port open.
pub(crate) fn plugged() -> UsbBench {
    static PLUGGED: OnceLock<Mutex<UsbBench>> = OnceLock::new();
    let bench = PLUGGED.get_or_init(|| Mutex::new(UsbBench::plugged()));
    bench.lock().expect("no test ends within a clone").clone()
}

impl UsbBench {
    fn plugged() -> Self {
        let mut bench = Self {
            probe: RecordedBoard::new(),
            port: SerialPort::new(),
        };
        bench.probe.board.usb_mut().plug();
        bench.probe.board.usb_mut().enumerate();
        bench.run(Time::from_ms(100));
        bench.until_open(START);
        bench.probe.stream();
        bench.run(Time::from_ms(20));
        bench
    }

    /// Runs, and reads both links every millisecond.
    pub(crate) fn run(&mut self, time: Time) {
        let end = self.probe.board.now() + time;
        while self.probe.board.now() < end {
            let left = end - self.probe.board.now();
            self.probe.run(left.min(Time::from_ms(1)));
            self.listen();
        }
    }

    pub(crate) fn listen(&mut self) {
        let bytes = self.probe.board.usb_mut().read();
        self.port.take(&bytes);
    }

    /// Runs until a condition is true, checked every millisecond; returns the time taken.
    pub(crate) fn until(
        &mut self,
        limit: Time,
        mut is_true: impl FnMut(&mut Self) -> bool,
    ) -> Option<Time> {
        let begin = self.probe.board.now();
        while !is_true(self) {
            if self.probe.board.now() - begin >= limit {
                return None;
            }
            self.run(Time::from_ms(1));
        }
        Some(self.probe.board.now() - begin)
    }

    /// Whether the device is configured and the port open, with all related state.
    pub(crate) fn is_open(&self) -> bool {
        let host = self.probe.board.usb();
        host.state() == UsbState::Configured && host.description().is_some()
    }

    /// Runs until the port is open and has delivered a record.
    pub(crate) fn until_open(&mut self, limit: Time) -> Time {
        let begin = self.probe.board.now();
        self.until(limit, |bench| bench.is_open())
            .unwrap_or_else(|| panic!("no port: {:?}", self.probe.board.usb().enumerated()));
        let seen = self.port.frames.len();
        let has_come = |bench: &mut Self| bench.port.frames.len() > seen;
        self.until(Time::from_ms(300), has_come)
            .expect("records come by a port that is open");
        self.probe.board.now() - begin
    }

    /// Sends a command over USB; returns its sequence number.
    pub(crate) fn send(&mut self, command: &Command) -> u32 {
        let boot_id = self.port.frames.last().map_or(0, |it| it.header.boot_id);
        let (number, bytes) = self.port.encode(command, boot_id);
        self.probe.board.usb_mut().write(&bytes);
        number
    }

    /// Answer over USB to the command of a sequence number, among the records from an index on.
    pub(crate) fn answer(&self, from: usize, number: u32) -> Option<Acknowledgement> {
        answer(&self.port.frames[from..], number)
    }

    /// Sends a command over USB and returns its answer, with a record that comes with or after it.
    pub(crate) fn ask<T>(
        &mut self,
        command: &Command,
        of: impl Fn(&Record) -> Option<T>,
    ) -> (Acknowledgement, T) {
        let from = self.port.frames.len();
        let number = self.send(command);
        // A command that needs the coil waits for its test.
        for _ in 0..150 {
            self.run(Time::from_ms(1));
            let found = self.port.frames[from..]
                .iter()
                .find_map(|frame| of(&frame.message));
            if let (Some(answer), Some(found)) = (self.answer(from, number), found) {
                return (answer, found);
            }
        }
        panic!("{command:?} is not answered over USB");
    }

    /// Sends a command over USB and returns its outcome.
    pub(crate) fn command(&mut self, command: &Command) -> Outcome {
        self.ask(command, |_| Some(())).0.outcome
    }

    /// Status, requested over USB.
    pub(crate) fn status(&mut self) -> Status {
        let status = |record: &Record| match record {
            Record::Status(status) => Some(status.clone()),
            _ => None,
        };
        self.ask(&Command::Identify, status).1
    }

    /// Arms over USB, and waits for the coil's test.
    pub(crate) fn arm(&mut self) {
        let from = self.port.frames.len();
        for command in [Command::SetCoil(coil()), Command::Arm] {
            assert_eq!(self.command(&command), Outcome::Accepted, "{command:?}");
        }
        let is_tested = |bench: &mut Self| {
            let mut records = bench.port.frames[from..].iter().map(|it| &it.message);
            records.any(|record| matches!(record, Record::CoilTest(_)))
        };
        self.until(Time::from_ms(300), is_tested)
            .expect("the coil's test ends");
    }

    /// Arms and starts a train over USB; returns during the train, while current flows.
    pub(crate) fn begin_train(&mut self) {
        self.arm();
        assert_eq!(self.command(&Command::Sweep), Outcome::Accepted);
        let has_current = |bench: &mut Self| bench.probe.board.current_a() > 1.0;
        self.until(Time::from_ms(100), has_current)
            .expect("the train begins");
    }

    pub(crate) fn submit(&mut self, transfer: ControlTransfer) -> TransferId {
        self.probe.board.usb_mut().submit(transfer)
    }
}

/// Answer to the command of a sequence number.
pub(crate) fn answer(frames: &[Frame<Record>], number: u32) -> Option<Acknowledgement> {
    frames.iter().find_map(|frame| match &frame.message {
        Record::Acknowledgement(answer) if answer.command == number => Some(answer.clone()),
        _ => None,
    })
}

/// A 64-bit random generator (xorshift).
#[derive(Clone, Debug)]
pub(crate) struct Chance(u64);

impl Chance {
    /// A generator; every seed gives a state other than zero.
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(crate) const fn word(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 32) as u32
    }

    /// A random number below a limit.
    pub(crate) const fn below(&mut self, limit: u32) -> u32 {
        self.word() % limit
    }

    pub(crate) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len() as u32) as usize]
    }
}
