//! Selection of the image for the emulated board, by one rule for every verb.
//!
//! 1. `--image FILE`.
//! 2. Otherwise the image of the tool's release, which lies beside the tool.
//! 3. Otherwise the image of the workspace in which the command runs; cargo builds it if it is out
//!    of date.
//! 4. Outside of a workspace there is no image, and the error says where to get one.

use std::env;
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_emulator::{Image, firmware};

/// Argument that selects the image for the emulated board.
#[derive(Args)]
// Skipped: the group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub struct Arguments {
    /// The image for the emulated board, an ELF file. Without it, the image of the release that the
    /// tool is from, or that of the palpate checkout in which the command is run, built first
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
}

/// Programs of the firmware's package.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// The firmware.
    Firmware,
    /// The example `bring_up`, with which a PC tests the converter.
    BringUp,
}

impl Program {
    fn build(self) -> Result<PathBuf, firmware::BuildError> {
        match self {
            Self::Firmware => firmware::build(),
            Self::BringUp => firmware::build_example("bring_up"),
        }
    }

    /// Path in a release, relative to the tool.
    const fn of_release(self) -> Option<&'static str> {
        match self {
            Self::Firmware => Some("firmware/palpate-pico.elf"),
            Self::BringUp => None,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Firmware => "firmware image",
            Self::BringUp => "image bring_up",
        }
    }

    /// The command that builds the image in a checkout, and its path.
    const fn made_by(self) -> &'static str {
        match self {
            Self::Firmware => "`cargo xtask firmware` writes target/image/palpate-pico.elf",
            Self::BringUp => {
                "`cargo build --profile firmware --target thumbv6m-none-eabi -p palpate-firmware \
                 --example bring_up` writes target/thumbv6m-none-eabi/firmware/examples/bring_up"
            }
        }
    }
}

impl Arguments {
    /// Returns file and image, by the rule of this module.
    pub fn load(&self, program: Program) -> Result<(PathBuf, Image), Failure> {
        let file = self.file(program)?;
        let image = Image::load(&file).map_err(|error| unusable(&file, program, &error))?;
        Ok((file, image))
    }

    /// Fails if an image is named that would not be used. `instead` names the option that uses it.
    pub fn none_without(&self, instead: &str) -> Result<(), Failure> {
        match &self.image {
            None => Ok(()),
            Some(_) => Err(Failure::Argument(format!(
                "--image names the image for the emulated board: add {instead}"
            ))),
        }
    }

    fn file(&self, program: Program) -> Result<PathBuf, Failure> {
        if let Some(file) = &self.image {
            return Ok(file.clone());
        }
        if let Some(file) = beside_tool(program) {
            return Ok(file);
        }
        let Some(workspace) = firmware::workspace() else {
            let looked: Vec<String> = (places_beside_tool(program).iter())
                .map(|place| place.display().to_string())
                .collect();
            return Err(Failure::Argument(format!(
                "no {}{}: name one with --image FILE, or run this inside of a palpate checkout, \
                 where it is built. In a checkout, {}.",
                program.name(),
                if looked.is_empty() {
                    String::new()
                } else {
                    format!(" at {}", looked.join(" or "))
                },
                program.made_by()
            )));
        };
        notice::say(format_args!(
            "palpate: building the {} of {}",
            program.name(),
            workspace.display()
        ));
        program
            .build()
            .map_err(|error| Failure::Refused(error.to_string()))
    }
}

/// Paths of the image beside the tool: its path in a release, and the file directly in the tool's
/// folder.
fn places_beside_tool(program: Program) -> Vec<PathBuf> {
    // Resolves a symbolic link to the tool.
    let tool = env::current_exe().and_then(|tool| tool.canonicalize());
    let tool = tool.ok();
    let folder = tool.as_deref().and_then(Path::parent);
    let (Some(folder), Some(of_release)) = (folder, program.of_release()) else {
        return Vec::new();
    };
    let of_release = folder.join(of_release);
    let alone = of_release.file_name().map(|name| folder.join(name));
    [Some(of_release), alone].into_iter().flatten().collect()
}

fn beside_tool(program: Program) -> Option<PathBuf> {
    let mut places = places_beside_tool(program).into_iter();
    places.find(|place| place.is_file())
}

fn unusable(file: &Path, program: Program, error: &dyn std::fmt::Display) -> Failure {
    Failure::Argument(format!(
        "{}: {error}. Name an ELF file of the {} with --image: in a palpate checkout, {}.",
        file.display(),
        program.name(),
        program.made_by()
    ))
}
