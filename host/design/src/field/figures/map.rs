//! Map: |B| in colours, field lines at equal steps of flux, and outlines of the parts.

use contour::ContourBuilder;
use palpate_cli::plot::{self, Area};
use palpate_field::design::Design;
use palpate_field::geometry::shape::Shape;
use palpate_field::solve::Locator;
use plotters::prelude::*;

use super::picture::{FONT, LABEL, Picture, TITLE};
use super::scale::{ColourScale, colour};

/// Number of columns of the lattice; three of them are half a millimetre of a 70 mm wide picture.
const COLUMNS: usize = 200;
/// Number of field lines up to the greatest flux, for each sign.
const LINES: i32 = 16;

/// Values on a lattice over r ≥ 0.
struct Lattice {
    step_mm: f64,
    from_x_mm: f64,
    columns: usize,
    rows: usize,
    /// |B|, mT.
    size: Vec<f64>,
    /// Flux through the circle, in any unit, with its sign.
    flux: Vec<f64>,
}

impl Lattice {
    fn of(picture: &Picture<'_>) -> Self {
        let circle = picture.solved.level.space.mesh.circle;
        let locator = Locator::new(&picture.solved.level, &picture.solved.w);
        let step = circle.radius / COLUMNS as f64;
        let [low, high] = picture.design.height_m();
        // A third of the radius above and below shows how the field lines run.
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
    // Same scale for both directions: 1520 pixels across both sides of the axis.
    let scale = 1520.0 / (2.0 * reach);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "pixels"
    )]
    let (width, height) = (1520 + 140 + 260, (tall * scale) as u32 + 200);
    plot::svg((width, height), |root| {
        let (chart_area, legend) = root.split_horizontally(width - 250);
        let scale = ColourScale::of(&lattice.size);
        draw_map(picture, &lattice, &scale, &chart_area)?;
        scale.draw(&legend, &picture.unit)
    })
}

