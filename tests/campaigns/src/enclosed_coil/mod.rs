//! `cargo campaign enclosed-coil`: a sensing coil enclosed in magneto-sensitive elastomer (MSE) against one
//! on its surface, by one model of field, layer and converter.

mod layers;
mod mechanics;

use std::fs;
use std::path::PathBuf;

use clap::Args;
use layers::{Layers, Sensitivity, Slab, Winding};
use mechanics::Pressed;
use palpate_cli::failure::Failure;
use palpate_cli::plot::{
    Axis, BLACK, BLUE, Chart, Colour, GREEN, GREY, Marks, ORANGE, PURPLE, Series,
};
use palpate_sim::sensing_coil::tank::{BENDING_M2, QUALITY_IN_AIR};
use palpate_sim::sensing_coil::{CoilDesign, Sides};
use palpate_sim::touch::Layer;

/// Compare a sensing coil enclosed in elastomer with one on its surface
#[derive(Args)]
pub(crate) struct Arguments {
    /// Draw the readings against the distance of the press into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// The winding of the built-in layouts of `palpate plan-touch`.
const COIL: CoilDesign = CoilDesign {
    outer_diameter_m: 13.5e-3,
    inner_diameter_m: 3.5e-3,
    turns: 10,
    sides: Sides::One,
    slab_m: 2e-3,
    gap_at_rest_m: 0.1e-3,
    relative_permeability: 3.7,
};

/// Elastic layer: 5 mm of incompressible silicone.
const THICKNESS_M: f64 = 5e-3;
const SHEAR_MODULUS_PA: f64 = 20e3;

/// Radius of contact of the press, m.
const CONTACT_M: f64 = 2e-3;

/// Least distance of MSE from the turns: half of a flexible board, m.
const FOIL_M: f64 = 0.1e-3;

/// Noise of an inductance, relative: twice that of a frequency converted in 0.9 ms at 40 MHz, by whole
/// counts (ldc161x-sim, "The counter").
const NOISE: f64 = 2.0 * 8.07e-6;

/// Loss tangent of MSE (guess, as in docs/field-ac.md).
const LOSS_TANGENT: f64 = 0.01;

/// Growth of the volume of silicone, 1/K (guess within published 0.9e-3 to 1e-3). A bonded layer grows
/// in height alone.
const GROWTH_PER_K: f64 = 0.9e-3;

/// d ln μ / d ln φ, with φ the volume share of iron, by Lichtenecker's rule: ln μ at 3.7 (guess).
const DILUTION: f64 = 1.308;

/// A way to build the sensor.
struct Build {
    name: &'static str,
    colour: Colour,
    /// Thickness of the elastic layer, m, and height of the turns above its rigid base.
    thickness_m: f64,
    coil_m: f64,
    layers: Layers,
    /// Whether the turns move, with the elastomer below them; otherwise they lie on the base.
    moves: bool,
}

const fn slab(gap_m: f64, thickness_m: f64) -> Option<Slab> {
    Some(Slab { gap_m, thickness_m })
}

const fn layers(above: Option<Slab>, below: Option<Slab>) -> Layers {
    Layers {
        above,
        below,
        permeability: 3.7,
    }
}

/// All builds but the last have 5 mm of elastomer above a rigid board.
const BUILDS: [Build; 6] = [
    Build {
        name: "surface, plain silicone between",
        colour: BLUE,
        thickness_m: THICKNESS_M,
        coil_m: 0.0,
        layers: layers(slab(3e-3, 2e-3), None),
        moves: false,
    },
    Build {
        name: "surface, MSE cast on it",
        colour: GREEN,
        thickness_m: THICKNESS_M,
        coil_m: 0.0,
        layers: layers(slab(FOIL_M, THICKNESS_M - FOIL_M), None),
        moves: false,
    },
    Build {
        name: "the first, MSE behind its board",
        colour: BLACK,
        thickness_m: THICKNESS_M,
        coil_m: 0.0,
        layers: layers(slab(3e-3, 2e-3), slab(FOIL_M, 2e-3)),
        moves: false,
    },
    Build {
        name: "enclosed, cast in",
        colour: ORANGE,
        thickness_m: THICKNESS_M,
        coil_m: 2.5e-3,
        layers: layers(slab(FOIL_M, 2.5e-3 - FOIL_M), slab(FOIL_M, 2.5e-3 - FOIL_M)),
        moves: true,
    },
    Build {
        name: "enclosed, plain silicone between",
        colour: PURPLE,
        thickness_m: THICKNESS_M,
        coil_m: 2.5e-3,
        layers: layers(slab(1.5e-3, 1e-3), slab(1.5e-3, 1e-3)),
        moves: true,
    },
    // The foil is stiff: only the half above it is pressed.
    Build {
        name: "the same, on a rigid board",
        colour: GREY,
        thickness_m: 2.5e-3,
        coil_m: 0.0,
        layers: layers(slab(1.5e-3, 1e-3), slab(1.5e-3, 1e-3)),
        moves: false,
    },
];

/// The first and the fifth build, by the thickness of plain silicone in their 5 mm.
type Split = (&'static str, fn(f64) -> Build);
const SPLITS: [Split; 2] = [
    ("Surface", |plain_m| {
        let [build, ..] = BUILDS;
        Build {
            layers: layers(slab(plain_m, THICKNESS_M - plain_m), None),
            ..build
        }
    }),
    ("Enclosed", |plain_m| {
        let [_, _, _, _, build, _] = BUILDS;
        let half = slab(0.5 * plain_m, 0.5 * (THICKNESS_M - plain_m));
        Build {
            layers: layers(half, half),
            ..build
        }
    }),
];

/// Results of one build.
struct Judged {
    inductance_h: f64,
    quality: f64,
    /// Relative change of the inductance per even compression of the elastomer by 1 um.
    per_um: f64,
    /// Departure from a line at 5 % of even compression, relative.
    bent: f64,
    /// Relative change by the bending of the coil under a press of 0.1 mm, relative to its reading.
    bending: f64,
    /// Readings per force against the distance of the press, m and 1/N.
    profile: Vec<(f64, f64)>,
    /// Relative changes of the inductance per kelvin: by growth of the layer, by dilution of the iron.
    per_k: [f64; 2],
    /// Coupling with a coil 6 mm away.
    coupling: f64,
}

/// Runs the campaign, prints the table and draws the figure.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let winding = Winding::new(COIL);
    let results: Vec<Judged> = BUILDS.iter().map(|build| judged(build, &winding)).collect();
    println!(
        "| coil | L, uH | Q | dL/L per um, even, ppm | per N in the centre, % | noise, mN | bent at 5 %, % | \
         bending of the coil, % of the reading | per K: growth, dilution, ppm | the same, mN/K | \
         reading 6 and 10 mm beside, % | coupling at 6 mm, % |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for (build, result) in BUILDS.iter().zip(&results) {
        println!("{}", row(build, result));
    }
    for (name, at) in SPLITS {
        let readings = (2..=9).map(|step| {
            let plain_m = 0.5e-3 * f64::from(step);
            let build = at(plain_m);
            let reading = judged(&build, &winding).in_centre();
            format!("{:.1} mm: {:+.2}", 1e3 * plain_m, 100.0 * reading)
        });
        println!(
            "\n{name}, % per N by the thickness of plain silicone in all: {}",
            readings.collect::<Vec<_>>().join(", ")
        );
    }
    if let Some(path) = &arguments.plot {
        fs::write(path, chart(&results).svg()?)?;
    }
    Ok(())
}

impl Judged {
    /// Reading of a press above the centre, 1/N.
    fn in_centre(&self) -> f64 {
        self.profile
            .first()
            .map_or(f64::NAN, |(_, reading)| *reading)
    }
}

fn judged(build: &Build, winding: &Winding) -> Judged {
    let pressed = &build.pressed(CONTACT_M);
    let inductance_h = |squeezed: f64| winding.inductance_h(&build.squeezed(squeezed));
    let at_rest_h = inductance_h(0.0);
    let step = 1e-4;
    let slope = (inductance_h(step) - inductance_h(-step)) / (2.0 * step * at_rest_h);
    let bent = (inductance_h(0.05) / at_rest_h - 1.0) / (0.05 * slope) - 1.0;
    let sensitivity = winding.sensitivity(&build.layers);
    let profile = profile(build, &sensitivity, pressed, at_rest_h);
    let centre = profile.first().map_or(f64::NAN, |(_, reading)| *reading);
    let permeable = |factor: f64| {
        let permeability = factor * build.layers.permeability;
        winding.inductance_h(&Layers {
            permeability,
            ..build.layers
        })
    };
    let per_ln_permeability =
        (permeable(1.0 + step) - permeable(1.0 - step)) / (2.0 * step * at_rest_h);
    let resistance_ohm = resistance_ohm();
    let impedance_ohm = (at_rest_h / CAPACITANCE_F).sqrt();
    Judged {
        inductance_h: at_rest_h,
        quality: 1.0 / (resistance_ohm / impedance_ohm + per_ln_permeability * LOSS_TANGENT),
        per_um: 1e-6 / build.thickness_m * slope,
        bent,
        bending: bending(build, pressed, centre),
        per_k: [
            -GROWTH_PER_K * slope,
            -GROWTH_PER_K * DILUTION * per_ln_permeability,
        ],
        coupling: winding.mutual_h(&build.layers, 6e-3) / at_rest_h,
        profile,
    }
}

/// Capacitance of the tank, F.
const CAPACITANCE_F: f64 = 330e-12;

/// Series resistance of the coil in air, Ω, from the published quality factor.
fn resistance_ohm() -> f64 {
    (COIL.inductance_in_air_h() / CAPACITANCE_F).sqrt() / QUALITY_IN_AIR
}

impl Build {
    /// The layers, with moving elastomer compressed evenly by this share.
    fn squeezed(&self, share: f64) -> Layers {
        let squeezed = |slab: Slab| Slab {
            gap_m: FOIL_M + (1.0 - share) * (slab.gap_m - FOIL_M),
            thickness_m: (1.0 - share) * slab.thickness_m,
        };
        Layers {
            above: self.layers.above.map(squeezed),
            below: if self.moves {
                self.layers.below.map(squeezed)
            } else {
                self.layers.below
            },
            ..self.layers
        }
    }

