//! Standard errors of a press, from the information that all readings have of it.
//!
//! Unknown are x, y, ln F and ln a. A reading is F times its coil's profile; its error is the noise, and the gain's error times the
//! reading itself. The information is the sum of J'J/variance, with the inverse variance of a declared radius; its inverse bounds
//! the covariance of every unbiased estimate (Cramer and Rao).

use super::coil::Winding;
use super::layout::{Layout, Noise, Radius};
use super::profile::Profile;

/// Limits of the standard errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    /// Limit for the place in its worst direction, m.
    pub(super) place_m: f64,
    /// Limit for ln F, with the force F.
    pub(super) force_ln: f64,
    /// Limit for ln a, with the contact radius a.
    pub(super) radius_ln: f64,
}

impl Limits {
    /// Limits of x, y, ln F and ln a.
    pub(super) fn units(&self) -> [f64; 4] {
        [self.place_m, self.place_m, self.force_ln, self.radius_ln]
    }

    /// Place, force and radius.
    pub(super) fn all(&self) -> [f64; 3] {
        [self.place_m, self.force_ln, self.radius_ln]
    }
}

/// Standard errors of one press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Errors {
    /// Standard errors of the place (m, worst direction), ln F and ln a; infinite where the readings do not determine it.
    pub(super) standard: [f64; 3],
    /// The least determined combination: changes of x, y, m, ln F and ln a, of which the greatest is one limit.
    pub(super) weakest: [f64; 4],
    /// Whether the readings do not determine that combination at all.
    pub(super) is_undetermined: bool,
}

/// A combination counts as not determined if its information, in units of the limits, is below this part of the information on
/// the best determined combination. For the built-in coils in a square that part is 3e-17 (rounding) on the lines of symmetry,
/// and 2e-8 or more beside them.
const LEAST_INFORMATION: f64 = 1e-12;

/// Layout with the profiles of its coils for one radius of contact.
pub(super) struct Sensor<'l> {
    layout: &'l Layout,
    /// For each coil, its profile and the variance of its noise, m^2.
    channels: Vec<(usize, f64)>,
    profiles: Vec<Profile>,
}

impl<'l> Sensor<'l> {
    pub(super) fn new(layout: &'l Layout, radius_m: f64) -> Self {
        let mut windings: Vec<Winding> = Vec::new();
        let mut kinds = Vec::new();
        for coil in &layout.coils {
            let known = windings.iter().position(|winding| *winding == coil.winding);
            if known.is_none() {
                windings.push(coil.winding);
            }
            kinds.push(known.unwrap_or(windings.len() - 1));
        }
        let noises: Vec<f64> = windings
            .iter()
            .map(|winding| noise_m(layout, winding))
            .collect();
        let reach_m = reach_m(layout);
        let profile = |winding: &Winding| Profile::new(winding, &layout.layer, radius_m, reach_m);
        Self {
            layout,
            channels: kinds
                .iter()
                .map(|&kind| (kind, noises[kind].powi(2)))
                .collect(),
            profiles: windings.iter().map(profile).collect(),
        }
    }

    /// Readings of a press at a place, m: derivatives by x, y, ln F and ln a. That by ln F is the mean approach itself, m.
    fn rows(&self, [x, y]: [f64; 2]) -> impl Iterator<Item = ([f64; 4], f64)> + '_ {
        let force_n = self.layout.force_n;
        let channels = self.layout.coils.iter().zip(&self.channels);
        channels.filter_map(move |(coil, (kind, variance_m2))| {
            let [dx, dy] = [x - coil.centre_m[0], y - coil.centre_m[1]];
            let distance_m = dx.hypot(dy);
            let response = self.profiles.get(*kind)?.at(distance_m);
            let slope = force_n * response.by_distance / distance_m.max(f64::MIN_POSITIVE);
            let row = [
                slope * dx,
                slope * dy,
                force_n * response.approach_m,
                force_n * response.by_ln_radius_m,
            ];
            Some((row, *variance_m2))
        })
    }

    /// Greatest mean approach that a coil reads of a press: m, and in units of its depth.
    pub(super) fn greatest_approach(&self, at: [f64; 2]) -> [f64; 2] {
        let readings = self.rows(at).zip(&self.layout.coils);
        let readings = readings.map(|((row, _), coil)| [row[2], row[2] / coil.winding.depth_m]);
        readings.fold([0.0; 2], greatest)
    }

    /// Standard errors of a press at a place, m.
    pub(super) fn errors(&self, at: [f64; 2], limits: &Limits) -> Errors {
        let units = limits.units();
        let mut information = [[0.0; 4]; 4];
        let mut add = |row: [f64; 4], variance: f64| {
            let row: [f64; 4] = core::array::from_fn(|i| row[i] * units[i]);
            for (entries, one) in information.iter_mut().zip(row) {
                for (entry, other) in entries.iter_mut().zip(row) {
                    *entry += one * other / variance;
                }
            }
        };
        for (row, noise_m2) in self.rows(at) {
            add(row, noise_m2 + (self.layout.gain_error * row[2]).powi(2));
        }
        if let Radius::Declared(_, tolerance) = self.layout.radius {
            add([0.0, 0.0, 0.0, 1.0], tolerance * tolerance);
        }
        Errors::of(information, units)
    }
}

