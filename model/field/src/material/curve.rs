//! A measured magnetisation curve: H as a monotone cubic of B.

use super::{MU_0, Reluctivity};

/// How much steeper than in vacuum H may rise between two points: what rounded tables need.
const ROUNDED: f64 = 1.01;
/// Below this field, T, ν is that at 0.
const LEAST_T: f64 = 1e-9;

/// A magnetisation curve through given points, odd in B. Between them H is a cubic polynomial of B that rises
/// wherever the points do (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980); beyond the last one B
/// rises as in vacuum.
#[derive(Clone, Debug, PartialEq)]
pub struct BhCurve {
    knots: Vec<Knot>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Knot {
    b_t: f64,
    h_a_per_m: f64,
    /// dH/dB, m/H.
    slope: f64,
    /// ∫ H dB from 0, J/m³.
    energy_j_per_m3: f64,
}

/// Why there is no curve through some points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CurveError {
    /// The point at which it is noticed, from 0.
    pub point: usize,
    /// What is wrong.
    pub problem: &'static str,
    /// What would be right.
    pub allowed: &'static str,
}

impl BhCurve {
    /// The curve through points [H in A/m, B in T]; 0, 0 may be left out.
    ///
    /// # Errors
    /// [`CurveError`] for fewer than three points, the origin included, and for points that are not finite, do
    /// not ascend, or rise less than in vacuum.
    pub fn through(points: &[[f64; 2]]) -> Result<Self, CurveError> {
        let refuse = |point, problem, allowed| {
            Err(CurveError {
                point,
                problem,
                allowed,
            })
        };
        let mut knots = vec![Knot::default()];
        for (index, &[h_a_per_m, b_t]) in points.iter().enumerate() {
            if !h_a_per_m.is_finite() || !b_t.is_finite() {
                return refuse(index, "is not finite", "finite numbers");
            }
            if index == 0 && h_a_per_m == 0.0 && b_t == 0.0 {
                continue;
            }
            let last = knots.last().copied().unwrap_or_default();
            let [more_h, more_b] = [h_a_per_m - last.h_a_per_m, b_t - last.b_t];
            if more_h <= 0.0 || more_b <= 0.0 {
                let allowed = "H and B above those of the point before, from 0 on";
                return refuse(index, "does not ascend", allowed);
            }
            if MU_0 * more_h > ROUNDED * more_b {
                let allowed = "B that rises by mu0 times the rise of H or more";
                return refuse(index, "rises less than in vacuum", allowed);
            }
            knots.push(Knot {
                b_t,
                h_a_per_m,
                ..Knot::default()
            });
        }
        if knots.len() < 3 {
            let allowed = "two points or more beside the origin";
            return refuse(points.len().saturating_sub(1), "is too few points", allowed);
        }
        let slopes = slopes(&knots);
        for (knot, slope) in knots.iter_mut().zip(slopes) {
            knot.slope = slope;
        }
        let mut energy_j_per_m3 = 0.0;
        let mut last: Option<Knot> = None;
        for knot in &mut knots {
            if let Some(last) = last {
                energy_j_per_m3 = between(&last, knot, 1.0).energy_j_per_m3;
            }
            knot.energy_j_per_m3 = energy_j_per_m3;
            last = Some(*knot);
        }
        Ok(Self { knots })
    }

    /// The relative permeability at B = 0.
    #[must_use]
    pub fn initial_mu_r(&self) -> f64 {
        1.0 / (MU_0 * self.at(0.0).slope)
    }

    /// H, its derivative and its integral at |B| = `b_t` ≥ 0.
    fn at(&self, b_t: f64) -> Knot {
        let above = self.knots.partition_point(|knot| knot.b_t <= b_t);
        let below = self.knots.get(above.saturating_sub(1));
        match (below, self.knots.get(above)) {
            (Some(low), Some(high)) => between(low, high, (b_t - low.b_t) / (high.b_t - low.b_t)),
            (Some(last), None) => {
                let beyond_t = b_t - last.b_t;
                Knot {
                    b_t,
                    h_a_per_m: last.h_a_per_m + beyond_t / MU_0,
                    slope: 1.0 / MU_0,
                    energy_j_per_m3: last.energy_j_per_m3
                        + beyond_t * (last.h_a_per_m + 0.5 * beyond_t / MU_0),
                }
            }
            (None, _) => Knot::default(),
        }
    }

    /// ν and dν/dB at |B| = `b_t` ≥ 0, T.
    pub(super) fn reluctivity(&self, b_t: f64) -> Reluctivity {
        let knot = self.at(b_t);
        if b_t < LEAST_T {
            return Reluctivity {
                nu: knot.slope,
                slope: 0.0,
            };
        }
        let nu = knot.h_a_per_m / b_t;
        Reluctivity {
            nu,
            slope: (knot.slope - nu) / b_t,
        }
    }

    /// ∫ H dB from 0 to `b_t`, J/m³.
    pub(super) fn energy_j_per_m3(&self, b_t: f64) -> f64 {
        self.at(b_t).energy_j_per_m3
    }
}

