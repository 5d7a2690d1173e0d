//! What a planar sensing coil reads of a boundary that moves.
//!
//! A coil carries one ampere. Its inductance changes with the displacement w of a boundary between air and a thick magnetic
//! elastomer as dL = integral of s w dA. To first order s is proportional to H_r^2 + mu_r H_z^2 of the coil's own field there,
//! by the energy of a moving boundary (Jackson, "Classical electrodynamics", section 5.16). The reflection (mu_r - 1)/(mu_r + 1)
//! at a half-space changes the field on each side by factors that are the same everywhere.

use core::f64::consts::{PI, TAU};

use palpate_sim::sensing_coil::integral::CoilIntegral;
use palpate_sim::sensing_coil::{CoilDesign, Sides};

/// A round coil below a moving boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Winding {
    /// Inner and outer edge of the winding, m; the turns lie evenly between them.
    pub(super) inner_m: f64,
    pub(super) outer_m: f64,
    pub(super) turns: u32,
    /// Depth of the coil's plane below the boundary, m.
    pub(super) depth_m: f64,
    /// Relative permeability of the elastomer.
    pub(super) relative_permeability: f64,
}

impl Winding {
    /// The coil beside a slab of elastomer of this thickness, m, on one side.
    fn design(&self, slab_m: f64) -> CoilDesign {
        CoilDesign {
            outer_diameter_m: 2.0 * self.outer_m,
            inner_diameter_m: 2.0 * self.inner_m,
            turns: self.turns,
            sides: Sides::One,
            slab_m,
            gap_at_rest_m: self.depth_m,
            relative_permeability: self.relative_permeability,
        }
    }

    /// Relative change of the inductance per metre by which a slab of this thickness, m, approaches.
    pub(super) fn relative_change_per_m(&self, slab_m: f64) -> f64 {
        let coil = CoilIntegral::new(self.design(slab_m), None);
        let step_m = 1e-4 * self.depth_m;
        let [near, far] =
            [-step_m, step_m].map(|step_m| coil.inductance_h(self.depth_m + step_m).ln());
        (near - far) / (2.0 * step_m)
    }

    /// Inductance beside a slab of this thickness, m, H.
    pub(super) fn inductance_h(&self, slab_m: f64) -> f64 {
        let design = self.design(slab_m);
        let effect = CoilIntegral::new(design, None);
        effect.inductance_h(self.depth_m)
    }

    /// Sum of the turns' a J1(k a), m.
    pub(super) fn wave(&self, k: f64) -> f64 {
        let radii_m = self.design(self.outer_m);
        radii_m.radii_m().map(|a_m| a_m * libm::j1(k * a_m)).sum()
    }

    /// Weight s of a displacement at the distance `r_m` from the coil's axis, (A/m)^2 for 1 A.
    pub(super) fn weight(&self, r_m: f64) -> f64 {
        let design = self.design(self.outer_m);
        let (mut radial, mut axial) = (0.0, 0.0);
        for a_m in design.radii_m() {
            let [h_r, h_z] = loop_field(a_m, r_m, self.depth_m);
            radial += h_r;
            axial += h_z;
        }
        radial * radial + self.relative_permeability * axial * axial
    }

    /// Weight on rings: radius, m, and share of the ring in a displacement that is the same
    /// everywhere. The shares add up to one.
    pub(super) fn rings(&self) -> Vec<(f64, f64)> {
        // Midpoint rule: the field varies over the coil's depth and falls with the third power of the distance. Half the
        // step and twice the reach change the transform by less than 2e-4 (a test).
        let step_m = (self.depth_m / 8.0).min(self.outer_m / 40.0);
        self.rings_of(step_m, 6.0 * (self.outer_m + self.depth_m))
    }

