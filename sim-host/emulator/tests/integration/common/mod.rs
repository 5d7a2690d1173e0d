//! The image on a board, with a PC on its debug channels.

#![allow(dead_code, reason = "no test file uses all of it")]

pub(crate) mod driven;
pub(crate) mod during_save;
pub(crate) mod stamps;
pub(crate) mod stored;
pub(crate) mod usb;

use std::sync::OnceLock;

use ldc161x_sim::Settings;
use palpate_emulator::{EmulatedBoard, Image, Options, Plant, Still, Time, firmware};
use palpate_wire::code::Outcome;
use palpate_wire::command::{Coil, Command};
use palpate_wire::record::{Acknowledgement, Fault, Sample, Status};
use palpate_wire::{Frame, Message, Record, RecordDecoder, Sequencer, encode};

/// Channels of the probe: for records, and for commands.
pub(crate) const DATA: u32 = 1;
pub(crate) const COMMANDS: u32 = 0;

pub(crate) const FREQUENCIES_HZ: [f64; 4] = [3.1e6, 3.2e6, 3.3e6, 3.4e6];

/// The flashed image, built once for each test program.
pub(crate) fn image() -> &'static Image {
    static IMAGE: OnceLock<Image> = OnceLock::new();
    IMAGE.get_or_init(|| {
        let path = firmware::build().unwrap_or_else(|error| panic!("{error}"));
        Image::load(&path).unwrap()
    })
}

/// A board with a PC that records everything.
#[derive(Clone)]
pub(crate) struct RecordedBoard<P: Plant = Still> {
    pub(crate) board: EmulatedBoard<P>,
    pub(crate) frames: Vec<Frame<Record>>,
    pending: Vec<u8>,
    sequencer: Sequencer,
}

impl RecordedBoard {
    pub(crate) fn new() -> Self {
        Self::with(Settings::default(), recording())
    }

    pub(crate) fn with(chip: Settings, options: Options) -> Self {
        Self::of(EmulatedBoard::new(
            image(),
            Still::new(FREQUENCIES_HZ),
            chip,
            options,
        ))
    }
}

pub(crate) fn recording() -> Options {
    Options {
        record: true,
        ..Options::default()
    }
}

impl<P: Plant> RecordedBoard<P> {
    pub(crate) fn of(board: EmulatedBoard<P>) -> Self {
        Self {
            board,
            frames: Vec::new(),
            pending: Vec::new(),
            sequencer: Sequencer::new(0),
        }
    }

    /// Runs, and reads the board's channels every millisecond.
    pub(crate) fn run(&mut self, time: Time) {
        let end = self.board.now() + time;
        while self.board.now() < end {
            let left = end - self.board.now();
            self.board
                .run_for(left.min(Time::from_ms(1)))
                .unwrap_or_else(|stop| {
                    panic!("at {}: {stop}", self.board.now());
                });
            self.listen();
        }
    }

    pub(crate) fn listen(&mut self) {
        self.pending.extend(self.board.read_channel(DATA));
        while let Some(end) = self.pending.iter().position(|&byte| byte == 0) {
            let bytes: Vec<u8> = self.pending.drain(..=end).collect();
            let mut decoder = RecordDecoder::new();
            for frame in decoder.frames(&bytes) {
                self.frames
                    .push(frame.expect("the device sends whole frames"));
            }
        }
    }

    /// Drops the received bytes and any partial frame: the next bytes may start within a frame.
    pub(crate) fn restart_listening(&mut self) {
        self.frames.clear();
        self.pending.clear();
    }

    /// Runs until a record satisfies the condition, for a limited time.
    pub(crate) fn wait_for<T>(
        &mut self,
        limit: Time,
        of: impl Fn(&Record) -> Option<T>,
    ) -> Option<T> {
        let end = self.board.now() + limit;
        let mut seen = self.frames.len();
        while self.board.now() < end {
            self.run(Time::from_ms(1));
            if let Some(found) = self.frames[seen..]
                .iter()
                .find_map(|frame| of(&frame.message))
            {
                return Some(found);
            }
            seen = self.frames.len();
        }
        None
    }

    /// Boot id of the present run.
    pub(crate) fn boot_id(&self) -> u32 {
        self.frames.last().map_or(0, |frame| frame.header.boot_id)
    }

    /// Sends a command and returns the answer.
    pub(crate) fn command(&mut self, command: &Command) -> Acknowledgement {
        self.ask(command, |_| Some(())).0
    }

