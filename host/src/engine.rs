//! Which program runs the simulated instrument.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use palpate_board::Image;

use crate::failure::Failure;

/// Where `cargo xtask firmware` writes the image.
const DEFAULT_IMAGE: &str = "target/image/palpate-pico.elf";

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
    Image(Image),
}

impl Arguments {
    /// The engine, with its image loaded.
    pub(crate) fn engine(&self) -> Result<Engine, Failure> {
        match self.engine {
            Kind::Native => Ok(Engine::Native),
            Kind::Image => load(&self.image).map(Engine::Image),
        }
    }
}

fn load(file: &Path) -> Result<Image, Failure> {
    Image::load(file).map_err(|error| {
        Failure::Refused(format!(
            "{}: {error}. Build the image with `cargo xtask firmware`, or name one with --image.",
            file.display()
        ))
    })
}
