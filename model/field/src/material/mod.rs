//! Magnetic materials: the reluctivity ν = H/B as a function of B.

mod curve;
mod reluctivity;

use std::sync::Arc;

pub use curve::{BhCurve, CurveError};
pub use reluctivity::{MU_0, Reluctivity};

/// Magnetisation law of a material. All laws are isotropic and without hysteresis.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// B = μ₀ μ_r H.
    Linear {
        /// Relative permeability μ_r, above 0.
        mu_r: f64,
    },
    /// Froehlich–Kennelly, for powder in rubber: M = χ M_s H / (M_s + χ H).
    Powder {
        /// Initial susceptibility χ = μ_r − 1, above 0.
        chi: f64,
        /// Saturation magnetisation M_s, A/m.
        saturation_a_per_m: f64,
    },
    /// Soft metal: ν/ν₀ = 1/μ_i + (1 − 1/μ_i) t/(1 + t), t = (B/B_knee)ⁿ.
    Metal {
        /// Initial relative permeability μ_i, at least 1.
        initial_mu_r: f64,
        /// Flux density at the knee, T.
        knee_t: f64,
        /// Exponent n, at least 2.
        exponent: f64,
        /// Fraction of the area across the field that is metal, above 0 to 1; the remaining area is
        /// air.
        fill: f64,
    },
    /// Soft metal by a table of H and B.
    Table {
        /// The curve through the table's points.
        curve: Arc<BhCurve>,
        /// Fraction of the area across the field that is metal, above 0 to 1; the remaining area is
        /// air.
        fill: f64,
    },
}

impl Material {
    /// Vacuum.
    pub const VACUUM: Self = Self::Linear { mu_r: 1.0 };

    /// Whether ν does not depend on B.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        matches!(self, Self::Linear { .. })
    }

    /// The relative permeability at B = 0.
    #[must_use]
    pub fn initial_mu_r(&self) -> f64 {
        match *self {
            Self::Linear { mu_r } => mu_r,
            Self::Powder { chi, .. } => 1.0 + chi,
            Self::Metal {
                initial_mu_r, fill, ..
            } => 1.0 + fill * (initial_mu_r - 1.0),
            Self::Table { ref curve, fill } => 1.0 + fill * (curve.initial_mu_r() - 1.0),
        }
    }

    /// A linear material with the initial permeability of this one: its law far below saturation.
    #[must_use]
    pub fn initially(&self) -> Self {
        Self::Linear {
            mu_r: self.initial_mu_r(),
        }
    }

    /// Soft metal with a magnetisation curve.
    #[must_use]
    pub fn table(curve: BhCurve) -> Self {
        Self::Table {
            curve: Arc::new(curve),
            fill: 1.0,
        }
    }

    /// Pieces of this material parallel to the field, with air between: H is the same in both, so
    /// the mean magnetisation is `fill` times that of the material, where `fill` is its fraction of
    /// the area. With the field across the pieces the mixture is less permeable than this model.
    #[must_use]
    pub fn diluted(&self, fill: f64) -> Self {
        match *self {
            Self::Linear { mu_r } => Self::Linear {
                mu_r: 1.0 + fill * (mu_r - 1.0),
            },
            Self::Powder {
                chi,
                saturation_a_per_m,
            } => Self::Powder {
                chi: fill * chi,
                saturation_a_per_m: fill * saturation_a_per_m,
            },
            Self::Metal {
                initial_mu_r,
                knee_t,
                exponent,
                fill: before,
            } => Self::Metal {
                initial_mu_r,
                knee_t,
                exponent,
                fill: before * fill,
            },
            Self::Table {
                ref curve,
                fill: before,
            } => Self::Table {
                curve: Arc::clone(curve),
                fill: before * fill,
            },
        }
    }

    /// Differential permeability dM/dH + 1 at a field strength, A/m.
    #[must_use]
    pub fn differential_mu_r(&self, h_a_per_m: f64) -> f64 {
        match *self {
            Self::Powder {
                chi,
                saturation_a_per_m,
            } => 1.0 + chi / (1.0 + chi * h_a_per_m.abs() / saturation_a_per_m).powi(2),
            _ => self.initial_mu_r(),
        }
    }

    /// ν in m/H and dν/dB in m/(H T), at |B| = `b_t` ≥ 0, T.
    #[must_use]
    pub fn reluctivity(&self, b_t: f64) -> Reluctivity {
        match *self {
            Self::Linear { mu_r } => Reluctivity {
                nu: 1.0 / (MU_0 * mu_r),
                slope: 0.0,
            },
            Self::Powder {
                chi,
                saturation_a_per_m,
            } => powder(b_t, chi, saturation_a_per_m),
            Self::Metal {
                initial_mu_r,
                knee_t,
                exponent,
                fill,
            } => beside_air(b_t, fill, |b_t| metal(b_t, initial_mu_r, knee_t, exponent)),
            Self::Table { ref curve, fill } => beside_air(b_t, fill, |b_t| curve.reluctivity(b_t)),
        }
    }

    /// Flux density in the metal at the mean flux density `b_t`, and last flux density of the
    /// metal's table, T; `None` without a table.
    pub(crate) fn in_table_t(&self, b_t: f64) -> Option<[f64; 2]> {
        let Self::Table { curve, fill } = self else {
            return None;
        };
        let air_t = (1.0 - fill) * MU_0 * self.reluctivity(b_t).nu * b_t;
        Some([(b_t - air_t) / fill, curve.end()[1]])
    }

    /// Energy density of the field, ∫ H dB from 0 to `b_t`, J/m³.
    #[must_use]
    pub fn energy_j_per_m3(&self, b_t: f64) -> f64 {
        if self.is_linear() {
            return 0.5 * self.reluctivity(b_t).nu * b_t * b_t;
        }
        if let Self::Table { curve, fill } = self {
            // Energy of the material, from the cubics of its curve, plus the energy of the air
            // beside it.
            let air = 1.0 - fill;
            let h = self.reluctivity(b_t).nu * b_t;
            let b_m = (b_t - air * MU_0 * h) / fill;
            return fill * curve.energy_j_per_m3(b_m) + 0.5 * air * MU_0 * h * h;
        }
        // Gauss–Legendre with 5 points on each of 16 intervals is accurate within 1e-9 for
        // exponents up to 20.
        const PANELS: u32 = 16;
        let width = b_t / f64::from(PANELS);
        let mut sum = 0.0;
        for panel in 0..PANELS {
            for (node, weight) in GAUSS_5 {
                let b = width * (f64::from(panel) + node);
                sum += weight * width * b * self.reluctivity(b).nu;
            }
        }
        sum
    }
}