fn draw_map(
    picture: &Picture<'_>,
    lattice: &Lattice,
    scale: &ColourScale,
    area: &Area<'_>,
) -> Result<(), String> {
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
    let band = |size: f64| scale.band(size);
    chart.draw_series(cells(lattice, band)).map_err(text)?;
    for line in field_lines(lattice, picture.design)? {
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

/// Merges neighbouring cells of one band in a row into a rectangle, on both sides of the axis.
fn cells(lattice: &Lattice, band: impl Fn(f64) -> i32) -> Vec<Rectangle<(f64, f64)>> {
    let mut found = Vec::new();
    let end = lattice.from_x_mm + lattice.to_mm()[1];
    let rows = lattice.size.chunks(lattice.columns).zip(0_u32..);
    for (row, number) in rows {
        let x = lattice.from_x_mm + f64::from(number) * lattice.step_mm;
        // Each row overlaps the next, since rounding to whole pixels leaves gaps.
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

/// Field lines at equal steps of flux, of both signs, in mm. None are drawn in plates of soft
/// metal: nearly all lines concentrate and would merge there, so colour alone shows their field.
fn field_lines(lattice: &Lattice, design: &Design) -> Result<Vec<Vec<(f64, f64)>>, String> {
    let greatest = lattice
        .flux
        .iter()
        .map(|flux| flux.abs())
        .fold(0.0, f64::max);
    let lines = (1 - LINES..LINES).filter(|line| *line != 0);
    let levels: Vec<f64> = lines
        .map(|line| greatest * f64::from(line) / f64::from(LINES))
        .collect();
    let in_plate = |point: [f64; 2]| {
        let parts = design.parts.iter();
        let mut plates = parts.filter(|part| !part.cast && part.remanence_t == 0.0);
        plates.any(|plate| plate.contains(point))
    };
    let half = 0.5 * lattice.step_mm;
    let builder = ContourBuilder::new(lattice.columns, lattice.rows, true)
        .x_step(lattice.step_mm)
        .y_step(lattice.step_mm)
        .y_origin(lattice.from_x_mm);
    let found = builder.lines(&lattice.flux, &levels).map_err(text)?;
    let [reach, tall] = lattice.to_mm();
    let inside = |&(r, x): &(f64, f64)| {
        let top = lattice.from_x_mm + tall;
        // The lattice's edge at the axis is not a field line.
        let shown = (1.01 * half..reach - half).contains(&r)
            && x > lattice.from_x_mm + half
            && x < top - half;
        shown && !in_plate([1e-3 * r, 1e-3 * x])
    };
    let mut lines = Vec::new();
    for level in &found {
        for ring in level.geometry() {
            // Contours close along the edge of the lattice; field lines do not.
            let points: Vec<(f64, f64)> = ring.coords().map(|c| (c.x, c.y)).collect();
            let pieces = points.split(|point| !inside(point));
            lines.extend(pieces.filter(|piece| piece.len() > 1).map(<[_]>::to_vec));
        }
    }
    Ok(lines)
}

/// Outlines of all parts, in mm, with their colours.
fn outlines(design: &Design) -> Vec<(Vec<(f64, f64)>, ShapeStyle)> {
    let mut found = Vec::new();
    let mut add = |shape: &Shape, style: ShapeStyle| {
        for path in shape.paths() {
            let points = (0..=60).map(|k| path.at(f64::from(k) / 60.0));
            let points = points.map(|[r, x]| (1e3 * r, 1e3 * x));
            // The axis is not an outline.
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

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use palpate_field::design::builtin_text;
    use palpate_field::solve::{Accuracy, Excitation, solve};

    use super::*;

    /// Field lines of the coils in air. `senses` are those of the lower and the upper board.
    fn lines(senses: [&str; 2]) -> Vec<Vec<(f64, f64)>> {
        let text = builtin_text("air").unwrap();
        let mut design = Design::parse("air.toml", text).unwrap();
        for coil in &mut design.coils {
            let upper = usize::from(coil.name.starts_with("upper"));
            coil.sense = if senses[upper] == "+" { 1.0 } else { -1.0 };
        }
        let accuracy = Accuracy {
            relative: 1e-2,
            ..Accuracy::default()
        };
        let solved = solve(&design, &Excitation::small(&design, 1.0), &accuracy).unwrap();
        let picture = Picture {
            design: &design,
            solved: &solved,
            unit: String::new(),
            driven: String::new(),
        };
        field_lines(&Lattice::of(&picture), &design).unwrap()
    }

    fn length_mm(lines: &[Vec<(f64, f64)>]) -> f64 {
        let step = |pair: &[(f64, f64)]| (pair[0].0 - pair[1].0).hypot(pair[0].1 - pair[1].1);
        lines
            .iter()
            .flat_map(|line| line.windows(2))
            .map(step)
            .sum()
    }

    /// Lines are drawn in a magnet (a part with remanence), but not in soft metal.
    #[test]
    fn field_lines_are_drawn_in_magnets() {
        let inside = |law: &str| {
            let text = format!(
                "name = \"x\"\nlength_unit = \"mm\"\n[background]\nfield_T = 0.1\n[core]\nr = 2.0\nx = [-2.0, 2.0]\n\
                 [material.m]\nmu_r = 1.1\n{law}\n[[plate]]\nname = \"p\"\nmaterial = \"m\"\n\
                 shape = {{ r = [0.0, 6.0], x = [-6.0, 6.0] }}\n"
            );
            let design = Design::parse("x", &text).unwrap();
            let accuracy = Accuracy {
                relative: 1e-2,
                ..Accuracy::default()
            };
            let excitation = Excitation::saturating(&design, 0.0);
            let solved = solve(&design, &excitation, &accuracy).unwrap();
            let picture = Picture {
                design: &design,
                solved: &solved,
                unit: String::new(),
                driven: String::new(),
            };
            let lines = field_lines(&Lattice::of(&picture), &design).unwrap();
            let mut points = lines.into_iter().flatten();
            points.any(|(r, x)| r < 5.0 && x.abs() < 5.0)
        };
        assert!(inside("remanence_T = 1.0"));
        assert!(!inside(""));
    }

    #[test]
    fn field_lines_do_not_depend_on_the_sense() {
        let alike = |one: f64, other: f64| (one / other - 1.0).abs() < 0.02;
        let [plus, minus] = ["+", "-"].map(|sense| length_mm(&lines([sense, sense])));
        assert!(plus > 100.0 && alike(plus, minus), "{plus} {minus}");
        // Opposed coils: equal lengths above and below the mid-plane at 4.14 mm.
        let opposed = lines(["+", "-"]).into_iter();
        let (above, below): (Vec<_>, Vec<_>) = opposed.partition(|line| line[0].1 > 4.14);
        let [above, below] = [above, below].map(|lines| length_mm(&lines));
        assert!(above > 100.0 && alike(above, below), "{above} {below}");
    }
}
