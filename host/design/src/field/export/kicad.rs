//! Windings as KiCad 9 footprints: tracks on their layers, plated holes, the board's edge.

use std::fmt::Write as _;

use super::winding::{Hole, Place, Winding};

/// A place in millimetres as KiCad has it, downwards.
fn place([y, z]: Place) -> String {
    format!("{:.4} {:.4}", 1e3 * y, -1e3 * z)
}

/// The pads that one conductor joins.
fn tie(holes: &[Hole]) -> String {
    let mut numbers: Vec<u8> = holes.iter().map(|hole| hole.number).collect();
    numbers.sort_unstable();
    let numbers: Vec<String> = numbers.iter().map(u8::to_string).collect();
    format!("\"{}\"", numbers.join(", "))
}

/// Text of a footprint. The winding joins its pads, which KiCad allows in a group of net ties.
pub(super) fn footprint(name: &str, about: &str, winding: &Winding) -> String {
    let mut text = format!(
        "(footprint \"{name}\"\n\t(version 20241229)\n\t(generator \"palpate\")\n\t(layer \"F.Cu\")\n\t(descr \"{about}\")\n"
    );
    let middle = "(effects (font (size 1 1) (thickness 0.15)))";
    for (key, value, y, layer) in [
        ("Reference", "REF**", -1, "SilkS"),
        ("Value", name, 1, "Fab"),
    ] {
        let _ = writeln!(
            text,
            "\t(property \"{key}\" \"{value}\" (at 0 {y} 0) (layer \"F.{layer}\") (hide yes) {middle})"
        );
    }
    let ties: Vec<String> = winding.holes.chunks(3).map(tie).collect();
    let _ = writeln!(
        text,
        "\t(attr through_hole)\n\t(net_tie_pad_groups {})",
        ties.join(" ")
    );
    let mut line = |from: Place, to: Place, width_m: f64, layer: &str| {
        let _ = writeln!(
            text,
            "\t(fp_line (start {}) (end {}) (stroke (width {:.4}) (type solid)) (layer \"{layer}\"))",
            place(from),
            place(to),
            1e3 * width_m
        );
    };
    for track in &winding.tracks {
        let layer = if track.front { "F.Cu" } else { "B.Cu" };
        for ends in track.places.windows(2) {
            line(ends[0], ends[1], track.width_m, layer);
        }
    }
    for edge in &winding.edges {
        for (from, to) in edge.iter().zip(edge.iter().cycle().skip(1)) {
            line(*from, *to, 0.05e-3, "Edge.Cuts");
        }
    }
    for hole in &winding.holes {
        let _ = writeln!(
            text,
            "\t(pad \"{}\" thru_hole circle (at {}) (size {2:.4} {2:.4}) (drill {3:.4}) (layers \"*.Cu\" \"*.Mask\"))",
            hole.number,
            place(hole.place),
            1e3 * hole.diameter_m,
            1e3 * hole.drill_m()
        );
    }
    text.push_str(")\n");
    text
}