/// Nodes and weights of Gauss–Legendre on [0, 1].
const GAUSS_5: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// ν of powder in rubber. H is the positive root of χH² + qH − M_s b = 0, with b = B/μ₀ and q =
/// M_s(1 + χ) − χb.
fn powder(b_t: f64, chi: f64, saturation: f64) -> Reluctivity {
    let b = b_t / MU_0;
    let q = saturation * (1.0 + chi) - chi * b;
    let root = (q * q + 4.0 * chi * b * saturation).sqrt();
    // The sign of q selects the form of the root that has no cancellation.
    let (nu_r, sum) = if q >= 0.0 {
        (2.0 * saturation / (q + root), q + root)
    } else {
        let nu_r = (root - q) / (2.0 * chi * b);
        (nu_r, 2.0 * saturation / nu_r)
    };
    let root_slope = (2.0 * chi * saturation - chi * q) / root;
    let slope = -2.0 * saturation * (root_slope - chi) / (sum * sum);
    Reluctivity {
        nu: nu_r / MU_0,
        slope: slope / (MU_0 * MU_0),
    }
}

fn metal(b_t: f64, initial: f64, knee_t: f64, exponent: f64) -> Reluctivity {
    let t = (b_t / knee_t).powf(exponent);
    let span = 1.0 - 1.0 / initial;
    let share = if t.is_finite() { t / (1.0 + t) } else { 1.0 };
    let slope = if b_t > 0.0 {
        span * exponent * share * (1.0 - share) / b_t
    } else {
        0.0
    };
    Reluctivity {
        nu: (1.0 / initial + span * share) / MU_0,
        slope: slope / MU_0,
    }
}

