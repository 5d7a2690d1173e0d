//! The field over the half-plane as VTK and CSV.

use std::fmt::Write as _;
use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_cli::output::{OutputFile, distinct};
use palpate_field::design::Design;
use palpate_field::solve::{FieldAt, Locator, Piece, Solved};

use super::super::drive::{Drive, reached};
use super::super::tables::BeyondTable;
use super::Arguments;

/// Maximum number of points of a grid, which give 100 MB of text.
const MOST_POINTS: f64 = 1e6;

/// Solves the field and writes it to the files that are named; returns their paths.
pub(super) fn write(design: &Design, arguments: &Arguments) -> Result<Vec<String>, Failure> {
    let vtk = OutputFile::optional("--vtk", arguments.vtk.as_ref())?;
    let csv = OutputFile::optional("--csv", arguments.csv.as_ref())?;
    for file in vtk.iter().chain(&csv) {
        file.clone()
            .apart_from(Path::new(&arguments.source.design))?;
    }
    distinct(vtk.iter().chain(&csv))?;
    let drive = Drive::of(design, arguments.current)?;
    let solved = drive.attempt(design, &arguments.source.effort)?;
    BeyondTable::say_all(design, &solved);
    if let Some(file) = &vtk {
        let title = format!("{}, {}", design.name, drive.words(design));
        file.write(vtk_text(&title, per(drive), &solved.pieces()))?;
    }
    if let Some(file) = &csv {
        let step_m = 1e-3 * arguments.step;
        file.write(csv_text(design, &solved, per(drive), step_m)?)?;
    }
    reached(design, &solved)?;
    let written = vtk.iter().chain(&csv);
    Ok(written
        .map(|file| file.path().display().to_string())
        .collect())
}

/// Suffix of the units of a field.
const fn per(drive: Drive) -> &'static str {
    match drive {
        Drive::PerAmpere => "_per_A",
        Drive::Current(_) | Drive::Background => "",
    }
}

/// Flux through the circle of radius `r_m` about the axis, Wb.
fn flux_wb(r_m: f64, field: &FieldAt) -> f64 {
    core::f64::consts::TAU * r_m * r_m * field.w
}

/// Number of a part from 1; 0 outside magnetic parts.
fn part_number(part: Option<u32>) -> u32 {
    part.map_or(0, |part| part + 1)
}

/// Formats triangles as an unstructured grid. Writing to a `String` cannot fail.
fn vtk_text(title: &str, per: &str, pieces: &[Piece]) -> String {
    let places = || pieces.iter().flat_map(|piece| &piece.places);
    let (points, cells) = pieces.iter().fold((0, 0), |(points, cells), piece| {
        (points + piece.places.len(), cells + piece.triangles.len())
    });
    // VTK limits the title to one line of 255 characters.
    let title: String = title
        .chars()
        .filter(|c| !c.is_control())
        .take(200)
        .collect();
    let mut text = format!(
        "# vtk DataFile Version 3.0\npalpate field: {title}\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {points} double\n"
    );
    for ([r, x], _) in places() {
        let _ = writeln!(text, "{r:.9e} {x:.9e} 0");
    }
    let _ = writeln!(text, "CELLS {cells} {}", 4 * cells);
    let mut first = 0;
    for piece in pieces {
        for [a, b, c] in &piece.triangles {
            let _ = writeln!(text, "3 {} {} {}", first + a, first + b, first + c);
        }
        first += piece.places.len();
    }
    let _ = writeln!(text, "CELL_TYPES {cells}");
    text.push_str(&"5\n".repeat(cells));
    let _ = writeln!(
        text,
        "CELL_DATA {cells}\nSCALARS part int 1\nLOOKUP_TABLE default"
    );
    for piece in pieces {
        let line = format!("{}\n", part_number(piece.region.part));
        text.push_str(&line.repeat(piece.triangles.len()));
    }
    let _ = writeln!(text, "POINT_DATA {points}\nVECTORS B_T{per} double");
    for (_, field) in places() {
        let _ = writeln!(text, "{:.9e} {:.9e} 0", field.b[0], field.b[1]);
    }
    let _ = writeln!(text, "SCALARS flux_Wb{per} double 1\nLOOKUP_TABLE default");
    for ([r, _], field) in places() {
        let _ = writeln!(text, "{:.9e}", flux_wb(*r, field));
    }
    text
}

/// Formats a square grid over the design and a third of the circle's radius around it.
fn csv_text(design: &Design, solved: &Solved, per: &str, step_m: f64) -> Result<String, Failure> {
    let circle = solved.level.space.mesh.circle;
    let [low, high] = design.height_m();
    let [from, to] = [low - 0.33 * circle.radius, high + 0.33 * circle.radius];
    let [columns, rows] = [circle.radius, to - from].map(|length| (length / step_m).floor() + 1.0);
    if columns * rows > MOST_POINTS {
        return Err(Failure::Argument(format!(
            "--step {}: {:.1e} points, at most {MOST_POINTS:.0e}: choose a greater one",
            1e3 * step_m,
            columns * rows
        )));
    }
    let locator = Locator::new(&solved.level, &solved.w);
    let regions = &solved.level.space.mesh.regions;
    let mut text = format!("r_mm,x_mm,B_r_T{per},B_x_T{per},B_T{per},flux_Wb{per},part\n");
    for row in 0..rows as u32 {
        for column in 0..columns as u32 {
            let [r, x] = [f64::from(column) * step_m, from + f64::from(row) * step_m];
            let field = locator.at([r, x]);
            let part = regions
                .get(field.region as usize)
                .and_then(|region| region.part);
            let _ = writeln!(
                text,
                "{:.6},{:.6},{:.9e},{:.9e},{:.9e},{:.9e},{}",
                1e3 * r,
                1e3 * x,
                field.b[0],
                field.b[1],
                field.size(),
                flux_wb(r, &field),
                part_number(part)
            );
        }
    }
    Ok(text)
}
