//! `palpate field figures`: the field as pictures.

mod map;
mod profiles;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_field::design::Design;
use palpate_field::solve::Solved;

use super::input::{Source, at_current, current, per_ampere, sharpened};
use crate::failure::Failure;

/// Draw a design: map of the flux density with field lines, profiles along and across the axis
#[derive(Args)]
#[command(after_help = "\
Writes DESIGN-map.svg, DESIGN-axial.svg and DESIGN-radial.svg.
Without --current the field is that of one ampere, far below saturation.")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: Source,
    /// Draw the field at this current, with saturation, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// The folder to write to
    #[arg(long, default_value = ".", value_name = "FOLDER")]
    out: PathBuf,
}

/// A field that is to be drawn.
struct Picture<'p> {
    design: &'p Design,
    solved: &'p Solved,
    /// What stands behind every |B|: `mT` or `mT/A`.
    unit: &'static str,
    /// The current in words.
    driven: String,
}

/// Text in drawings: any sans-serif font, at these sizes. Drawings are made large, since the library
/// rounds to whole pixels.
const FONT: &str = "sans-serif";
const TITLE: u32 = 40;
const LABEL: u32 = 30;

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load()?;
    let effort = &arguments.source.effort;
    let (solved, unit, driven) = match arguments.current {
        None => (
            per_ampere(&design, effort)?,
            "mT/A",
            "per ampere".to_owned(),
        ),
        Some(current_a) => {
            let solved = at_current(&design, current_a, effort)?;
            (solved, "mT", format!("at {current_a} A"))
        }
    };
    let points = profiles::points(&design.core, &solved);
    let solved = sharpened(&design, solved, &points)?;
    let picture = Picture {
        design: &design,
        solved: &solved,
        unit,
        driven,
    };
    let folder = &arguments.out;
    let to = |kind: &str| folder.join(format!("{}-{kind}.svg", file_name(&design.name)));
    std::fs::create_dir_all(folder)?;
    let mut out = io::stdout().lock();
    let drawn = [
        (
            to("map"),
            map::draw as fn(&Picture<'_>, &Path) -> Result<(), String>,
        ),
        (to("axial"), profiles::axial),
        (to("radial"), profiles::radial),
    ];
    for (path, draw) in drawn {
        draw(&picture, &path).map_err(|reason| {
            Failure::Refused(format!("{} could not be drawn: {reason}", path.display()))
        })?;
        writeln!(out, "{}", path.display())?;
    }
    Ok(())
}

/// A design's name without what a file's name should not have.
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
