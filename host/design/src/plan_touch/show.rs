//! Maps as a table and as JSON.

use std::fmt::Write as _;

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use super::coupling;
use super::errors::Limits;
use super::inside::Shape;
use super::layout::{Layout, Noise, Radius};
use super::map::{Map, Press};

/// Names of the determined quantities.
pub(super) const QUANTITIES: [&str; 3] = ["place", "force", "radius"];
/// Channels of a converter, the LDC1614.
const CHANNELS: usize = 4;
/// Distance from the edge, in thicknesses, where a wide layer's response has decayed to e^(-0.74 * 3), a tenth.
const FROM_EDGE: f64 = 3.0;

/// Formats the maps for the terminal.
pub(super) fn text(layout: &Layout, limits: &Limits, maps: &[Map]) -> String {
    let mut text = heading(layout, maps);
    // Writing to a `String` cannot fail.
    let _ = writeln!(
        text,
        "\nStandard errors of a press, and the share of the inside within each limit and all of them:\n{}",
        table(limits, maps)
    );
    for map in maps {
        text.push_str(&remarks(map, limits));
    }
    text.push_str(&coupling::text(layout));
    text.push_str(&edge(layout));
    text.push_str("A linear calculation for a design.\n");
    text
}

fn heading(layout: &Layout, maps: &[Map]) -> String {
    let coils = layout.coils.len();
    let converters = coils.div_ceil(CHANNELS);
    let plural = |count: usize| if count == 1 { "" } else { "s" };
    let inside = &layout.inside;
    let shape = match inside.shape {
        Shape::Disc => format!("disc of {:.1} mm radius", 1e3 * inside.reach_m()),
        Shape::Hull => "hull of the centres".to_owned(),
    };
    let noise = match layout.noise {
        Noise::Approach(noise_m) => format!("{:.3} um", 1e6 * noise_m),
        Noise::Relative(noise) => format!("{noise:.1e} of the inductance"),
    };
    let radius = match layout.radius {
        Radius::Free(_) => "free".to_owned(),
        Radius::Declared(_, tolerance) => format!("declared within {:.1} %", 100.0 * tolerance),
    };
    format!(
        "Layout {}: {coils} coil{} on {converters} converter{}; layer {:.2} mm, G {:.1} kPa, nu {:.3}\n\
         Inside: {shape} (outermost centres at {:.1} mm, margin {:.1} mm); {} presses of {:.2} N, radius {radius}\n\
         Errors of a reading: noise {noise}, gain {:.1} %\n",
        layout.name,
        plural(coils),
        plural(converters),
        1e3 * layout.layer.thickness_m,
        1e-3 * layout.layer.shear_modulus_pa,
        layout.layer.poisson,
        1e3 * inside.outermost_m,
        1e3 * inside.margin_m,
        maps.first().map_or(0, |map| map.presses.len()),
        layout.force_n,
        100.0 * layout.gain_error,
    )
}