    /// Sends a command without waiting for its answer.
    pub(crate) fn send(&mut self, command: &Command) {
        self.sequencer.address(self.boot_id());
        let header = self.sequencer.stamp(0);
        let mut buffer = [0; Command::MAX_FRAME];
        let bytes = encode(&header, command, &mut buffer).unwrap();
        assert_eq!(self.board.write_channel(COMMANDS, bytes), bytes.len());
    }

    /// Sends a command and returns its answer, with a record that comes with or after it.
    pub(crate) fn ask<T>(
        &mut self,
        command: &Command,
        of: impl Fn(&Record) -> Option<T>,
    ) -> (Acknowledgement, T) {
        self.sequencer.address(self.boot_id());
        let header = self.sequencer.stamp(0);
        let mut buffer = [0; Command::MAX_FRAME];
        let bytes = encode(&header, command, &mut buffer).unwrap();
        let before = self.frames.len();
        assert_eq!(self.board.write_channel(COMMANDS, bytes), bytes.len());
        // A command that needs the coil is answered after the coil's test.
        for _ in 0..100 {
            self.run(Time::from_ms(1));
            let records = || self.frames[before..].iter().map(|frame| &frame.message);
            let answer = records().find_map(|record| match record {
                Record::Acknowledgement(answer) if answer.command == header.sequence => {
                    Some(answer.clone())
                }
                _ => None,
            });
            if let (Some(answer), Some(found)) = (answer, records().find_map(&of)) {
                return (answer, found);
            }
        }
        panic!("{command:?} is not answered");
    }

    /// Settings in force.
    pub(crate) fn settings(&mut self) -> palpate_wire::command::Settings {
        let settings = |record: &Record| match record {
            Record::Settings(settings) => Some(settings.clone()),
            _ => None,
        };
        self.ask(&Command::GetSettings, settings).1
    }

    /// Runs until samples arrive.
    pub(crate) fn stream(&mut self) {
        self.wait_for(Time::from_ms(200), |record| {
            matches!(record, Record::Sample(_) | Record::Raw(_)).then_some(())
        })
        .expect("samples come within 200 ms");
    }

    pub(crate) fn samples(&self) -> impl Iterator<Item = (u64, &Sample)> {
        self.frames.iter().filter_map(|frame| match &frame.message {
            Record::Sample(sample) => Some((frame.header.time_us, sample)),
            _ => None,
        })
    }

    pub(crate) fn words(&self) -> Vec<u32> {
        let of = |frame: &Frame<Record>| match &frame.message {
            Record::Sample(sample) => sample.channels.iter().map(|it| it.word).collect(),
            Record::Raw(raw) => raw.words.to_vec(),
            _ => Vec::new(),
        };
        self.frames.iter().flat_map(of).collect()
    }

    pub(crate) fn faults(&self) -> Vec<Fault> {
        let of = |frame: &Frame<Record>| match &frame.message {
            Record::Fault(fault) => Some(fault.clone()),
            _ => None,
        };
        self.frames.iter().filter_map(of).collect()
    }

    pub(crate) fn status(&mut self) -> Status {
        let status = |record: &Record| match record {
            Record::Status(status) => Some(status.clone()),
            _ => None,
        };
        self.ask(&Command::Identify, status).1
    }
}

/// Time at which the image's timer was 0, us.
pub(crate) fn origin_us<P: Plant>(board: &EmulatedBoard<P>) -> f64 {
    let mut board = board.clone();
    let shown_us = board.timer_us();
    board
        .run_until(Time::from_us(10), |board| board.timer_us() > shown_us)
        .unwrap();
    board.now().as_secs_f64() * 1e6 - board.timer_us() as f64
}

/// A board with constant sensors and an image.
pub(crate) fn board(image: &Image) -> EmulatedBoard<Still> {
    let plant = Still::new(FREQUENCIES_HZ);
    EmulatedBoard::new(image, plant, Settings::default(), recording())
}

pub(crate) fn streaming() -> RecordedBoard {
    let mut bench = RecordedBoard::new();
    bench.stream();
    bench.run(Time::from_ms(20));
    bench
}

pub(crate) fn coil() -> Coil {
    Coil {
        resistance_ohm: 0.5,
        copper_capacity_j_per_k: 5.0,
        pad_capacity_j_per_k: 50.0,
        copper_to_pad_k_per_w: 1.0,
        pad_to_ambient_k_per_w: 10.0,
        current_uncertainty: 0.01,
    }
}

/// A bench in the middle of a train of ramps.
pub(crate) fn ramping(image: &Image) -> RecordedBoard {
    ramping_on(board(image))
}

