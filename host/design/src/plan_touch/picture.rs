//! Map as SVG: for each radius of contact and each quantity, where its error is within the limit.

use core::f64::consts::TAU;

use palpate_cli::plot::{self, Area, BLACK, BLUE, Colour, GREY, ORANGE};
use plotters::prelude::*;

use super::errors::Limits;
use super::layout::Layout;
use super::map::Map;
use super::show::QUANTITIES;

/// Side of a panel, and its margin, pixels.
const PANEL: u32 = 660;
const MARGIN: u32 = 20;
/// Height of the legend, pixels.
const LEGEND: u32 = 90;
const FONT: &str = "sans-serif";
const TITLE: u32 = 32;
const LABEL: u32 = 26;

/// Draws the maps, a row for each radius of contact.
pub(super) fn svg(layout: &Layout, limits: &Limits, maps: &[Map]) -> Result<String, String> {
    let rows = u32::try_from(maps.len()).map_err(text)?;
    let size = (3 * PANEL, rows * PANEL + LEGEND);
    plot::svg(size, |root| {
        let (legend, panels) = root.split_vertically(LEGEND);
        draw_legend(&legend)?;
        let panels = panels.split_evenly((maps.len(), 3));
        let drawn = maps
            .iter()
            .flat_map(|map| (0..3).map(move |quantity| (map, quantity)));
        for (panel, (map, quantity)) in panels.iter().zip(drawn) {
            draw_panel(layout, limits, map, quantity, panel)?;
        }
        Ok(())
    })
}

/// Colours of presses: within the limit, beyond it, not determined.
const WITHIN: Colour = BLUE;
const BEYOND: Colour = RGBColor(225, 225, 225);
const UNDETERMINED: Colour = ORANGE;

fn draw_legend(area: &Area<'_>) -> Result<(), String> {
    let entries = [
        ("within the limit", WITHIN),
        ("beyond it", BEYOND),
        ("not determined", UNDETERMINED),
    ];
    for (x, (words, colour)) in (20..).step_by(330).zip(entries) {
        area.draw(&Rectangle::new([(x, 26), (x + 42, 64)], colour.filled()))
            .map_err(text)?;
        area.draw(&Text::new(words, (x + 56, 30), (FONT, LABEL)))
            .map_err(text)?;
    }
    area.draw(&Text::new(
        "grey: centres and outer edges of the coils; black: edge of the inside",
        (1040, 30),
        (FONT, LABEL),
    ))
    .map_err(text)
}

fn draw_panel(
    layout: &Layout,
    limits: &Limits,
    map: &Map,
    quantity: usize,
    area: &Area<'_>,
) -> Result<(), String> {
    let [x, y] = layout.inside.middle_m.map(|at| 1e3 * at);
    let reach = 1e3 * extent_m(layout);
    let mut chart = ChartBuilder::on(area)
        .caption(caption(limits, map, quantity), (FONT, TITLE))
        .margin(MARGIN)
        .x_label_area_size(70)
        .y_label_area_size(85)
        .build_cartesian_2d(x - reach..x + reach, y - reach..y + reach)
        .map_err(text)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_labels(7)
        .y_labels(7)
        .x_desc("x / mm")
        .y_desc("y / mm")
        .label_style((FONT, LABEL))
        .draw()
        .map_err(text)?;
    let half = 0.5e3 * layout.inside.step_m();
    let cells = map.presses.iter().map(|press| {
        let [x, y] = press.at_m.map(|at| 1e3 * at);
        let colour = if press.within[quantity] {
            WITHIN
        } else if press.errors.standard[quantity].is_finite() {
            BEYOND
        } else {
            UNDETERMINED
        };
        Rectangle::new(
            [(x - half, y - half), (x + half, y + half)],
            colour.filled(),
        )
    });
    chart.draw_series(cells).map_err(text)?;
    let edges = layout.coils.iter().map(|coil| {
        let edge = (0..=60).map(|step| {
            let angle = TAU * f64::from(step) / 60.0;
            let [x, y] = coil.centre_m;
            let radius_m = coil.winding.outer_m;
            [x + radius_m * angle.cos(), y + radius_m * angle.sin()]
        });
        (edge.collect(), GREY)
    });
    let inside = core::iter::once((layout.inside.outline(), BLACK));
    for (line, colour) in edges.chain(inside) {
        let line: Vec<[f64; 2]> = line;
        let points = line.into_iter().map(|[x, y]| (1e3 * x, 1e3 * y));
        let series = LineSeries::new(points, colour.stroke_width(3));
        chart.draw_series(series).map_err(text)?;
    }
    let centres = layout.coils.iter().map(|coil| {
        let [x, y] = coil.centre_m;
        Cross::new((1e3 * x, 1e3 * y), 8, GREY.stroke_width(3))
    });
    chart.draw_series(centres).map_err(text)?;
    Ok(())
}

/// Title of a panel: quantity, limit, contact and share.
fn caption(limits: &Limits, map: &Map, quantity: usize) -> String {
    let limit = limits.all()[quantity];
    let limit = match quantity {
        0 => format!("{} mm", 1e3 * limit),
        _ => format!("{} %", 100.0 * limit),
    };
    format!(
        "{} within {limit}, contact of {} mm: {:.0} %",
        QUANTITIES[quantity],
        1e3 * map.radius_m,
        100.0 * map.share(|press| press.within[quantity])
    )
}

/// Half of a panel's side, m: all coils and the inside.
fn extent_m(layout: &Layout) -> f64 {
    let [x, y] = layout.inside.middle_m;
    let reach_m = layout.coils.iter().map(|coil| {
        let [dx, dy] = [coil.centre_m[0] - x, coil.centre_m[1] - y];
        dx.abs().max(dy.abs()) + coil.winding.outer_m
    });
    1.05 * reach_m.fold(layout.inside.reach_m(), f64::max)
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}
