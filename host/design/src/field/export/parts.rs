//! The list of what a design is made of: wire, resistance, inductance, heat, volumes.

use palpate_cli::failure::Failure;
use palpate_field::design::Design;

use super::solid::{corners, volume_m3};
use super::trip::{RoundTrip, Series};
use super::winding::Winding;

/// A table of part, quantity, value and unit.
pub(super) fn table(
    design: &Design,
    windings: &[Winding],
    trips: &[(Series<'_>, RoundTrip)],
) -> Result<Vec<u8>, Failure> {
    let mut rows: Vec<[String; 4]> = Vec::new();
    let mut row = |part: &str, quantity: &str, value: f64, unit: &str| {
        rows.push([
            part.to_owned(),
            quantity.to_owned(),
            format!("{value:.6}"),
            unit.to_owned(),
        ]);
    };
    for winding in windings {
        let name = &winding.name;
        row(name, "length of the track", winding.length_m(), "m");
        row(
            name,
            "resistance at 20 C",
            winding.resistance_ohm(design.resistivity_ohm_m),
            "ohm",
        );
        for track in winding.tracks.iter().take(1) {
            row(name, "width of the track", 1e3 * track.width_m, "mm");
            row(
                name,
                "thickness of the copper",
                1e6 * track.thickness_m,
                "um",
            );
        }
        row(name, "clearance", 1e3 * winding.clearance_m, "mm");
        row(name, "between the layers", 1e3 * winding.depth_m, "mm");
    }
    for (series, trip) in trips {
        row(
            &series.name,
            "inductance in air",
            1e6 * trip.inductance_in_air_h,
            "uH",
        );
        if let Some(current_a) = series.current_a {
            let resistances = series.windings.iter();
            let resistance: f64 = resistances
                .map(|winding| winding.resistance_ohm(design.resistivity_ohm_m))
                .sum();
            row(&series.name, "current", current_a, "A");
            row(
                &series.name,
                "heat at the current",
                current_a * current_a * resistance,
                "W",
            );
        }
    }
    for part in &design.parts {
        let cut: f64 = part
            .minus
            .iter()
            .map(|shape| volume_m3(&corners(shape)))
            .sum();
        let volume_m3 = volume_m3(&corners(&part.shape)) - cut;
        row(
            &part.name,
            &format!("volume of {}, by its outline", part.material_name),
            1e6 * volume_m3,
            "cm3",
        );
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    let written = writer.write_record(["part", "quantity", "value", "unit"]);
    written.map_err(Failure::refused)?;
    for row in rows {
        writer.write_record(row).map_err(Failure::refused)?;
    }
    writer.into_inner().map_err(Failure::refused)
}
