//! Displacement inside an incompressible layer that is bonded to a rigid base, under a round contact.
//!
//! At the wave number k the displacement is w = b (x cosh x − sinh x) + d x sinh x with x = kz above the
//! base, where w and w' vanish; b/d follows from a surface without shear, the scale from the surface's
//! compliance (Johnson, "Contact mechanics", 1985, section 5.8). The pressure is Hertz's, p = 3F (sin q −
//! q cos q)/q³ with q = ka.

use std::f64::consts::TAU;

use palpate_sim::touch::Layer;

/// Displacement of heights and radii by a force of 1 N.
pub(super) struct Pressed {
    /// Wave numbers, 1/m, with the surface's displacement of each, m²/N.
    waves: Vec<[f64; 2]>,
    thickness_m: f64,
}

impl Pressed {
    /// A contact of this radius on a layer with Poisson's ratio 0.5.
    pub(super) fn new(layer: &Layer, contact_m: f64) -> Self {
        let (last_per_m, count) = (40.0 / contact_m, 3000);
        let step_per_m = last_per_m / f64::from(count);
        let wave = |index: u32| {
            let k = step_per_m * (f64::from(index) + 0.5);
            let q = k * contact_m;
            let pressure = 3.0 * (q.sin() - q * q.cos()) / (q * q * q);
            let surface = layer.compliance_m_per_pa(k) * pressure;
            [k, step_per_m * k * surface / TAU]
        };
        Self {
            waves: (0..count).map(wave).collect(),
            thickness_m: layer.thickness_m,
        }
    }

    /// Displacements at a height above the base, m/N, as a table over the distance from the axis in
    /// steps of `step_m`.
    pub(super) fn at(&self, height_m: f64, step_m: f64, count: u32) -> Vec<f64> {
        let waves: Vec<[f64; 2]> = self
            .waves
            .iter()
            .map(|[k, surface]| [*k, surface * share(k * height_m, k * self.thickness_m)])
            .collect();
        let sum = |index: u32| {
            let r_m = step_m * f64::from(index);
            waves.iter().map(|[k, w]| w * libm::j0(k * r_m)).sum()
        };
        (0..count).map(sum).collect()
    }
}

/// Displacement at x = kz relative to that of the surface at α = kh.
fn share(x: f64, alpha: f64) -> f64 {
    // Divided by e^α, so that nothing overflows.
    let wave = |x: f64| {
        let (up, down) = (0.5 * (x - alpha).exp(), 0.5 * (-x - alpha).exp());
        (up + down, up - down)
    };
    let (cosh, sinh) = wave(alpha);
    let ratio = -(cosh + alpha * sinh) / (alpha * cosh);
    let at = |x: f64| {
        let (cosh, sinh) = wave(x);
        ratio * (x * cosh - sinh) + x * sinh
    };
    at(x) / at(alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thick_layer_moves_as_a_half_space() {
        // Under a harmonic pressure (1 + kd) e^(−kd) at the depth d (Johnson 1985, section 2.2).
        for depth in [0.1, 1.0, 3.0] {
            let found = share(40.0 - depth, 40.0);
            let expected = (1.0 + depth) * f64::exp(-depth);
            assert!((found / expected - 1.0).abs() < 1e-9, "{depth}: {found}");
        }
    }

    #[test]
    fn a_thin_layer_bulges_as_a_parabola_over_its_height() {
        // Flow between plates: w' follows z (2h − z), so w follows z² (3h − z)/(2h³).
        let found = share(0.5e-3, 1e-3);
        assert!((found - 0.3125).abs() < 1e-4, "{found}");
    }
}