/// A bench in the middle of a train of ramps, on a board that has just been powered.
pub(crate) fn ramping_on(board: EmulatedBoard<Still>) -> RecordedBoard {
    let mut bench = RecordedBoard::of(board);
    bench.stream();
    bench.run(Time::from_ms(20));
    assert_eq!(bench.command(&Command::Arm).outcome, Outcome::NotCalibrated);
    assert_eq!(bench.command(&Command::Sweep).outcome, Outcome::NotArmed);
    assert_eq!(bench.board.current_a(), 0.0);
    assert_eq!(
        bench.command(&Command::SetCoil(coil())).outcome,
        Outcome::Accepted
    );
    assert_eq!(bench.command(&Command::Arm).outcome, Outcome::Accepted);
    assert_eq!(
        bench.command(&Command::SetCoil(coil())).outcome,
        Outcome::Armed
    );
    assert_eq!(bench.command(&Command::Sweep).outcome, Outcome::Accepted);
    bench.run(Time::from_ms(50));
    assert!(bench.board.current_a() > 2.0, "{}", bench.board.current_a());
    bench
}

/// Time until the bridge is off; `None` if it is on after 100 ms, or does not stay off.
pub(crate) fn time_to_off(bench: &mut RecordedBoard) -> Option<Time> {
    let begin = bench.board.now();
    bench
        .board
        .run_until(Time::from_ms(100), |board| !board.bridge().awake)
        .ok()?;
    let took = bench.board.now() - begin;
    for _ in 0..100 {
        bench.run(Time::from_ms(1));
        if bench.board.current_a() != 0.0 || bench.board.bridge().awake {
            return None;
        }
    }
    Some(took)
}

/// Words of two equal instructions: of an endless loop, and of an undefined one.
pub(crate) const LOOP: u32 = 0xE7FE_E7FE;
pub(crate) const UNDEFINED: u32 = 0xDE00_DE00;
/// A free word near the end of memory.
pub(crate) const SPARE: u32 = 0x2004_1FF0;

/// Exceptions in which the firmware runs: the tasks' two dispatchers, the timer, the two interrupts
/// of the bus and the one that follows them, and no exception.
pub(crate) const EXCEPTIONS: [u32; 6] = [16 + 26, 16 + 27, 16, 16 + 13, 16 + 23, 16 + 7];

/// Cause of the end of a run.
#[derive(Clone, Copy)]
pub(crate) enum Crash {
    /// An undefined instruction.
    HardFault,
    /// An endless loop.
    Loop,
}

impl Crash {
    /// Ends the run within an exception; returns how long the bridge stayed on after that.
    pub(crate) fn in_exception(self, bench: &mut RecordedBoard, number: u32) -> Option<Time> {
        bench
            .board
            .run_until(Time::from_ms(20), |board| board.exception() == number)
            .ok()?;
        let instruction = match self {
            Self::HardFault => UNDEFINED,
            Self::Loop => LOOP,
        };
        bench.board.poke(SPARE, instruction);
        bench.board.set_pc(SPARE);
        time_to_off(bench)
    }
}

/// Number of tasks in an image with a planted panic.
pub(crate) const TASKS: u32 = 3;

/// Makes a task panic; returns how long the bridge stayed on after that. The task reads its order
/// when it runs next; the time until then does not count.
pub(crate) fn panic_in(bench: &mut RecordedBoard, task: u32) -> Option<Time> {
    let order = bench.board.image().symbol("PLANTED_PANIC")?;
    bench.board.poke(order, task + 1);
    let panicked = bench.board.image().symbol("PLANTED_PANICS")?;
    bench
        .board
        .run_until(Time::from_ms(20), |board| board.peek(panicked) != 0)
        .ok()?;
    time_to_off(bench)
}

/// Makes the processor write the watchdog's trigger, as overwritten memory may do: a reset that the
/// firmware did not request.
pub(crate) fn reset_without_a_record<P: Plant>(bench: &mut RecordedBoard<P>) {
    // ldr r0, [pc, #4]; ldr r1, [pc, #8]; str r1, [r0], in a loop; WATCHDOG.CTRL and TRIGGER.
    const PROGRAM: [u32; 4] = [0x4902_4801, 0xE7FD_6001, 0x4005_8000, 1 << 31];
    for (index, word) in (0..).zip(PROGRAM) {
        bench.board.poke(SPARE + 4 * index, word);
    }
    bench.board.set_pc(SPARE);
}
