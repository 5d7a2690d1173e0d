//! An elastic object under a rigid tip: half-space or bonded layer, frictionless.
//!
//! Under a pin F = k x, under a ball F = k x^1.5 (1 + p_1 χ + ... + p_7 χ⁷) with χ = √(R x)/h: k is
//! that of a half-space, 2 a E* and 4/3 E* √R. The layer's numbers come from the integral equation of
//! Hayes, Keer, Herrmann and Mockros (J. Biomech. 5 (1972) 541), solved here.

use std::f64::consts::PI;

/// Shape of a tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tip {
    /// Cylinder with a flat face.
    Pin,
    /// Sphere.
    Ball,
}

/// Object and tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus, Pa, 10³ to 10¹⁰.
    pub young_pa: f64,
    /// Poisson's ratio, 0 to 0.5.
    pub poisson_ratio: f64,
    /// Thickness, m, 10⁻⁴ to 1; `None` for a half-space.
    pub thickness_m: Option<f64>,
}

/// Number of terms of a layer's series.
const TERMS: usize = 7;
/// Greatest contact radius over the thickness at which the series is fitted.
const WIDEST: f64 = 1.3;

/// An indented object as a load.
///
/// ```
/// use palpate_sim::mechanics::indented::{Indented, Material, Tip};
///
/// let rubber = Material { young_pa: 0.75e6, poisson_ratio: 0.5, thickness_m: None };
/// let ball = Indented::new(Tip::Ball, 8e-3, rubber);
/// let force = 4.0 / 3.0 * 1e6 * (8e-3_f64 * 0.2e-3).sqrt() * 0.2e-3;
/// assert!((ball.force_n(0.2e-3) / force - 1.0).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Indented {
    /// Shape of the tip.
    pub tip: Tip,
    /// Radius of the pin's face or of the ball, m.
    pub radius_m: f64,
    /// The object.
    pub material: Material,
    /// F is the sum of these coefficients times s^n with s = √x, n from the tip's power on.
    coefficients: [f64; TERMS + 1],
}

impl Indented {
    /// A tip of a radius, 10⁻⁵ to 0.1 m, on an object.
    #[must_use]
    pub fn new(tip: Tip, radius_m: f64, material: Material) -> Self {
        let nu = material.poisson_ratio;
        let reduced_pa = material.young_pa / (1.0 - nu * nu);
        let thick = match tip {
            Tip::Pin => 2.0 * radius_m * reduced_pa,
            Tip::Ball => 4.0 / 3.0 * reduced_pa * radius_m.sqrt(),
        };
        let mut coefficients = [0.0; TERMS + 1];
        match (tip, material.thickness_m) {
            (Tip::Ball, Some(thickness_m)) => {
                let step = radius_m.sqrt() / thickness_m;
                for ((to, of), power) in coefficients.iter_mut().zip(series(nu)).zip(0..) {
                    *to = thick * of * step.powi(power);
                }
            }
            (_, thickness_m) => {
                let stiffer = thickness_m.map(|of_m| LayerContact::new(radius_m / of_m, nu).flat);
                let [first, ..] = &mut coefficients;
                *first = thick * stiffer.unwrap_or(1.0);
            }
        }
        Self {
            tip,
            radius_m,
            material,
            coefficients,
        }
    }

    fn power(&self) -> i32 {
        match self.tip {
            Tip::Pin => 2,
            Tip::Ball => 3,
        }
    }

    /// Sum of the coefficients times s^(n + shift), each by its factor of n.
    fn sum(&self, s: f64, shift: i32, factor: fn(f64) -> f64) -> f64 {
        let terms = (self.power()..).zip(self.coefficients);
        terms
            .map(|(n, of)| of * factor(n.into()) * s.powi(n + shift))
            .sum()
    }

    /// Force for a compression, N.
    #[must_use]
    pub fn force_n(&self, x_m: f64) -> f64 {
        self.sum(x_m.sqrt(), 0, |_| 1.0)
    }

    /// Energy stored at a compression, J: the integral of 2 s F over s.
    #[must_use]
    pub fn energy_j(&self, x_m: f64) -> f64 {
        self.sum(x_m.abs().sqrt(), 2, |n| 2.0 / (n + 2.0))
    }

