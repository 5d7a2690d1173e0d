//! Reflection of a coil's field at plane layers.
//!
//! A layer reflects the field component exp(−kz) with the coefficient G. In a static field the
//! layers act like sections of a transmission line of "length" k·thickness, so any stack of layers
//! reduces from its far end to one reflection coefficient.

/// Reflection at a half-space of relative permeability `mu`, seen from air: 0.574 at 3.7.
#[must_use]
pub fn interface(mu: f64) -> f64 {
    (mu - 1.0) / (mu + 1.0)
}

/// Reflection at a slab of thickness `thickness_m` with air behind it, for the wave number `k`, 1/m:
/// G = (μ²−1)(1−e^(−2kt)) / [(μ+1)² − (μ−1)² e^(−2kt)] (SOURCES.md section 5).
#[must_use]
pub fn slab(mu: f64, thickness_m: f64, k: f64) -> f64 {
    backed_slab(mu, thickness_m, k, 0.0)
}

/// Reflection at a slab with a reflection `behind` at its back face, seen from the air at that face
/// (−1 for an ideal conductor that touches it).
#[must_use]
pub fn backed_slab(mu: f64, thickness_m: f64, k: f64, behind: f64) -> f64 {
    let front = interface(mu);
    // Back face, seen from inside the slab: the front's reflection with its sign reversed, combined
    // with `behind`.
    let back = (behind - front) / (1.0 - front * behind);
    let returned = back * libm::exp(-2.0 * k * thickness_m);
    (front + returned) / (1.0 + front * returned)
}

/// Reflection at an ideal conductor behind `air_m` of air.
#[must_use]
pub fn conductor_behind_air(air_m: f64, k: f64) -> f64 {
    -libm::exp(-2.0 * k * air_m)
}

/// Gain of a coil from layers on one side at the gap `gap_m`: F = G e^(−2kd).
#[must_use]
pub fn one_side(reflection: f64, gap_m: f64, k: f64) -> f64 {
    reflection * libm::exp(-2.0 * k * gap_m)
}

/// Gain of a coil from layers on both sides, each given as [`one_side`]:
/// F = (1+G1')(1+G2')/(1−G1'G2') − 1.
#[must_use]
pub fn both_sides(one: f64, other: f64) -> f64 {
    (1.0 + one) * (1.0 + other) / (1.0 - one * other) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const MU: f64 = 3.7;

    #[test]
    fn the_slab_is_the_published_expression() {
        for (thickness_m, k) in [(2e-3, 50.0), (2e-3, 400.0), (0.5e-3, 3000.0)] {
            let decay = f64::exp(-2.0 * k * thickness_m);
            let expected =
                (MU * MU - 1.0) * (1.0 - decay) / ((MU + 1.0).powi(2) - (MU - 1.0).powi(2) * decay);
            assert!((slab(MU, thickness_m, k) - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn ideal_limits_of_contact_and_embedding() {
        let thick = slab(MU, 1.0, 1e3);
        assert!((thick - 0.574).abs() < 5e-4);
        assert!((1.0 + one_side(thick, 0.0, 1e3) - 2.0 * MU / (MU + 1.0)).abs() < 1e-12);
        assert!((1.0 + both_sides(thick, thick) - MU).abs() < 1e-12);
    }

    #[test]
    fn a_slab_of_air_leaves_what_is_behind_it() {
        let (k, thickness_m) = (700.0, 1.5e-3);
        let behind = conductor_behind_air(0.4e-3, k);
        let through_air = backed_slab(1.0, thickness_m, k, behind);
        assert!((through_air - conductor_behind_air(1.9e-3, k)).abs() < 1e-15);
    }

    #[test]
    fn two_slabs_in_touch_are_one() {
        let (k, one, other) = (900.0, 0.7e-3, 1.3e-3);
        let folded = backed_slab(MU, one, k, slab(MU, other, k));
        assert!((folded - slab(MU, one + other, k)).abs() < 1e-14);
    }
}
