//! Quadrature of the coil's inductance between its layers.

use core::f64::consts::PI;

use super::filaments::MU_0;
use super::layers::{backed_slab, both_sides, conductor_behind_air, one_side};
use super::{COPPER_M, CoilDesign, Sides};

/// Least gap of the model, m. Turns are point filaments, which overestimate the interaction with a
/// slab at contact (SOURCES.md section 5).
pub const LEAST_GAP_M: f64 = 0.1e-3;

/// Upper limit of the wave number in the integral, times [`LEAST_GAP_M`]: exp(−2 · 18.5) is below
/// 10⁻¹⁶.
const CUT_OFF: f64 = 18.5;

/// The coil's part of the integrand, tabulated once: S(k)² times the weights of a composite
/// Gauss–Legendre rule. The layers' part then costs little for any gap.
#[derive(Clone, Debug)]
pub struct CoilIntegral {
    design: CoilDesign,
    /// Distance from the turns at rest to a plane of copper under the lower slab, m.
    copper_m: Option<f64>,
    /// Reflection at the face of an object that touches the upper slab.
    object: f64,
    /// Wave numbers, 1/m, and weights with S(k)², m.
    nodes: Vec<(f64, f64)>,
    /// Inductance with neither MSE nor copper, H.
    in_air_h: f64,
}

impl CoilIntegral {
    /// A coil alone, or with a plane of copper at the distance `copper_m` from its turns at rest.
    ///
    /// The copper reflects as an ideal conductor (70 µm are two skin depths at 3.7 MHz), and lies
    /// behind the lower slab at a fixed distance from it, as under a rigid spacer.
    #[must_use]
    pub fn new(design: CoilDesign, copper_m: Option<f64>) -> Self {
        let radii_m: Vec<f64> = design.radii_m().collect();
        let turns = |k: f64| turns_sum(&radii_m, k);
        Self::with_panels(design, copper_m, design.inductance_in_air_h(), turns, 2.0)
    }

    /// Adds an object that touches the upper slab, with a plane face of this reflection:
    /// (μ − 1)/(μ + 1) for a permeable one. This image method for a half-space is valid for faces
    /// as wide as the coil and as thick as its radius. If MSE is on one side only, the object is on
    /// the other side of the coil, at the gap.
    #[must_use]
    pub fn facing(self, reflection: f64) -> Self {
        Self {
            object: reflection,
            ..self
        }
    }

    /// A coil as in [`Self::new`], with tracks `width_m` wide, above zero and at most the pitch, in
    /// copper of 35 µm. The current is uniform over each track's section, not in a filament at its
    /// centre; gaps count from that centre.
    #[must_use]
    pub fn of_tracks(design: CoilDesign, copper_m: Option<f64>, width_m: f64) -> Self {
        let tracks: Vec<f64> = design.radii_m().collect();
        let turns = |k: f64| track_sum(&tracks, width_m, k);
        let in_air_h = design.inductance_of_tracks_in_air_h(width_m);
        Self::with_panels(design, copper_m, in_air_h, turns, 2.0)
    }

    /// Tabulates the integrand with `panels` panels per period of the fastest oscillation of S²;
    /// `turns` returns S(k).
    fn with_panels(
        design: CoilDesign,
        copper_m: Option<f64>,
        in_air_h: f64,
        turns: impl Fn(f64) -> f64,
        panels: f64,
    ) -> Self {
        let period = PI / (0.5 * design.outer_diameter_m);
        let last = CUT_OFF / LEAST_GAP_M;
        let count = (panels * last / period).ceil();
        let half = 0.5 * last / count;
        let mut nodes = Vec::with_capacity(count as usize * 16);
        for panel in 0..count as u32 {
            let centre = half * f64::from(2 * panel + 1);
            for &(x, weight) in &GAUSS_8 {
                for k in [centre - half * x, centre + half * x] {
                    let s = turns(k);
                    nodes.push((k, half * weight * s * s));
                }
            }
        }
        Self {
            design,
            copper_m,
            object: 0.0,
            nodes,
            in_air_h,
        }
    }

    /// Design of the coil.
    #[must_use]
    pub fn design(&self) -> &CoilDesign {
        &self.design
    }

