//! Profiles along and across the axis, as in the paper's figures 5 to 10.

use palpate_cli::plot;
use palpate_field::design::Core;
use palpate_field::geometry::Point;
use palpate_field::solve::Solved;
use plotters::prelude::*;

use super::picture::{FONT, LABEL, Picture, TITLE};
use crate::field::profile::ProfileLine;

const POINTS: u32 = 601;
/// Size of a drawing, pixels.
const SIZE: (u32, u32) = (1600, 1000);
/// Colours that differ in brightness too.
const COLOURS: [RGBColor; 4] = [
    RGBColor(0, 60, 160),
    RGBColor(200, 60, 20),
    RGBColor(30, 140, 70),
    RGBColor(150, 90, 170),
];

/// A line with its name.
type Named = (String, ProfileLine);

/// Axial range, m, from one core length below the core to one above.
fn axial_range(core: &Core) -> [f64; 2] {
    let length = core.x_m[1] - core.x_m[0];
    [core.x_m[0] - length, core.x_m[1] + length]
}

/// Lines on the axis, at half the core's radius and near its edge.
fn axial_lines(core: &Core) -> [Named; 3] {
    [0.0, 0.5, 0.9].map(|share| {
        let r = share * core.r_m;
        (format!("r = {:.1} mm", 1e3 * r), ProfileLine::Parallel(r))
    })
}

/// Lines in the mid-plane and closer to the upper board.
fn radial_lines(core: &Core) -> [Named; 3] {
    let half = 0.5 * (core.x_m[1] - core.x_m[0]);
    [0.0, 0.4, 0.8].map(|share| {
        let x = core.middle_m() + share * half;
        (format!("x = {:.2} mm", 1e3 * x), ProfileLine::Radius(x))
    })
}

/// All points of the lines, where the mesh must be fine.
pub(super) fn points(core: &Core, solved: &Solved) -> Vec<Point> {
    let axial = axial_lines(core).map(|(_, line)| line.points(axial_range(core), POINTS));
    let radial = radial_lines(core).map(|(_, line)| line.points(line.range(solved), POINTS));
    axial.into_iter().chain(radial).flatten().collect()
}

/// Draws |B| along lines parallel to the axis.
pub(super) fn axial(picture: &Picture<'_>) -> Result<String, String> {
    let core = &picture.design.core;
    let chart = Chart {
        title: format!(
            "{}: along the axis, {}",
            picture.design.name, picture.driven
        ),
        across: "x / mm",
        range: axial_range(core),
        core: core.x_m,
    };
    plot::svg(SIZE, |root| chart.draw(picture, &axial_lines(core), root))
}

/// Draws |B| along radial lines.
pub(super) fn radial(picture: &Picture<'_>) -> Result<String, String> {
    let core = &picture.design.core;
    let chart = Chart {
        title: format!(
            "{}: across the axis, {}",
            picture.design.name, picture.driven
        ),
        across: "r / mm",
        range: ProfileLine::Radius(0.0).range(picture.solved),
        core: [0.0, core.r_m],
    };
    plot::svg(SIZE, |root| chart.draw(picture, &radial_lines(core), root))
}

struct Chart {
    title: String,
    across: &'static str,
    /// Range of the positions, m.
    range: [f64; 2],
    /// Position of the core, m.
    core: [f64; 2],
}

impl Chart {
    fn draw(
        &self,
        picture: &Picture<'_>,
        curves: &[Named],
        root: &plot::Area<'_>,
    ) -> Result<(), String> {
        let sampled: Vec<(&str, Vec<(f64, f64)>)> = curves
            .iter()
            .map(|(name, line)| {
                let samples = line.sample(picture.solved, &line.points(self.range, POINTS));
                let points = samples
                    .iter()
                    .map(|(at, field)| (1e3 * at, 1e3 * field.size()));
                (name.as_str(), points.collect())
            })
            .collect();
        let top = 1.08 * self.greatest(&sampled);
        let [from, to] = self.range.map(|end| 1e3 * end);
        let mut chart = ChartBuilder::on(root)
            .caption(&self.title, (FONT, TITLE))
            .margin(24)
            .x_label_area_size(90)
            .y_label_area_size(130)
            .build_cartesian_2d(from..to, 0.0..top)
            .map_err(text)?;
        let [low, high] = self.core.map(|end| 1e3 * end);
        let shade = RGBColor(235, 235, 235).filled();
        let shaded = Rectangle::new([(low, 0.0), (high, top)], shade);
        chart
            .draw_series(std::iter::once(shaded))
            .map_err(text)?
            .label("core")
            .legend(move |(x, y)| Rectangle::new([(x, y - 12), (x + 44, y + 12)], shade));
        chart
            .configure_mesh()
            .x_desc(self.across)
            .y_desc(format!("|B| / {}", picture.unit))
            .label_style((FONT, LABEL))
            .light_line_style(TRANSPARENT)
            .draw()
            .map_err(text)?;
        for ((name, points), colour) in sampled.into_iter().zip(COLOURS) {
            let style = colour.stroke_width(4);
            // The curve is cut off at peaks on the corners of plates, which would compress all
            // other values.
            for shown in points.split(|(_, size)| *size > top) {
                let line = LineSeries::new(shown.iter().copied(), style);
                chart.draw_series(line).map_err(text)?;
            }
            chart
                .draw_series(LineSeries::new(std::iter::empty(), style))
                .map_err(text)?
                .label(name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 44, y)], style));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .legend_area_size(60)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.4))
            .label_font((FONT, LABEL))
            .draw()
            .map_err(text)
    }

    /// Upper limit of the chart: the greatest value in the middle of the core, with a margin, since
    /// in plates the field is hundreds of times as large.
    fn greatest(&self, sampled: &[(&str, Vec<(f64, f64)>)]) -> f64 {
        let middle = 0.5 * (self.core[0] + self.core[1]);
        let reach = 0.45 * (self.core[1] - self.core[0]);
        let inner = |at: f64| (1e-3 * at - middle).abs() <= reach;
        let points = || sampled.iter().flat_map(|(_, points)| points);
        let within = points().filter(|(at, _)| inner(*at)).map(|(_, size)| *size);
        let core = within.fold(0.0, f64::max);
        let all = points().map(|(_, size)| *size).fold(0.0, f64::max);
        all.min(1.6 * core)
    }
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}
