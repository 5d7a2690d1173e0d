//! The force between the halves of the stack, by two methods.
//!
//! The halves are parted in the middle half of the core's length
//! ([`crate::design::Core::parting_m`]): all parts above are moved away rigidly, and the rubber and
//! air between are stretched, keeping their permeability at each point. Positive means that the
//! halves attract.
//!
//! A uniform background field has a magnetic tension of its own, which reaches to infinity. It is
//! subtracted, so the force is that of the design in the background.
//!
//! A magnet in the middle half is stretched with its remanence unchanged.
//!
//! If a body's outline is slanted in the middle half, the field pulls at the body along the axis,
//! and the force depends a little on the plane at which the halves are parted. The force by stress
//! uses the mid-plane.

use core::f64::consts::TAU;

use crate::design::Design;
use crate::geometry::{Point, length};
use crate::material::Material;
use crate::mesh::Region;
use crate::solve::{Level, Locator};

/// Magnetic tension along the axis in excess of that of the background field in vacuum, N/m². It is
/// ∫H dB − H_r B_r, or B²/2μ where B is parallel to the axis.
fn tension(level: &Level, region: usize, b: [f64; 2]) -> f64 {
    let (material, excess) = level.law_at(region, b);
    tension_of(level, material, excess)
}

/// Magnetic tension in a material, N/m²; `b` is the field in excess of the material's remanence.
fn tension_of(level: &Level, material: &Material, b: [f64; 2]) -> f64 {
    let size = length(b);
    let background = Material::VACUUM.energy_j_per_m3(level.background_t);
    material.energy_j_per_m3(size) - material.reluctivity(size).nu * b[0] * b[0] - background
}

/// Force by virtual work, N: the change of the energy with the gap at constant flux.
///
/// With r A_φ constant at each point of the material, a stretch dx → (1 + ε) dx leaves B_x
/// unchanged, divides B_r by 1 + ε and multiplies volumes by it: dW/dε = ∫ (∫H dB − H_r B_r) dV
/// over the stretched volume (Coulomb's method, applied to the discrete energy itself).
#[must_use]
pub fn by_virtual_work(design: &Design, level: &Level, w: &[f64], locator: &Locator<'_>) -> f64 {
    let [from, to] = design.core.parting_m();
    let mut sum = 0.0;
    let parting = |region: &Region| region.parting;
    level.visit_where(w, parting, |at| {
        sum += TAU * at.weight * at.point[0] * tension(level, at.index, at.b);
    });
    // Outside of the circle around the design the field is smooth.
    let beyond = panels(to - from, 1, |x| ring_beyond(level, locator, from + x));
    (sum + beyond) / (to - from)
}

/// Closing force, N: Maxwell's stress, integrated over the core's mid-plane out to infinity.
#[must_use]
pub fn by_stress(design: &Design, level: &Level, locator: &Locator<'_>) -> f64 {
    let x = design.core.middle_m();
    let stress = |point: Point| {
        let at = locator.at(point);
        tension(level, at.region as usize, at.b)
    };
    let edge = reach(level, x);
    // The stress jumps where the material changes, so the integral is split at these radii.
    let mut stops = vec![0.0];
    let region = |r: f64| locator.at([r, x]).region;
    for step in 0..STEPS {
        let [mut from, mut to] = [step, step + 1].map(|k| edge * f64::from(k) / f64::from(STEPS));
        if region(from) != region(to) {
            for _ in 0..40 {
                let middle = 0.5 * (from + to);
                if region(middle) == region(from) {
                    from = middle;
                } else {
                    to = middle;
                }
            }
            stops.push(to);
        }
    }
    stops.push(edge);
    let pieces = stops.windows(2).map(|ends| match ends {
        &[from, to] => panels(to - from, 40, |r| TAU * (from + r) * stress([from + r, x])),
        _ => 0.0,
    });
    pieces.sum::<f64>() + ring_beyond(level, locator, x)
}

/// Number of steps along the mid-plane in which changes of the material are located.
const STEPS: u32 = 200;

/// Integral of the tension over the part of a plane outside of the circle: r = R/t maps the radii
/// from R to infinity onto (0, 1].
fn ring_beyond(level: &Level, locator: &Locator<'_>, x: f64) -> f64 {
    let edge = reach(level, x) * (1.0 + 1e-12);
    panels(1.0, 8, |t| {
        let r = edge / t;
        TAU * r * tension_of(level, &Material::VACUUM, locator.at([r, x]).b) * r / t
    })
}

/// Radius at which a plane across the axis leaves the circle.
fn reach(level: &Level, x: f64) -> f64 {
    let circle = level.space.mesh.circle;
    (circle.radius.powi(2) - (x - circle.centre_x).powi(2))
        .max(0.0)
        .sqrt()
}

/// Integrates from 0 to `end` by Gauss's rule with three points in each of `count` panels.
fn panels(end: f64, count: u32, f: impl Fn(f64) -> f64) -> f64 {
    const NODES: [(f64, f64); 3] = [
        (0.112_701_665_379_258_3, 5.0 / 18.0),
        (0.5, 8.0 / 18.0),
        (0.887_298_334_620_741_7, 5.0 / 18.0),
    ];
    let width = end / f64::from(count);
    let mut sum = 0.0;
    for panel in 0..count {
        for (node, weight) in NODES {
            sum += weight * width * f(width * (f64::from(panel) + node));
        }
    }
    sum
}
