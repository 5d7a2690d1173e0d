//! What a coil reads of a press, with derivatives.
//!
//! dL_i = g_i (F Phi(|x - x_i|, a) + F^2 Psi(|x - x_i|, a)), with Phi and Psi as sums of cubic B-splines whose
//! coefficients are quadratic in s, the root of the contact radius scaled to -1 to 1.

use std::ops::Range;

/// Number of coefficients of the profile in the middle of the radii.
pub const BASE: usize = 9;
/// Number of coefficients of each change by the radius.
pub const BY_RADIUS: usize = 5;
/// Number of coefficients of each part of Psi.
pub const BENT: usize = 4;
/// Index of the first coefficient of Psi.
pub(super) const PSI: usize = BASE + 2 * BY_RADIUS;
/// All coefficients of the profile.
pub(super) const COMMON: usize = PSI + 3 * BENT;

/// Spline of a coefficient, and the power of s that multiplies it.
const fn part(index: usize) -> (usize, i32) {
    match index {
        0..BASE => (index, 0),
        BASE..PSI => (
            (index - BASE) % BY_RADIUS,
            1 + ((index - BASE) / BY_RADIUS) as i32,
        ),
        _ => ((index - PSI) % BENT, ((index - PSI) / BENT) as i32),
    }
}

/// Scales of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Distance between two knots, m.
    pub spacing_m: f64,
    /// Least and greatest contact radius, m.
    pub radii_m: [f64; 2],
}

/// Profile, bend, gains (as logarithms) and places of all coils, in one list.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parameters {
    pub(super) scales: Scales,
    pub(super) coils: usize,
    pub(super) values: Vec<f64>,
}

/// A press: x and y, m, ln F and ln a.
pub(super) type At = [f64; 4];

/// A predicted reading with its derivatives.
pub(super) struct Predicted {
    pub(super) value: f64,
    pub(super) by_parameters: Vec<f64>,
    pub(super) by_press: [f64; 4],
}

impl Parameters {
    /// No profile yet, gains of one, and coils at their nominal places.
    pub(super) fn start(scales: Scales, coils_m: &[[f64; 2]]) -> Self {
        let mut values = vec![0.0; COMMON + coils_m.len()];
        values.extend(coils_m.iter().flatten());
        Self {
            scales,
            coils: coils_m.len(),
            values,
        }
    }

    pub(super) fn gain(&self, coil: usize) -> usize {
        debug_assert!(coil < self.coils);
        COMMON + coil
    }

    pub(super) fn place(&self, coil: usize) -> Range<usize> {
        let first = COMMON + self.coils + 2 * coil;
        first..first + 2
    }

    pub(super) fn predict(&self, coil: usize, [x, y, ln_force, ln_radius]: At) -> Predicted {
        let place = self.place(coil);
        let [dx, dy] = [
            x - self.values[place.start],
            y - self.values[place.start + 1],
        ];
        let distance_m = dx.hypot(dy);
        let (force_n, gain) = (ln_force.exp(), self.values[self.gain(coil)].exp());
        let (s, s_by_ln_radius) = self.shape(ln_radius);
        let splines: Vec<[f64; 2]> = (0..BASE)
            .map(|j| even_spline(distance_m / self.scales.spacing_m, j))
            .collect();
        let (mut value, mut by_distance, mut by_ln_force, mut by_shape) = (0.0, 0.0, 0.0, 0.0);
        let mut by_parameters = vec![0.0; self.values.len()];
        for (index, coefficient) in self.values[..COMMON].iter().enumerate() {
            let (j, power) = part(index);
            let [spline, spline_slope] = splines[j];
            let order = if index < PSI { 1 } else { 2 };
            let forces = force_n.powi(order);
            let of_shape = forces * s.powi(power);
            by_parameters[index] = gain * of_shape * spline;
            value += coefficient * of_shape * spline;
            by_distance += coefficient * of_shape * spline_slope / self.scales.spacing_m;
            by_ln_force += f64::from(order) * coefficient * of_shape * spline;
            if power > 0 {
                let slope = f64::from(power) * s.powi(power - 1);
                by_shape += coefficient * forces * slope * spline;
            }
        }
        let [by_x, by_y] = [dx, dy].map(|d| gain * by_distance * d / distance_m.max(1e-12));
        by_parameters[self.gain(coil)] = gain * value;
        by_parameters[place.start] = -by_x;
        by_parameters[place.start + 1] = -by_y;
        Predicted {
            value: gain * value,
            by_parameters,
            by_press: [
                by_x,
                by_y,
                gain * by_ln_force,
                gain * by_shape * s_by_ln_radius,
            ],
        }
    }

    /// s with its derivative by ln a.
    fn shape(&self, ln_radius: f64) -> (f64, f64) {
        let [least, greatest] = self.scales.radii_m.map(f64::sqrt);
        let (middle, half) = (0.5 * (greatest + least), 0.5 * (greatest - least));
        let root = (0.5 * ln_radius).exp();
        let s = (root - middle) / half;
        (s.clamp(-1.0, 1.0), 0.5 * root / half)
    }
}

/// Value and slope of the cubic B-spline about knot `j`, with its mirror image about zero.
fn even_spline(x: f64, j: usize) -> [f64; 2] {
    let one = |t: f64| {
        let size = t.abs();
        let [value, slope] = if size < 1.0 {
            [
                (4.0 + size * size * (3.0 * size - 6.0)) / 6.0,
                size * (1.5 * size - 2.0),
            ]
        } else if size < 2.0 {
            [(2.0 - size).powi(3) / 6.0, -0.5 * (2.0 - size).powi(2)]
        } else {
            [0.0; 2]
        };
        [value, slope * t.signum()]
    };
    let [right, left] = [one(x - j as f64), one(x + j as f64)];
    if j == 0 {
        return right;
    }
    [right[0] + left[0], right[1] + left[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivatives_are_those_of_the_value() {
        let scales = Scales {
            spacing_m: 2e-3,
            radii_m: [1e-3, 5e-3],
        };
        let mut parameters = Parameters::start(scales, &[[0.0; 2], [6e-3, 1e-3]]);
        for (index, value) in parameters.values.iter_mut().enumerate() {
            *value += 1e-4 * (1.0 + (1.3 * index as f64).sin());
        }
        for at in [[1e-3, 2e-3, 0.3, -6.2], [-4e-3, 5e-3, -0.5, -5.6]] {
            for coil in 0..2 {
                let exact = parameters.predict(coil, at);
                for index in 0..parameters.values.len() {
                    let beside = |step: f64| {
                        let mut moved = parameters.clone();
                        moved.values[index] += step;
                        moved.predict(coil, at).value
                    };
                    let slope = (beside(1e-7) - beside(-1e-7)) / 2e-7;
                    let off = slope - exact.by_parameters[index];
                    assert!(off.abs() < 1e-5 * (1.0 + slope.abs()), "{index}: {slope}");
                }
                for (index, by) in exact.by_press.iter().enumerate() {
                    let beside = |step: f64| {
                        let mut moved = at;
                        moved[index] += step;
                        parameters.predict(coil, moved).value
                    };
                    let slope = (beside(1e-7) - beside(-1e-7)) / 2e-7;
                    assert!(
                        (slope - by).abs() < 1e-6 * (1.0 + slope.abs()),
                        "{slope} {by}"
                    );
                }
            }
        }
    }
}