    /// Height above the base, m, of a height above the turns; `None` where nothing moves.
    fn above_base_m(&self, height_m: f64) -> Option<f64> {
        let above_base_m = self.coil_m + height_m;
        (above_base_m > 0.0).then_some(above_base_m.min(self.thickness_m))
    }

    /// The layer under a contact of this radius.
    fn pressed(&self, contact_m: f64) -> Pressed {
        let layer = Layer {
            thickness_m: self.thickness_m,
            shear_modulus_pa: SHEAR_MODULUS_PA,
            poisson: 0.5,
        };
        Pressed::new(&layer, contact_m)
    }
}

/// Steps of tables over the distance from a press, m.
const STEP_M: f64 = 50e-6;
const STEPS: u32 = 1000;

/// Directions over which the displacement around a coil is averaged.
const ANGLES: u32 = 90;

/// Relative change of the inductance per newton against the distance of the press from the axis.
fn profile(
    build: &Build,
    sensitivity: &Sensitivity,
    pressed: &Pressed,
    at_rest_h: f64,
) -> Vec<(f64, f64)> {
    let mut heights: Vec<f64> = sensitivity
        .boundaries
        .iter()
        .map(|of| of.height_m)
        .collect();
    if build.moves {
        heights.push(0.0);
    }
    let tables: Vec<(f64, Vec<f64>)> = heights
        .into_iter()
        .filter_map(|height_m| {
            Some((
                height_m,
                pressed.at(build.above_base_m(height_m)?, STEP_M, STEPS),
            ))
        })
        .collect();
    let moved_m = |height_m: f64, distance_m: f64| {
        let table = tables.iter().find(|(height, _)| *height == height_m);
        table.map_or(0.0, |(_, table)| interpolated(table, distance_m / STEP_M))
    };
    (0..=32)
        .map(|step| {
            let place_m = 0.5e-3 * f64::from(step);
            let around = |height_m: f64, r_m: f64| {
                let angles = (0..ANGLES).map(|index| {
                    let angle = std::f64::consts::PI * (f64::from(index) + 0.5) / f64::from(ANGLES);
                    let square = r_m * r_m + place_m * place_m - 2.0 * r_m * place_m * angle.cos();
                    moved_m(height_m, square.max(0.0).sqrt())
                });
                angles.sum::<f64>() / f64::from(ANGLES)
            };
            (
                place_m,
                sensitivity.change_h(around, build.moves) / at_rest_h,
            )
        })
        .collect()
}

/// Linear interpolation; nothing beyond the table.
fn interpolated(table: &[f64], position: f64) -> f64 {
    let index = position as usize;
    match table.get(index..index + 2) {
        Some([low, high]) => low + (high - low) * position.fract(),
        _ => 0.0,
    }
}

/// Loss of inductance by the bending of a coil that follows the elastomer, relative to its reading of a
/// press 0.1 mm deep above its centre. The bend is the mean over its area of the squares of both curvatures.
fn bending(build: &Build, pressed: &Pressed, per_n: f64) -> f64 {
    if !build.moves {
        return 0.0;
    }
    let surface = pressed.at(build.thickness_m, STEP_M, 1);
    let force_n = 0.1e-3 / surface.first().copied().unwrap_or(f64::NAN);
    let table = pressed.at(build.coil_m, STEP_M, STEPS);
    let (mut sum, mut area) = (0.0, 0.0);
    for (index, of) in table.windows(3).enumerate() {
        let r_m = STEP_M * (index + 1) as f64;
        if let ([before, here, after], true) = (of, r_m < 0.5 * COIL.outer_diameter_m) {
            let along = force_n * (after - 2.0 * here + before) / (STEP_M * STEP_M);
            let across = force_n * (after - before) / (2.0 * STEP_M * r_m);
            sum += r_m * (along * along + across * across);
            area += r_m;
        }
    }
    BENDING_M2 * sum / area / (per_n * force_n)
}

fn row(build: &Build, result: &Judged) -> String {
    let at = |step: usize| {
        result
            .profile
            .get(step)
            .map_or(f64::NAN, |(_, reading)| *reading)
    };
    let centre = at(0);
    let [growth, dilution] = result.per_k;
    format!(
        "| {} | {:.2} | {:.0} | {:+.0} | {:+.2} | {:.2} | {:+.0} | {:.1} | {:+.0}, {:+.0} | {:+.0}, {:+.0} | {:+.0}, {:+.0} | {:.0} |",
        build.name,
        1e6 * result.inductance_h,
        result.quality,
        1e6 * result.per_um,
        100.0 * centre,
        1e3 * (NOISE / centre).abs(),
        100.0 * result.bent,
        100.0 * result.bending,
        1e6 * growth,
        1e6 * dilution,
        1e3 * growth / centre,
        1e3 * dilution / centre,
        100.0 * at(12) / centre,
        100.0 * at(20) / centre,
        100.0 * result.coupling,
    )
}

fn chart(results: &[Judged]) -> Chart {
    let series = BUILDS.iter().zip(results).map(|(build, result)| {
        let points = result
            .profile
            .iter()
            .map(|(place_m, reading)| (1e3 * place_m, 100.0 * reading));
        Series::new(build.name, build.colour, Marks::Line(points.collect()))
    });
    Chart {
        title: "Reading of a press of 1 N, contact of 2 mm, linear".to_owned(),
        x: Axis::linear("distance of the press from the coil's axis / mm"),
        y: Axis::linear("change of inductance / %"),
        series: series.collect(),
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::touch::{
        Demand, Indenter, Layout, Press, Surroundings, TouchParameters, TouchSensor,
    };

    use super::*;

    #[test]
    fn the_coil_on_the_surface_reads_as_in_the_simulated_world() {
        // A ball of 20 mm pressed 0.05 mm deep: a contact of about 1 mm. The simulated world shares no
        // function with this campaign.
        let [build, ..] = &BUILDS;
        let mut layout = Layout::three_around_one();
        layout.coils.truncate(1);
        layout.boundary_m = 3e-3;
        layout.coils[0].design = CoilDesign {
            gap_at_rest_m: 3e-3,
            ..COIL
        };
        let layer = Layer {
            thickness_m: THICKNESS_M,
            shear_modulus_pa: SHEAR_MODULUS_PA,
            poisson: 0.5,
        };
        let sensor = TouchSensor::new(TouchParameters::ideal(&layout, &layer));
        let mut pressing = sensor.pressed_by(&Indenter::Ball { radius_m: 20e-3 }, [0.0; 2], 0);
        let rest_h = sensor.inductance_at_rest_h(0).unwrap();
        let mut read = |x_m: f64| {
            let press = Press {
                place_m: [x_m, 0.0],
                demand: Demand::Depth(0.05e-3),
            };
            let (inductances_h, truth) =
                pressing.inductances_h(0.0, &press, &Surroundings::default());
            let reading = (inductances_h[0] - rest_h) / rest_h / truth.force_n;
            (reading, truth.radius_m)
        };
        let (centre, radius_m) = read(0.0);
        let winding = Winding::new(COIL);
        let at_rest_h = winding.inductance_h(&build.layers);
        assert!(
            (at_rest_h / rest_h - 1.0).abs() < 2e-3,
            "{at_rest_h} {rest_h}"
        );
        let sensitivity = winding.sensitivity(&build.layers);
        let profile = profile(build, &sensitivity, &build.pressed(radius_m), at_rest_h);
        for (place_m, found) in profile.into_iter().step_by(4) {
            let (expected, _) = read(place_m);
            println!("{place_m:e}: {found:e} {expected:e}");
            assert!(
                (found - expected).abs() < 0.02 * centre,
                "{place_m}: {found} {expected}"
            );
        }
    }
}
