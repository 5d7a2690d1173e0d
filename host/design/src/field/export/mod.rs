//! `palpate field export`: a design as files for other programs: its field, and what one orders to build it.

pub(crate) mod array;
mod dxf;
mod filament;
mod grid;
mod kicad;
mod parts;
mod solid;
mod trip;
mod winding;

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};
use palpate_cli::failure::Failure;
use palpate_cli::output::{OutputFile, distinct};
use palpate_cli::quantity::within;
use palpate_field::design::Design;

use super::input::{DesignSource, current};
use solid::Mould;
use trip::{RoundTrip, Series};
use winding::Winding;

/// Write a design for other programs: its field (VTK, CSV), and what one orders: KiCad, DXF, STL, list of parts
#[derive(Args)]
#[command(
    group(ArgGroup::new("files").args(["vtk", "csv", "kicad", "dxf", "stl", "parts"]).required(true).multiple(true)),
    after_help = "\
VTK is the legacy format as text: the solver's own triangles, divided by the order of the elements, each with \
its own points, since the field jumps between materials. Points are (r, x, 0) in m; B in T with its \
components along r and x; flux in Wb, through the circle about the axis; part: 0 for what is not magnetic, \
then the bodies and plates in the order of the design.

CSV has the same on a square grid over the design and a third of the radius about it; lengths in mm.

Without --current the field is that of one ampere, far below saturation, without background and \
magnets; names end with _per_A then. \
There is no estimate of the error of single points: `palpate field profile` has one.

KiCad: a footprint for each board, with the turns as tracks on both layers, via, pads and the board's edge. A turn is \
a circle with a jog to the next one, of which the first and the last cannot be whole. The round trip says what \
that does: tracks, leads and via as filaments in air against the circles of the design, and, with its iron, \
finite elements of the tracks' mean around the axis. Out of the axis iron is not computed.

DXF: each board from its front, the section through bodies and plates, and iron through which tabs of the boards lead, \
from above with its slots. STL: a mould for each body, open above, \
and discs for the empty spaces along the axis. What is cut out of a body, and boards in it, are not in the mould. \
Nothing of this has been made yet.

Examples:
  palpate field export closed --current 5 --vtk closed.vtk --csv closed.csv --step 0.5
  palpate field export closed-sensing --kicad boards --dxf drawings
  palpate field export closed-sensing --stl moulds --parts parts.csv"
)]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// The field at this current, with saturation, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// Write the triangles there, as VTK
    #[arg(long, value_name = "FILE")]
    vtk: Option<PathBuf>,
    /// Write a grid there, as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Distance of the grid's points, mm
    #[arg(long, default_value_t = 0.5, value_name = "MM", value_parser = within(1e-3, 100.0, "mm"))]
    step: f64,
    /// Write a KiCad footprint of each board into this folder
    #[arg(long, value_name = "FOLDER")]
    kicad: Option<PathBuf>,
    /// Write drawings of each board and of the section into this folder
    #[arg(long, value_name = "FOLDER")]
    dxf: Option<PathBuf>,
    /// Write moulds and spacers into this folder
    #[arg(long, value_name = "FOLDER")]
    stl: Option<PathBuf>,
    /// Write lengths, resistance, inductance, heat and volumes there, as CSV
    #[arg(long, value_name = "FILE")]
    parts: Option<PathBuf>,
    /// Distance of tracks from each other, mm; less where the design leaves less
    #[arg(long, default_value_t = 0.2, value_name = "MM", value_parser = within(0.05, 10.0, "mm"))]
    clearance: f64,
    /// Thickness of the moulds' walls, mm
    #[arg(long, default_value_t = 2.0, value_name = "MM", value_parser = within(0.4, 50.0, "mm"))]
    wall: f64,
    /// Slope of the moulds' walls, degrees; the casting has its radius at half of its height
    #[arg(long, default_value_t = 1.0, value_name = "DEGREES", value_parser = within(0.0, 10.0, "degrees"))]
    draft: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load()?;
    let mut out = io::stdout().lock();
    if arguments.vtk.is_some() || arguments.csv.is_some() {
        for path in grid::write(&design, arguments)? {
            writeln!(out, "written: {path}")?;
        }
    }
    if arguments.stl.is_some() {
        let stls = Files::of(
            "--stl",
            arguments.stl.as_deref(),
            solids(&design, arguments),
        )?;
        stls.write(&mut out)?;
    }
    let boards = [&arguments.kicad, &arguments.dxf, &arguments.parts];
    if boards.iter().any(|named| named.is_some()) {
        write_boards(&design, arguments, &mut out)?;
    }
    Ok(())
}

