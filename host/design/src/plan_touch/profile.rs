//! The radial profile: what a coil reads of a press at a distance.

use core::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::coil::Winding;
use super::layer::{Layer, pressure, pressure_by_ln_radius};

/// Mean approach of the surface per force, weighted by the coil's field, as a function of the distance rho between the press and
/// the coil's axis: Phi(rho) = 1/(2 pi) integral of k S(k) C(k) p(k a) J0(k rho) dk. k is the wave number, S the transform of the
/// coil's weight, C the layer's compliance, and p the transform of the pressure under a contact of radius a.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    step_m: f64,
    /// Responses at multiples of the step.
    points: Vec<Response>,
}

/// Reading of a press of 1 N, m of approach, and its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Response {
    pub(super) approach_m: f64,
    /// Derivative by the distance.
    pub(super) by_distance: f64,
    /// Derivative by the logarithm of the contact's radius, m.
    pub(super) by_ln_radius_m: f64,
}

// A test compares the three with finer and longer sums: within 1e-3 of the profile's peak.

/// Last wave number, where the field's decay exp(-k depth) is 1e-4, or the transform of the pressure, 3/(k a)^2, is 1e-3.
const LAST_DEPTH: f64 = 9.0;
const LAST_CONTACT: f64 = 55.0;
/// Thicknesses beyond the farthest press at which sampling repeats the profile: the layer decays as exp(-0.74 rho/h).
const REACH_THICKNESSES: f64 = 14.0;
/// Points of the table per smallest length of the profile.
const POINTS_PER_LENGTH: f64 = 40.0;

impl Profile {
    /// Profile up to `reach_m`, for a contact of the radius `radius_m`.
    pub(super) fn new(winding: &Winding, layer: &Layer, radius_m: f64, reach_m: f64) -> Self {
        let waves = Waves::new(winding, layer, radius_m, reach_m);
        let smallest_m = winding.depth_m + 0.5 * radius_m;
        let step_m = smallest_m / POINTS_PER_LENGTH;
        let count = (reach_m / step_m).ceil() as u32 + 2;
        let points = (0..count).into_par_iter();
        let points = points.map(|index| waves.at(f64::from(index) * step_m));
        Self {
            step_m,
            points: points.collect(),
        }
    }

    /// Response at a distance, m; zero beyond the table.
    pub(super) fn at(&self, distance_m: f64) -> Response {
        let place = distance_m / self.step_m;
        let (index, share) = (place as usize, place.fract());
        let points = self.points.get(index).zip(self.points.get(index + 1));
        let Some((low, high)) = points else {
            return Response::default();
        };
        let mix = |low: f64, high: f64| low + share * (high - low);
        Response {
            approach_m: mix(low.approach_m, high.approach_m),
            by_distance: mix(low.by_distance, high.by_distance),
            by_ln_radius_m: mix(low.by_ln_radius_m, high.by_ln_radius_m),
        }
    }
}

/// The integrand without J0, at equidistant wave numbers: k, 1/m; the profile's part and the part by ln a, each with the step.
struct Waves(Vec<[f64; 3]>);

impl Waves {
    fn new(winding: &Winding, layer: &Layer, radius_m: f64, reach_m: f64) -> Self {
        let last = (LAST_DEPTH / winding.depth_m).min(LAST_CONTACT / radius_m);
        let period_m =
            reach_m + 2.0 * winding.outer_m + radius_m + REACH_THICKNESSES * layer.thickness_m;
        Self::up_to(winding, layer, radius_m, (last, PI / period_m))
    }

    fn up_to(winding: &Winding, layer: &Layer, radius_m: f64, (last, step): (f64, f64)) -> Self {
        let rings = winding.rings();
        let wave = |index: u32| {
            let k = (f64::from(index) + 0.5) * step;
            let shares = rings.iter().map(|(r_m, share)| share * libm::j0(k * r_m));
            let common = k * shares.sum::<f64>() * layer.compliance_m_per_pa(k) * step / TAU;
            let q = k * radius_m;
            [k, common * pressure(q), common * pressure_by_ln_radius(q)]
        };
        let count = (last / step).ceil() as u32;
        Self((0..count).into_par_iter().map(wave).collect())
    }

