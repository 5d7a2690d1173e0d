//! `palpate field sensing`: inductance of the sensing coil against its gap, and the effect of a
//! stray field. The inductance is computed by the simulation, in `palpate_sim::sensing_coil`.

use std::io::{self, Write};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::quantity::within;
use palpate_field::material::Material;
use palpate_sim::sensing_coil::integral::{CoilIntegral, LEAST_GAP_M};
use palpate_sim::sensing_coil::{CoilDesign, Sides};
use serde::Serialize;

/// Inductance of the sensing coil against its gap
#[derive(Args)]
#[command(after_help = "\
A planar spiral between slabs of elastomer that are wide against it, at a constant field, in closed form: \
rings with an even current over each track. Losses, slabs of finite width and copper near it are in \
`palpate field ac`. The frequency is that of the coil with --capacitance, its slope that of both gaps together.

Example:
  palpate field sensing --gap 0.2,0.5,1,2 --turns 20 --track 0.12")]
pub(super) struct Arguments {
    /// Gaps between coil and slabs, mm, separated by commas
    #[arg(long, value_name = "MM", value_delimiter = ',', default_values_t = [0.2, 0.5, 1.0, 1.5, 2.0, 3.0], value_parser = within(1e3 * LEAST_GAP_M, 3.0, "mm"))]
    gap: Vec<f64>,
    /// Outer diameter, mm
    #[arg(long, value_name = "MM", default_value_t = 14.0)]
    outer: f64,
    /// Inner diameter, mm
    #[arg(long, value_name = "MM", default_value_t = 4.0)]
    inner: f64,
    /// Turns
    #[arg(long, default_value_t = 25)]
    turns: u32,
    /// Width of the tracks, mm; half of the pitch without it
    #[arg(long, value_name = "MM")]
    track: Option<f64>,
    /// Thickness of each slab, mm
    #[arg(long, value_name = "MM", default_value_t = 2.0)]
    slab: f64,
    /// Relative permeability of the slabs
    #[arg(long, default_value_t = 3.7)]
    mu_r: f64,
    /// A slab on one side only
    #[arg(long)]
    one_side: bool,
    /// Capacitance of the tank, pF
    #[arg(long, value_name = "PF", default_value_t = 330.0, value_parser = within(1.0, 1e6, "pF"))]
    capacitance: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Result at one gap.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct AtGap {
    gap_m: f64,
    inductance_H: f64,
    inductance_by_gap_H_per_m: f64,
    frequency_Hz: f64,
    /// Relative change of the frequency per metre of gap.
    frequency_change_per_m: f64,
}

/// Half of the step between the points of a slope, m. At the smallest gap the cubic error is below
/// 1e-7 of the slope.
const STEP_M: f64 = 1e-8;

impl AtGap {
    fn of(coil: &CoilIntegral, capacitance_f: f64, gap_m: f64) -> Self {
        let inductance_h = coil.inductance_h(gap_m);
        // The lower point is not below the smallest gap, where the inductance becomes constant.
        let [low, high] = [(gap_m - STEP_M).max(LEAST_GAP_M), gap_m + STEP_M];
        let slope = (coil.inductance_h(high) - coil.inductance_h(low)) / (high - low);
        Self {
            gap_m,
            inductance_H: inductance_h,
            inductance_by_gap_H_per_m: slope,
            frequency_Hz: 1.0 / (core::f64::consts::TAU * (inductance_h * capacitance_f).sqrt()),
            frequency_change_per_m: -0.5 * slope / inductance_h,
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = CoilDesign {
        outer_diameter_m: 1e-3 * arguments.outer,
        inner_diameter_m: 1e-3 * arguments.inner,
        turns: arguments.turns,
        sides: if arguments.one_side {
            Sides::One
        } else {
            Sides::Both
        },
        slab_m: 1e-3 * arguments.slab,
        relative_permeability: arguments.mu_r,
        ..CoilDesign::REFERENCE
    };
    design
        .check()
        .map_err(|error| Failure::Argument(error.to_string()))?;
    let pitch_m = design.pitch_m();
    let track_m = arguments.track.map_or(0.5 * pitch_m, |track| 1e-3 * track);
    if !(1e-6..=pitch_m).contains(&track_m) {
        return Err(Failure::Argument(format!(
            "--track: {} mm is out of range; allowed: 0.001 mm to the pitch of {} mm",
            1e3 * track_m,
            1e3 * pitch_m
        )));
    }
    let coil = CoilIntegral::of_tracks(design, None, track_m);
    let capacitance_f = 1e-12 * arguments.capacitance;
    let at = |gap_mm: &f64| AtGap::of(&coil, capacitance_f, 1e-3 * gap_mm);
    let rows: Vec<AtGap> = arguments.gap.iter().map(at).collect();
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        return Ok(writeln!(out)?);
    }
    let in_air = 1e6 * design.inductance_of_tracks_in_air_h(track_m);
    writeln!(out, "L {in_air:.5} uH without slabs")?;
    writeln!(
        out,
        "  gap mm        L uH   uH per mm       f MHz   ppm of f per um"
    )?;
    for row in rows {
        writeln!(
            out,
            "{:>8.3} {:>11.5} {:>11.4} {:>11.5} {:>17.2}",
            1e3 * row.gap_m,
            1e6 * row.inductance_H,
            1e3 * row.inductance_by_gap_H_per_m,
            1e-6 * row.frequency_Hz,
            row.frequency_change_per_m
        )?;
    }
    Ok(())
}

/// Returns the apparent deformation of the reference's sensing layer, m, and the relative change of
/// L, for a stray field `b_t` across the slabs. The field lowers their permeability.
///
/// The field passes the slabs along the axis, so B is the same inside and outside; the coil's own
/// field meets the differential permeability at that bias. The reversible permeability is lower
/// than the differential one, so this is an upper bound.
pub(super) fn disturbance(elastomer: &Material, b_t: f64) -> (f64, f64) {
    let coil = |mu_r: f64| {
        let design = CoilDesign {
            relative_permeability: mu_r,
            ..CoilDesign::REFERENCE
        };
        CoilIntegral::new(design, None)
    };
    let h = elastomer.reluctivity(b_t.abs()).nu * b_t.abs();
    let gap_m = CoilDesign::REFERENCE.gap_at_rest_m;
    let at_rest = AtGap::of(&coil(elastomer.initial_mu_r()), 1.0, gap_m);
    let biased_h = coil(elastomer.differential_mu_r(h)).inductance_h(gap_m);
    let change = biased_h / at_rest.inductance_H - 1.0;
    let moved_m = (biased_h - at_rest.inductance_H) / at_rest.inductance_by_gap_H_per_m;
    (moved_m, change)
}

#[cfg(test)]
mod tests {
    use palpate_field::design::{Design, builtin_text, vary};
    use palpate_field::solve::{Accuracy, solve_ac};

