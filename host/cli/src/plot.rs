//! Charts as SVG: lines, points, error bars; linear and logarithmic axes.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::element::ErrorBar;
use plotters::prelude::*;
pub use plotters::style::RGBColor as Colour;

use crate::failure::Failure;

/// Number of pieces into which a curve over time is divided; the minimum and maximum of each piece
/// are drawn.
const PIECES: usize = 400;
/// Charts are drawn three times as large as they are shown, since the library rounds to whole
/// pixels.
const ENLARGED: u32 = 3;
/// Size of a chart as it is shown, in CSS pixels.
const SIZE: (u32, u32) = (520, 300);
const FONT: &str = "sans-serif";
/// Approximate part of a chart's width and height that a legend covers.
const LEGEND: (f64, f64) = (0.55, 0.3);
const TITLE_SIZE: u32 = 15 * ENLARGED;
const LABEL_SIZE: u32 = 13 * ENLARGED;

// Colours that colour-blind readers can distinguish, also on paper (Okabe and Ito 2008).

/// Blue.
pub const BLUE: Colour = RGBColor(0, 114, 178);
/// Vermilion.
pub const ORANGE: Colour = RGBColor(213, 94, 0);
/// Bluish green.
pub const GREEN: Colour = RGBColor(0, 158, 115);
/// Reddish purple.
pub const PURPLE: Colour = RGBColor(204, 121, 167);
/// Orange.
pub const YELLOW: Colour = RGBColor(230, 159, 0);
/// Black.
pub const BLACK: Colour = RGBColor(0, 0, 0);
/// Grey, for given values.
pub const GREY: Colour = RGBColor(120, 120, 120);

/// Axis scale: linear or logarithmic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal steps for equal differences.
    Linear,
    /// Equal steps for equal ratios.
    Logarithmic,
}

/// An axis with its quantity and unit.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Quantity and unit.
    pub label: &'static str,
    /// Linear or logarithmic.
    pub scale: Scale,
}

impl Axis {
    /// Creates a linear axis.
    pub const fn linear(label: &'static str) -> Self {
        Self {
            label,
            scale: Scale::Linear,
        }
    }

    /// Creates a logarithmic axis.
    pub const fn logarithmic(label: &'static str) -> Self {
        Self {
            label,
            scale: Scale::Logarithmic,
        }
    }

    /// Position of a value along the axis; `None` where the value has no logarithm.
    fn place(&self, value: f64) -> Option<f64> {
        let place = match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic => value.log10(),
        };
        place.is_finite().then_some(place)
    }

    /// Positions of the marks: one, two or five times a power of ten.
    fn marks(&self, span: &Range<f64>) -> Vec<f64> {
        match self.scale {
            Scale::Linear => {
                let step = step((span.end - span.start) / MARKS);
                let (first, last) = ((span.start / step).ceil(), (span.end / step).floor());
                let count = (last - first).clamp(0.0, 4.0 * MARKS) as u32;
                (0..=count).map(|k| (first + f64::from(k)) * step).collect()
            }
            Scale::Logarithmic => {
                let (first, last) = (span.start.floor() as i32, span.end.ceil() as i32);
                let decades = (first..=last).map(f64::from);
                let places =
                    decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|m: f64| decade + m.log10()));
                places.filter(|place| span.contains(place)).collect()
            }
        }
    }

    /// Label of a mark.
    fn text(&self, place: f64, span: &Range<f64>) -> String {
        match self.scale {
            Scale::Linear => {
                let step = step((span.end - span.start) / MARKS);
                let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
                // Avoids a label of -0.
                let place = if place.abs() < 0.5 * step { 0.0 } else { place };
                format!("{place:.digits$}")
            }
            Scale::Logarithmic => {
                let digits = (-place.floor()).clamp(0.0, 9.0) as usize;
                format!("{:.digits$}", 10_f64.powf(place))
            }
        }
    }
}

/// Approximate number of marks per axis.
const MARKS: f64 = 7.0;

/// Returns the smallest step of 1, 2 or 5 times a power of ten that is not below `least`.
fn step(least: f64) -> f64 {
    let decade = 10_f64.powf(least.log10().floor());
    let factors = [1.0, 2.0, 5.0].map(|factor| factor * decade);
    let above = factors.into_iter().find(|step| *step >= least);
    above.unwrap_or(10.0 * decade)
}

