//! The firmware's image on an emulated board, as an engine.

use std::cell::Cell;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::progress::Progress;
use palpate_emulator::{Image, Options};
use palpate_sim::world::World;
use palpate_simulate::engine::{Engine, EngineChoice, Native};
use palpate_simulate::instrument::CalibratedInstrument;
use palpate_simulate::press::{Press, PressOutcome, press_on};

use crate::board::image::{self, Program};
use crate::board::log::{self, Log};

/// Which program runs the instrument
#[derive(Args)]
// Skipped: the group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Arguments {
    /// What runs the instrument: its crates on this computer, or the firmware's image on an
    /// emulated board
    #[arg(long, value_enum, default_value_t = EngineKind::Native)]
    engine: EngineKind,
    #[command(flatten)]
    image: image::Arguments,
    #[command(flatten)]
    log: log::Arguments,
    /// With `--engine image`: write pins, bus and coil current of every press as a value change
    /// dump, for a waveform viewer. The second press goes to FILE-2.vcd, and so on
    #[arg(long, value_name = "FILE.vcd")]
    trace: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum EngineKind {
    Native,
    Image,
}

/// The firmware's image, with the requested log and trace.
pub(crate) struct OnBoard {
    image: Image,
    log: Option<Log>,
    trace: Option<OutputFile>,
    /// Number of traced presses.
    traced: Cell<u32>,
}

impl EngineChoice for Arguments {
    fn engine(&self) -> Result<Box<dyn Engine>, Failure> {
        match self.engine {
            EngineKind::Native if self.trace.is_some() => Err(only_with_image("--trace")),
            EngineKind::Native => {
                self.log.none_without("add --engine image")?;
                self.image.none_without("--engine image")?;
                Ok(Box::new(Native))
            }
            EngineKind::Image => Ok(Box::new(self.on_board()?)),
        }
    }
}

impl Arguments {
    /// Loads the image for the engine `image`.
    fn on_board(&self) -> Result<OnBoard, Failure> {
        let trace = OutputFile::optional("--trace", self.trace.as_ref())?;
        let (file, image) = self.image.load(Program::Firmware)?;
        let trace = trace.map(|trace| trace.apart_from(&file)).transpose()?;
        Ok(OnBoard {
            image,
            log: self.log.load(Some(&file))?,
            trace,
            traced: Cell::new(0),
        })
    }
}

fn only_with_image(argument: &str) -> Failure {
    Failure::Argument(format!(
        "{argument} shows what the firmware's image does on the emulated board: add --engine image"
    ))
}

impl OnBoard {
    /// Options of the emulated board.
    fn options(&self) -> Options {
        Options {
            trace: self.trace.is_some(),
            ..Options::default()
        }
    }

    /// Prints the log and writes the trace of a press, also of one that failed.
    fn show(&self, what: &str, board: &mut palpate_emulator::Instrument) -> Result<(), Failure> {
        if let Some(log) = &self.log {
            log.show(what, &board.take_logs());
        }
        let (Some(file), Some(trace)) = (&self.trace, board.board_mut().take_trace()) else {
            return Ok(());
        };
        self.traced.set(self.traced.get() + 1);
        let file = file.numbered(self.traced.get());
        file.write_with(|to| trace.write(to))
    }
}

impl Engine for OnBoard {
    /// Creates a bar; hidden where the log is shown.
    fn progress(&self, steps: usize) -> Progress {
        if self.log.is_some() {
            Progress::hidden()
        } else {
            Progress::new(steps)
        }
    }

    fn press(
        &self,
        world: World,
        instrument: &CalibratedInstrument,
        how: &Press,
    ) -> Result<PressOutcome, Failure> {
        let mut board = palpate_emulator::Instrument::new(&self.image, world, self.options());
        let started = board.start();
        let pressed = started.and_then(|()| press_on(&mut board, instrument, how));
        self.show(&how.name, &mut board)?;
        pressed.map_err(Failure::refused)
    }
}
