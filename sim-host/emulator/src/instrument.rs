//! The image with a PC on its debug channels: commands in, records out, on a plant.

use std::fmt;

use ldc161x_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::electrical::ConverterParameters;
use palpate_sim::world::World;
use palpate_wire::{Command, Frame, Message, Record, RecordDecoder, Sequencer, encode};

use crate::board::coil::BridgeCircuit;
use crate::board::plant::PressedWorld;
use crate::board::{EmulatedBoard, Options};
use crate::image::Image;
use crate::stop::Stop;

/// Channel from the image for its logs.
pub const LOGS: u32 = 0;
/// Channel from the image for its records.
pub const RECORDS: u32 = 1;
/// Channel to the image for commands.
pub const COMMANDS: u32 = 0;

/// Interval of the PC's polls for records; the firmware's channel can queue the records of a tenth
/// of a second.
const POLL: Time = Time::from_ms(1);
/// Longest time from power on to the first record: boot, the converter's wake-up, and the deadlines
/// that pass if the converter is absent.
const GREETING: Time = Time::from_ms(200);
/// Longest time from a command to its answer.
const ANSWER: Time = Time::from_ms(100);
/// Crystal frequency of a Raspberry Pi Pico, Hz.
const CRYSTAL_HZ: f64 = 12e6;
/// Frequency that the firmware derives from the crystal for a converter with one channel, Hz.
const CLKIN_HZ: f64 = 200e6 / 6.0;

/// Failure of the image or of the emulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFailure {
    /// The emulation cannot continue at this time.
    Stopped(Stop, Time),
    /// The image never sent its identity.
    Silent,
    /// The image did not answer a command of this kind.
    NoAnswer {
        /// Kind of the command.
        kind: u8,
    },
    /// The command cannot be encoded.
    NotEncoded {
        /// Kind of the command.
        kind: u8,
    },
}

impl fmt::Display for ImageFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stopped(stop, time) => write!(f, "the image at {time}: {stop}"),
            Self::Silent => f.write_str("the image never said who it is"),
            Self::NoAnswer { kind } => {
                write!(f, "the image did not answer the command 0x{kind:02x}")
            }
            Self::NotEncoded { kind } => {
                write!(f, "the command 0x{kind:02x} does not fit into a frame")
            }
        }
    }
}

impl std::error::Error for ImageFailure {}

/// The image on its board, with a world of `palpate-sim` pressed on its sensor and a PC on its
/// channels. A clone is a snapshot.
#[derive(Clone)]
pub struct Instrument {
    board: EmulatedBoard<PressedWorld>,
    /// Bytes of an incomplete frame.
    pending: Vec<u8>,
    sequencer: Sequencer,
    frames: Vec<Frame<Record>>,
    logs: Vec<u8>,
    damaged: u32,
}

impl Instrument {
    /// An image that is powered now, with the converter and the crystal of this world.
    #[must_use]
    pub fn new(image: &Image, world: World, options: Options) -> Self {
        let chip = world.chip_settings(CLKIN_HZ);
        let clock = chip.external_clock;
        let error = clock.map_or(0.0, |clock| clock.relative_error);
        let current = &world.parameters().current;
        let options = Options {
            crystal_hz: CRYSTAL_HZ * (1.0 + error),
            drive: BridgeCircuit {
                gain_error: current.gain_error,
                converter: ConverterParameters {
                    nonlinearity_lsb: current.nonlinearity_lsb,
                    nonlinearity_phase: current.nonlinearity_phase,
                    noise_lsb: current.noise_lsb,
                    // The world's own non-linearity of the current measurement applies instead: the
                    // bench has calibrated with it.
                    wide_codes: false,
                    ..options.drive.converter
                },
                ..options.drive
            },
            ..options
        };
        Self {
            board: EmulatedBoard::new(image, PressedWorld::new(world), chip, options),
            pending: Vec::new(),
            sequencer: Sequencer::new(0),
            frames: Vec::new(),
            logs: Vec::new(),
            damaged: 0,
        }
    }

    /// Waits until the image sends its identity: before that the image accepts no commands.
    ///
    /// # Errors
    /// [`ImageFailure`].
    pub fn start(&mut self) -> Result<(), ImageFailure> {
        let is_hello = |record: &Record| matches!(record, Record::Hello(_));
        match self.run_to(GREETING, is_hello)? {
            true => Ok(()),
            false => Err(ImageFailure::Silent),
        }
    }

    /// The board.
    #[must_use]
    pub const fn board(&self) -> &EmulatedBoard<PressedWorld> {
        &self.board
    }

    /// The board, to inject faults.
    pub const fn board_mut(&mut self) -> &mut EmulatedBoard<PressedWorld> {
        &mut self.board
    }

    /// Runs the board for a duration; the bytes on its channels stay there.
    ///
    /// Equivalent to [`EmulatedBoard::run_for`]. That function is generic and compiled with its
    /// caller, so it would be a third as fast in an unoptimised program.
    ///
    /// # Errors
    /// [`Stop`] where the emulation cannot continue.
    pub fn run_for(&mut self, time: Time) -> Result<(), Stop> {
        self.board.run_for(time)
    }

    /// Bytes of the log since the last call, as defmt encodes them.
    pub fn take_logs(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.logs)
    }

    /// Number of damaged frames; a debug probe damages none.
    #[must_use]
    pub const fn damaged(&self) -> u32 {
        self.damaged
    }

    fn listen(&mut self) {
        self.logs.extend(self.board.read_channel(LOGS));
        self.pending.extend(self.board.read_channel(RECORDS));
        while let Some(end) = self.pending.iter().position(|&byte| byte == 0) {
            let bytes: Vec<u8> = self.pending.drain(..=end).collect();
            for frame in RecordDecoder::new().frames(&bytes) {
                let Ok(frame) = frame else {
                    self.damaged += 1;
                    continue;
                };
                self.sequencer.address(frame.header.boot_id);
                self.frames.push(frame);
            }
        }
    }
}

impl Device for Instrument {
    type Error = ImageFailure;

    fn now(&self) -> Time {
        self.board.now()
    }

    fn send(&mut self, command: Command) -> Result<(), ImageFailure> {
        let header = self.sequencer.stamp(0);
        let kind = command.kind();
        let mut buffer = [0; Command::MAX_FRAME];
        let bytes = encode(&header, &command, &mut buffer)
            .map_err(|_| ImageFailure::NotEncoded { kind })?;
        if self.board.write_channel(COMMANDS, bytes) < bytes.len() {
            return Err(ImageFailure::NoAnswer { kind });
        }
        let end = self.now() + ANSWER;
        let is_answer = |record: &Record| match record {
            Record::Acknowledgement(answer) => answer.command == header.sequence,
            _ => false,
        };
        match self.run_to(end, is_answer)? {
            true => Ok(()),
            false => Err(ImageFailure::NoAnswer { kind }),
        }
    }

    fn advance(&mut self, end: Time) -> Result<(), ImageFailure> {
        let end = end.min(self.now() + POLL);
        let left = end.max(self.now()) - self.now();
        let ran = self.board.run_for(left);
        self.listen();
        ran.map_err(|stop| ImageFailure::Stopped(stop, self.now()))
    }

    fn frames(&mut self) -> &mut Vec<Frame<Record>> {
        &mut self.frames
    }

    fn with_world<T>(&mut self, apply: impl FnOnce(&mut World) -> T) -> T {
        let now = self.now();
        let world = self.board.plant_mut().world_mut();
        world.advance_to(now);
        apply(world)
    }
}
