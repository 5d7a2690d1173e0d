//! Drawings in DXF of the oldest format (R12), which every program reads: groups of a code and a value, a line each.

use std::fmt::Write as _;

use palpate_field::design::Design;
use palpate_field::geometry::shape::Shape;

use super::solid::corners;
use super::winding::{Place, Tab, Winding};

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

    /// Adds letters 1.5 mm high.
    fn text_at(&mut self, layer: &str, place: Place, letters: &str) {
        let [x, y] = place.map(|coordinate| format!("{:.4}", 1e3 * coordinate));
        self.0.push_str(&groups(&[
            (0, "TEXT"),
            (8, layer),
            (10, &x),
            (20, &y),
            (40, "1.5"),
            (1, letters),
        ]));
    }

    pub(super) fn text(mut self) -> String {
        self.0.push_str(&groups(&[(0, "ENDSEC"), (0, "EOF")]));
        self.0
    }
}

/// Play of a tab in its slot, on either side, m.
const PLAY_M: f64 = 0.25e-3;
/// Overlap below which two parts only touch, m.
const TOUCH_M: f64 = 1e-6;

/// Name and drawing, from above, of each iron part through which tabs of the boards lead, with its slots. Layers
/// OUTLINE, SLOT and NOTE; the note has the heights of the slots.
pub(super) fn slotted(design: &Design, windings: &[Winding]) -> Vec<(String, String)> {
    let parts = design.parts.iter().filter(|part| !part.cast);
    let drawn = parts.filter_map(|part| {
        let corners = corners(&part.shape);
        let [r_m, x_m] = [0, 1].map(|axis| ends(corners.iter().map(|corner| corner[axis])));
        let tabs: Vec<Tab> = windings.iter().flat_map(Winding::tabs).collect();
        let meet = |a: [f64; 2], b: [f64; 2]| a[0] < b[1] - TOUCH_M && b[0] < a[1] - TOUCH_M;
        let through = tabs
            .iter()
            .filter(|tab| meet(tab.r_m, r_m) && meet(tab.x_m, x_m));
        let through: Vec<&Tab> = through.collect();
        (!through.is_empty()).then(|| (part.name.clone(), slots(r_m, &through)))
    });
    drawn.collect()
}

/// A ring from above with slots from its inner to its outer edge.
fn slots([inner_m, outer_m]: [f64; 2], tabs: &[&Tab]) -> String {
    let mut drawing = Drawing::new();
    for radius_m in [inner_m, outer_m]
        .into_iter()
        .filter(|radius_m| *radius_m > 0.0)
    {
        drawing.circle("OUTLINE", [0.0; 2], 2.0 * radius_m);
    }
    for tab in tabs {
        let (sin, cos) = tab.angle.sin_cos();
        let half_m = tab.half_m + PLAY_M;
        let from_m = inner_m.max(tab.r_m[0] - PLAY_M);
        let corner =
            |[along, across]: Place| [along * cos - across * sin, along * sin + across * cos];
        let corners = [
            [from_m, -half_m],
            [outer_m, -half_m],
            [outer_m, half_m],
            [from_m, half_m],
        ];
        drawing.line("SLOT", &corners.map(corner), 0.0, true);
        let [low, high] = tab.x_m.map(|x_m| 1e3 * x_m);
        let note = format!("x = {low:.2} to {high:.2} mm");
        drawing.text_at("NOTE", corner([1.05 * outer_m, 0.0]), &note);
    }
    drawing.text()
}

fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
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

#[cfg(test)]
mod tests {
    use palpate_field::design::builtin;

    use super::*;

    /// The tabs of both boards of `closed` pass its rims, and no other part.
    #[test]
    fn tabs_have_slots_in_the_iron_that_they_pass() {
        let design = builtin("closed").unwrap();
        let windings = Winding::all(&design, 0.2e-3).unwrap();
        let drawings = slotted(&design, &windings);
        let slots: Vec<(&str, usize)> = drawings
            .iter()
            .map(|(name, text)| (name.as_str(), text.matches("\nPOLYLINE\n").count()))
            .collect();
        println!("{slots:?}");
        assert!(
            !slots.is_empty() && slots.iter().all(|(_, count)| *count == 2),
            "{slots:?}"
        );
        assert!(
            slots.iter().all(|(name, _)| name.contains("rim")),
            "{slots:?}"
        );
        let air = builtin("air").unwrap();
        assert!(slotted(&air, &Winding::all(&air, 0.2e-3).unwrap()).is_empty());
    }
}
