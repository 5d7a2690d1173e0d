//! `palpate plan-touch`: what a layout of sensing coils can determine of a press.

mod coil;
mod coupling;
mod errors;
mod inside;
mod layer;
mod layout;
mod map;
mod picture;
mod profile;
mod show;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::quantity::within;

use crate::field::export::array::{self, ArrayCoil, Target};

use errors::Limits;
use layout::Layout;
use map::Map;

/// Compute what several sensing coils under one elastic layer can determine of a press: place, force and radius of contact
#[derive(Args)]
#[command(after_help = "\
A linear calculation for the design of a layout. \
The layer is elastic, wide against its thickness and bonded to a rigid base; it is pressed without friction by Hertz's \
pressure. Each coil reads the displacement of the layer's surface, weighted by its own field at the boundary of the \
magnetic elastomer. Standard errors follow from the derivatives of all readings by x, y, ln F and ln a, with the noise, \
the gain errors and a declared radius. Viscosity, large strains, a tilted or second contact are not in them.

--kicad and --dxf write the coils' boards and nothing else of this: each coil is a spiral of tracks as wide as the spaces \
between them, on the front of a flexible board of two layers, with a via and a lead on the back. Coils that overlap are \
on boards of their own, one on the other. The round trip compares inductance and coupling of the tracks with those of \
the layout's circles, in air. Nothing of this has been made yet.

Each limit is one of a standard error, at every press of a lattice inside.

Exit code 1 when no press lies inside; exit code 2 for an invalid layout or number.

Examples: a built-in layout with a map; a layout of your own

  palpate plan-touch three-around-one --plot touch.svg
  palpate plan-touch seven --show > mine.toml
  palpate plan-touch mine.toml --place 0.5 --json
  palpate plan-touch three-around-one --kicad boards --dxf drawings")]
pub struct Arguments {
    /// Layout: three-around-one, seven, or a file
    #[arg(value_name = "LAYOUT")]
    layout: String,
    /// Limit of the place's error in its worst direction, mm
    #[arg(long, default_value_t = 0.3, value_name = "MM", value_parser = within(1e-4, 100.0, "mm"))]
    place: f64,
    /// Limit of the force's error, %
    #[arg(long, default_value_t = 3.0, value_name = "PERCENT", value_parser = within(1e-3, 100.0, "%"))]
    force: f64,
    /// Limit of the radius' error, %
    #[arg(long, default_value_t = 20.0, value_name = "PERCENT", value_parser = within(1e-3, 100.0, "%"))]
    radius: f64,
    /// Print the layout's file, to start one of your own
    #[arg(long, conflicts_with_all = ["json", "plot", "kicad", "dxf"])]
    show: bool,
    /// One JSON object
    #[arg(long)]
    json: bool,
    /// Write the coils' boards as KiCad footprints into this folder
    #[arg(long, value_name = "FOLDER")]
    kicad: Option<PathBuf>,
    /// Write drawings of the coils' boards into this folder
    #[arg(long, value_name = "FOLDER")]
    dxf: Option<PathBuf>,
    /// Least distance of the boards' tracks, mm; less where the layout leaves less
    #[arg(long, default_value_t = 0.1, value_name = "MM", value_parser = within(0.05, 10.0, "mm"))]
    clearance: f64,
    /// Draw where each limit is met
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// Writes the boards of the layout's coils.
fn boards(layout: &Layout, arguments: &Arguments, out: &mut impl Write) -> Result<(), Failure> {
    let coil = |coil: &layout::Coil| ArrayCoil {
        centre_m: coil.centre_m,
        radii_m: [coil.winding.inner_m, coil.winding.outer_m],
        turns: coil.winding.turns,
    };
    let coils: Vec<ArrayCoil> = layout.coils.iter().map(coil).collect();
    let target = Target {
        kicad: arguments.kicad.as_deref(),
        dxf: arguments.dxf.as_deref(),
        clearance_m: 1e-3 * arguments.clearance,
    };
    array::write(&layout.name, &coils, &target, out)
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let plot = OutputFile::optional("--plot", arguments.plot.as_ref())?;
    let plot = plot.map(|file| file.apart_from(Path::new(&arguments.layout)));
    let plot = plot.transpose()?;
    let text = layout::text_of(&arguments.layout)?;
    let layout = Layout::parse(&arguments.layout, &text).map_err(Failure::Document)?;
    let mut out = io::stdout().lock();
    if arguments.show {
        return Ok(write!(out, "{text}")?);
    }
    if arguments.kicad.is_some() || arguments.dxf.is_some() {
        return boards(&layout, arguments, &mut out);
    }
    let limits = Limits {
        place_m: 1e-3 * arguments.place,
        force_ln: 1e-2 * arguments.force,
        radius_ln: 1e-2 * arguments.radius,
    };
    let maps = Map::all(&layout, &limits)?;
    if arguments.json {
        writeln!(out, "{}", show::json(&layout, &limits, &maps)?)?;
    } else {
        write!(out, "{}", show::text(&layout, &limits, &maps))?;
    }
    let Some(file) = plot else {
        return Ok(());
    };
    let drawing = picture::svg(&layout, &limits, &maps);
    file.write(drawing.map_err(|reason| {
        Failure::Refused(format!(
            "{} could not be drawn: {reason}",
            file.path().display()
        ))
    })?)
}
