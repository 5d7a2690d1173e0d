//! `palpate field figures`: the field as pictures.

mod map;
mod picture;
mod profiles;
mod scale;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;

use super::input::{DesignSource, current, sharpened};
use super::tables::BeyondTable;
use crate::field::drive::Drive;
use picture::Picture;

/// Draw a design: map of the flux density with field lines, profiles along and across the axis
#[derive(Args)]
#[command(after_help = "\
Writes DESIGN-map.svg, DESIGN-axial.svg and DESIGN-radial.svg. \
Without --current the field is that of one ampere, far below saturation and without background and magnets; \
of a design without a coil, that of its background and magnets.")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// Draw the field at this current, with saturation, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// The folder to write to
    #[arg(long, default_value = ".", value_name = "FOLDER")]
    out: PathBuf,
}

/// Draws a picture as SVG.
type Draw = fn(&Picture<'_>) -> Result<String, String>;

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load()?;
    let kinds = ["map", "axial", "radial"];
    let names = kinds.map(|kind| format!("{}-{kind}.svg", file_name(&design.name)));
    let files = OutputFile::in_folder("--out", &arguments.out, names)?;
    let effort = &arguments.source.effort;
    let drive = Drive::of(&design, arguments.current)?;
    let solved = drive.solve(&design, effort)?;
    BeyondTable::say_all(&design, &solved);
    let points = profiles::points(&design.core, &solved);
    let solved = sharpened(&design, solved, &points, effort)?;
    let picture = Picture {
        design: &design,
        solved: &solved,
        unit: format!("mT{}", drive.per()),
        driven: drive.words(&design),
    };
    let mut out = io::stdout().lock();
    let drawn: [Draw; 3] = [map::draw, profiles::axial, profiles::radial];
    for (file, draw) in files.iter().zip(drawn) {
        let path = file.path().display();
        let drawing = draw(&picture)
            .map_err(|reason| Failure::Refused(format!("{path} could not be drawn: {reason}")))?;
        file.write(drawing)?;
        writeln!(out, "{path}")?;
    }
    Ok(())
}

/// Returns a design's name without characters that a file name should not have.
fn file_name(name: &str) -> String {
    let kept = |c: char| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '_'
        }
    };
    name.chars().map(kept).collect()
}
