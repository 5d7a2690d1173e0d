//! Mutual inductance of the drive coils and the sensing coil, through a plane of copper.
//!
//! Coaxial turns couple as M = μ0 π Σᵢ Σⱼ aᵢ bⱼ ∫₀^∞ J1(k aᵢ) J1(k bⱼ) e^(−k zⱼ) T(k) dk, with the
//! radii aᵢ of the sensing coil and bⱼ of the drive coils at the distance zⱼ. A plane of
//! conductivity σ and thickness t transmits, at the angular frequency ω, the part
//!
//! T(k) = 1/[cosh γt + ½ (γ/k + k/γ) sinh γt],  γ² = k² + jωμ0σ
//!
//! of each component (boundary conditions of A at both faces). The plane is infinite. Magnetic
//! elastomer is left out, since it raises mutual and own inductance of the drive coils alike.

use core::f64::consts::{PI, TAU};

use super::CoilDesign;
use super::filaments::MU_0;

/// Conductivity of copper at 20 °C, S/m (IEC 60028).
pub const COPPER_S_PER_M: f64 = 5.8e7;

/// Number of wave numbers at which the midpoint rule evaluates the integrand: up to 1500/m, beyond
/// which e^(−k z) is below 3·10⁻³ at the 4 mm or more between drive and sensing coil.
const STEPS: u32 = 600;
const STEP_PER_M: f64 = 2.5;

/// A turn of the drive coils.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// Radius of the turn, m.
    pub radius_m: f64,
    /// Distance of the turn from the plane of the sensing coil, m, 4 mm or more.
    pub distance_m: f64,
}

/// The turns of the paper's actuated layer: seven rings in each of four layers of copper (table 1 of
/// the paper), with the sensing coil `above_m` above the upper board.
pub fn drive_turns(above_m: f64) -> impl Iterator<Item = Turn> {
    let layers_m = [0.035e-3, 1.605e-3, 6.675e-3, 8.245e-3];
    layers_m.into_iter().flat_map(move |layer_m| {
        (0..7).map(move |ring| Turn {
            radius_m: 9e-3 + 3e-3 * f64::from(ring),
            distance_m: 8.28e-3 + above_m - layer_m,
        })
    })
}

/// Mutual inductance at a frequency, H, with a plane of copper of `copper_m` between the coils.
#[must_use]
pub fn mutual_inductance_h(
    sensing: &CoilDesign,
    turns: &[Turn],
    copper_m: f64,
    frequency_hz: f64,
) -> f64 {
    let alpha = TAU * frequency_hz * MU_0 * COPPER_S_PER_M;
    let (mut real, mut imaginary) = (0.0, 0.0);
    for step in 0..STEPS {
        let k = STEP_PER_M * (f64::from(step) + 0.5);
        let sensing: f64 = sensing.radii_m().map(|a| a * libm::j1(k * a)).sum();
        let drive: f64 = turns
            .iter()
            .map(|turn| {
                turn.radius_m * libm::j1(k * turn.radius_m) * libm::exp(-k * turn.distance_m)
            })
            .sum();
        let (passes, turned) = passes(k, alpha, copper_m);
        real += sensing * drive * passes;
        imaginary += sensing * drive * turned;
    }
    MU_0 * PI * STEP_PER_M * libm::hypot(real, imaginary)
}

/// Real and imaginary part of T(k), with α = ωμ0σ in 1/m².
fn passes(k: f64, alpha: f64, thickness_m: f64) -> (f64, f64) {
    // γ = p + jq
    let magnitude = libm::hypot(k * k, alpha);
    let p = libm::sqrt(0.5 * (magnitude + k * k));
    let q = libm::sqrt(0.5 * (magnitude - k * k));
    let (a, b) = (p * thickness_m, q * thickness_m);
    let (sin, cos, sinh, cosh) = (libm::sin(b), libm::cos(b), libm::sinh(a), libm::cosh(a));
    // ½ (γ/k + k/γ) = u + jv
    let u = 0.5 * (p / k + k * p / magnitude);
    let v = 0.5 * (q / k - k * q / magnitude);
    let real = cosh * cos + u * sinh * cos - v * cosh * sin;
    let imaginary = sinh * sin + u * cosh * sin + v * sinh * cos;
    let square = real * real + imaginary * imaginary;
    (real / square, -imaginary / square)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_loops_have_maxwells_mutual_inductance() {
        // Maxwell 1873, art. 701, with the integrals by the arithmetic-geometric mean.
        let [a, b, z] = [5e-3_f64, 20e-3, 10e-3];
        let square = 4.0 * a * b / ((a + b).powi(2) + z * z);
        let (mut m, mut n, mut power) = (1.0, (1.0 - square).sqrt(), 0.5);
        let mut sum = power * square;
        for _ in 0..8 {
            let c: f64 = 0.5 * (m - n);
            (m, n) = (0.5 * (m + n), f64::sqrt(m * n));
            power *= 2.0;
            sum += power * c * c;
        }
        let first = 0.5 * PI / m;
        let second = first * (1.0 - sum);
        let modulus = square.sqrt();
        let exact =
            MU_0 * (a * b).sqrt() * ((2.0 / modulus - modulus) * first - 2.0 / modulus * second);
        let loop_alone = CoilDesign {
            outer_diameter_m: 10.1e-3,
            inner_diameter_m: 9.9e-3,
            turns: 1,
            ..CoilDesign::REFERENCE
        };
        let turn = Turn {
            radius_m: b,
            distance_m: z,
        };
        let found = mutual_inductance_h(&loop_alone, &[turn], 0.0, 3e6);
        assert!((found / exact - 1.0).abs() < 1e-3, "{found} {exact}");
    }

    #[test]
    fn a_thin_sheet_passes_what_the_closed_form_says() {
        // T = 1/(1 + jωμ0σt/2k) for a sheet much thinner than the skin.
        let (k, thickness_m) = (120.0, 1e-6);
        let alpha = TAU * 62.5e3 * MU_0 * COPPER_S_PER_M;
        let (real, imaginary) = passes(k, alpha, thickness_m);
        let x = alpha * thickness_m / (2.0 * k);
        assert!((real - 1.0 / (1.0 + x * x)).abs() < 1e-3);
        assert!((imaginary + x / (1.0 + x * x)).abs() < 1e-3);
    }

    #[test]
    fn direct_current_passes_any_sheet() {
        let (real, imaginary) = passes(100.0, 0.0, 70e-6);
        assert!((real * (100.0 * 70e-6_f64).exp() - 1.0).abs() < 1e-9 && imaginary == 0.0);
    }
}
