//! Maps of touches: places with their 95 % ellipses over the coils, as SVG.

use std::fmt::Write as _;

use palpate_wire::Command;
use palpate_wire::code::TouchVerdict;
use palpate_wire::command::TouchArray;
use palpate_wire::record::Touch;
use serde::Serialize;

use crate::plot::{BLUE, Colour, GREY, ORANGE};

/// The 95 % region of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Centre, m.
    pub centre_m: [f64; 2],
    /// Larger and smaller half axis, m.
    pub half_axes_m: [f64; 2],
    /// Direction of the larger one, counterclockwise from the x axis, rad.
    pub angle_rad: f64,
}

/// Root of the 95 % quantile of chi-square with two degrees of freedom, -2 ln 0.05.
const QUANTILE: f64 = 2.447_747;

impl Ellipse {
    /// Returns the region of a touch; `None` if it claims no place.
    pub fn of(touch: &Touch) -> Option<Self> {
        let [x, y] = [touch.x_m?, touch.y_m?].map(f64::from);
        let [xs, ys] = [touch.x_sigma_m?, touch.y_sigma_m?].map(f64::from);
        let xy = f64::from(touch.correlation?) * xs * ys;
        let (mean, half) = (0.5 * (xs * xs + ys * ys), 0.5 * (xs * xs - ys * ys));
        let difference = half.hypot(xy);
        let axis = |variance: f64| QUANTILE * variance.max(0.0).sqrt();
        Some(Self {
            centre_m: [x, y],
            half_axes_m: [axis(mean + difference), axis(mean - difference)],
            angle_rad: 0.5 * xy.atan2(half),
        })
    }

    /// Whether a place is within the region.
    pub fn covers(&self, [x_m, y_m]: [f64; 2]) -> bool {
        let [dx, dy] = [x_m - self.centre_m[0], y_m - self.centre_m[1]];
        let (sin, cos) = self.angle_rad.sin_cos();
        let [major_m, minor_m] = self.half_axes_m;
        let [along, across] = [
            (cos * dx + sin * dy) / major_m,
            (cos * dy - sin * dx) / minor_m,
        ];
        along * along + across * across <= 1.0
    }
}

/// Coils of an array, with the disc within which it claims presses.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Array {
    /// Places of the coils' axes, m.
    pub coils_m: Vec<[f64; 2]>,
    /// Centre of the disc, m.
    pub centre_m: [f64; 2],
    /// Radius of the disc, m.
    pub reach_m: f64,
}

/// An array's calibration is a list of numbers in the order of the protocol: index of the disc's
/// first number, count of numbers of a coil (its place first), and count before the coils.
const DISC: usize = 5;
const OF_A_COIL: usize = palpate_wire::command::COIL_NUMBERS;
const BEFORE_COILS: usize = palpate_wire::command::ARRAY_NUMBERS;

impl Array {
    /// Reads the array from its chunks; a later chunk replaces the numbers of an earlier one.
    /// `None` unless all numbers are there.
    pub fn of_chunks<'c>(chunks: impl IntoIterator<Item = &'c TouchArray>) -> Option<Self> {
        let mut numbers: Vec<Option<f64>> = Vec::new();
        for chunk in chunks {
            numbers.resize(chunk.total.into(), None);
            let places = numbers.iter_mut().skip(chunk.first.into());
            for (place, number) in places.zip(&chunk.numbers) {
                *place = Some(f64::from(*number));
            }
        }
        let numbers: Vec<f64> = numbers.into_iter().collect::<Option<_>>()?;
        let disc = numbers.get(DISC..DISC + 3)?;
        let coils = numbers.get(BEFORE_COILS..)?.chunks_exact(OF_A_COIL);
        Some(Self {
            coils_m: coils.map(|coil| [coil[0], coil[1]]).collect(),
            centre_m: [disc[0], disc[1]],
            reach_m: disc[2],
        })
    }

    /// Reads the array from the commands that set it.
    pub fn of_commands<'c>(commands: impl IntoIterator<Item = &'c Command>) -> Option<Self> {
        Self::of_chunks(commands.into_iter().filter_map(|command| match command {
            Command::SetTouchArray(chunk) => Some(chunk),
            _ => None,
        }))
    }

    /// Half of the side of a square about the origin that has the coils, the disc and these places.
    fn half_side_m(&self, places_m: impl Iterator<Item = [f64; 2]>) -> f64 {
        let [x, y] = self.centre_m.map(f64::abs);
        let all = self.coils_m.iter().copied().chain(places_m);
        let farthest = all.map(|[x, y]| x.abs().max(y.abs()));
        farthest.fold(x.max(y) + self.reach_m, f64::max)
    }
}