impl Errors {
    /// Errors by the information in these units.
    fn of(information: [[f64; 4]; 4], units: [f64; 4]) -> Self {
        let (values, vectors) = eigen(information);
        let best = values.iter().copied().fold(0.0, f64::max);
        let least = LEAST_INFORMATION * best;
        let mut covariance = [[0.0; 4]; 4];
        let mut weakest = ([0.0; 4], f64::INFINITY);
        for (value, vector) in values.into_iter().zip(vectors) {
            if value < weakest.1 {
                weakest = (vector, value);
            }
            for (row, one) in covariance.iter_mut().zip(vector) {
                for (entry, other) in row.iter_mut().zip(vector) {
                    *entry += part(one * other, value, least);
                }
            }
        }
        let [xx, yy, xy] = [covariance[0][0], covariance[1][1], covariance[0][1]];
        // Greatest eigenvalue of the block of x and y.
        let place = 0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy);
        let standard = |variance: f64, unit: f64| {
            if variance.is_finite() {
                unit * variance.max(0.0).sqrt()
            } else {
                f64::INFINITY
            }
        };
        let greatest = weakest
            .0
            .iter()
            .fold(0.0_f64, |most, part| most.max(part.abs()));
        Self {
            standard: [
                standard(place, units[0]),
                standard(covariance[2][2], units[2]),
                standard(covariance[3][3], units[3]),
            ],
            weakest: core::array::from_fn(|i| weakest.0[i] * units[i] / greatest),
            is_undetermined: weakest.1 <= least,
        }
    }

    /// Whether place, force and radius are within their limits, each.
    pub(super) fn within(&self, limits: &Limits) -> [bool; 3] {
        let limits = limits.all();
        core::array::from_fn(|i| self.standard[i] <= limits[i])
    }
}

/// Greater one of each pair.
pub(super) fn greatest([a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
    [a.max(c), b.max(d)]
}

/// Part of a covariance that a combination of this information adds.
fn part(product: f64, information: f64, least: f64) -> f64 {
    /// Squared share of an unknown in a combination below which the share is only rounding.
    const NO_SHARE: f64 = 1e-9;
    if information > least {
        product / information
    } else if product.abs() > NO_SHARE {
        f64::INFINITY
    } else {
        0.0
    }
}

/// Noise of a coil's reading as an approach, m.
fn noise_m(layout: &Layout, winding: &Winding) -> f64 {
    match layout.noise {
        Noise::Approach(noise_m) => noise_m,
        // The layer is the slab that approaches.
        Noise::Relative(noise) => noise / winding.relative_change_per_m(layout.layer.thickness_m),
    }
}

/// Greatest distance of a press from a coil, m.
fn reach_m(layout: &Layout) -> f64 {
    let inside = &layout.inside;
    let [x, y] = inside.middle_m;
    let coils = layout.coils.iter();
    let far = coils.map(|coil| (coil.centre_m[0] - x).hypot(coil.centre_m[1] - y));
    // A lattice is square: its corners are outside, its edge is not.
    inside.reach_m() + far.fold(0.0, f64::max) + inside.step_m()
}

/// Eigenvalues and eigenvectors of a symmetric matrix, by Jacobi's rotations (Golub and Van Loan, "Matrix computations",
/// section 8.5).
fn eigen(mut matrix: [[f64; 4]; 4]) -> ([f64; 4], [[f64; 4]; 4]) {
    /// Sweeps: convergence is quadratic, and six reach rounding.
    const SWEEPS: u32 = 12;
    let mut vectors: [[f64; 4]; 4] =
        core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            if matrix[p][q] == 0.0 {
                continue;
            }
            let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * matrix[p][q]);
            let tangent = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            let sine = tangent * cosine;
            let rotate = |rows: &mut [[f64; 4]; 4]| {
                let [one, other] = [rows[p], rows[q]];
                rows[p] = core::array::from_fn(|i| cosine * one[i] - sine * other[i]);
                rows[q] = core::array::from_fn(|i| sine * one[i] + cosine * other[i]);
            };
            rotate(&mut matrix);
            matrix = transposed(&matrix);
            rotate(&mut matrix);
            matrix = transposed(&matrix);
            rotate(&mut vectors);
        }
    }
    (core::array::from_fn(|i| matrix[i][i]), vectors)
}

