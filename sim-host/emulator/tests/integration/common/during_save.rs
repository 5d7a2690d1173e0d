//! Activity while the image saves: samples over both links, requests over USB, the watchdog, and
//! the bridge, which must rest.

use std::collections::VecDeque;

use palpate_emulator::usb::{ControlOutcome, ControlTransfer};
use palpate_emulator::{EmulatedBoard, FlashOperationKind, Plant, Stop, Time};
use palpate_wire::code::{Outcome, RebootTarget};
use palpate_wire::{Command, Frame, Record, RecordDecoder};

use super::stored::{LONGEST_SAVE, erases, reboot, storage};
use super::{RecordedBoard, coil};

/// Exception number of the coil's control interrupt, PWM_IRQ_WRAP (RP2040 datasheet 2.3.2).
pub(crate) const CONTROL: u32 = 16 + 4;
/// Interval between two requests over USB, ms.
const REQUEST_EVERY_MS: u64 = 7;
/// GET_DESCRIPTOR of the device (USB 2.0 9.4.3).
const GET_DEVICE: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 18, 0];

/// Frames received over a link, in order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stream {
    pub(crate) samples: usize,
    /// Frames that are missing in the sequence, or reported as dropped by the sender.
    pub(crate) missing_frames: u32,
    /// Scans that were not fetched.
    pub(crate) lost: u32,
    /// Number of samples marked as after a gap, because their stamp is off the grid.
    pub(crate) marked: usize,
    /// Greatest deviation of the interval between two samples from a millisecond, us.
    pub(crate) off_us: u64,
}

impl Stream {
    fn of(frames: &[Frame<Record>]) -> Self {
        let mut stream = Self::default();
        for pair in frames.windows(2) {
            let [before, after] = [pair[0].header, pair[1].header];
            let step = after.sequence.wrapping_sub(before.sequence);
            let dropped = after.dropped.wrapping_sub(before.dropped);
            stream.missing_frames += step.wrapping_sub(1).max(dropped);
        }
        let samples = frames.iter().filter_map(|frame| match &frame.message {
            Record::Sample(sample) => Some((frame.header.time_us, sample)),
            _ => None,
        });
        let mut last_us = None;
        for (time_us, sample) in samples {
            stream.samples += 1;
            stream.lost += sample.missed;
            stream.marked += usize::from(sample.gap && sample.missed == 0);
            if let Some(last_us) = last_us.replace(time_us) {
                let off_us = (time_us - last_us).abs_diff(1_000);
                stream.off_us = stream.off_us.max(off_us);
            }
        }
        stream
    }

    /// Whether nothing was lost, and samples are a millisecond apart, within the tolerance of the
    /// converter's clock and two roundings.
    pub(crate) const fn is_whole(&self) -> bool {
        self.missing_frames == 0 && self.lost == 0 && self.marked == 0 && self.off_us <= 5
    }
}

/// A PC at the USB port that reads all data and sends a request now and then.
#[derive(Default)]
struct UsbPc {
    frames: Vec<Frame<Record>>,
    pending: Vec<u8>,
    /// Times of the unanswered requests.
    asked: VecDeque<Time>,
    answered: usize,
    refused: usize,
    slowest: Time,
}

impl UsbPc {
    fn ask<P: Plant>(&mut self, board: &mut EmulatedBoard<P>) {
        self.asked.push_back(board.now());
        board.usb_mut().submit(ControlTransfer::new(GET_DEVICE));
    }

    fn listen<P: Plant>(&mut self, board: &mut EmulatedBoard<P>) {
        self.pending.extend(board.usb_mut().read());
        while let Some(end) = self.pending.iter().position(|&byte| byte == 0) {
            let bytes: Vec<u8> = self.pending.drain(..=end).collect();
            let mut decoder = RecordDecoder::new();
            let frames = decoder.frames(&bytes);
            let whole = frames.map(|frame| frame.expect("whole frames come over USB"));
            self.frames.extend(whole);
        }
        for (_, outcome) in board.usb_mut().take_results() {
            match outcome {
                ControlOutcome::Done(data) if data.len() == 18 => self.answered += 1,
                _ => self.refused += 1,
            }
            if let Some(asked) = self.asked.pop_front() {
                self.slowest = self.slowest.max(board.now() - asked);
            }
        }
    }
}

/// Observations during a save.
#[derive(Clone, Debug)]
pub(crate) struct DuringSave {
    pub(crate) took: Time,
    pub(crate) erases: usize,
    pub(crate) programs: usize,
    pub(crate) probe: Stream,
    pub(crate) usb: Stream,
    /// Worst delay from an edge of INTB to START.
    pub(crate) edge_to_start: Time,
    /// Longest interval between two feedings of the watchdog.
    pub(crate) unfed: Time,
    /// Number of successful control transfers; `refused` counts the others, and `slowest` is the
    /// longest duration, to a millisecond.
    pub(crate) answered: usize,
    pub(crate) refused: usize,
    pub(crate) slowest: Time,
    /// Whether the bridge or its control interrupt woke up.
    pub(crate) bridge_woke: bool,
    pub(crate) watchdog_resets: u32,
    /// Answers to commands in the middle of an erase.
    pub(crate) answers: Vec<(Command, Outcome)>,
}