/// Moulds of all bodies, and spacers.
fn solids(design: &Design, arguments: &Arguments) -> Vec<(String, Vec<u8>)> {
    let mould = Mould {
        wall_m: 1e-3 * arguments.wall,
        draft: arguments.draft.to_radians().tan(),
    };
    let cast = design.parts.iter().filter(|part| part.cast);
    let moulds = cast.flat_map(|part| solid::moulds(part, &mould));
    let solids = moulds.chain(solid::spacers(design));
    solids
        .map(|solid| (format!("{}.stl", solid.name), solid::stl(&solid)))
        .collect()
}

/// Writes footprints, drawings and the list of parts, after the round trip.
fn write_boards(
    design: &Design,
    arguments: &Arguments,
    out: &mut impl io::Write,
) -> Result<(), Failure> {
    let windings = Winding::all(design, 1e-3 * arguments.clearance)?;
    let stem = |winding: &Winding| file_stem(&format!("{}_{}", design.name, winding.name));
    let about = "made by palpate field export; not built yet";
    let footprint = |winding: &Winding| {
        let text = kicad::footprint(&stem(winding), about, winding);
        (format!("{}.kicad_mod", stem(winding)), text.into_bytes())
    };
    let drawing = |winding: &Winding| {
        (
            format!("{}.dxf", stem(winding)),
            dxf::board(winding).into_bytes(),
        )
    };
    let section = (
        format!("{}_section.dxf", file_stem(&design.name)),
        dxf::section(design).into_bytes(),
    );
    let slotted = dxf::slotted(design, &windings)
        .into_iter()
        .map(|(part, text)| {
            let stem = file_stem(&format!("{}_{part}_slots", design.name));
            (format!("{stem}.dxf"), text.into_bytes())
        });
    let drawings = windings.iter().map(drawing).chain([section]).chain(slotted);
    let files = [
        Files::of(
            "--kicad",
            arguments.kicad.as_deref(),
            windings.iter().map(footprint).collect(),
        )?,
        Files::of("--dxf", arguments.dxf.as_deref(), drawings.collect())?,
    ];
    let parts = OutputFile::optional("--parts", arguments.parts.as_ref())?;
    distinct(
        files
            .iter()
            .flat_map(|files| files.0.iter().map(|(file, _)| file))
            .chain(&parts),
    )?;
    for winding in &windings {
        writeln!(out, "{}", winding.explain())?;
    }
    let mut trips = Vec::new();
    for series in Series::all(design, &windings) {
        let trip = RoundTrip::of(design, &series, &arguments.source.effort)?;
        write!(out, "{}", trip.explain(&series))?;
        trips.push((series, trip));
    }
    for files in files {
        files.write(out)?;
    }
    if let Some(file) = parts {
        file.write(parts::table(design, &windings, &trips)?)?;
        writeln!(out, "written: {}", file.path().display())?;
    }
    Ok(())
}

/// Files of a folder with their contents.
struct Files(Vec<(OutputFile, Vec<u8>)>);

impl Files {
    /// Checks that the files can be written; there are none without a folder.
    fn of(
        argument: &'static str,
        folder: Option<&Path>,
        files: Vec<(String, Vec<u8>)>,
    ) -> Result<Self, Failure> {
        let Some(folder) = folder else {
            return Ok(Self(Vec::new()));
        };
        let file = |(name, contents)| {
            let files = OutputFile::in_folder(argument, folder, [name])?;
            Ok(files
                .into_iter()
                .map(move |file| (file, Vec::clone(&contents))))
        };
        let files: Vec<_> = files
            .into_iter()
            .map(file)
            .collect::<Result<_, Failure>>()?;
        Ok(Self(files.into_iter().flatten().collect()))
    }

    fn write(self, out: &mut impl io::Write) -> Result<(), Failure> {
        for (file, contents) in self.0 {
            file.write(contents)?;
            writeln!(out, "written: {}", file.path().display())?;
        }
        Ok(())
    }
}

/// A name as the name of a file: letters, digits and hyphens; all else becomes an underscore.
fn file_stem(name: &str) -> String {
    let plain = |character: char| character.is_ascii_alphanumeric() || character == '-';
    name.chars()
        .map(|character| if plain(character) { character } else { '_' })
        .collect()
}
