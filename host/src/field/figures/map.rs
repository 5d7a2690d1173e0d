//! The map: |B| in colours, field lines at equal steps of flux, and what lies where.

use contour::ContourBuilder;
use palpate_field::design::Design;
use palpate_field::geometry::shape::Shape;
use palpate_field::solve::Locator;
use plotters::prelude::*;

use super::{FONT, LABEL, Picture, TITLE};
use crate::plot::{self, Area};

/// Half a millimetre of a 70 mm wide picture is three of these.
const COLUMNS: usize = 200;
/// Bands of colour.
const BANDS: i32 = 18;
/// Field lines through one side of the mid-plane.
const LINES: u32 = 16;
/// The map ends at so many decades below its greatest field.
const DECADES: f64 = 2.0;

/// Values on a lattice over r ≥ 0.
struct Lattice {
    step_mm: f64,
    from_x_mm: f64,
    columns: usize,
    rows: usize,
    /// |B|, in mT.
    size: Vec<f64>,
    /// Flux through the circle, in any unit.
    flux: Vec<f64>,
}

impl Lattice {
    /// The greatest |B|, mT.
    fn greatest(&self) -> f64 {
        self.size.iter().copied().fold(0.0, f64::max)
    }

    fn of(picture: &Picture<'_>) -> Self {
        let circle = picture.solved.level.space.mesh.circle;
        let locator = Locator::new(&picture.solved.level, &picture.solved.w);
        let step = circle.radius / COLUMNS as f64;
        let [low, high] = picture.design.height_m();
        // A third of the radius above and below shows where the field lines go.
        let (from, to) = (low - 0.33 * circle.radius, high + 0.33 * circle.radius);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few hundred"
        )]
        let rows = ((to - from) / step).clamp(10.0, 2_000.0) as usize;
        let (mut size, mut flux) = (Vec::new(), Vec::new());
        for row in 0..rows {
            for column in 0..COLUMNS {
                let [r, x] = [
                    (column as f64 + 0.5) * step,
                    from + (row as f64 + 0.5) * step,
                ];
                let at = locator.at([r, x]);
                size.push(1e3 * at.size());
                flux.push(r * r * at.w);
            }
        }
        Self {
            step_mm: 1e3 * step,
            from_x_mm: 1e3 * from,
            columns: COLUMNS,
            rows,
            size,
            flux,
        }
    }

    fn to_mm(&self) -> [f64; 2] {
        [self.columns as f64, self.rows as f64].map(|cells| cells * self.step_mm)
    }
}

pub(super) fn draw(picture: &Picture<'_>) -> Result<String, String> {
    let lattice = Lattice::of(picture);
    let [reach, tall] = lattice.to_mm();
    // One scale for both directions: 1520 pixels for both sides of the axis.
    let scale = 1520.0 / (2.0 * reach);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "pixels"
    )]
    let (width, height) = (1520 + 140 + 260, (tall * scale) as u32 + 200);
    plot::svg((width, height), |root| {
        let (chart_area, legend) = root.split_horizontally(width - 250);
        draw_map(picture, &lattice, &chart_area)?;
        colour_bar(&legend, lattice.greatest(), &picture.unit)
    })
}

fn draw_map(picture: &Picture<'_>, lattice: &Lattice, area: &Area<'_>) -> Result<(), String> {
    let [reach, tall] = lattice.to_mm();
    let title = format!(
        "{}: flux density and field lines {}",
        picture.design.name, picture.driven
    );
    let mut chart = ChartBuilder::on(area)
        .caption(title, (FONT, TITLE))
        .margin(20)
        .x_label_area_size(85)
        .y_label_area_size(100)
        .build_cartesian_2d(-reach..reach, lattice.from_x_mm..lattice.from_x_mm + tall)
        .map_err(text)?;
    let greatest = lattice.greatest();
    let band = |size: f64| {
        let decades = (size / greatest).log10();
        #[allow(clippy::cast_possible_truncation, reason = "clamped to the bands")]
        let band = (f64::from(BANDS) * (1.0 + decades / DECADES)) as i32;
        band.clamp(0, BANDS - 1)
    };
    chart.draw_series(cells(lattice, band)).map_err(text)?;
    for line in field_lines(lattice)? {
        for side in [-1.0, 1.0] {
            let line = line.iter().map(|&(r, x)| (side * r, x));
            let style = WHITE.mix(0.75).stroke_width(2);
            chart
                .draw_series(LineSeries::new(line, style))
                .map_err(text)?;
        }
    }
    for (outline, style) in outlines(picture.design) {
        for side in [-1.0, 1.0] {
            let line = outline.iter().map(|&(r, x)| (side * r, x));
            chart
                .draw_series(LineSeries::new(line, style))
                .map_err(text)?;
        }
    }
    chart
        .configure_mesh()
        .disable_mesh()
        .x_desc("r / mm")
        .y_desc("x / mm")
        .x_label_formatter(&|r| format!("{:.0}", r.abs()))
        .y_label_formatter(&|x| format!("{x:.0}"))
        .label_style((FONT, LABEL))
        .draw()
        .map_err(text)
}

