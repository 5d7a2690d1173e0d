//! Response of an elastic layer that is bonded to a rigid base.
//!
//! For tractions of one wave number k at the surface, the displacement follows from two harmonic
//! functions ψ and φ (Papkovich and Neuber; Johnson, "Contact mechanics", 1985, section 5.8):
//!
//! 2G w = −κψ + zψ' + φ' (downwards),  2G u = −k (zψ + φ) (along the wave),  κ = 3 − 4ν
//!
//! with the height z above the base, where both displacements vanish. Linear elasticity without
//! friction or inertia; the layer is wide against its thickness.

/// An elastic layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Thickness, m, 1 mm to 50 mm.
    pub thickness_m: f64,
    /// Shear modulus, Pa, 10³ to 10⁸.
    pub shear_modulus_pa: f64,
    /// Poisson's ratio, 0 to 0.5.
    pub poisson: f64,
}

/// Displacement of the layer at one height by tractions of one wave number at its surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Response {
    /// Downward displacement per pressure, m/Pa.
    pub(super) down_by_pressure: f64,
    /// Downward displacement per traction along the wave, m/Pa; it leads the traction by a quarter
    /// of a wave: i times this factor.
    pub(super) down_by_shear: f64,
}

impl Layer {
    /// Compliance of a half-space times the wave number, (1 − ν)/G, 1/Pa.
    pub(super) fn half_space_per_pa(&self) -> f64 {
        (1.0 - self.poisson) / self.shear_modulus_pa
    }

    /// Displacement of the surface per pressure at the wave number `k`, m/Pa:
    ///
    /// C = (1 − ν)/(Gk) · [κ sinh 2α − 2α] / [κ cosh 2α + 5 − 12ν + 8ν² + 2α²],  α = kh
    #[must_use]
    pub fn compliance_m_per_pa(&self, k: f64) -> f64 {
        self.response(k, self.thickness_m).down_by_pressure
    }

    /// Compliance of the surface as a share of the half-space's, less one: −1 at k = 0, and 0 for
    /// waves much shorter than the layer is thick.
    pub(super) fn reduction(&self, k: f64) -> f64 {
        k * self.compliance_m_per_pa(k) / self.half_space_per_pa() - 1.0
    }

    /// Response at the height `height_m` above the base, at most the thickness.
    pub(super) fn response(&self, k: f64, height_m: f64) -> Response {
        if k == 0.0 {
            return self.uniform(height_m);
        }
        let (nu, kappa, h) = (self.poisson, 3.0 - 4.0 * self.poisson, self.thickness_m);
        let alpha = k * h;
        // With e^(k(z−h)) and e^(−kz) in place of cosh and sinh nothing overflows. The base leaves
        // two constants, a and c: ψ = a (up − E down) + (2c/κ) E down, kφ = c (up − E down).
        let e = libm::exp(-alpha);
        let square = e * e;
        let mixed = 2.0 / kappa * square;
        // Pressure: 2(1 − ν) ψ'/k − kh ψ − kφ = −p/k. Traction: (1 − 2ν) ψ − h ψ' − φ' = q/k.
        let [a11, a12] = [
            2.0 * (1.0 - nu) * (1.0 + square) - alpha * (1.0 - square),
            -(2.0 * (1.0 - nu) + alpha) * mixed - (1.0 - square),
        ];
        let [a21, a22] = [
            (1.0 - 2.0 * nu) * (1.0 - square) - alpha * (1.0 + square),
            (1.0 - 2.0 * nu + alpha) * mixed - (1.0 + square),
        ];
        let determinant = a11 * a22 - a12 * a21;
        let (up, down) = (libm::exp(k * (height_m - h)), libm::exp(-k * height_m));
        let [difference, sum, rest] = [up - e * down, up + e * down, 2.0 / kappa * e * down];
        let displacement = |a: f64, c: f64| {
            let psi = a * difference + c * rest;
            let psi_slope = a * sum - c * rest;
            let down = -kappa * psi + k * height_m * psi_slope + c * sum;
            down / (2.0 * self.shear_modulus_pa * k * determinant)
        };
        Response {
            down_by_pressure: displacement(-a22, a21),
            down_by_shear: -displacement(-a12, a11),
        }
    }

    /// Response to an even pressure: compression without bulging.
    fn uniform(&self, height_m: f64) -> Response {
        let nu = self.poisson;
        let per_pa = (1.0 - 2.0 * nu) / (2.0 * self.shear_modulus_pa * (1.0 - nu));
        Response {
            down_by_pressure: per_pa * height_m,
            down_by_shear: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(poisson: f64) -> Layer {
        Layer {
            thickness_m: 5e-3,
            shear_modulus_pa: 20e3,
            poisson,
        }
    }

    #[test]
    fn the_surface_has_the_published_compliance() {
        for nu in [0.0, 0.3, 0.45, 0.5] {
            for alpha in [0.02_f64, 0.3, 1.0, 2.5, 6.0, 15.0, 40.0, 300.0] {
                let layer = layer(nu);
                let k = alpha / layer.thickness_m;
                let kappa = 3.0 - 4.0 * nu;
                let twice = (2.0 * alpha).min(600.0);
                let share = (kappa * twice.sinh() - 2.0 * alpha)
                    / (kappa * twice.cosh() + 5.0 - 12.0 * nu
                        + 8.0 * nu * nu
                        + 2.0 * alpha * alpha);
                let expected = (1.0 - nu) / (20e3 * k) * share;
                let error = layer.compliance_m_per_pa(k) / expected - 1.0;
                assert!(error.abs() < 1e-9, "{nu} {alpha}: {error}");
            }
        }
    }

    #[test]
    fn an_even_pressure_is_the_limit_of_long_waves() {
        for nu in [0.0, 0.3, 0.45] {
            let even = layer(nu).compliance_m_per_pa(0.0);
            let long = layer(nu).compliance_m_per_pa(0.1);
            assert!((long / even - 1.0).abs() < 1e-5, "{nu}");
        }
        assert_eq!(layer(0.5).compliance_m_per_pa(0.0), 0.0);
    }

    #[test]
    fn below_the_surface_the_base_is_at_rest_and_a_thick_layer_is_a_half_space() {
        let layer = layer(0.4);
        let k = 40.0 / layer.thickness_m;
        assert!(layer.response(k, 0.0).down_by_pressure.abs() < 1e-25);
        for depth_m in [0.1e-3, 0.5e-3, 2e-3] {
            // Half-space (Johnson 1985, section 2.2 under a harmonic pressure).
            let x = k * depth_m;
            let expected = (2.0 * 0.6 + x) * libm::exp(-x) / (2.0 * 20e3 * k);
            let found = layer
                .response(k, layer.thickness_m - depth_m)
                .down_by_pressure;
            assert!((found / expected - 1.0).abs() < 1e-9, "{depth_m}");
        }
    }

    #[test]
    fn pressure_and_traction_are_reciprocal() {
        // Maxwell and Betti: the displacement along the wave by a pressure is that downwards by a
        // traction. For an incompressible half-space both vanish.
        let incompressible = layer(0.5);
        let short = incompressible.response(8e3, 5e-3).down_by_shear;
        assert!(short.abs() < 1e-9 * incompressible.compliance_m_per_pa(8e3));
        // Half-space: u = (1 − 2ν) p/(2Gk) (Johnson 1985, section 2.2).
        let other = layer(0.3);
        let expected = 0.4 / (2.0 * 20e3 * 8e3);
        let found = other.response(8e3, 5e-3).down_by_shear;
        assert!(
            (found.abs() / expected - 1.0).abs() < 1e-9,
            "{found} {expected}"
        );
    }
}
