//! The object that is pressed on the sensor.

use super::indented::Indented;
use super::layer::CreepMode;

/// Number of modes of a load that relaxes.
pub const LOAD_MODES: usize = 5;

/// A load spring. Only [`Load::Viscoelastic`] has a memory: its forces, displacements and energies
/// here are those of its instant spring, and [`chain`](super::chain) follows its modes.
///
/// ```
/// use palpate_sim::mechanics::load::Load;
///
/// let load = Load::Hardening { n_per_m: 4e3, cubic_n_per_m3: 1e10 };
/// let force = 4e3 * 0.3e-3 + 1e10 * 0.3e-3_f64.powi(3);
/// assert!((load.displacement_m(force) - 0.3e-3).abs() < 1e-17);
/// assert!((1.0 / load.compliance_m_per_n(0.3e-3) - (4e3 + 3e10 * 0.3e-3_f64.powi(2))).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// F = c x, with c in N/m, 1 to 10¹⁰.
    Spring {
        /// c, N/m.
        n_per_m: f64,
    },
    /// F = c x + k x³: an object that stiffens under load, as a finger does.
    Hardening {
        /// c, N/m, 1 to 10¹⁰.
        n_per_m: f64,
        /// k, N/m³, 0 to 10²⁰.
        cubic_n_per_m3: f64,
    },
    /// An elastic object under a tip.
    Indented(Indented),
    /// An object that relaxes: F = c (x − Σ z), the Kelvin chain of [`layer`](super::layer). One
    /// mode is the standard linear solid; several, decades apart, are a spectrum.
    Viscoelastic {
        /// c, N/m, 1 to 10¹⁰.
        n_per_m: f64,
        /// Modes; amplitudes of zero leave a spring.
        creep: [CreepMode; LOAD_MODES],
    },
    /// A rigid object.
    Rigid,
}

impl Load {
    /// Force for a compression, N; infinite for any compression of a rigid load.
    #[must_use]
    pub fn force_n(&self, x_m: f64) -> f64 {
        match *self {
            Self::Spring { n_per_m } | Self::Viscoelastic { n_per_m, .. } => n_per_m * x_m,
            Self::Hardening {
                n_per_m,
                cubic_n_per_m3,
            } => x_m * (n_per_m + cubic_n_per_m3 * x_m * x_m),
            Self::Indented(object) => object.force_n(x_m),
            Self::Rigid if x_m == 0.0 => 0.0,
            Self::Rigid => f64::INFINITY,
        }
    }

    /// Compression under a force of zero or more, m.
    #[must_use]
    pub fn displacement_m(&self, force_n: f64) -> f64 {
        match *self {
            Self::Spring { n_per_m } | Self::Viscoelastic { n_per_m, .. } => force_n / n_per_m,
            Self::Hardening {
                n_per_m,
                cubic_n_per_m3,
            } => cubic_root(n_per_m, cubic_n_per_m3, force_n),
            Self::Indented(object) => object.displacement_m(force_n),
            Self::Rigid => 0.0,
        }
    }

    /// Compression x and force F of the load in series with a spring of compliance C, which
    /// together take `total_m`, zero or more: the root of x + C F(x) = total.
    ///
    /// A hardening load uses Newton's method from the linear solution. The left side is convex, so
    /// the iteration falls monotonically to the root; relative error 10⁻¹⁵.
    #[must_use]
    pub fn in_series(&self, total_m: f64, compliance_m_per_n: f64) -> (f64, f64) {
        let x_m = match *self {
            Self::Spring { n_per_m } | Self::Viscoelastic { n_per_m, .. } => {
                total_m / (1.0 + compliance_m_per_n * n_per_m)
            }
            Self::Hardening {
                n_per_m,
                cubic_n_per_m3,
            } => cubic_root(
                1.0 + compliance_m_per_n * n_per_m,
                compliance_m_per_n * cubic_n_per_m3,
                total_m,
            ),
            Self::Indented(object) => return object.in_series(total_m, compliance_m_per_n),
            Self::Rigid => return (0.0, total_m / compliance_m_per_n),
        };
        (x_m, self.force_n(x_m))
    }

    /// dx/dF at a compression, m/N.
    #[must_use]
    pub fn compliance_m_per_n(&self, x_m: f64) -> f64 {
        match *self {
            Self::Spring { n_per_m } | Self::Viscoelastic { n_per_m, .. } => 1.0 / n_per_m,
            Self::Hardening {
                n_per_m,
                cubic_n_per_m3,
            } => 1.0 / (n_per_m + 3.0 * cubic_n_per_m3 * x_m * x_m),
            Self::Indented(object) => object.compliance_m_per_n(x_m),
            Self::Rigid => 0.0,
        }
    }

