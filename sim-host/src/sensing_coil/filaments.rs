//! Inductance of a planar spiral in air: the sum over its turns as circular filaments.
//!
//! L0 = Σᵢ Lᵢ + Σᵢ≠ⱼ Mᵢⱼ with Maxwell's mutual inductance of coaxial circles and the self-inductance
//! of a ring, μ0 a (ln(8a/R) − 2), R being the geometric mean distance of a flat track to itself,
//! 0.2235 (width + thickness) (Grover, "Inductance calculations", 1946).

use core::f64::consts::{FRAC_PI_2, PI};

/// Permeability of free space, H/m.
pub(super) const MU_0: f64 = 4e-7 * PI;

/// Sum over the turns of a spiral, H. `radii_m` are the turns' radii, `track_m` width and thickness
/// of the conductor.
#[must_use]
pub(super) fn inductance_h(radii_m: &[f64], track_m: (f64, f64)) -> f64 {
    let own_distance_m = 0.2235 * (track_m.0 + track_m.1);
    let mut sum = 0.0;
    for (turn, &a) in radii_m.iter().enumerate() {
        sum += MU_0 * a * (libm::log(8.0 * a / own_distance_m) - 2.0);
        for &b in radii_m.iter().take(turn) {
            sum += 2.0 * mutual_h(a, b);
        }
    }
    sum
}

/// Inductance as [`inductance_h`], H, but with the width w and thickness t of the tracks in the
/// mutual inductances too. The geometric mean distance R of two rectangles side by side at the
/// distance d is ln R = ln d − (w² − t²)/12d² − w⁴/60d⁴ (Grover, chapter 3; the first terms, within
/// 1e-4 of a pair's inductance for tracks of half the pitch).
#[must_use]
pub(super) fn inductance_of_tracks_h(radii_m: &[f64], track_m: (f64, f64)) -> f64 {
    let [w, t] = [track_m.0 * track_m.0, track_m.1 * track_m.1];
    let mut sum = inductance_h(radii_m, track_m);
    for (turn, &a) in radii_m.iter().enumerate() {
        for &b in radii_m.iter().take(turn) {
            let d = (a - b) * (a - b);
            sum += 2.0 * MU_0 * libm::sqrt(a * b) * ((w - t) / (12.0 * d) + w * w / (60.0 * d * d));
        }
    }
    sum
}

/// Mutual inductance of two circles in one plane, H (Maxwell):
/// μ0 √(ab) [(2/k − k) K − (2/k) E], k² = 4ab/(a+b)².
fn mutual_h(a_m: f64, b_m: f64) -> f64 {
    let k = 2.0 * libm::sqrt(a_m * b_m) / (a_m + b_m);
    let (first, second) = elliptic(k);
    MU_0 * libm::sqrt(a_m * b_m) * ((2.0 / k - k) * first - 2.0 / k * second)
}

/// Complete elliptic integrals K(k) and E(k), 0 ≤ k < 1, by the arithmetic–geometric mean
/// (Abramowitz and Stegun 17.6).
fn elliptic(k: f64) -> (f64, f64) {
    let (mut a, mut b, mut c) = (1.0, libm::sqrt(1.0 - k * k), k);
    let (mut power, mut sum) = (0.5, 0.5 * c * c);
    // Quadratic convergence: once c is below 1e-9 of a, the next c is only rounding error, so the
    // sum has its last digit.
    while c.abs() > 1e-9 * a {
        (a, b, c) = (0.5 * (a + b), libm::sqrt(a * b), 0.5 * (a - b));
        power *= 2.0;
        sum += power * c * c;
    }
    let first = FRAC_PI_2 / a;
    (first, first * (1.0 - sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elliptic_integrals_are_those_of_the_tables() {
        // Abramowitz and Stegun tables 17.1 and 17.2, m = k^2.
        for (m, first, second) in [
            (0.0, FRAC_PI_2, FRAC_PI_2),
            (0.5, 1.854_074_677_301_372, 1.350_643_881_047_676),
            (0.99, 3.695_637_362_989_875, 1.015_993_545_025_224),
        ] {
            let (k, e) = elliptic(f64::sqrt(m));
            assert!((k / first - 1.0).abs() < 1e-14, "K({m}) = {k}");
            assert!((e / second - 1.0).abs() < 1e-14, "E({m}) = {e}");
        }
    }
}