    /// Inductance at the gap `gap_m`, H; the value at [`LEAST_GAP_M`] for smaller gaps.
    #[must_use]
    pub fn inductance_h(&self, gap_m: f64) -> f64 {
        let gap_m = gap_m.max(LEAST_GAP_M);
        let integral: f64 = self
            .nodes
            .iter()
            .map(|&(k, weight)| weight * self.layers(k, gap_m))
            .sum();
        self.in_air_h + MU_0 * PI * integral
    }

    /// Gain F(k) of the layers at the gap.
    fn layers(&self, k: f64, gap_m: f64) -> f64 {
        let CoilDesign {
            relative_permeability: mu,
            slab_m,
            gap_at_rest_m,
            sides,
            ..
        } = self.design;
        let behind = self.copper_m.map_or(0.0, |copper_m| {
            conductor_behind_air(copper_m - gap_at_rest_m - slab_m, k)
        });
        let lower = one_side(backed_slab(mu, slab_m, k, behind), gap_m, k);
        match sides {
            Sides::One if self.object == 0.0 => lower,
            Sides::One => both_sides(lower, one_side(self.object, gap_m, k)),
            Sides::Both => {
                let upper = backed_slab(mu, slab_m, k, self.object);
                both_sides(lower, one_side(upper, gap_m, k))
            }
        }
    }
}

/// S(k) = Σ aᵢ J1(k aᵢ), m.
fn turns_sum(radii_m: &[f64], k: f64) -> f64 {
    radii_m.iter().map(|&a| a * libm::j1(k * a)).sum()
}

/// S(k), m, for tracks of finite width and thickness: Σ aᵢ J1(k aᵢ), each term averaged over the
/// track's width, times the mean of e^(kz) over the copper's thickness.
fn track_sum(radii_m: &[f64], width_m: f64, k: f64) -> f64 {
    let mean = |share: f64| {
        let radii_m = radii_m.iter().map(|a| a + 0.5 * share * width_m);
        radii_m.map(|a| a * libm::j1(k * a)).sum::<f64>()
    };
    let of = |&(x, weight): &(f64, f64)| 0.5 * weight * (mean(x) + mean(-x));
    let half = 0.5 * k * COPPER_M;
    GAUSS_8.iter().map(of).sum::<f64>() * libm::sinh(half) / half
}

/// Positive nodes and weights of the 16-point Gauss–Legendre rule (Abramowitz and Stegun 25.4).
const GAUSS_8: [(f64, f64); 8] = [
    (0.095_012_509_837_637_44, 0.189_450_610_455_068_5),
    (0.281_603_550_779_258_9, 0.182_603_415_044_923_6),
    (0.458_016_777_657_227_4, 0.169_156_519_395_002_54),
    (0.617_876_244_402_643_7, 0.149_595_988_816_576_73),
    (0.755_404_408_355_003, 0.124_628_971_255_533_87),
    (0.865_631_202_387_831_7, 0.095_158_511_682_492_78),
    (0.944_575_023_073_232_6, 0.062_253_523_938_647_89),
    (0.989_400_934_991_649_9, 0.027_152_459_411_754_095),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_integrates_polynomials_of_degree_31() {
        let sum =
            |power: i32| -> f64 { GAUSS_8.iter().map(|(x, w)| 2.0 * w * x.powi(power)).sum() };
        for power in (0..=30).step_by(2) {
            let error = sum(power) - 2.0 / f64::from(power + 1);
            assert!(error.abs() < 1e-15, "x^{power}: {error}");
        }
    }

    #[test]
    fn twice_the_panels_change_nothing() {
        let coarse = CoilIntegral::new(CoilDesign::REFERENCE, Some(5e-3));
        let radii_m: Vec<f64> = CoilDesign::REFERENCE.radii_m().collect();
        let fine = CoilIntegral::with_panels(
            CoilDesign::REFERENCE,
            Some(5e-3),
            CoilDesign::REFERENCE.inductance_in_air_h(),
            |k| turns_sum(&radii_m, k),
            4.0,
        );
        for gap_m in [0.1e-3, 0.3e-3, 1e-3, 3e-3] {
            let (coarse, fine) = (coarse.inductance_h(gap_m), fine.inductance_h(gap_m));
            assert!(
                (coarse / fine - 1.0).abs() < 2e-12,
                "{gap_m}: {coarse} {fine}"
            );
        }
    }
}