/// Slopes at the knots: those of parabolas through neighbours, at 0 by symmetry, lowered to where each cubic
/// rises all the way (Fritsch and Carlson's circle).
fn slopes(knots: &[Knot]) -> Vec<f64> {
    let step = |pair: &[Knot]| match pair {
        [a, b] => [b.b_t - a.b_t, (b.h_a_per_m - a.h_a_per_m) / (b.b_t - a.b_t)],
        _ => [1.0, 0.0],
    };
    let steps: Vec<[f64; 2]> = knots.windows(2).map(step).collect();
    let inner = steps.windows(2).map(|pair| match pair {
        &[[d, secant], [next_d, next]] => (next_d * secant + d * next) / (d + next_d),
        _ => 0.0,
    });
    let mut slopes: Vec<f64> = steps.first().map(|step| step[1]).into_iter().collect();
    slopes.extend(inner);
    if let Some(&[_, secant]) = steps.last() {
        let before = slopes.last().copied().unwrap_or(secant);
        slopes.push((2.0 * secant - before).clamp(0.0, 1.0 / MU_0));
    }
    for (index, &[_, secant]) in steps.iter().enumerate() {
        if let Some([low, high]) = slopes.get_mut(index..index + 2) {
            let size = low.hypot(*high) / secant;
            if size > 3.0 {
                *low *= 3.0 / size;
                *high *= 3.0 / size;
            }
        }
    }
    slopes
}

/// Hermite's cubic a share `t` of the way between two knots; the energy from the first where that has none.
fn between(low: &Knot, high: &Knot, t: f64) -> Knot {
    let d = high.b_t - low.b_t;
    let [h0, h1] = [low.h_a_per_m, high.h_a_per_m];
    let [m0, m1] = [d * low.slope, d * high.slope];
    let rest = 1.0 - t;
    let values =
        h0 * (1.0 + 2.0 * t) * rest * rest + m0 * t * rest * rest + h1 * t * t * (3.0 - 2.0 * t)
            - m1 * t * t * rest;
    let slope = 6.0 * t * rest * (h1 - h0) + m0 * rest * (1.0 - 3.0 * t) + m1 * t * (3.0 * t - 2.0);
    let [t2, t3, t4] = [2, 3, 4].map(|power| t.powi(power));
    let integral = h0 * (t - t3 + 0.5 * t4)
        + m0 * (0.5 * t2 - 2.0 / 3.0 * t3 + 0.25 * t4)
        + h1 * (t3 - 0.5 * t4)
        + m1 * (0.25 * t4 - t3 / 3.0);
    Knot {
        b_t: low.b_t + t * d,
        h_a_per_m: values,
        slope: slope / d,
        energy_j_per_m3: low.energy_j_per_m3 + d * integral,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steel as in a data sheet, with few points.
    const STEEL: [[f64; 2]; 9] = [
        [30.0, 0.1],
        [60.0, 0.35],
        [100.0, 0.7],
        [200.0, 1.1],
        [500.0, 1.4],
        [2e3, 1.6],
        [1e4, 1.85],
        [5e4, 2.1],
        [2e5, 2.32],
    ];

    #[test]
    fn the_curve_meets_its_points_and_rises() {
        let curve = BhCurve::through(&STEEL).expect("a curve");
        for [h, b] in STEEL {
            let found = curve.reluctivity(b).nu * b;
            assert!((found / h - 1.0).abs() < 1e-12, "{b}: {found}");
        }
        let h = |step: u32| curve.at(f64::from(step) * 1e-3).h_a_per_m;
        assert!((0..3_000).all(|step| h(step + 1) > h(step)));
        assert!((curve.initial_mu_r() / (0.1 / 30.0 / MU_0) - 1.0).abs() < 1e-12);
        // Beyond the last point B rises as in vacuum.
        assert!((curve.at(3.32).h_a_per_m - 2e5 - 1.0 / MU_0).abs() < 1e-6);
    }

    #[test]
    fn points_that_make_no_curve_are_refused_at_their_place() {
        let nan = f64::NAN;
        let cases: [(&[[f64; 2]], usize, &str); 7] = [
            (&[], 0, "too few"),
            (&[[0.0, 0.0], [100.0, 1.0]], 1, "too few"),
            (&[[100.0, 1.0], [200.0, nan], [300.0, 1.5]], 1, "finite"),
            (&[[100.0, 1.0], [200.0, 0.9], [300.0, 1.5]], 1, "ascend"),
            (&[[100.0, 1.0], [100.0, 1.1]], 1, "ascend"),
            (&[[-100.0, 1.0], [100.0, 1.1]], 0, "ascend"),
            (&[[100.0, 1.0], [2e6, 1.1], [3e6, 3.0]], 1, "vacuum"),
        ];
        for (points, point, problem) in cases {
            let error = BhCurve::through(points).expect_err(problem);
            assert_eq!(error.point, point, "{error:?}");
            assert!(error.problem.contains(problem), "{error:?}");
        }
    }
}