    fn rings_of(&self, step_m: f64, reach_m: f64) -> Vec<(f64, f64)> {
        let count = (reach_m / step_m).ceil() as u32;
        let ring = |index: u32| {
            let r_m = (f64::from(index) + 0.5) * step_m;
            (r_m, r_m * self.weight(r_m))
        };
        let mut rings: Vec<_> = (0..count).map(ring).collect();
        let sum: f64 = rings.iter().map(|(_, share)| share).sum();
        rings.iter_mut().for_each(|(_, share)| *share /= sum);
        rings
    }
}

/// Field of a circular loop of radius `a_m` with 1 A, A/m, radial and axial, at the distance `r_m` from the axis and the height
/// `z_m` (Smythe, "Static and dynamic electricity", section 7.10).
fn loop_field(a_m: f64, r_m: f64, z_m: f64) -> [f64; 2] {
    let far = (a_m + r_m).powi(2) + z_m * z_m;
    let near = (a_m - r_m).powi(2) + z_m * z_m;
    let (first, second) = elliptic((near / far).sqrt());
    let scale = 1.0 / (TAU * far.sqrt());
    let squares = a_m * a_m + r_m * r_m + z_m * z_m;
    let h_z = scale * (first + (2.0 * a_m * a_m - squares) / near * second);
    let h_r = scale * z_m / r_m * (squares / near * second - first);
    [h_r, h_z]
}

/// Complete elliptic integrals K and E for the complementary modulus k' > 0, by the arithmetic-geometric mean (Abramowitz and
/// Stegun 17.6).
fn elliptic(complement: f64) -> (f64, f64) {
    /// Steps: convergence is quadratic, and six reach rounding for k' above 1e-4.
    const STEPS: u32 = 8;
    let (mut a, mut b) = (1.0, complement);
    let (mut power, mut sum) = (0.5, 0.5 * (1.0 - complement * complement));
    for _ in 0..STEPS {
        let c = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        power *= 2.0;
        sum += power * c * c;
    }
    let first = 0.5 * PI / a;
    (first, first * (1.0 - sum))
}

#[cfg(test)]
mod tests {
    use palpate_field::design::Design;
    use palpate_field::solve::{Accuracy, solve_ac};

    use super::*;

    const WINDING: Winding = Winding {
        inner_m: 1.75e-3,
        outer_m: 6.75e-3,
        turns: 10,
        depth_m: 0.6e-3,
        relative_permeability: 3.7,
    };

    /// Compares the weight with the slope of the inductance in the simulation, which uses reflections in place of field and
    /// weight: dL/dd = -mu_0 (mu_r - 1) 4/(mu_r + 1)^2 times the integral of the weight.
    #[test]
    fn the_weight_is_the_slope_of_the_inductance() {
        for relative_permeability in [1.01, 3.7, 20.0] {
            let winding = Winding {
                relative_permeability,
                ..WINDING
            };
            let mu = relative_permeability;
            let step_m = 2e-5;
            let rings = (0..6_000).map(|i| (f64::from(i) + 0.5) * step_m);
            let integral: f64 = rings.map(|r| TAU * r * step_m * winding.weight(r)).sum();
            let expected = 4e-7 * PI * (mu - 1.0) * 4.0 / (mu + 1.0).powi(2) * integral;
            let thick_m = 50e-3;
            let coil = CoilIntegral::new(winding.design(thick_m), None);
            let found = winding.relative_change_per_m(thick_m) * coil.inductance_h(winding.depth_m);
            let off = found / expected - 1.0;
            assert!(off.abs() < 2e-3, "mu_r {mu}: {off}");
        }
    }

    /// An approach by a tenth of the depth changes the slope by 5 to 10 %.
    #[test]
    fn a_small_approach_changes_the_slope_little() {
        let nearer = Winding {
            depth_m: 0.9 * WINDING.depth_m,
            ..WINDING
        };
        let slope = |winding: &Winding| {
            let coil = CoilIntegral::new(winding.design(5e-3), None);
            winding.relative_change_per_m(5e-3) * coil.inductance_h(winding.depth_m)
        };
        let change = slope(&nearer) / slope(&WINDING) - 1.0;
        assert!((0.05..0.1).contains(&change), "{change}");
    }

