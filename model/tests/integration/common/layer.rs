//! Indentation of a bonded elastic layer: Hayes' integral equation in `f64`.
//!
//! The pressure under a tip of contact radius a has the transform p(xi) = integral of psi(t) cos(xi t)
//! over 0 to a. For the depth profile w(r) = d - r^2/(2R) of a ball, and w = d of a pin,
//!
//! psi(x) - (2/pi) integral of psi(t) k(x, t) = (E*/pi) (d - x^2/R),
//! k(x, t) = integral of N(xi h) cos(xi x) cos(xi t) over xi from 0 to infinity,
//!
//! with 1 - N the transform of a layer's compliance over that of a half-space. The force is 2 pi
//! times the integral of psi, and psi(a) = 0 where a ball's surface leaves the object smoothly.

use super::linalg::least_squares;

/// Contact of radius 1 on a layer of thickness `1/aspect`, with E* = 1.
pub struct Layer {
    /// Stiffness over that on a half-space, 2.
    pub kappa: f64,
    /// Depth of a ball, in units of a^2/R.
    pub depth: f64,
    /// Force of a ball over that on a half-space, 4/3 a^3/R.
    pub lambda: f64,
}

/// Points of the quadrature over the contact, and over the transform's variable up to `END`.
const POINTS: usize = 24;
const WAVES: usize = 600;
const END: f64 = 30.0;

impl Layer {
    pub fn new(aspect: f64, nu: f64) -> Self {
        let (x, w) = gauss(POINTS, 1.0);
        let (wave, weight) = gauss(WAVES, END);
        let kernel = |x: f64, t: f64| -> f64 {
            let waves = wave.iter().zip(&weight);
            waves
                .map(|(of, by)| {
                    by * lack(*of, nu) * (of * aspect * x).cos() * (of * aspect * t).cos()
                })
                .sum::<f64>()
                * aspect
        };
        let factor = 2.0 / std::f64::consts::PI;
        let matrix: Vec<Vec<f64>> = (0..POINTS)
            .map(|i| {
                (0..POINTS)
                    .map(|j| f64::from(i == j) - factor * w[j] * kernel(x[i], x[j]))
                    .collect()
            })
            .collect();
        let edge: Vec<f64> = (0..POINTS)
            .map(|j| factor * w[j] * kernel(1.0, x[j]))
            .collect();
        // psi in units of E*/pi, for the right sides 1 and x^2: integral and value at the edge.
        let of = |right: &[f64], at_edge: f64| {
            let psi = least_squares(&matrix, right).0;
            let dot = |by: &[f64]| psi.iter().zip(by).map(|(a, b)| a * b).sum::<f64>();
            (dot(&w), at_edge + dot(&edge))
        };
        let (flat, flat_edge) = of(&[1.0; POINTS], 1.0);
        let squares: Vec<f64> = x.iter().map(|x| x * x).collect();
        let (curved, curved_edge) = of(&squares, 1.0);
        let depth = curved_edge / flat_edge;
        Self {
            kappa: flat,
            depth,
            lambda: 1.5 * (depth * flat - curved),
        }
    }
}

/// N(alpha) for a layer bonded to a rigid base, with a frictionless surface.
fn lack(alpha: f64, nu: f64) -> f64 {
    let k = 3.0 - 4.0 * nu;
    let e2 = (-2.0 * alpha).exp();
    let above = k * (1.0 - e2 * e2) - 4.0 * alpha * e2;
    let below = k * (1.0 + e2 * e2) + (4.0 * alpha * alpha + 1.0 + k * k) * e2;
    1.0 - above / below
}

/// Gauss-Legendre points and weights on 0 to `end`.
fn gauss(points: usize, end: f64) -> (Vec<f64>, Vec<f64>) {
    let n = points as f64;
    let of = |index: usize| {
        let mut x = (std::f64::consts::PI * (index as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut low, mut value) = (1.0, x);
            for k in 2..=points {
                let k = k as f64;
                (low, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * low) / k);
            }
            slope = n * (x * value - low) / (x * x - 1.0);
            x -= value / slope;
        }
        (0.5 * end * (1.0 - x), end / ((1.0 - x * x) * slope * slope))
    };
    (0..points).map(of).unzip()
}