/// Material that takes the fraction `fill` of an area across the field, beside air. H is the same
/// in both, so B = fill B_m + (1 − fill) μ₀ H(B_m): the flux density B_m in the material lies
/// between B and B/fill.
fn beside_air(b_t: f64, fill: f64, material: impl Fn(f64) -> Reluctivity) -> Reluctivity {
    let air = (1.0 - fill) * MU_0;
    if fill >= 1.0 || b_t <= 0.0 {
        let Reluctivity { nu, slope } = material(b_t);
        return Reluctivity {
            nu: nu / (fill + air * nu),
            slope,
        };
    }
    let state = |b_m: f64| {
        let Reluctivity { nu, slope } = material(b_m);
        (nu * b_m, nu + slope * b_m)
    };
    let (mut low, mut high) = (b_t, b_t / fill);
    let mut b_m = high;
    let mut last_step = high - low;
    // Newton's method; a step that leaves the interval of the root, or is not shorter than the one
    // before, is replaced by halving the interval.
    for _ in 0..100 {
        let (h, differential) = state(b_m);
        let excess = fill * b_m + air * h - b_t;
        if excess > 0.0 {
            high = b_m;
        } else {
            low = b_m;
        }
        let step = excess / (fill + air * differential);
        let next = b_m - step;
        let better = next > low && next < high && step.abs() < 0.5 * last_step;
        let next = if better { next } else { 0.5 * (low + high) };
        last_step = (next - b_m).abs();
        b_m = next;
        if last_step <= 1e-15 * b_m {
            break;
        }
    }
    let (h, differential) = state(b_m);
    let nu = h / b_t;
    Reluctivity {
        nu,
        slope: (differential / (fill + air * differential) - nu) / b_t,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POWDER: Material = Material::Powder {
        chi: 2.7,
        saturation_a_per_m: 510e3,
    };
    const METAL: Material = Material::Metal {
        initial_mu_r: 1e5,
        knee_t: 1.25,
        exponent: 12.0,
        fill: 1.0,
    };

    /// Soft metal with a table of few points.
    fn steel() -> Material {
        let points = [
            [80.0, 0.3],
            [200.0, 1.1],
            [2e3, 1.55],
            [2e4, 1.95],
            [2e5, 2.3],
        ];
        Material::table(BhCurve::through(&points).expect("a curve"))
    }

    /// At equal H, the mean flux density of pillars is that of metal and air, each weighted by its
    /// share of the plane.
    #[test]
    fn soft_metal_is_diluted() {
        for (metal, fill) in [(METAL, 0.05), (METAL, 0.5), (steel(), 0.05), (steel(), 0.5)] {
            let pillars = metal.diluted(fill);
            let initial = 1.0 + fill * (metal.initial_mu_r() - 1.0);
            assert!((pillars.initial_mu_r() / initial - 1.0).abs() < 1e-12);
            for b_m in [1e-9, 0.1, 1.2, 1.6, 2.5] {
                let h = metal.reluctivity(b_m).nu * b_m;
                let b = fill * b_m + (1.0 - fill) * MU_0 * h;
                let found = pillars.reluctivity(b).nu * b;
                assert!(
                    (found / h - 1.0).abs() < 1e-9,
                    "{fill} {b_m}: {found:e} {h:e}"
                );
            }
        }
    }

    #[test]
    fn powder_follows_its_law() {
        for h in [1.0_f64, 1e3, 3e4, 4e5, 1e7] {
            let m = 2.7 * 510e3 * h / (510e3 + 2.7 * h);
            let b = MU_0 * (h + m);
            let found = POWDER.reluctivity(b).nu * b;
            assert!((found / h - 1.0).abs() < 1e-10, "{h}: {found}");
        }
    }

    #[test]
    fn slopes_are_derivatives() {
        for material in [
            POWDER,
            METAL,
            METAL.diluted(0.4),
            steel(),
            steel().diluted(0.4),
        ] {
            for b in [0.01, 0.3, 1.0, 1.25, 1.6, 2.5] {
                let step = 1e-6;
                let nu = |b: f64| material.reluctivity(b).nu;
                let numeric = (nu(b + step) - nu(b - step)) / (2.0 * step);
                let slope = material.reluctivity(b).slope;
                let scale = slope.abs().max(nu(b) * 1e-3);
                assert!((slope - numeric).abs() < 1e-4 * scale, "{material:?} {b}");
            }
        }
    }

    #[test]
    fn energy_integrates_h() {
        for material in [
            POWDER,
            METAL,
            METAL.diluted(0.4),
            steel(),
            steel().diluted(0.4),
        ] {
            let steps = 200_000;
            let b_t = 1.5;
            let width = b_t / f64::from(steps);
            let sum: f64 = (0..steps)
                .map(|k| {
                    let b = width * (f64::from(k) + 0.5);
                    width * b * material.reluctivity(b).nu
                })
                .sum();
            let found = material.energy_j_per_m3(b_t);
            assert!(
                (found / sum - 1.0).abs() < 1e-6,
                "{material:?}: {found} {sum}"
            );
        }
    }
}