    /// dx/dF at a compression, m/N. Below a picometre the value at a picometre, since dx/dF of a
    /// ball grows without bounds.
    #[must_use]
    pub fn compliance_m_per_n(&self, x_m: f64) -> f64 {
        2.0 / self.sum(x_m.abs().max(1e-12).sqrt(), -2, |n| n)
    }

    /// Compression under a force of zero or more, m.
    #[must_use]
    pub fn displacement_m(&self, force_n: f64) -> f64 {
        let [first, ..] = self.coefficients;
        let highest = (force_n / first).powf(1.0 / f64::from(self.power()));
        self.root(highest, |_| 0.0, force_n, 1.0)
    }

    /// Compression and force in series with a spring of compliance C that share `total_m`, zero or
    /// more.
    #[must_use]
    pub fn in_series(&self, total_m: f64, compliance_m_per_n: f64) -> (f64, f64) {
        let x_m = self.root(total_m.sqrt(), |s| s, total_m, compliance_m_per_n);
        (x_m, self.force_n(x_m))
    }

    /// Solves s own(s) + C F(s²) = total, where own is 0 or s, and returns x = s². Newton's method
    /// from above: the left side is convex, so the iteration falls to the root.
    fn root(&self, highest: f64, own: fn(f64) -> f64, total: f64, compliance: f64) -> f64 {
        let mut s = highest;
        for _ in 0..80 {
            let left = s * own(s) + compliance * self.sum(s, 0, |_| 1.0);
            let slope = 2.0 * own(s) + compliance * self.sum(s, -1, |n| n);
            let next = s - (left - total) / slope;
            // Also ends for a slope of zero, at s = 0.
            if next.is_nan() || next >= s {
                break;
            }
            s = next;
        }
        s * s
    }
}

/// 1 and p_1 to p_7 of a ball on a layer: the force over that of a half-space at the same depth, as a
/// polynomial of χ through solutions up to the widest contact.
fn series(nu: f64) -> Vec<f64> {
    let contacts = (1..=TERMS).map(|step| {
        let aspect = WIDEST * step as f64 / TERMS as f64;
        let layer = LayerContact::new(aspect, nu);
        (
            layer.depth.sqrt() * aspect,
            layer.force / layer.depth.powf(1.5),
        )
    });
    let points: Vec<(f64, f64)> = std::iter::once((0.0, 1.0)).chain(contacts).collect();
    let mut sum = vec![0.0; points.len()];
    for (at, value) in &points {
        // The polynomial that is `value` here and zero at all other points.
        let mut term = vec![*value];
        for (other, _) in points.iter().filter(|(other, _)| other != at) {
            let raised = std::iter::once(0.0).chain(term.iter().copied());
            let same = term.iter().copied().chain(std::iter::once(0.0));
            let product = raised
                .zip(same)
                .map(|(up, of)| (up - other * of) / (at - other));
            term = product.collect();
        }
        sum.iter_mut().zip(term).for_each(|(to, of)| *to += of);
    }
    sum
}

/// Contact on a bonded layer, over that of the same radius on a half-space.
struct LayerContact {
    /// Stiffness of a pin.
    flat: f64,
    /// Depth of a ball.
    depth: f64,
    /// Force of a ball.
    force: f64,
}

/// Points of the midpoint rule over the contact, and over the transform's variable with its step.
const POINTS: usize = 120;
const WAVES: usize = 400;
const WAVE_STEP: f64 = 0.05;

