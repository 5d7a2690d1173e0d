//! Which program runs the simulated instrument.

use std::cell::Cell;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use palpate_board::{Image, Instrument, Options};

use crate::failure::Failure;
use crate::log::Log;
use crate::progress::Progress;

/// Where `cargo xtask firmware` writes the image.
pub(crate) const DEFAULT_IMAGE: &str = "target/image/palpate-pico.elf";

/// Which program runs the instrument
#[derive(Args)]
// Its group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Arguments {
    /// What runs the instrument: its crates on this computer, or the firmware's image on an
    /// emulated board
    #[arg(long, value_enum, default_value_t = Kind::Native)]
    engine: Kind,
    /// The image for `--engine image`
    #[arg(long, value_name = "FILE", default_value = DEFAULT_IMAGE)]
    image: PathBuf,
    /// With `--engine image`: show the image's own log on standard error, each line with the time
    /// of the image's clock in seconds
    #[arg(long)]
    log: bool,
    /// With `--engine image`: write pins, bus and coil current of every press as a value change
    /// dump, for a waveform viewer. The second press goes to FILE-2.vcd, and so on
    #[arg(long, value_name = "FILE.vcd")]
    trace: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    Native,
    Image,
}

/// What runs the instrument.
pub(crate) enum Engine {
    /// Driver and procedure on this computer.
    Native,
    /// The firmware's image on an emulated board.
    Image(Box<OnBoard>),
}

/// The firmware's image, and what is wanted to be seen of it.
pub(crate) struct OnBoard {
    pub(crate) image: Image,
    log: Option<Log>,
    trace: Option<PathBuf>,
    /// Presses that were traced.
    traced: Cell<u32>,
}

impl Arguments {
    /// The engine, with its image loaded.
    pub(crate) fn engine(&self) -> Result<Engine, Failure> {
        match self.engine {
            Kind::Native if self.log => Err(only_with_image("--log")),
            Kind::Native if self.trace.is_some() => Err(only_with_image("--trace")),
            Kind::Native => Ok(Engine::Native),
            Kind::Image => Ok(Engine::Image(Box::new(OnBoard {
                image: Image::load(&self.image).map_err(|error| unusable(&self.image, &error))?,
                log: self.log.then(|| self.load_log()).transpose()?,
                trace: self.trace.clone(),
                traced: Cell::new(0),
            }))),
        }
    }

    /// A bar for the presses; none where the log is shown.
    pub(crate) fn progress(&self, steps: usize) -> Progress {
        if self.log {
            Progress::hidden()
        } else {
            Progress::new(steps)
        }
    }

    fn load_log(&self) -> Result<Log, Failure> {
        let bytes = fs::read(&self.image).map_err(|error| unusable(&self.image, &error))?;
        Log::of(&bytes, &self.image)
    }
}

fn only_with_image(argument: &str) -> Failure {
    Failure::Argument(format!(
        "{argument} shows what the firmware's image does on the emulated board: add --engine image"
    ))
}

pub(crate) fn unusable(file: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::Refused(format!(
        "{}: {error}. Build the image with `cargo xtask firmware`, or name one with --image.",
        file.display()
    ))
}

impl OnBoard {
    /// An image of which nothing is to be seen but its records.
    #[cfg(test)]
    pub(crate) fn quiet(image: Image) -> Self {
        Self {
            image,
            log: None,
            trace: None,
            traced: Cell::new(0),
        }
    }

    /// How the board is to be set up.
    pub(crate) fn options(&self) -> Options {
        Options {
            trace: self.trace.is_some(),
            ..Options::default()
        }
    }

    /// Shows what is wanted to be seen of a press, whatever came of it.
    pub(crate) fn show(&self, what: &str, board: &mut Instrument) -> Result<(), Failure> {
        if let Some(log) = &self.log {
            log.show(what, &board.take_logs());
        }
        let (Some(file), Some(trace)) = (&self.trace, board.board_mut().take_trace()) else {
            return Ok(());
        };
        self.traced.set(self.traced.get() + 1);
        let file = numbered(file, self.traced.get());
        let unwritable = |error: std::io::Error| {
            Failure::Refused(format!(
                "{}: {error}. Name a file that may be written with --trace.",
                file.display()
            ))
        };
        let to = File::create(&file).map_err(unwritable)?;
        trace.write(BufWriter::new(to)).map_err(unwritable)
    }
}

/// The file for the press of this number, from 1.
fn numbered(file: &Path, number: u32) -> PathBuf {
    if number == 1 {
        return file.to_path_buf();
    }
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("{stem}-{number}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_press_has_the_file_and_the_next_ones_numbers() {
        let file = Path::new("out/finger.vcd");
        assert_eq!(numbered(file, 1), file);
        assert_eq!(numbered(file, 3), Path::new("out/finger-3.vcd"));
    }
}
