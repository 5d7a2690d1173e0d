//! Drawings in DXF of the oldest format (R12), which every program reads: groups of a code and a value, a line each.

use std::fmt::Write as _;

use palpate_field::design::Design;
use palpate_field::geometry::shape::Shape;

use super::solid::corners;
use super::winding::{Place, Winding};

/// A drawing in millimetres.
pub(super) struct Drawing(String);

impl Drawing {
    pub(super) fn new() -> Self {
        // $INSUNITS 4: millimetres.
        Self(groups(&[
            (0, "SECTION"),
            (2, "HEADER"),
            (9, "$ACADVER"),
            (1, "AC1009"),
            (9, "$INSUNITS"),
            (70, "4"),
            (0, "ENDSEC"),
            (0, "SECTION"),
            (2, "ENTITIES"),
        ]))
    }

    /// Adds a line of this width through places in metres.
    fn line(&mut self, layer: &str, places: &[Place], width_m: f64, closed: bool) {
        let width = format!("{:.4}", 1e3 * width_m);
        let closed = if closed { "1" } else { "0" };
        self.0.push_str(&groups(&[
            (0, "POLYLINE"),
            (8, layer),
            (66, "1"),
            (70, closed),
            (40, &width),
            (41, &width),
        ]));
        for place in places {
            let [x, y] = place.map(|coordinate| format!("{:.4}", 1e3 * coordinate));
            self.0
                .push_str(&groups(&[(0, "VERTEX"), (8, layer), (10, &x), (20, &y)]));
        }
        self.0.push_str(&groups(&[(0, "SEQEND"), (8, layer)]));
    }

    fn circle(&mut self, layer: &str, place: Place, diameter_m: f64) {
        let [x, y] = place.map(|coordinate| format!("{:.4}", 1e3 * coordinate));
        let radius = format!("{:.4}", 0.5e3 * diameter_m);
        self.0.push_str(&groups(&[
            (0, "CIRCLE"),
            (8, layer),
            (10, &x),
            (20, &y),
            (40, &radius),
        ]));
    }

    pub(super) fn text(mut self) -> String {
        self.0.push_str(&groups(&[(0, "ENDSEC"), (0, "EOF")]));
        self.0
    }
}

fn groups(groups: &[(u32, &str)]) -> String {
    groups
        .iter()
        .fold(String::new(), |mut text, (code, value)| {
            let _ = writeln!(text, "{code}\n{value}");
            text
        })
}

/// A board from its front: layers FRONT, BACK, HOLES and EDGE.
pub(super) fn board(winding: &Winding) -> String {
    let mut drawing = Drawing::new();
    for track in &winding.tracks {
        let layer = if track.front { "FRONT" } else { "BACK" };
        drawing.line(layer, &track.places, track.width_m, false);
    }
    for hole in &winding.holes {
        drawing.circle("HOLES", hole.place, hole.drill_m());
    }
    for edge in &winding.edges {
        drawing.line("EDGE", edge, 0.0, true);
    }
    drawing.text()
}

/// The section through all bodies and plates, r to the right and x upwards, each on a layer of its name.
pub(super) fn section(design: &Design) -> String {
    let mut drawing = Drawing::new();
    for part in &design.parts {
        let mut outline = |shape: &Shape, cut: &str| {
            let layer = format!("{}{cut}", super::file_stem(&part.name));
            drawing.line(&layer, &corners(shape), 0.0, true);
        };
        outline(&part.shape, "");
        part.minus.iter().for_each(|cut| outline(cut, "_cut_out"));
    }
    drawing.text()
}
