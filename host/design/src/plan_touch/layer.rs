//! An elastic layer that is bonded to a rigid base and pressed by a round contact.
//!
//! Linear elasticity, without friction at the surface, of a layer that is wide against its thickness. In the Hankel
//! transform of order zero, with the wave number k, the displacement of the surface is the pressure times [`Layer::compliance_m_per_pa`].

/// An elastic layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layer {
    pub(super) thickness_m: f64,
    pub(super) shear_modulus_pa: f64,
    /// Poisson's ratio, 0 to 0.5.
    pub(super) poisson: f64,
}

impl Layer {
    /// Displacement of the surface per pressure at the wave number `k`, 1/m (above zero):
    ///
    /// C = (1 - nu)/(G k) [(3 - 4 nu) sinh 2x - 2x] / [(3 - 4 nu) cosh 2x + 5 - 12 nu + 8 nu^2 + 2 x^2], x = k h
    ///
    /// (Johnson, "Contact mechanics", section 5.8). It rises to (1 - nu)/(G k), the half-space's.
    pub(super) fn compliance_m_per_pa(&self, k: f64) -> f64 {
        let nu = self.poisson;
        let x = k * self.thickness_m;
        let stiff = 3.0 - 4.0 * nu;
        // Numerator and denominator times exp(-2x), so that neither overflows.
        let decay = (-2.0 * x).exp();
        let above = 0.5 * stiff * (1.0 - decay * decay) - 2.0 * x * decay;
        let constant = 5.0 - 12.0 * nu + 8.0 * nu * nu + 2.0 * x * x;
        let below = 0.5 * stiff * (1.0 + decay * decay) + constant * decay;
        (1.0 - nu) / (self.shear_modulus_pa * k) * above / below
    }
}

/// Transform of the pressure of a round contact of the force 1, p(r) = 3/(2 pi a^2) sqrt(1 - r^2/a^2) (Hertz), at
/// q = k a: 3 (sin q - q cos q)/q^3.
pub(super) fn pressure(q: f64) -> f64 {
    if q < SMALL {
        return 1.0 - 0.1 * q * q;
    }
    3.0 * (q.sin() - q * q.cos()) / (q * q * q)
}

/// Derivative of [`pressure`] by ln a.
pub(super) fn pressure_by_ln_radius(q: f64) -> f64 {
    if q < SMALL {
        return -0.2 * q * q;
    }
    3.0 * (q.sin() / q - pressure(q))
}

/// Value of q below which the series replaces the closed form: the first term that the series omits, q^4/280, is below 4e-15,
/// and the closed form would have a rounding error of about 1e-9.
const SMALL: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns W at the surface per pressure there, by integrating the equations of a layer in plane strain from the base to the
    /// surface (Runge and Kutta). The displacements are u = U sin kx along the layer and w = W cos kx across it; the amplitudes
    /// of the shear and normal stress are t and s. With the shear modulus G and m = nu/(1 - nu):
    /// U' = t/G + kW, W' = (1 - m) s/2G - m k U, t' = k (m s + 2G (1 + m) k U), s' = -k t.
    fn integrated(layer: &Layer, k: f64) -> f64 {
        const STEPS: u32 = 2_000;
        let (g, m) = (
            layer.shear_modulus_pa,
            layer.poisson / (1.0 - layer.poisson),
        );
        let slope = |[u, w, t, s]: [f64; 4]| {
            [
                t / g + k * w,
                (1.0 - m) * s / (2.0 * g) - m * k * u,
                k * (m * s + 2.0 * g * (1.0 + m) * k * u),
                -k * t,
            ]
        };
        let plus = |one: [f64; 4], by: f64, other: [f64; 4]| {
            core::array::from_fn::<f64, 4, _>(|i| one[i] + by * other[i])
        };
        let step = layer.thickness_m / f64::from(STEPS);
        let surface = |mut y: [f64; 4]| {
            for _ in 0..STEPS {
                let a = slope(y);
                let b = slope(plus(y, 0.5 * step, a));
                let c = slope(plus(y, 0.5 * step, b));
                let d = slope(plus(y, step, c));
                y = core::array::from_fn(|i| {
                    y[i] + step / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
                });
            }
            y
        };
        // At the base U = W = 0; the surface has no shear stress.
        let [one, other] = [surface([0.0, 0.0, 1.0, 0.0]), surface([0.0, 0.0, 0.0, 1.0])];
        let share = -one[2] / other[2];
        let [w, stress] = [one[1] + share * other[1], one[3] + share * other[3]];
        w / stress
    }

    #[test]
    fn the_compliance_is_that_of_the_integrated_equations() {
        for poisson in [0.0, 0.3, 0.45, 0.499, 0.5] {
            for x in [0.1, 0.5, 1.0, 2.0, 4.0] {
                let layer = Layer {
                    thickness_m: 5e-3,
                    shear_modulus_pa: 20e3,
                    poisson,
                };
                let k = x / layer.thickness_m;
                let off = layer.compliance_m_per_pa(k) / integrated(&layer, k) - 1.0;
                assert!(off.abs() < 1e-7, "nu {poisson}, kh {x}: {off}");
            }
        }
    }

    /// nu = 1/2: (sinh 2x - 2x) / [2 G k (cosh 2x + 1 + 2x^2)].
    #[test]
    fn the_incompressible_layer_has_the_shorter_form() {
        let layer = Layer {
            thickness_m: 3e-3,
            shear_modulus_pa: 20e3,
            poisson: 0.5,
        };
        for x in [0.2_f64, 1.0, 3.0, 300.0] {
            let k = x / layer.thickness_m;
            let half_space = 1.0 / (2.0 * layer.shear_modulus_pa * k);
            let ratio = if x > 100.0 {
                1.0
            } else {
                ((2.0 * x).sinh() - 2.0 * x) / ((2.0 * x).cosh() + 1.0 + 2.0 * x * x)
            };
            let off = layer.compliance_m_per_pa(k) / (half_space * ratio) - 1.0;
            assert!(off.abs() < 1e-12, "{x}: {off}");
        }
    }

    /// Pressure times J0 over the contact, by the midpoint rule.
    #[test]
    fn the_pressure_is_that_of_hertz() {
        const RINGS: u32 = 40_000;
        for q in [1e-4_f64, 0.5, 3.0, 12.0] {
            let ring = |i: u32| {
                let r = (f64::from(i) + 0.5) / f64::from(RINGS);
                3.0 * r * (1.0 - r * r).sqrt() * libm::j0(q * r) / f64::from(RINGS)
            };
            let sum: f64 = (0..RINGS).map(ring).sum();
            assert!((pressure(q) - sum).abs() < 1e-6, "{q}");
            let step = 1e-4;
            let slope = (pressure(q * (1.0 + step)) - pressure(q * (1.0 - step))) / (2.0 * step);
            assert!((pressure_by_ln_radius(q) - slope).abs() < 1e-7, "{q}");
        }
    }
}
