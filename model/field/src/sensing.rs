//! The sensing coil above the stack, and what the stack's stray field does to it.
//!
//! L = L₀ + μ₀π ∫ S(k)² F(k) dk over k from 0, S(k) = Σ aᵢ J₁(k aᵢ) over the turns' radii, for
//! slabs of elastomer on both sides: F = (1 + G′)²/(1 − G′²) − 1 with G′ = G e^(−2kd) and
//! G = (μ² − 1)(1 − e^(−2kt))/[(μ + 1)² − (μ − 1)² e^(−2kt)].

use core::f64::consts::PI;

use crate::material::{MU_0, Material};

/// A planar spiral between two slabs of elastomer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensingCoil {
    /// Outer diameter, m.
    pub outer_m: f64,
    /// Inner diameter, m.
    pub inner_m: f64,
    /// Turns.
    pub turns: u32,
    /// Thickness of each slab, m.
    pub slab_m: f64,
    /// Gap between coil and slab at rest, m.
    pub gap_m: f64,
}

impl SensingCoil {
    /// 14 mm outside, 4 mm inside, 25 turns, slabs of 2 mm at 1 mm on both sides.
    pub const REFERENCE: Self = Self {
        outer_m: 14e-3,
        inner_m: 4e-3,
        turns: 25,
        slab_m: 2e-3,
        gap_m: 1e-3,
    };

    /// Inductance without slabs, H, by Mohan's current sheet.
    #[must_use]
    pub fn free_h(&self) -> f64 {
        let ratio = (self.outer_m - self.inner_m) / (self.outer_m + self.inner_m);
        let mean = 0.5 * (self.outer_m + self.inner_m);
        let turns = f64::from(self.turns);
        0.5 * MU_0 * turns * turns * mean * ((2.46 / ratio).ln() + 0.2 * ratio * ratio)
    }

    /// Inductance with slabs of a relative permeability at a gap, H.
    #[must_use]
    pub fn between_slabs_h(&self, mu_r: f64, gap_m: f64) -> f64 {
        let pitch = (self.outer_m - self.inner_m) / 2.0 / f64::from(self.turns);
        let radius = |turn: u32| 0.5 * (self.inner_m + pitch) + f64::from(turn) * pitch;
        // e^(−2kd) ends the integrand: 20/d is e^-40.
        const STEPS: u32 = 1_000;
        let step = 20.0 / gap_m.max(1e-4) / f64::from(STEPS);
        let mut sum = 0.0;
        for k in (0..STEPS).map(|n| (f64::from(n) + 0.5) * step) {
            let source: f64 = (0..self.turns)
                .map(|turn| radius(turn) * libm::j1(k * radius(turn)))
                .sum();
            let decay = (-2.0 * k * self.slab_m).exp();
            let slab = (mu_r * mu_r - 1.0) * (1.0 - decay)
                / ((mu_r + 1.0).powi(2) - (mu_r - 1.0).powi(2) * decay);
            let image = slab * (-2.0 * k * gap_m).exp();
            let both = (1.0 + image) * (1.0 + image) / (1.0 - image * image) - 1.0;
            sum += source * source * both * step;
        }
        self.free_h() + MU_0 * PI * sum
    }

    /// How far the sensing layer seems to move, m, when a stray field `b_t` across the slabs lowers
    /// their permeability, and the relative change of L.
    ///
    /// The field passes the slabs along the axis, so that B is the same in them as outside; the
    /// coil's own field meets the differential permeability at that bias. Reversible permeability
    /// is lower than differential, so that this is an upper bound by its kind.
    #[must_use]
    pub fn disturbance(&self, elastomer: &Material, b_t: f64) -> (f64, f64) {
        let h = elastomer.reluctivity(b_t.abs()).nu * b_t.abs();
        let at_rest = self.between_slabs_h(elastomer.initial_mu_r(), self.gap_m);
        let biased = self.between_slabs_h(elastomer.differential_mu_r(h), self.gap_m);
        let step = 1e-6;
        let nearer = self.between_slabs_h(elastomer.initial_mu_r(), self.gap_m - step);
        let slope = (nearer - at_rest) / step;
        ((at_rest - biased) / slope, biased / at_rest - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inductances_as_tabulated() {
        let coil = SensingCoil::REFERENCE;
        assert!((coil.free_h() / 5.48e-6 - 1.0).abs() < 5e-3);
        for (gap, ratio) in [(0.5e-3, 1.897), (1e-3, 1.551), (2e-3, 1.252), (5e-3, 1.045)] {
            let found = coil.between_slabs_h(3.7, gap) / coil.free_h();
            assert!((found / ratio - 1.0).abs() < 3e-3, "{gap}: {found}");
        }
    }

    #[test]
    fn a_stray_field_seems_a_retreat() {
        let elastomer = Material::Powder {
            chi: 2.7,
            saturation_a_per_m: 510e3,
        };
        let (displacement, change) = SensingCoil::REFERENCE.disturbance(&elastomer, 6e-3);
        assert!((-0.006..-0.0005).contains(&change), "{change}");
        assert!((1e-6..20e-6).contains(&displacement), "{displacement}");
    }
}