    use super::*;

    #[test]
    fn a_stray_field_seems_a_retreat() {
        let elastomer = Material::Powder {
            chi: 2.7,
            saturation_a_per_m: 510e3,
        };
        let (displacement, change) = disturbance(&elastomer, 6e-3);
        assert!((-0.006..-0.0005).contains(&change), "{change}");
        assert!((1e-6..20e-6).contains(&displacement), "{displacement}");
    }

    /// The finite elements have tracks of 0.1 x 0.035 mm between slabs of 60 mm radius. The closed
    /// form has flat tracks at the middle of the copper, which widens the gap by half of 0.035 mm.
    #[test]
    fn finite_elements_find_the_same_inductance() {
        for (gap_mm, mu_r) in [(1.0, 1.002), (0.2, 3.7), (1.0, 3.7)] {
            let text = builtin_text("sensing").unwrap();
            let changes = [
                ("parameters.slab_r", 60.0),
                ("parameters.gap_below", gap_mm),
                ("parameters.gap_above", gap_mm),
                ("material.slab.mu_r", mu_r),
            ];
            let changes = changes.map(|(path, value)| (path.to_owned(), value));
            let design = Design::parse("sensing", &vary::set(text, &changes).unwrap()).unwrap();
            let accuracy = Accuracy {
                relative: 1e-4,
                ..Accuracy::default()
            };
            let solved = solve_ac(&design, None, 1.0, &[0], &accuracy).unwrap();
            let coil = CoilDesign {
                relative_permeability: mu_r,
                ..CoilDesign::REFERENCE
            };
            let coil = CoilIntegral::of_tracks(coil, None, 0.1e-3);
            let exact_h = coil.inductance_h(1e-3 * gap_mm + 0.0175e-3);
            let off = exact_h / solved.coils[0].dc_inductance_h - 1.0;
            println!("{gap_mm} mm, mu_r {mu_r}: off by {off:.1e}");
            assert!(off.abs() < 1e-4, "{gap_mm} mm: {off}");
        }
    }
}