/// A map of one touch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TouchMap {
    /// Heading.
    pub title: String,
    /// The array.
    pub array: Array,
    /// True path, m; empty if it is not known.
    pub truth_m: Vec<[f64; 2]>,
    /// Claimed regions, in the order of time.
    pub found: Vec<Ellipse>,
}

/// Size of a map, px, and the part of it beside the square of the array.
const SIDE: f64 = 360.0;
const MARGIN: f64 = 26.0;

/// Draws maps side by side, two in a row.
pub fn svg(maps: &[TouchMap]) -> String {
    let columns = maps.len().clamp(1, 2);
    let [width, height] = [columns, maps.len().div_ceil(columns).max(1)].map(|n| n as f64 * SIDE);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
    );
    for (number, map) in maps.iter().enumerate() {
        let [x, y] = [number % columns, number / columns].map(|n| n as f64 * SIDE);
        let _ = writeln!(text, "<g transform=\"translate({x} {y})\">");
        map.draw(&mut text);
        text.push_str("</g>\n");
    }
    text.push_str("</svg>\n");
    text
}

impl TouchMap {
    /// Draws the map into a square; writing to a `String` cannot fail.
    fn draw(&self, text: &mut String) {
        let found = self.found.iter().map(|of| of.centre_m);
        let half_m = self
            .array
            .half_side_m(self.truth_m.iter().copied().chain(found));
        let half_m = (1.1 * half_m).max(1e-3);
        let scale = (0.5 * SIDE - MARGIN) / half_m;
        let place = |[x_m, y_m]: [f64; 2]| [0.5 * SIDE + scale * x_m, 0.5 * SIDE - scale * y_m];
        let [grey, blue, orange] = [GREY, BLUE, ORANGE].map(name);
        let title = escaped(&self.title);
        let middle = 0.5 * SIDE;
        let _ = writeln!(
            text,
            "<text x=\"{middle}\" y=\"17\" text-anchor=\"middle\" font-size=\"14\">{title}</text>"
        );
        let [x, y] = place(self.array.centre_m);
        let _ = writeln!(
            text,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"none\" stroke=\"{grey}\" stroke-dasharray=\"4 4\"/>",
            scale * self.array.reach_m
        );
        for (number, coil_m) in self.array.coils_m.iter().enumerate() {
            let [x, y] = place(*coil_m);
            let _ = writeln!(
                text,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"9\" fill=\"#eee\" stroke=\"{grey}\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{grey}\">{number}</text>",
                y + 4.0
            );
        }
        let bar = millimetres(half_m);
        let [left, bottom] = [MARGIN, SIDE - 10.0];
        let _ = writeln!(
            text,
            "<path d=\"M{left} {bottom}h{:.1}\" stroke=\"#111\" stroke-width=\"2\"/><text x=\"{left}\" y=\"{:.1}\">{bar} mm</text>",
            1e-3 * bar * scale,
            bottom - 5.0
        );
        for of in &self.found {
            let [x, y] = place(of.centre_m);
            let [major, minor] = of.half_axes_m.map(|of| (scale * of).max(0.6));
            let _ = writeln!(
                text,
                "<ellipse cx=\"{x:.1}\" cy=\"{y:.1}\" rx=\"{major:.1}\" ry=\"{minor:.1}\" transform=\"rotate({:.0} {x:.1} {y:.1})\" \
                 fill=\"{blue}\" fill-opacity=\"0.05\" stroke=\"{blue}\" stroke-width=\"0.7\"/>",
                -of.angle_rad.to_degrees()
            );
        }
        if !self.truth_m.is_empty() {
            let places: Vec<_> = self.truth_m.iter().map(|at| place(*at)).collect();
            let points = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}"));
            let points = points.collect::<Vec<_>>().join(" ");
            let _ = writeln!(
                text,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{orange}\" stroke-width=\"1.2\"/>"
            );
            for [x, y] in places.first().into_iter().chain(places.last()) {
                let _ = writeln!(
                    text,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{orange}\"/>"
                );
            }
            let right = SIDE - MARGIN;
            let _ = writeln!(
                text,
                "<text x=\"{right}\" y=\"{:.1}\" text-anchor=\"end\"><tspan fill=\"{orange}\">truth</tspan>, \
                 <tspan fill=\"{blue}\">95 % regions</tspan></text>",
                bottom - 5.0
            );
        }
    }
}

