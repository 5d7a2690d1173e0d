//! Sensing coils under a bonded layer, in `f64`, by closed forms alone.
//!
//! A layer of incompressible elastomer on a rigid base is pressed by a round pressure. A coil reads
//! the surface's displacement, weighted by the energy density of its own field. Per newton, at the
//! distance rho from the coil's axis, its inductance changes by
//!
//! dL = (1/2 pi) integral of k S(k) C(k) p(k a) J0(k rho) dk,
//!
//! where k is the wave number, S the transform of the coil's weight, C the layer's compliance and p
//! the transform of the pressure under a contact of radius a. The crate's formulas are not used.

use std::f64::consts::{PI, TAU};

/// Pressure under the indenter.
#[derive(Clone, Copy, PartialEq)]
pub enum Pressure {
    /// Hertz's: a ball.
    Hertz,
    /// Of a rigid flat pin on a half-space.
    Pin,
}

pub struct World {
    pub coils: Vec<[f64; 2]>,
    pub gains: Vec<f64>,
    /// Bend of the readings: (exp(bend y) - 1)/bend.
    pub bend: f64,
    pub pressure: Pressure,
    /// k and the part of the integrand without pressure and J0.
    waves: Vec<(f64, f64)>,
}

/// Relative change of inductance per metre of mean approach.
const PER_M: f64 = 100.0;
const DEPTH_M: f64 = 0.6e-3;
const SHEAR_PA: f64 = 20e3;
const STEP: f64 = 30.0;

impl World {
    pub fn new(thickness_m: f64, coils: &[[f64; 2]]) -> Self {
        let rings = rings();
        let wave = |i: usize| {
            let k = (i as f64 + 0.5) * STEP;
            let field: f64 = rings.iter().map(|(r, part)| part * libm::j0(k * r)).sum();
            let x = k * thickness_m;
            // (sinh 2x - 2x) / (cosh 2x + 1 + 2 x^2), times exp(-2x) above and below.
            let small = (-2.0 * x).exp();
            let layer = (0.5 * (1.0 - small * small) - 2.0 * x * small)
                / (0.5 * (1.0 + small * small) + (1.0 + 2.0 * x * x) * small);
            (k, PER_M * field * layer / (2.0 * SHEAR_PA) * STEP / TAU)
        };
        Self {
            coils: coils.to_vec(),
            gains: vec![1.0; coils.len()],
            bend: 0.0,
            pressure: Pressure::Hertz,
            waves: (0..480).map(wave).collect(),
        }
    }

    /// Change per newton at a distance, without bend.
    pub fn profile(&self, distance_m: f64, radius_m: f64) -> f64 {
        let part = |(k, part): &(f64, f64)| {
            let q = k * radius_m;
            let pressure = match self.pressure {
                Pressure::Hertz if q < 1e-2 => 1.0 - q * q / 10.0,
                Pressure::Hertz => 3.0 * (q.sin() - q * q.cos()) / (q * q * q),
                Pressure::Pin => q.sin() / q,
            };
            part * pressure * libm::j0(k * distance_m)
        };
        self.waves.iter().map(part).sum()
    }

    /// Readings of presses (x, y, F, a).
    pub fn readings(&self, presses: &[[f64; 4]]) -> Vec<f64> {
        let of = |(coil, gain): (&[f64; 2], &f64)| {
            let linear: f64 = presses
                .iter()
                .map(|[x, y, force, radius]| {
                    let distance = (x - coil[0]).hypot(y - coil[1]);
                    force * self.profile(distance, *radius)
                })
                .sum();
            let bent = if self.bend == 0.0 {
                linear
            } else {
                (self.bend * linear).exp_m1() / self.bend
            };
            gain * bent
        };
        self.coils.iter().zip(&self.gains).map(of).collect()
    }
}

pub fn three_around_one() -> Vec<[f64; 2]> {
    ring(3, 90.0)
}

pub fn seven() -> Vec<[f64; 2]> {
    ring(6, 0.0)
}

pub fn square() -> Vec<[f64; 2]> {
    vec![[5e-3, 5e-3], [-5e-3, 5e-3], [-5e-3, -5e-3], [5e-3, -5e-3]]
}

fn ring(count: usize, first_deg: f64) -> Vec<[f64; 2]> {
    let at = |i: usize| {
        let angle = first_deg.to_radians() + TAU * i as f64 / count as f64;
        [6e-3 * angle.cos(), 6e-3 * angle.sin()]
    };
    std::iter::once([0.0; 2])
        .chain((0..count).map(at))
        .collect()
}

/// Radius and share of rings of the surface: energy density of ten loops from 2 to 6.5 mm.
fn rings() -> Vec<(f64, f64)> {
    let ring = |i: u32| {
        let r = (f64::from(i) + 0.5) * 0.1e-3;
        let (mut radial, mut axial) = (0.0, 0.0);
        for turn in 0..10 {
            let [h_r, h_z] = loop_field(2e-3 + 0.5e-3 * f64::from(turn), r);
            radial += h_r;
            axial += h_z;
        }
        (r, r * (radial * radial + axial * axial))
    };
    let all: Vec<_> = (0..300).map(ring).collect();
    let sum: f64 = all.iter().map(|(_, part)| part).sum();
    all.into_iter().map(|(r, part)| (r, part / sum)).collect()
}

/// Field of a loop of 1 A and the radius `a` at the height of the surface (Smythe 7.10), by Biot and
/// Savart's integral over the loop.
fn loop_field(a: f64, r: f64) -> [f64; 2] {
    const POINTS: u32 = 240;
    let z = DEPTH_M;
    let mut sum = [0.0; 2];
    for i in 0..POINTS {
        let angle = PI * (f64::from(i) + 0.5) / f64::from(POINTS);
        let cube = (a * a + r * r + z * z - 2.0 * a * r * angle.cos()).powf(1.5);
        sum[0] += a * z * angle.cos() / cube;
        sum[1] += a * (a - r * angle.cos()) / cube;
    }
    sum.map(|sum| 2.0 * sum * PI / f64::from(POINTS) / (4.0 * PI))
}
