//! A coil above an infinite plate by Dodd and Deeds, J. Appl. Phys. 39, 2829, 1968, with a Bessel
//! function and integrals of this file.

use std::f64::consts::{FRAC_PI_4, PI};

use num_complex::Complex64;

pub(crate) const MU_0: f64 = 4e-7 * PI;

/// J₁(x). From x = 25 on it is Hankel's expansion, off by less than 1e-9 (Abramowitz and Stegun
/// 9.2.5); below 25 it is Bessel's own integral, for which the trapezoidal rule is exact to
/// rounding with more than x points.
fn j1(x: f64) -> f64 {
    if x > 25.0 {
        let y = (8.0 * x).powi(-2);
        let p = 1.0 + y * (7.5 + y * (-590.625 + y * 177_364.687_5));
        let q = (3.0 + y * (-52.5 + y * 9_095.625)) / (8.0 * x);
        let phase = x - 3.0 * FRAC_PI_4;
        return (2.0 / (PI * x)).sqrt() * (p * phase.cos() - q * phase.sin());
    }
    let points = 40 + (1.2 * x) as u32;
    let at = |k: u32| (f64::from(k) + 0.5) * PI / f64::from(points);
    let sum: f64 = (0..points).map(|k| (at(k) - x * at(k).sin()).cos()).sum();
    sum / f64::from(points)
}

/// Nodes and weights of Simpson's rule on an interval.
fn simpson([from, to]: [f64; 2], panels: u32) -> impl Iterator<Item = (f64, f64)> {
    let step = (to - from) / f64::from(2 * panels);
    (0..=2 * panels).map(move |k| {
        let weight = match k {
            0 => 1.0,
            k if k == 2 * panels => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (from + step * f64::from(k), weight * step / 3.0)
    })
}

/// A coil of rectangular cross-section above a plate whose upper face is at x = 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ring {
    pub(crate) r_m: [f64; 2],
    /// Lower and upper end of the coil above the plate, m.
    pub(crate) above_m: [f64; 2],
    pub(crate) turns: f64,
}

/// A plate, or a half-space if it is thick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plate {
    pub(crate) conductivity: f64,
    pub(crate) mu_r: f64,
    pub(crate) loss_tangent: f64,
    pub(crate) thickness_m: f64,
}

/// Spectrum of a ring: for each wave number α, its weight and (∫ r J₁(αr) dr/α)².
pub(crate) struct Spectrum {
    ring: Ring,
    waves: Vec<[f64; 3]>,
}

impl Spectrum {
    /// Fraction of a coil's own inductance that waves beyond the last wave number contribute.
    pub(crate) const LEFT_OUT: f64 = 1e-6;

    /// Spectrum up to the wave number 100 divided by the section's shorter side or the height: a
    /// plate reflects no waves beyond.
    pub(crate) fn of(ring: Ring) -> Self {
        let [width, height] = [ring.r_m, ring.above_m].map(|[from, to]| to - from);
        let along = |alpha: f64| simpson(ring.r_m, 48).map(move |(r, w)| w * r * j1(alpha * r));
        let of = |(alpha, weight)| [alpha, weight, (along(alpha).sum::<f64>() / alpha).powi(2)];
        let scale = 1.0 / ring.r_m[1];
        let last = 100.0 / width.min(height).min(ring.above_m[0]);
        let panels = (last / scale / 0.2).ceil() as u32;
        let low = simpson([1e-3 * scale, 10.0 * scale], 500);
        let high = simpson([10.0 * scale, last], panels);
        Self {
            ring,
            waves: low.chain(high).map(of).collect(),
        }
    }

    /// π μ₀ n² ∫ (∫ r J₁(αr) dr/α)² f(α) dα: the coil's inductances are of this form, H.
    fn integral(&self, f: impl Fn(f64) -> Complex64) -> Complex64 {
        let Ring {
            r_m,
            above_m,
            turns,
        } = self.ring;
        let turns_per_m2 = turns / ((r_m[1] - r_m[0]) * (above_m[1] - above_m[0]));
        let waves = self.waves.iter();
        let sum: Complex64 = waves
            .map(|&[a, weight, radial]| weight * radial * f(a))
            .sum();
        PI * MU_0 * turns_per_m2.powi(2) * sum
    }

    /// The coil's inductance without a plate, H.
    pub(crate) fn in_air_h(&self) -> f64 {
        let height = self.ring.above_m[1] - self.ring.above_m[0];
        let within = |alpha: f64| 2.0 * (alpha * height + (-alpha * height).exp() - 1.0);
        self.integral(|alpha| within(alpha).into()).re
    }

    /// The complex inductance that a plate adds to the coil, H: L − i R/ω.
    pub(crate) fn added_by(&self, plate: &Plate, omega: f64) -> Complex64 {
        let [from, to] = self.ring.above_m;
        let height = |alpha: f64| (-alpha * from).exp() - (-alpha * to).exp();
        self.integral(|alpha| height(alpha).powi(2) * plate.reflection(alpha, omega))
    }
}

impl Plate {
    /// Fraction of a wave e^(−αz) J₁(αr) that the plate reflects.
    fn reflection(&self, alpha: f64, omega: f64) -> Complex64 {
        let mu_r = self.mu_r * Complex64::new(1.0, -self.loss_tangent);
        let inside =
            (alpha * alpha + Complex64::I * omega * MU_0 * mu_r * self.conductivity).sqrt();
        let (sum, difference) = (mu_r * alpha + inside, mu_r * alpha - inside);
        let twice = (-2.0 * inside * self.thickness_m).exp();
        sum * difference * (1.0 - twice) / (sum * sum - difference * difference * twice)
    }

    /// A disc of this plate with its upper face at x = 0.
    pub(crate) fn disc(&self, radius_m: f64) -> String {
        format!(
            "[material.m]\nmu_r = {}\nconductivity_S_per_m = {}\nloss_tangent = {}\n\
             [[plate]]\nname = \"p\"\nmaterial = \"m\"\nshape = {{ r = [0.0, {radius_m}], x = [{}, 0.0] }}\n",
            self.mu_r, self.conductivity, self.loss_tangent, -self.thickness_m
        )
    }
}

impl Ring {
    pub(crate) fn coil(&self, name: &str) -> String {
        let Self {
            r_m,
            above_m,
            turns,
        } = self;
        format!("[[coil]]\nname = \"{name}\"\nr = {r_m:?}\nx = {above_m:?}\nturns = {turns}\n")
    }
}
