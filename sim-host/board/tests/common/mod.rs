//! The image, on a board, with a PC at its channels.

#![allow(dead_code, reason = "no test file uses all of it")]

use std::sync::OnceLock;

use ldc161x_sim::Settings;
use palpate_board::{Board, Image, Options, Plant, Still, Time, firmware};
use palpate_wire::command::Command;
use palpate_wire::record::{Acknowledgement, Fault, Sample, Status};
use palpate_wire::{Frame, Message, Record, RecordDecoder, Sequencer, encode};

/// Channels of the probe.
pub(crate) const DATA: u32 = 1;
pub(crate) const COMMANDS: u32 = 0;

pub(crate) const FREQUENCIES_HZ: [f64; 4] = [3.1e6, 3.2e6, 3.3e6, 3.4e6];

/// The image that is flashed, built once for each test program.
pub(crate) fn image() -> &'static Image {
    static IMAGE: OnceLock<Image> = OnceLock::new();
    IMAGE.get_or_init(|| {
        let path = firmware::build().unwrap_or_else(|error| panic!("{error}"));
        Image::load(&path).unwrap()
    })
}

/// A board with a PC that records everything.
#[derive(Clone)]
pub(crate) struct Bench<P: Plant = Still> {
    pub(crate) board: Board<P>,
    pub(crate) frames: Vec<Frame<Record>>,
    pending: Vec<u8>,
    sequencer: Sequencer,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self::with(Settings::default(), recording())
    }

    pub(crate) fn with(chip: Settings, options: Options) -> Self {
        Self::of(Board::new(
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

impl<P: Plant> Bench<P> {
    pub(crate) fn of(board: Board<P>) -> Self {
        Self {
            board,
            frames: Vec::new(),
            pending: Vec::new(),
            sequencer: Sequencer::new(0),
        }
    }

    /// Runs, and takes what the board says every millisecond.
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

    /// Runs until a record says something, for at most so long.
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

    /// The number of the present run.
    pub(crate) fn boot_id(&self) -> u32 {
        self.frames.last().map_or(0, |frame| frame.header.boot_id)
    }

    /// Sends a command and returns the answer.
    pub(crate) fn command(&mut self, command: &Command) -> Acknowledgement {
        self.ask(command, |_| Some(())).0
    }

    /// Sends a command and returns the answer, and a record that comes with it or after it.
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
        for _ in 0..50 {
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

    /// The settings in force.
    pub(crate) fn settings(&mut self) -> palpate_wire::command::Settings {
        let settings = |record: &Record| match record {
            Record::Settings(settings) => Some(settings.clone()),
            _ => None,
        };
        self.ask(&Command::GetSettings, settings).1
    }

    /// Runs until samples come.
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