/// The largest round length, mm, that is at most half of the map's half side.
fn millimetres(half_m: f64) -> f64 {
    let rounds = [100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5];
    let mut fitting = rounds.into_iter().filter(|mm| 1e-3 * mm <= 0.5 * half_m);
    fitting.next().unwrap_or(0.2)
}

fn name(Colour(red, green, blue): Colour) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

/// A verdict in words.
pub fn verdict(of: TouchVerdict) -> String {
    of.name().replace('_', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(x_sigma_m: f32, y_sigma_m: f32, correlation: f32) -> Touch {
        Touch {
            verdict: TouchVerdict::Inside,
            x_m: Some(1e-3),
            y_m: Some(-2e-3),
            x_sigma_m: Some(x_sigma_m),
            y_sigma_m: Some(y_sigma_m),
            correlation: Some(correlation),
            force_n: Some(1.0),
            force_uncertainty: Some(0.01),
            radius_m: None,
            radius_uncertainty: None,
            chi_square: Some(1.0),
        }
    }

    #[test]
    fn an_ellipse_has_the_axes_of_its_covariance() {
        // An ellipse turned by 30 degrees, with sigmas of 3 and 1 um along its axes.
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let [xx, yy, xy] = [
            9.0 * cos * cos + sin * sin,
            9.0 * sin * sin + cos * cos,
            8.0 * sin * cos,
        ];
        let correlation = xy / (xx * yy).sqrt();
        let [xs, ys] = [xx, yy].map(|of| (1e-6 * of.sqrt()) as f32);
        let ellipse = Ellipse::of(&touch(xs, ys, correlation as f32)).unwrap();
        let [major, minor] = ellipse.half_axes_m.map(|of| 1e6 * of / QUANTILE);
        assert!(
            (major - 3.0).abs() < 1e-4 && (minor - 1.0).abs() < 1e-4,
            "{ellipse:?}"
        );
        assert!(
            (ellipse.angle_rad.to_degrees() - 30.0).abs() < 1e-3,
            "{ellipse:?}"
        );
        let along = |r: f64| [1e-3 + r * cos, -2e-3 + r * sin];
        assert!(ellipse.covers(along(7.3e-6)) && !ellipse.covers(along(7.4e-6)));
        assert!(!ellipse.covers([1e-3 - 3e-6 * sin, -2e-3 + 3e-6 * cos]));
    }

    #[test]
    fn an_array_is_read_from_its_chunks_only_if_whole() {
        let total = BEFORE_COILS + 2 * OF_A_COIL;
        let number = |index: usize| match index {
            5 => 1e-3,
            7 => 4e-3,
            _ if index == BEFORE_COILS + OF_A_COIL => -3e-3,
            _ => 0.0,
        };
        let chunk = |first: usize| TouchArray {
            total: total as u8,
            first: first as u8,
            numbers: (first..total.min(first + 16)).map(number).collect(),
        };
        let chunks: Vec<_> = (0..total).step_by(16).map(chunk).collect();
        let array = Array::of_chunks(&chunks).unwrap();
        assert_eq!(array.coils_m.len(), 2);
        assert!((array.coils_m[1][0] + 3e-3).abs() < 1e-9);
        assert!((array.reach_m - 4e-3).abs() < 1e-9 && (array.centre_m[0] - 1e-3).abs() < 1e-9);
        assert_eq!(Array::of_chunks(&chunks[1..]), None);
        assert_eq!(Array::of_chunks([]), None);
    }

    #[test]
    fn a_map_has_coils_path_and_regions() {
        let map = TouchMap {
            title: "a < b".to_owned(),
            array: Array {
                coils_m: vec![[0.0; 2], [6e-3, 0.0]],
                centre_m: [0.0; 2],
                reach_m: 4e-3,
            },
            truth_m: vec![[0.0; 2], [1e-3, 0.0]],
            found: vec![Ellipse::of(&touch(1e-4, 1e-4, 0.0)).unwrap()],
        };
        let text = svg(&[map]);
        assert!(
            text.contains("a &lt; b") && text.matches("<ellipse").count() == 1,
            "{text}"
        );
        assert!(
            text.matches("<circle").count() == 5 && text.contains("<polyline"),
            "{text}"
        );
    }
}