/// The marks of a series.
#[derive(Clone, Debug)]
pub enum Marks {
    /// Points joined by lines.
    Line(Vec<(f64, f64)>),
    /// A dot for each value.
    Points(Vec<(f64, f64)>),
    /// A cross for each value.
    Crosses(Vec<(f64, f64)>),
    /// Error bars: position, lower end, value, upper end.
    Bars(Vec<(f64, f64, f64, f64)>),
}

impl Marks {
    /// All points that must lie within the chart.
    fn corners(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Line(points) | Self::Points(points) | Self::Crosses(points) => points.clone(),
            Self::Bars(bars) => bars
                .iter()
                .flat_map(|&(x, low, middle, high)| [(x, low), (x, middle), (x, high)])
                .collect(),
        }
    }
}

/// Data drawn in one colour under one name.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Colour of its marks.
    pub colour: Colour,
    /// Data and how they are drawn.
    pub marks: Marks,
}

impl Series {
    /// Creates a series with its name for the legend.
    pub fn new(name: &str, colour: Colour, marks: Marks) -> Self {
        Self {
            name: name.to_owned(),
            colour,
            marks,
        }
    }
}

/// Reduces a curve to the minimum and maximum of each piece, in order of time. The drawn curve
/// looks the same.
pub fn thinned(profile: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let piece = profile.len().div_ceil(PIECES).max(1);
    let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
    profile
        .chunks(piece)
        .flat_map(|piece| {
            let mut ends: Vec<(f64, f64)> =
                [piece.iter().min_by(by_value), piece.iter().max_by(by_value)]
                    .into_iter()
                    .flatten()
                    .copied()
                    .collect();
            ends.sort_by(|a, b| a.0.total_cmp(&b.0));
            ends.dedup();
            ends
        })
        .collect()
}

/// An SVG drawing area.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws on a white area of `size` pixels and returns the SVG. White keeps it readable on a dark
/// page.
pub fn svg(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), String>,
) -> Result<String, String> {
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
    area.fill(&WHITE).map_err(|error| error.to_string())?;
    draw(&area)?;
    area.present().map_err(|error| error.to_string())?;
    drop(area);
    Ok(text)
}

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Title above the chart.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// The data; with two or more the chart has a legend.
    pub series: Vec<Series>,
}

impl Chart {
    /// Draws the chart as an `<svg>` element that fills its container on a page.
    pub fn svg(&self) -> Result<String, Failure> {
        let size = (SIZE.0 * ENLARGED, SIZE.1 * ENLARGED);
        let text = svg(size, |area| self.draw(area))
            .map_err(|error| Failure::Refused(format!("cannot draw {:?}: {error}", self.title)))?;
        let fixed = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
        Ok(text.replacen(&fixed, "role=\"img\"", 1))
    }