fn transposed(matrix: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    core::array::from_fn(|row| core::array::from_fn(|column| matrix[column][row]))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::inside::{Inside, Shape};
    use super::*;
    use crate::plan_touch::layout::text_of;

    pub(in crate::plan_touch) const LIMITS: Limits = Limits {
        place_m: 0.3e-3,
        force_ln: 0.03,
        radius_ln: 0.2,
    };

    /// A built-in layout with its centres at 6 mm, and the coils that the other program computed.
    pub(in crate::plan_touch) fn earlier(name: &str) -> Layout {
        let mut layout = Layout::parse("test", &text_of(name).unwrap()).unwrap();
        for coil in &mut layout.coils {
            coil.centre_m = coil.centre_m.map(|of| of * 6.0 / 5.6);
            coil.winding.outer_m = 6.75e-3;
            coil.winding.depth_m = 0.6e-3;
        }
        layout.noise = Noise::Approach(1e-7);
        let margin_m = if layout.coils.len() == 4 { -2e-3 } else { 0.0 };
        let centres: Vec<_> = layout.coils.iter().map(|coil| coil.centre_m).collect();
        layout.inside = Inside::new(Shape::Disc, margin_m, &centres);
        layout
    }

    pub(in crate::plan_touch) fn three_around_one() -> Layout {
        earlier("three-around-one")
    }

    /// Four coils of the built-in layout at the corners of a square of 10 mm.
    pub(in crate::plan_touch) fn square() -> Layout {
        let mut layout = three_around_one();
        let corners = [[-5e-3, -5e-3], [5e-3, -5e-3], [-5e-3, 5e-3], [5e-3, 5e-3]];
        for (coil, centre_m) in layout.coils.iter_mut().zip(corners) {
            coil.centre_m = centre_m;
        }
        layout.inside = Inside::new(Shape::Hull, 0.0, &corners);
        layout
    }

    #[test]
    fn a_square_does_not_separate_force_from_radius_on_its_mid_lines() {
        let layout = square();
        let sensor = Sensor::new(&layout, 2e-3);
        for at in [[0.0, 0.0], [0.0, 1e-3], [0.0, -4e-3], [2.5e-3, 0.0]] {
            let errors = sensor.errors(at, &LIMITS);
            assert!(errors.is_undetermined, "{at:?}: {errors:?}");
            let [_, force, radius] = errors.standard;
            assert!(force.is_infinite() && radius.is_infinite(), "{errors:?}");
            assert!(errors.weakest[2] != 0.0 && errors.weakest[3] != 0.0);
        }
        // In the middle the place is known all the same.
        let middle = sensor.errors([0.0, 0.0], &LIMITS);
        assert!(middle.standard[0] < 0.3e-3, "{middle:?}");
        let beside = sensor.errors([2e-3, 3e-3], &LIMITS);
        assert!(
            !beside.is_undetermined && beside.standard[0] < 0.3e-3,
            "{beside:?}"
        );
    }

    #[test]
    fn a_declared_radius_leaves_the_force() {
        let mut layout = square();
        layout.radius = Radius::Declared(2e-3, 0.05);
        let errors = Sensor::new(&layout, 2e-3).errors([0.0, 1e-3], &LIMITS);
        assert!(!errors.is_undetermined, "{errors:?}");
        assert!(
            errors.standard[1] < 0.03 && errors.standard[2] < 0.0501,
            "{errors:?}"
        );
    }

    /// Four readings of four unknowns leave no residual: the errors are those of the exact solution of the four equations,
    /// with readings that are off by draws of noise and gain.
    #[test]
    fn the_errors_are_the_scatter_of_solved_presses() {
        let layout = three_around_one();
        let sensor = Sensor::new(&layout, 3e-3);
        let at = [1.0e-3, 1.2e-3];
        let rows: Vec<_> = sensor.rows(at).collect();
        let jacobian: [[f64; 4]; 4] = core::array::from_fn(|i| rows[i].0);
        let mut state = 1_u64;
        let mut draw = || {
            // Twelve even draws of a linear congruence (Knuth's MMIX).
            let even = (0..12).map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            });
            even.sum::<f64>() - 6.0
        };
        const PRESSES: u32 = 4_000;
        let mut squares = [0.0; 4];
        for _ in 0..PRESSES {
            let wrong = core::array::from_fn(|i| {
                draw() * rows[i].1.sqrt() + draw() * layout.gain_error * rows[i].0[2]
            });
            let solved = solved(jacobian, wrong);
            for (sum, value) in squares.iter_mut().zip(solved) {
                *sum += value * value / f64::from(PRESSES);
            }
        }
        let errors = sensor.errors(at, &LIMITS).standard;
        for (error, square) in [(errors[1], squares[2]), (errors[2], squares[3])] {
            assert!(
                (error / square.sqrt() - 1.0).abs() < 0.05,
                "{error} {square}"
            );
        }
        let worst = errors[0] / squares[0].max(squares[1]).sqrt();
        assert!((0.95..1.45).contains(&worst), "{worst}");
    }

    /// Solves four equations by elimination with the greatest pivot.
    fn solved(mut matrix: [[f64; 4]; 4], mut right: [f64; 4]) -> [f64; 4] {
        for column in 0..4 {
            let greatest = |a: &usize, b: &usize| {
                matrix[*a][column]
                    .abs()
                    .total_cmp(&matrix[*b][column].abs())
            };
            let pivot = (column..4).max_by(greatest).unwrap();
            matrix.swap(column, pivot);
            right.swap(column, pivot);
            for row in (0..4).filter(|row| *row != column) {
                let share = matrix[row][column] / matrix[column][column];
                let pivot = matrix[column];
                for (entry, of) in matrix[row].iter_mut().zip(pivot) {
                    *entry -= share * of;
                }
                right[row] -= share * right[column];
            }
        }
        core::array::from_fn(|i| right[i] / matrix[i][i])
    }

    #[test]
    fn eigenvalues_of_a_known_matrix() {
        // 2 on the diagonal, 1 beside it: 2 + 2 cos(pi k/5).
        let matrix = core::array::from_fn(|i: usize| {
            core::array::from_fn(|j: usize| match i.abs_diff(j) {
                0 => 2.0,
                1 => 1.0,
                _ => 0.0,
            })
        });
        let (mut values, vectors) = eigen(matrix);
        for (value, vector) in values.iter().zip(vectors) {
            for (row, part) in matrix.iter().zip(vector) {
                let product: f64 = row
                    .iter()
                    .zip(vector)
                    .map(|(a, b): (&f64, f64)| a * b)
                    .sum();
                assert!((product - value * part).abs() < 1e-12);
            }
        }
        values.sort_by(|a, b| b.total_cmp(a));
        for (k, value) in (1..5).zip(values) {
            let exact = 2.0 + 2.0 * (core::f64::consts::PI * f64::from(k) / 5.0).cos();
            assert!((value - exact).abs() < 1e-12, "{value} {exact}");
        }
    }

    /// A relative noise of the inductance becomes a noise of the approach, over the coil's slope.
    #[test]
    fn a_relative_noise_is_an_approach() {
        let mut layout = three_around_one();
        layout.noise = Noise::Relative(1e-5);
        let winding = layout.coils[0].winding;
        let found = noise_m(&layout, &winding) * winding.relative_change_per_m(5e-3);
        assert!((found - 1e-5).abs() < 1e-12);
        assert!((1e-8..1e-6).contains(&noise_m(&layout, &winding)));
    }
}