    /// Compares the share of the reading from a displacement within 3 mm of the axis with finite elements of a slab whose face
    /// has a step there. The share depends on the weights of the field's components: |H|^2 gives 0.365, H_z^2 alone 0.605.
    #[test]
    fn finite_elements_weigh_the_field_alike() {
        const STEP_MM: f64 = 0.04;
        let inductance_h = |step_mm: f64, within_mm: f64| {
            // The copper is centred at x = 0; its faces are the elements' bounds.
            let text = format!(
                "name = \"step\"\nlength_unit = \"mm\"\n[core]\nr = 5.0\nx = [0.0, 0.5]\n\
                 [conductor]\nresistivity_ohm_m = 1.72e-8\ncurrent_A = 1.0\n\
                 [material.slab]\nmu_r = 3.7\n\
                 [[coil]]\nname = \"sensing\"\ndriven = false\nr = [1.95, 2.05]\nx = [-0.0175, 0.0175]\n\
                 rings = 10\npitch = 0.5\n\
                 [[body]]\nname = \"slab\"\nmaterial = \"slab\"\n\
                 shape = {{ outline = [[0.0, {near}], [{within_mm}, {near}], [{within_mm}, 0.6], [60.0, 0.6], [60.0, 40.0], [0.0, 40.0]] }}\n",
                near = 0.6 - step_mm,
            );
            let design = Design::parse("step", &text).unwrap();
            let accuracy = Accuracy {
                relative: 1e-4,
                ..Accuracy::default()
            };
            let solved = solve_ac(&design, None, 1.0, &[0], &accuracy).unwrap();
            solved.coils[0].dc_inductance_h
        };
        let change =
            |within_mm: f64| inductance_h(STEP_MM, within_mm) - inductance_h(-STEP_MM, within_mm);
        let found = change(3.0) / change(30.0);
        let rings = WINDING.rings();
        let within = rings.iter().filter(|(r_m, _)| *r_m < 3e-3);
        let expected: f64 = within.map(|(_, share)| share).sum();
        println!("{found} by finite elements, {expected} by the weight");
        assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
    }

    /// Abramowitz and Stegun, tables 17.1 and 17.2.
    #[test]
    fn elliptic_integrals_are_those_of_the_tables() {
        for (m, first, second) in [
            (0.0_f64, 0.5 * PI, 0.5 * PI),
            (0.5, 1.854_074_677_301_372, 1.350_643_881_047_676),
            (0.99, 3.695_637_362_989_875, 1.015_993_545_025_224),
        ] {
            let (k, e) = elliptic((1.0 - m).sqrt());
            assert!((k / first - 1.0).abs() < 1e-14, "K({m}) = {k}");
            assert!((e / second - 1.0).abs() < 1e-14, "E({m}) = {e}");
        }
    }

    #[test]
    fn the_field_on_the_axis_is_biot_and_savarts() {
        let [a, z] = [4e-3_f64, 1.5e-3];
        let [h_r, h_z] = loop_field(a, 1e-9, z);
        let exact = 0.5 * a * a / (a * a + z * z).powf(1.5);
        assert!((h_z / exact - 1.0).abs() < 1e-9 && h_r.abs() < 1e-3 * exact);
    }

    #[test]
    fn the_rings_are_fine_and_wide_enough() {
        let peak = |rings: Vec<(f64, f64)>, k: f64| -> f64 {
            rings.iter().map(|(r, share)| share * libm::j0(k * r)).sum()
        };
        for k in [50.0, 200.0, 500.0, 1_000.0, 3_000.0] {
            let fine = WINDING.rings_of(0.6e-3 / 16.0, 12.0 * 7.35e-3);
            let off = peak(WINDING.rings(), k) - peak(fine, k);
            assert!(off.abs() < 2e-4, "{k}: {off}");
        }
    }
}