fn table(limits: &Limits, maps: &[Map]) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["contact", "error of", "limit", "within", "median", "worst"]);
    for map in maps {
        let contact = format!("{:.1} mm", 1e3 * map.radius_m);
        for (index, name) in QUANTITIES.into_iter().enumerate() {
            let [median, worst] = map.median_and_worst(index);
            table.add_row([
                if index == 0 {
                    contact.clone()
                } else {
                    String::new()
                },
                name.to_owned(),
                error(index, limits.all()[index]),
                percent(map.share(|press| press.within[index])),
                error(index, median),
                error(index, worst),
            ]);
        }
        let all = percent(map.share(|press| press.within == [true; 3]));
        table.add_row(["", "all at once", "", &all, "", ""]);
    }
    for column in table.column_iter_mut().filter(|column| column.index != 1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Formats an error of place (0), force (1) or radius (2).
fn error(quantity: usize, value: f64) -> String {
    match (value.is_finite(), quantity) {
        (false, _) => "not determined".to_owned(),
        (true, 0) => format!("{:.3} mm", 1e3 * value),
        (true, _) => format!("{:.2} %", 100.0 * value),
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Greatest reading, and the least determined combination.
fn remarks(map: &Map, limits: &Limits) -> String {
    let contact = format!("Contact of {:.1} mm:", 1e3 * map.radius_m);
    let [approach_m, share] = map.greatest_approach;
    let mut text = format!(
        "{contact} the greatest mean approach at a coil is {:.3} mm, {:.0} % of its depth{}.\n",
        1e3 * approach_m,
        100.0 * share,
        if share > LINEAR {
            ": too much for a linear calculation, lower force_N"
        } else {
            ""
        }
    );
    let undetermined = map.undetermined();
    if undetermined > 0 {
        let _ = writeln!(
            text,
            "{contact} at {undetermined} of {} places the readings leave a combination undetermined.",
            map.presses.len()
        );
    }
    if let Some(worst) = map.worst(limits) {
        let _ = writeln!(
            text,
            "{contact} least is known at x {:.2}, y {:.2} mm. {} {} there.",
            1e3 * worst.at_m[0],
            1e3 * worst.at_m[1],
            combination(worst, limits),
            if worst.errors.is_undetermined {
                "changes no reading"
            } else {
                "changes the readings least"
            }
        );
    }
    text
}

/// Formats the least determined combination of a press. Parts below a twentieth of a limit are left out.
fn combination(press: &Press, limits: &Limits) -> String {
    let parts = ["x", "y", "force", "radius"]
        .into_iter()
        .zip(press.errors.weakest);
    let parts = parts
        .zip(limits.units())
        .filter_map(|((name, part), limit)| {
            if part.abs() < NEGLIGIBLE * limit {
                return None;
            }
            Some(match name {
                "x" | "y" => format!("{name} by {:+.2} mm", 1e3 * part),
                _ => format!("{name} by {:+.1} %", 100.0 * part),
            })
        });
    let parts: Vec<String> = parts.collect();
    match parts.split_last() {
        Some((last, others)) if !others.is_empty() => {
            format!("A change of {} and {last}", others.join(", "))
        }
        _ => format!("A change of {}", parts.concat()),
    }
}

/// Greatest approach in units of the depth. At this approach the reading of a built-in coil per displacement has changed by 5 to
/// 10 % (a test).
const LINEAR: f64 = 0.1;
/// Part of a limit below which a change is not named.
const NEGLIGIBLE: f64 = 0.05;

/// States that the inside lies near the layer's edge.
fn edge(layout: &Layout) -> String {
    let inside = &layout.inside;
    let [x, y] = inside.middle_m.map(f64::abs);
    let distance_m = 0.5 * layout.width_m - x.max(y) - inside.reach_m();
    let least_m = FROM_EDGE * layout.layer.thickness_m;
    if distance_m >= least_m {
        return String::new();
    }
    format!(
        "The inside comes within {:.1} mm of the layer's edge, less than three thicknesses ({:.1} mm): this calculation is for a \
         wide layer.\n",
        1e3 * distance_m,
        1e3 * least_m
    )
}

/// The maps as JSON.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct TouchDocument<'l> {
    layout: &'l str,
    coils: usize,
    converters: usize,
    force_N: f64,
    limits: LimitsEntry,
    contacts: Vec<ContactEntry>,
}

#[derive(Serialize)]
struct LimitsEntry {
    place_m: f64,
    force_ln: f64,
    radius_ln: f64,
}

/// Result for one radius of contact. Errors that are not determined are `null`.
#[derive(Serialize)]
struct ContactEntry {
    radius_m: f64,
    presses: usize,
    undetermined: usize,
    within_all: f64,
    greatest_approach_m: f64,
    place_m: ErrorEntry,
    force_ln: ErrorEntry,
    radius_ln: ErrorEntry,
    worst: Option<WorstEntry>,
}

#[derive(Serialize)]
struct ErrorEntry {
    within: f64,
    median: Option<f64>,
    worst: Option<f64>,
}

/// The least determined press, with the combination that changes its readings least.
#[derive(Serialize)]
struct WorstEntry {
    x_m: f64,
    y_m: f64,
    is_undetermined: bool,
    by_x_m: f64,
    by_y_m: f64,
    by_force_ln: f64,
    by_radius_ln: f64,
}

/// Formats the maps as one JSON object.
pub(super) fn json(layout: &Layout, limits: &Limits, maps: &[Map]) -> serde_json::Result<String> {
    let contact = |map: &Map| {
        let finite = |value: f64| value.is_finite().then_some(value);
        let quantity = |index: usize| {
            let [median, worst] = map.median_and_worst(index);
            ErrorEntry {
                within: map.share(|press| press.within[index]),
                median: finite(median),
                worst: finite(worst),
            }
        };
        let worst = map.worst(limits).map(|press| {
            let [by_x_m, by_y_m, by_force_ln, by_radius_ln] = press.errors.weakest;
            WorstEntry {
                x_m: press.at_m[0],
                y_m: press.at_m[1],
                is_undetermined: press.errors.is_undetermined,
                by_x_m,
                by_y_m,
                by_force_ln,
                by_radius_ln,
            }
        });
        ContactEntry {
            radius_m: map.radius_m,
            presses: map.presses.len(),
            undetermined: map.undetermined(),
            within_all: map.share(|press| press.within == [true; 3]),
            greatest_approach_m: map.greatest_approach[0],
            place_m: quantity(0),
            force_ln: quantity(1),
            radius_ln: quantity(2),
            worst,
        }
    };
    serde_json::to_string(&TouchDocument {
        layout: &layout.name,
        coils: layout.coils.len(),
        converters: layout.coils.len().div_ceil(CHANNELS),
        force_N: layout.force_n,
        limits: LimitsEntry {
            place_m: limits.place_m,
            force_ln: limits.force_ln,
            radius_ln: limits.radius_ln,
        },
        contacts: maps.iter().map(contact).collect(),
    })
}
