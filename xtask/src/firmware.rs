//! The firmware's image: built anywhere, measured against its budget, written for flash tools.

mod panics;
mod size;
mod uf2;

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};

use crate::members::FIRMWARE_TARGET;
use crate::process::{Invocation, Workspace};
use crate::setup::Need;

pub(crate) use panics::check as check_panics;
pub(crate) use size::check as check_size;

const PACKAGE: &str = "palpate-firmware";
const PROFILE: &str = "firmware";
/// Where the files for flash tools and for `palpate --image` are written, in the workspace.
const FOLDER: &str = "target/image";
const NAME: &str = "palpate-pico";

/// The variable that plants a defect when the image is built; see docs/firmware.md.
const DEFECT: &str = "PALPATE_PLANTED_DEFECT";

/// Builds the image, writes ELF and UF2, and prints what it takes.
pub(crate) fn make(workspace: &Workspace) -> Result<()> {
    let image = build(workspace, None)?;
    let folder = workspace.root().join(FOLDER);
    fs::create_dir_all(&folder).with_context(|| format!("{FOLDER} could not be created"))?;
    let elf = folder.join(NAME).with_extension("elf");
    fs::copy(&image, &elf).with_context(|| format!("{} cannot be written", elf.display()))?;
    let bytes = fs::read(&image).with_context(|| format!("{} cannot be read", image.display()))?;
    let flash = uf2::convert(&bytes)?;
    let file = elf.with_extension("uf2");
    fs::write(&file, flash).with_context(|| format!("{} cannot be written", file.display()))?;
    println!("{FOLDER}/{NAME}.elf: for a debug probe, and for `--image` of palpate");
    println!("{FOLDER}/{NAME}.uf2: for a board that was started with BOOTSEL held");
    println!("{}", size::check(workspace)?);
    Ok(())
}

/// Flashes the image through a debug probe and shows its log.
pub(crate) fn flash(workspace: &Workspace) -> Result<()> {
    let image = build(workspace, None)?;
    let image = image.to_string_lossy().into_owned();
    let run = Invocation::new("probe-rs", &["run", "--chip", "RP2040", &image]);
    workspace.run(&run).with_context(|| {
        "no board could be flashed; probe-rs is installed with `cargo install --locked \
         probe-rs-tools`; without a probe, copy the UF2 file of `cargo xtask firmware` to the board"
    })
}

/// Builds an image, with a planted defect if one is named, and returns its path.
fn build(workspace: &Workspace, defect: Option<&'static str>) -> Result<PathBuf> {
    Need::Target(FIRMWARE_TARGET).provide(workspace)?;
    let mut cargo = Invocation::cargo(&[
        "build",
        "--locked",
        "--package",
        PACKAGE,
        "--profile",
        PROFILE,
        "--target",
        FIRMWARE_TARGET,
        "--message-format",
        "json-render-diagnostics",
    ]);
    if let Some(defect) = defect {
        cargo = cargo.with_env(DEFECT, defect);
    }
    let printed = workspace.output(&cargo)?;
    crate::panic_free::executable(&printed).context("cargo named no image")
}