    fn at(&self, distance_m: f64) -> Response {
        let mut sum = Response::default();
        for [k, part, by_ln_radius] in &self.0 {
            let x = k * distance_m;
            let wave = libm::j0(x);
            sum.approach_m += part * wave;
            sum.by_distance -= part * k * libm::j1(x);
            sum.by_ln_radius_m += by_ln_radius * wave;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYER: Layer = Layer {
        thickness_m: 3e-3,
        shear_modulus_pa: 20e3,
        poisson: 0.5,
    };
    /// Turns at 2, 2.5, ... 6.5 mm, beside an elastomer of little permeability, whose weight is |H|^2.
    const WINDING: Winding = Winding {
        inner_m: 1.75e-3,
        outer_m: 6.75e-3,
        turns: 10,
        depth_m: 0.6e-3,
        relative_permeability: 1.0,
    };

    /// Computed beforehand by another program, um per N, to a micrometre.
    #[test]
    fn the_profiles_are_those_of_the_reference() {
        let distances_mm = [0.0, 3.0, 5.0, 7.0, 10.0, 13.0, 15.0];
        for (radius_mm, approaches_um) in [
            (1.0, [205.0, 156.0, 47.0, -18.0, -23.0, -9.0, -5.0]),
            (2.0, [222.0, 149.0, 48.0, -14.0, -23.0, -10.0, -5.0]),
            (3.0, [215.0, 136.0, 49.0, -9.0, -22.0, -10.0, -6.0]),
            (4.0, [186.0, 122.0, 50.0, -3.0, -21.0, -10.0, -6.0]),
            (6.0, [124.0, 91.0, 47.0, 9.0, -14.0, -11.0, -7.0]),
        ] {
            let profile = Profile::new(&WINDING, &LAYER, 1e-3 * radius_mm, 20e-3);
            for (distance_mm, expected_um) in distances_mm.iter().zip(approaches_um) {
                let found_um = 1e6 * profile.at(1e-3 * distance_mm).approach_m;
                // A per cent of the peak: the reference is rounded, and off by up to 2 um about 7 mm.
                assert!(
                    (found_um - expected_um).abs() < 2.1,
                    "{radius_mm} mm at {distance_mm} mm: {found_um} um, not {expected_um}"
                );
            }
        }
    }

    #[test]
    fn an_incompressible_layer_keeps_its_volume() {
        let profile = Profile::new(&WINDING, &LAYER, 2e-3, 60e-3);
        let ring = |(index, point): (usize, &Response)| index as f64 * point.approach_m;
        let rings = profile.points.iter().enumerate().map(ring);
        let [down, net] = [rings.clone().map(|v| v.max(0.0)).sum::<f64>(), rings.sum()];
        assert!((net / down).abs() < 5e-3, "{}", net / down);
    }

    /// The zero of cosh 2x + 1 + 2x^2 nearest to the real axis is x = 0.739 i, where cos y = y.
    #[test]
    fn the_response_decays_as_the_layer_does() {
        let narrow = Winding {
            inner_m: 0.4e-3,
            outer_m: 0.6e-3,
            turns: 1,
            ..WINDING
        };
        let profile = Profile::new(&narrow, &LAYER, 1e-3, 30e-3);
        let at = |r: f64| profile.at(r).approach_m * r.sqrt();
        let decay = (at(15e-3) / at(18e-3)).ln();
        assert!((decay - 0.739).abs() < 0.03, "{decay}");
    }

    #[test]
    fn more_wave_numbers_and_points_change_nothing() {
        for radius_m in [1e-3, 4e-3] {
            let profile = Profile::new(&WINDING, &LAYER, radius_m, 20e-3);
            let fine = Waves::up_to(&WINDING, &LAYER, radius_m, (30e3, 10.0));
            let peak = fine.at(0.0).approach_m;
            for step in 0..190 {
                let distance_m = 1.03e-4 * f64::from(step);
                let (found, exact) = (profile.at(distance_m), fine.at(distance_m));
                let off = (found.approach_m - exact.approach_m) / peak;
                let slope = (found.by_distance - exact.by_distance) * 1e-3 / peak;
                let radius = (found.by_ln_radius_m - exact.by_ln_radius_m) / peak;
                let worst = off.abs().max(slope.abs()).max(radius.abs());
                assert!(worst < 1e-3, "{distance_m}: {off} {slope} {radius}");
            }
        }
    }

    /// Derivatives against differences of the profile itself.
    #[test]
    fn the_derivatives_are_those_of_the_profile() {
        let of = |radius_m: f64| Profile::new(&WINDING, &LAYER, radius_m, 20e-3);
        let (profile, wider, narrower) = (of(2e-3), of(2e-3 * 1.01), of(2e-3 * 0.99));
        let peak = profile.at(0.0).approach_m;
        for distance_m in [1e-3, 4e-3, 8e-3, 14e-3] {
            let at = profile.at(distance_m);
            let beside = |by: f64| profile.at(distance_m + by).approach_m;
            let slope = (beside(2e-4) - beside(-2e-4)) / 4e-4;
            assert!(
                (at.by_distance - slope).abs() < 0.02 * peak / 1e-3,
                "{slope}"
            );
            let change = wider.at(distance_m).approach_m - narrower.at(distance_m).approach_m;
            let change = change / 0.02;
            assert!((at.by_ln_radius_m - change).abs() < 0.01 * peak, "{change}");
        }
    }
}