impl DuringSave {
    /// Whether nothing was delayed, and no activity has started that must wait for the save.
    pub(crate) fn holds(&self) -> bool {
        // Either of two reasons for the refusal is valid here.
        let is_refused = |(command, outcome): &(Command, Outcome)| match command {
            Command::DriveCoil(_) | Command::Measure => *outcome != Outcome::Accepted,
            _ => *outcome == Outcome::Busy,
        };
        self.probe.is_whole()
            && self.usb.is_whole()
            && self.edge_to_start <= Time::from_us(10)
            && self.unfed <= Time::from_ms(12)
            && self.refused == 0
            && self.slowest <= Time::from_ms(5)
            && !self.bridge_woke
            && self.watchdog_resets == 0
            && !self.answers.is_empty()
            && self.answers.iter().all(is_refused)
    }
}

impl<P: Plant> RecordedBoard<P> {
    /// Plugs a PC into the USB port.
    pub(crate) fn plug(&mut self) {
        self.board.usb_mut().plug();
        self.board.usb_mut().enumerate();
        self.run(Time::from_ms(400));
        assert!(self.board.usb().description().is_some(), "it enumerates");
    }

    /// Runs for a millisecond; returns whether the bridge or its control interrupt woke up.
    pub(crate) fn run_seeing_the_bridge(&mut self) -> bool {
        let woke = self.board.run_until(Time::from_ms(1), |board| {
            board.bridge().awake || board.exception() == CONTROL
        });
        self.listen();
        match woke {
            Ok(()) => true,
            Err(Stop::TimedOut) => false,
            Err(stop) => panic!("at {}: {stop}", self.board.now()),
        }
    }

    /// Stores with a PC at each link, and observes everything else.
    pub(crate) fn store_beside_everything(&mut self) -> DuringSave {
        let mut usb = UsbPc::default();
        usb.listen(&mut self.board);
        // Drops the complete frames, but keeps the start of a frame in transmission.
        usb.frames.clear();
        let edges_before = self.edges_to_start().len();
        let resets_before = self.board.resets().watchdog;
        let operations_before = self.board.flash().operations().len();
        let received = self.frames.len();
        let begun = self.board.now();
        self.board.take_longest_unfed();
        let mut answers = Vec::new();
        let mut bridge_woke = false;
        self.send(&Command::Store);
        for ms in 0.. {
            if ms % REQUEST_EVERY_MS == 0 {
                usb.ask(&mut self.board);
            }
            bridge_woke |= self.run_seeing_the_bridge();
            usb.listen(&mut self.board);
            if answers.is_empty() && self.is_erasing() {
                answers = self.clone().answers();
            }
            let records = self.frames[received..].iter().map(|frame| &frame.message);
            if records.filter_map(storage).next().is_some() {
                break;
            }
            assert!(
                self.board.now() - begun < LONGEST_SAVE,
                "the save does not end"
            );
        }
        let took = self.board.now() - begun;
        let operations = &self.board.flash().operations()[operations_before..];
        let erases = erases(operations);
        let edges = &self.edges_to_start()[edges_before..];
        DuringSave {
            took,
            erases,
            programs: operations.len() - erases,
            probe: Stream::of(&self.frames[received..]),
            usb: Stream::of(&usb.frames),
            edge_to_start: edges.iter().copied().max().unwrap_or_default(),
            unfed: self.board.take_longest_unfed(),
            answered: usb.answered,
            refused: usb.refused,
            slowest: usb.slowest,
            bridge_woke,
            watchdog_resets: self.board.resets().watchdog - resets_before,
            answers,
        }
    }

    fn is_erasing(&self) -> bool {
        let flash = self.board.flash();
        let last = flash.operations().last();
        flash.is_busy() && last.is_some_and(|of| of.kind != FlashOperationKind::ProgramPage)
    }

    /// Answers to commands that may not start while the flash is written.
    fn answers(mut self) -> Vec<(Command, Outcome)> {
        let commands = [
            Command::Arm,
            super::driven::drive(1.0, 0.0),
            Command::Measure,
            Command::SetCoil(coil()),
            Command::Store,
            Command::Load,
            Command::Erase,
            reboot(RebootTarget::Firmware),
        ];
        let answer = |command: Command| {
            let outcome = self.command(&command).outcome;
            (command, outcome)
        };
        commands.map(answer).to_vec()
    }

    fn edges_to_start(&self) -> &[Time] {
        self.board.wire_log().map_or(&[], |log| &log.edge_to_start)
    }
}
