//! Contact radius under a known tip.

use std::f64::consts::PI;

/// Elastic layer on a rigid base; incompressible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Thickness, m.
    pub thickness_m: f64,
    /// Shear modulus, Pa.
    pub shear_modulus_pa: f64,
}

/// What presses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tip {
    /// Cylinder with a flat face of this radius, m.
    Pin(f64),
    /// Sphere of this radius, m.
    Ball(f64),
}

impl Tip {
    /// Radius of the round contact with Hertz's pressure and the same second moment, m.
    ///
    /// Under a pin the pressure is that on a half-space. Under a ball it is Hertz's, and the surface
    /// falls by a^2/2R from the edge to the centre of the contact: on a layer of three contact radii
    /// or more within 1 % of Hayes' solution.
    pub fn contact_radius_m(self, layer: &Layer, force_n: f64) -> f64 {
        match self {
            Self::Pin(radius_m) => (5.0_f64 / 3.0).sqrt() * radius_m,
            Self::Ball(radius_m) => {
                let waves = waves();
                // The fall per a^2 decreases with a.
                let excess = |a_m: f64| {
                    force_n * layer.fall_m_per_n(a_m, &waves) - a_m * a_m / (2.0 * radius_m)
                };
                let (mut low, mut high) = (1e-6, 10.0 * layer.thickness_m);
                for _ in 0..50 {
                    let middle = (low * high).sqrt();
                    if excess(middle) > 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                (low * high).sqrt()
            }
        }
    }
}

impl Layer {
    /// Displacement at the centre of a contact less that at its edge, m per newton:
    /// (1/2 pi) integral of k C(k) p(k a) (1 - J0(k a)) dk, with the wave number k, the layer's compliance C and the transform p
    /// of the pressure under a contact of radius a (Johnson, "Contact mechanics", 5.8).
    fn fall_m_per_n(&self, radius_m: f64, waves: &[[f64; 2]]) -> f64 {
        let wave = |[q, factor]: &[f64; 2]| {
            let x = q / radius_m * self.thickness_m;
            let decay = (-2.0 * x).exp();
            let above = 0.5 * (1.0 - decay * decay) - 2.0 * x * decay;
            let below = 0.5 * (1.0 + decay * decay) + (1.0 + 2.0 * x * x) * decay;
            above / below * factor
        };
        let sum: f64 = waves.iter().map(wave).sum();
        sum / (4.0 * PI * self.shear_modulus_pa * radius_m)
    }
}

/// q = k a of the integral's points, with p(q) (1 - J0(q)) times their distance, for any radius.
fn waves() -> Vec<[f64; 2]> {
    const STEP: f64 = 0.05;
    let wave = |i: u32| {
        let q = (f64::from(i) + 0.5) * STEP;
        let pressure = 3.0 * (q.sin() - q * q.cos()) / (q * q * q);
        [q, STEP * pressure * (1.0 - bessel_j0(q))]
    };
    (0..2_000).map(wave).collect()
}

/// J0 by its integral (Abramowitz and Stegun 9.1.18); the trapezoidal rule is exact to rounding for
/// `x` up to about the number of points.
fn bessel_j0(x: f64) -> f64 {
    const POINTS: u32 = 160;
    let angles = (0..POINTS).map(|i| PI * (f64::from(i) + 0.5) / f64::from(POINTS));
    angles.map(|angle| (x * angle.sin()).cos()).sum::<f64>() / f64::from(POINTS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hertz on a half-space of the reduced modulus 4 G.
    #[test]
    fn a_ball_on_a_thick_layer_has_the_contact_of_hertz() {
        let thick = Layer {
            thickness_m: 0.5,
            shear_modulus_pa: 20e3,
        };
        for (radius_m, force_n) in [(3e-3, 0.2), (8e-3, 1.0)] {
            let exact = (3.0 * force_n * radius_m / (16.0 * 20e3_f64)).cbrt();
            let found = Tip::Ball(radius_m).contact_radius_m(&thick, force_n);
            assert!((found / exact - 1.0).abs() < 2e-3, "{found} {exact}");
        }
    }

    /// Force over Hertz's at the same contact radius, for nu = 0.5, by Hayes' integral equation
    /// (J. Biomech. 5 (1972) 541): 1.008 at a/h = 0.2 and 1.044 at 0.4.
    #[test]
    fn a_ball_on_a_layer_has_a_smaller_contact() {
        let layer = Layer {
            thickness_m: 5e-3,
            shear_modulus_pa: 20e3,
        };
        for (aspect, factor) in [(0.2, 1.008), (0.4, 1.044)] {
            let a_m: f64 = aspect * layer.thickness_m;
            let radius_m = 8e-3;
            let force_n = 16.0 * 20e3 * a_m.powi(3) / (3.0 * radius_m) * factor;
            let found = Tip::Ball(radius_m).contact_radius_m(&layer, force_n);
            println!("{aspect}: {}", found / a_m - 1.0);
            assert!((found / a_m - 1.0).abs() < 0.01, "{aspect}: {found} {a_m}");
        }
    }
}
