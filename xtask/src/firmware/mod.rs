//! The firmware image: built anywhere, checked against its size budget, written for flash tools.

mod image;
mod panics;
mod planted;
mod size;
mod uf2;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::process::{Invocation, Workspace};

pub(crate) use image::build;
use image::build_with;
pub(crate) use panics::check as check_panics;
#[cfg(test)]
pub(crate) use planted::DEFECTS;
pub(crate) use size::check as check_size;

/// Folder of the files for flash tools and for `palpate --image`, in the workspace.
const FOLDER: &str = "target/image";
const NAME: &str = "palpate-pico";

/// Builds the image, writes ELF and UF2, and prints its size.
pub(crate) fn make(workspace: &Workspace) -> Result<()> {
    let image = build(workspace)?;
    write(&image, &workspace.root().join(FOLDER))?;
    println!("{FOLDER}/{NAME}.elf: for a debug probe, and for `--image` of palpate");
    println!("{FOLDER}/{NAME}.uf2: for a board that was started with BOOTSEL held");
    println!("{}", size::check(workspace)?);
    Ok(())
}

/// Builds the image with additional cargo arguments, writes ELF and UF2 into a folder, and returns
/// the ELF's path.
pub(crate) fn build_for_release(
    workspace: &Workspace,
    arguments: &[String],
    folder: &Path,
) -> Result<PathBuf> {
    let image = build_with(workspace, arguments)?;
    write(&image, folder)
}

/// Writes an image into a folder as ELF and UF2, and returns the ELF's path.
fn write(image: &Path, folder: &Path) -> Result<PathBuf> {
    fs::create_dir_all(folder)
        .with_context(|| format!("{} cannot be created", folder.display()))?;
    let elf = folder.join(NAME).with_extension("elf");
    fs::copy(image, &elf).with_context(|| format!("{} cannot be written", elf.display()))?;
    let bytes = fs::read(image).with_context(|| format!("{} cannot be read", image.display()))?;
    let flash = uf2::convert(&bytes)?;
    let file = elf.with_extension("uf2");
    fs::write(&file, flash).with_context(|| format!("{} cannot be written", file.display()))?;
    Ok(elf)
}

/// Builds the image with a defect of `firmware/planted-defects.toml` and prints only its path.
pub(crate) fn make_planted(workspace: &Workspace, defect: &str) -> Result<()> {
    println!("{}", planted::image(workspace, defect)?.display());
    Ok(())
}

/// Flashes the image through a debug probe and shows its log.
pub(crate) fn flash(workspace: &Workspace) -> Result<()> {
    let image = build(workspace)?;
    let image = image.to_string_lossy().into_owned();
    let run = Invocation::new("probe-rs", &["run", "--chip", "RP2040", &image]);
    workspace.run(&run).with_context(|| {
        "no board could be flashed; probe-rs is installed with `cargo install --locked \
         probe-rs-tools`; without a probe, copy the UF2 file of `cargo xtask firmware` to the board"
    })
}