    fn draw(&self, area: &Area<'_>) -> Result<(), String> {
        let corners = self.series.iter().flat_map(|series| series.marks.corners());
        let (xs, ys): (Vec<f64>, Vec<f64>) = corners
            .filter_map(|(x, y)| Some((self.x.place(x)?, self.y.place(y)?)))
            .unzip();
        let (across, along) = (span(&xs), span(&ys));
        let marks = (self.x.marks(&across), self.y.marks(&along));
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, TITLE_SIZE))
            .margin(4 * ENLARGED)
            .margin_right(14 * ENLARGED)
            .x_label_area_size(38 * ENLARGED)
            .y_label_area_size(58 * ENLARGED)
            .build_cartesian_2d(Marked::new(&across, marks.0), Marked::new(&along, marks.1))
            .map_err(|error| error.to_string())?;
        chart
            .configure_mesh()
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .x_label_formatter(&|place| self.x.text(*place, &across))
            .y_label_formatter(&|place| self.y.text(*place, &along))
            .axis_desc_style((FONT, LABEL_SIZE))
            .label_style((FONT, LABEL_SIZE))
            .light_line_style(TRANSPARENT)
            .bold_line_style(GREY.mix(0.25))
            .draw()
            .map_err(|error| error.to_string())?;
        for series in &self.series {
            self.draw_series(&mut chart, series)?;
        }
        if self.series.len() < 2 {
            return Ok(());
        }
        chart
            .configure_series_labels()
            .position(self.legend_position(&(across, along)))
            .legend_area_size(20 * ENLARGED)
            .label_font((FONT, LABEL_SIZE))
            .background_style(WHITE.mix(0.8))
            .border_style(GREY)
            .draw()
            .map_err(|error| error.to_string())
    }

    /// The corner where the legend hides the fewest points.
    fn legend_position(&self, (across, along): &(Range<f64>, Range<f64>)) -> SeriesLabelPosition {
        let part = |place: f64, span: &Range<f64>| (place - span.start) / (span.end - span.start);
        let places = || {
            let corners = self.series.iter().flat_map(|series| series.marks.corners());
            corners.filter_map(|(x, y)| {
                let (x, y) = (self.x.place(x)?, self.y.place(y)?);
                Some((part(x, across), part(y, along)))
            })
        };
        let hidden = |left: bool, upper: bool| {
            let within = |&(x, y): &(f64, f64)| {
                let x = if left { x } else { 1.0 - x };
                let y = if upper { 1.0 - y } else { y };
                x < LEGEND.0 && y < LEGEND.1
            };
            places().filter(within).count()
        };
        [
            (hidden(true, true), SeriesLabelPosition::UpperLeft),
            (hidden(false, true), SeriesLabelPosition::UpperRight),
            (hidden(true, false), SeriesLabelPosition::LowerLeft),
            (hidden(false, false), SeriesLabelPosition::LowerRight),
        ]
        .into_iter()
        .min_by_key(|(hidden, _)| *hidden)
        .map_or(SeriesLabelPosition::UpperLeft, |(_, position)| position)
    }

    fn draw_series(&self, chart: &mut Context<'_, '_>, series: &Series) -> Result<(), String> {
        let colour = series.colour;
        let at = |&(x, y): &(f64, f64)| Some((self.x.place(x)?, self.y.place(y)?));
        let thick = colour.stroke_width(2 * ENLARGED);
        let drawn = match &series.marks {
            Marks::Line(points) => chart
                .draw_series(LineSeries::new(points.iter().filter_map(at), thick))
                .map_err(|error| error.to_string())?,
            Marks::Points(points) => chart
                .draw_series(
                    points
                        .iter()
                        .filter_map(at)
                        .map(|place| Circle::new(place, ENLARGED, colour.mix(0.45).filled())),
                )
                .map_err(|error| error.to_string())?,
            Marks::Crosses(points) => chart
                .draw_series(
                    points
                        .iter()
                        .filter_map(at)
                        .map(|place| Cross::new(place, 5 * ENLARGED, thick)),
                )
                .map_err(|error| error.to_string())?,
            Marks::Bars(bars) => chart
                .draw_series(bars.iter().filter_map(|&(x, low, middle, high)| {
                    let y = |value| self.y.place(value);
                    Some(ErrorBar::new_vertical(
                        self.x.place(x)?,
                        y(low)?,
                        y(middle)?,
                        y(high)?,
                        colour.stroke_width(2 * ENLARGED),
                        8 * ENLARGED,
                    ))
                }))
                .map_err(|error| error.to_string())?,
        };
        drawn.label(&series.name).legend(move |(x, y)| {
            PathElement::new(
                [(x, y), (x + 14 * ENLARGED as i32, y)],
                colour.stroke_width(2 * ENLARGED),
            )
        });
        Ok(())
    }
}

/// An axis range with the positions of its marks.
struct Marked {
    span: Range<f64>,
    marks: Vec<f64>,
}

impl Marked {
    fn new(span: &Range<f64>, marks: Vec<f64>) -> Self {
        let span = span.clone();
        Self { span, marks }
    }
}

impl Ranged for Marked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let part = (value - self.span.start) / (self.span.end - self.span.start);
        from + (part * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match hint.weight().allow_light_points() {
            true => Vec::new(),
            false => self.marks.clone(),
        }
    }

    fn range(&self) -> Range<f64> {
        self.span.clone()
    }
}

type Context<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Marked, Marked>>;

/// Returns the range from the minimum to the maximum with a margin; never empty.
fn span(places: &[f64]) -> Range<f64> {
    let low = places.iter().copied().fold(f64::INFINITY, f64::min);
    let high = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return 0.0..1.0;
    }
    let room = 0.05 * (high - low);
    let room = if room > 0.0 {
        room
    } else {
        low.abs().max(1.0) * 0.05
    };
    low - room..high + room
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_is_on_white() {
        let text = svg((30, 20), |_| Ok(())).unwrap();
        let (_, first) = text.split_once('\n').unwrap();
        assert!(
            first.starts_with("<rect x=\"0\" y=\"0\" width=\"30\" height=\"20\""),
            "{text}"
        );
        assert!(first.contains("fill=\"#FFFFFF\""), "{text}");
    }
}