impl LayerContact {
    /// Contact of radius 1 on a layer of thickness `1/aspect`. psi is the density of the pressure's
    /// transform, psi(x) - (2/pi) ∫ k(x, t) psi(t) dt = 1 for a pin, less x²/depth for a ball, for which
    /// psi(1) = 0.
    fn new(aspect: f64, nu: f64) -> Self {
        let step = 1.0 / POINTS as f64;
        // The kernel depends on differences and sums of its arguments, all multiples of the step.
        let integral = |distance: f64| -> f64 {
            let waves = (0..WAVES).map(|wave| (wave as f64 + 0.5) * WAVE_STEP);
            let sum: f64 = waves
                .map(|of| lack(of, nu) * (of * aspect * distance).cos())
                .sum();
            aspect * WAVE_STEP * sum
        };
        // In steps of half a step, since the contact's edge lies between two points.
        let half: Vec<f64> = (0..=4 * POINTS)
            .map(|n| integral(0.5 * n as f64 * step))
            .collect();
        let table = |distance: usize| half.get(distance).copied().unwrap_or_default();
        let kernel = |two_x: usize, two_t: usize| {
            0.5 * (table(two_x.abs_diff(two_t)) + table(two_x + two_t)) * step * 2.0 / PI
        };
        let points = || (0..POINTS).map(|index| 2 * index + 1);
        let row =
            |two_x: usize| -> Vec<f64> { points().map(|two_t| kernel(two_x, two_t)).collect() };
        let matrix: Vec<Vec<f64>> = points().map(row).collect();
        let edge = row(2 * POINTS);
        let of = |right: fn(f64) -> f64| -> (f64, f64) {
            let right_sides: Vec<f64> = points()
                .map(|two_x| right(0.5 * step * two_x as f64))
                .collect();
            // The greatest eigenvalue of the kernel is 0.80 at the widest contact and nu 0.5.
            let mut psi = right_sides.clone();
            for _ in 0..250 {
                let next = right_sides.iter().zip(&matrix);
                psi = next.map(|(right, row)| right + dot(row, &psi)).collect();
            }
            (
                psi.iter().sum::<f64>() * step,
                right(1.0) + dot(&edge, &psi),
            )
        };
        let ((flat, flat_edge), (curved, curved_edge)) = (of(|_| 1.0), of(|x| x * x));
        let depth = curved_edge / flat_edge;
        Self {
            flat,
            depth,
            force: 1.5 * (depth * flat - curved),
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// One less the ratio of the surface's displacement on a layer to that on a half-space, for a pressure
/// of wave number α/h.
fn lack(alpha: f64, nu: f64) -> f64 {
    let k = 3.0 - 4.0 * nu;
    let (sinh, cosh) = ((2.0 * alpha).sinh(), (2.0 * alpha).cosh());
    1.0 - (2.0 * k * sinh - 4.0 * alpha) / (2.0 * k * cosh + 4.0 * alpha * alpha + 1.0 + k * k)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(poisson_ratio: f64) -> Material {
        Material {
            young_pa: 0.75e6,
            poisson_ratio,
            thickness_m: Some(4e-3),
        }
    }

    /// Finite elements, scikit-fem 12.0.2: model/tests/integration/indentation.rs says how.
    #[test]
    fn a_layer_under_a_pin_is_stiffer_as_finite_elements_find() {
        for (nu, radius_m, kappa) in [
            (0.3, 2e-3, 1.6249),
            (0.45, 1e-3, 1.3315),
            (0.45, 4e-3, 3.0960),
        ] {
            let half_space = Material {
                thickness_m: None,
                ..layer(nu)
            };
            let force = |of| Indented::new(Tip::Pin, radius_m, of).force_n(1e-4);
            let ratio = force(layer(nu)) / force(half_space);
            assert!(
                (ratio / kappa - 1.0).abs() < 3e-3,
                "{nu} {radius_m}: {ratio}"
            );
        }
    }

    /// In a small step all points under a ball move alike: its stiffness is that of a pin of the
    /// contact's radius.
    #[test]
    fn the_tangent_of_a_ball_is_the_stiffness_of_a_pin_of_its_contact() {
        for nu in [0.3, 0.5] {
            let ball = Indented::new(Tip::Ball, 20e-3, layer(nu));
            for aspect in [0.1, 0.35, 0.8, 1.1] {
                let contact_m = aspect * 4e-3;
                let depth_m = LayerContact::new(aspect, nu).depth * contact_m * contact_m / 20e-3;
                let pin = Indented::new(Tip::Pin, contact_m, layer(nu)).force_n(1.0);
                let ratio = pin * ball.compliance_m_per_n(depth_m);
                assert!((ratio - 1.0).abs() < 2e-3, "{nu} {aspect}: {ratio}");
            }
        }
    }
}