/// Rows of cells of the same band, on both sides of the axis, as few rectangles.
fn cells(lattice: &Lattice, band: impl Fn(f64) -> i32) -> Vec<Rectangle<(f64, f64)>> {
    let mut found = Vec::new();
    let end = lattice.from_x_mm + lattice.to_mm()[1];
    let rows = lattice.size.chunks(lattice.columns).zip(0_u32..);
    for (row, number) in rows {
        let x = lattice.from_x_mm + f64::from(number) * lattice.step_mm;
        // Rounding to whole pixels leaves gaps between rows, so that each reaches into the next.
        let top = (x + 1.5 * lattice.step_mm).min(end);
        let bands: Vec<i32> = row.iter().map(|&size| band(size)).collect();
        let mut column = 0;
        for run in bands.chunk_by(|a, b| a == b) {
            let [from, to] = [column, column + run.len()].map(|c| c as f64 * lattice.step_mm);
            column += run.len();
            let fill = colour(run.first().copied().unwrap_or(0)).filled();
            let mut add = |from: f64, to: f64| {
                found.push(Rectangle::new([(from, x), (to, top)], fill));
            };
            if from == 0.0 {
                add(-to, to);
            } else {
                add(-to, -from);
                add(from, to);
            }
        }
    }
    found
}

fn colour(band: i32) -> RGBColor {
    ViridisRGB::get_color_normalized(f64::from(band), 0.0, f64::from(BANDS - 1))
}

/// Lines of equal flux, in mm.
fn field_lines(lattice: &Lattice) -> Result<Vec<Vec<(f64, f64)>>, String> {
    let greatest = lattice.flux.iter().copied().fold(0.0, f64::max);
    let levels: Vec<f64> = (1..LINES)
        .map(|line| greatest * f64::from(line) / f64::from(LINES))
        .collect();
    let half = 0.5 * lattice.step_mm;
    let builder = ContourBuilder::new(lattice.columns, lattice.rows, true)
        .x_step(lattice.step_mm)
        .y_step(lattice.step_mm)
        .y_origin(lattice.from_x_mm);
    let found = builder.lines(&lattice.flux, &levels).map_err(text)?;
    let [reach, tall] = lattice.to_mm();
    let inside = |&(r, x): &(f64, f64)| {
        let top = lattice.from_x_mm + tall;
        r < reach - half && x > lattice.from_x_mm + half && x < top - half
    };
    let mut lines = Vec::new();
    for level in &found {
        for ring in level.geometry() {
            // Rings are closed along the edge of the lattice; a field line is not.
            let points: Vec<(f64, f64)> = ring.coords().map(|c| (c.x, c.y)).collect();
            let pieces = points.split(|point| !inside(point));
            lines.extend(pieces.filter(|piece| piece.len() > 1).map(<[_]>::to_vec));
        }
    }
    Ok(lines)
}

/// Outlines of all parts, in mm, each with its colour.
fn outlines(design: &Design) -> Vec<(Vec<(f64, f64)>, ShapeStyle)> {
    let mut found = Vec::new();
    let mut add = |shape: &Shape, style: ShapeStyle| {
        for path in shape.paths() {
            let points = (0..=60).map(|k| path.at(f64::from(k) / 60.0));
            let points = points.map(|[r, x]| (1e3 * r, 1e3 * x));
            // The axis is no outline.
            let points: Vec<(f64, f64)> = points.collect();
            if points.iter().any(|point| point.0 > 1e-9) {
                found.push((points, style));
            }
        }
    };
    let rectangle =
        |section: &palpate_field::design::Rectangle| Shape::rectangle(section.r_m, section.x_m);
    for part in &design.parts {
        let (colour, width) = if part.cast { (BLACK, 2) } else { (RED, 2) };
        for shape in std::iter::once(&part.shape).chain(&part.minus) {
            add(shape, colour.stroke_width(width));
        }
    }
    for board in &design.boards {
        add(&rectangle(&board.section), BLACK.stroke_width(2));
    }
    let copper = RGBColor(240, 130, 30);
    for ring in design.coils.iter().flat_map(|coil| &coil.rings) {
        add(&rectangle(ring), copper.stroke_width(4));
    }
    found
}

/// What the colours stand for.
fn colour_bar(area: &Area<'_>, greatest: f64, unit: &str) -> Result<(), String> {
    #[allow(clippy::cast_possible_wrap, reason = "pixels")]
    let height = area.dim_in_pixel().1 as i32;
    let (top, bottom) = (120, height - 120);
    let at = |band: i32| bottom - (bottom - top) * band / BANDS;
    for band in 0..BANDS {
        let corners = [(10, at(band + 1)), (60, at(band))];
        let block = Rectangle::new(corners, colour(band).filled());
        area.draw(&block).map_err(text)?;
    }
    let label = |words: String, place: (i32, i32)| {
        area.draw(&Text::new(words, place, (FONT, LABEL)))
            .map_err(text)
    };
    label(format!("|B| / {unit}"), (0, top - 60))?;
    for band in (0..=BANDS).step_by(3) {
        let size = greatest * 10_f64.powf(DECADES * (f64::from(band) / f64::from(BANDS) - 1.0));
        let words = if band == 0 {
            format!("< {}", short(size))
        } else {
            short(size)
        };
        label(words, (72, at(band) - 15))?;
    }
    Ok(())
}

/// Three digits.
fn short(value: f64) -> String {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 6"
    )]
    let digits = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.digits$}")
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}