    /// Modes of creep; amplitudes of zero for a load without memory.
    #[must_use]
    pub fn creep(&self) -> [CreepMode; LOAD_MODES] {
        match *self {
            Self::Viscoelastic { creep, .. } => creep,
            _ => [CreepMode::default(); LOAD_MODES],
        }
    }

    /// Compliances of the modes, m/N.
    #[must_use]
    pub fn mode_compliances(&self) -> [f64; LOAD_MODES] {
        let instant_m_per_n = self.compliance_m_per_n(0.0);
        self.creep().map(|mode| mode.amplitude * instant_m_per_n)
    }

    /// Storage compliance J′ at a compression of the instant spring and a frequency, m/N: the real
    /// part of dx/dF for small sine waves, dx/dF + Σ (a/c)/(1 + (2π f τ)²).
    #[must_use]
    pub fn storage_compliance_m_per_n(&self, x_m: f64, hertz: f64) -> f64 {
        let modes = self.mode_compliances().into_iter().zip(self.creep());
        let crept = modes.map(|(compliance, mode)| {
            let turned = core::f64::consts::TAU * hertz * mode.tau_s;
            compliance / (1.0 + turned * turned)
        });
        self.compliance_m_per_n(x_m) + crept.sum::<f64>()
    }

    /// Energy stored at a compression, J.
    #[must_use]
    pub fn energy_j(&self, x_m: f64) -> f64 {
        match *self {
            Self::Spring { n_per_m } | Self::Viscoelastic { n_per_m, .. } => {
                0.5 * n_per_m * x_m * x_m
            }
            Self::Hardening {
                n_per_m,
                cubic_n_per_m3,
            } => {
                let square = x_m * x_m;
                square * (0.5 * n_per_m + 0.25 * cubic_n_per_m3 * square)
            }
            Self::Indented(object) => object.energy_j(x_m),
            Self::Rigid => 0.0,
        }
    }
}

/// The root x ≥ 0 of a x + b x³ = c with a > 0, b ≥ 0, c ≥ 0.
fn cubic_root(a: f64, b: f64, c: f64) -> f64 {
    let mut x = c / a;
    // Sixty steps shrink x by (2/3)^60 where the cubic term dominates, more than any load needs.
    for _ in 0..60 {
        let step = (x * (a + b * x * x) - c) / (a + 3.0 * b * x * x);
        let next = x - step;
        if next >= x {
            break;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::indented::{Material, Tip};

    fn indented(tip: Tip, thickness_m: Option<f64>) -> Load {
        let material = Material {
            young_pa: 0.75e6,
            poisson_ratio: 0.5,
            thickness_m,
        };
        Load::Indented(Indented::new(tip, 8e-3, material))
    }

    #[test]
    fn roots_are_roots_from_soft_to_hard() {
        for b in [0.0, 1e-6, 1.0, 1e6, 1e12, 1e20] {
            for c in [0.0, 1e-12, 1e-3, 1.0, 1e3] {
                let x = cubic_root(1.7, b, c);
                let back = 1.7 * x + b * x * x * x;
                assert!((back - c).abs() <= 4e-15 * c, "{b} {c}: {x} gives {back}");
            }
        }
    }

    #[test]
    fn force_displacement_energy_and_compliance_agree() {
        for load in [
            Load::Spring { n_per_m: 3e3 },
            Load::Hardening {
                n_per_m: 3e3,
                cubic_n_per_m3: 5e10,
            },
            indented(Tip::Pin, None),
            indented(Tip::Ball, None),
            indented(Tip::Ball, Some(4e-3)),
        ] {
            let x = 0.37e-3;
            let force = load.force_n(x);
            assert!((load.displacement_m(force) / x - 1.0).abs() < 1e-14);
            let h = 1e-8;
            let slope = (load.energy_j(x + h) - load.energy_j(x - h)) / (2.0 * h);
            assert!((slope / force - 1.0).abs() < 1e-7);
            let slope = (load.force_n(x + h) - load.force_n(x - h)) / (2.0 * h);
            assert!((slope * load.compliance_m_per_n(x) - 1.0).abs() < 1e-7);
            let compliance = 2e-4;
            let (shared, shared_force) = load.in_series(x + compliance * force, compliance);
            assert!((shared / x - 1.0).abs() < 1e-14);
            assert!((shared_force / force - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn a_rigid_load_takes_no_displacement() {
        assert_eq!(Load::Rigid.displacement_m(5.0), 0.0);
        assert_eq!(Load::Rigid.in_series(1e-3, 1e-4), (0.0, 10.0));
        assert_eq!(Load::Rigid.force_n(1e-9), f64::INFINITY);
        assert_eq!(Load::Rigid.force_n(0.0), 0.0);
    }
}
