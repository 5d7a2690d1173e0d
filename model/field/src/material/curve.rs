//! A measured magnetisation curve: H as a monotone cubic of B.

use super::{MU_0, Reluctivity};

/// Largest flux density in a table, T. It also limits H to B/μ₀, 4e6 A/m, since B rises at least as
/// much as in vacuum.
const MOST_B_T: f64 = 5.0;
/// Largest polarisation B − μ₀H, T: iron with a third of cobalt has 2.45 T, more than any other
/// metal at room temperature (the top of the Slater–Pauling curve).
const MOST_J_T: f64 = 2.5;
/// Steepest rise of B with H, in multiples of vacuum's: the greatest permeability on sale is 1e6
/// (annealed cobalt ribbon), and curves rise up to 2.4 times as steeply as their greatest B/H (29
/// curves of FEMM's library).
const MOST_MU_R: f64 = 4e6;
/// Steepest rise of H between two points, in multiples of vacuum's: above 1, as a margin for
/// rounded tables.
const ROUNDED: f64 = 1.01;
/// Largest slope dH/dB at a point, in multiples of the slopes of both chords that meet there: up to
/// 3 the cubic is monotone (de Boor and Swartz), below 3 it also has no horizontal tangent.
const STEEPEST: f64 = 2.5;
/// Flux density below which ν equals its value at B = 0, T.
const LEAST_T: f64 = 1e-9;

/// A magnetisation curve through given points, odd in B. Between them H is a monotone cubic
/// polynomial of B (slopes limited as by de Boor and Swartz, J. Approx. Theory 21, 1977); beyond
/// the last point B rises as in vacuum.
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

/// Reason why a list of points is not a curve.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CurveError {
    /// Index of the point at which the error was found, from 0.
    pub point: usize,
    /// Description of the error.
    pub problem: String,
    /// What is allowed.
    pub allowed: String,
}

impl CurveError {
    fn new(point: usize, problem: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self {
            point,
            problem: problem.into(),
            allowed: allowed.into(),
        }
    }
}

impl BhCurve {
    /// Creates a curve through points [H in A/m, B in T]; the point 0, 0 may be omitted.
    ///
    /// # Errors
    /// [`CurveError`] for fewer than three points, the origin included, and for points that are not
    /// finite, do not ascend, or cannot belong to any material.
    pub fn through(points: &[[f64; 2]]) -> Result<Self, CurveError> {
        let mut knots = vec![Knot::default()];
        for (index, &[h_a_per_m, b_t]) in points.iter().enumerate() {
            if index == 0 && h_a_per_m == 0.0 && b_t == 0.0 {
                continue;
            }
            let last = knots.last().copied().unwrap_or_default();
            let knot = Knot {
                b_t,
                h_a_per_m,
                ..Knot::default()
            };
            next(&last, &knot)
                .map_err(|(problem, allowed)| CurveError::new(index, problem, allowed))?;
            knots.push(knot);
        }
        if knots.len() < 3 {
            let allowed = "two points or more beside the origin";
            let last = points.len().saturating_sub(1);
            return Err(CurveError::new(last, "is too few points", allowed));
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

    /// Relative permeability at B = 0.
    #[must_use]
    pub fn initial_mu_r(&self) -> f64 {
        1.0 / (MU_0 * self.at(0.0).slope)
    }

    /// The last point, H in A/m and B in T.
    #[must_use]
    pub fn end(&self) -> [f64; 2] {
        let last = self.knots.last().copied().unwrap_or_default();
        [last.h_a_per_m, last.b_t]
    }

    /// Slope of B between the last two points, in multiples of vacuum's.
    #[must_use]
    pub fn end_mu_r(&self) -> f64 {
        match self.knots.as_slice() {
            [.., before, last] => rise(before, last),
            _ => 1.0,
        }
    }

    /// Greatest relative permeability B/(μ₀H) of the points.
    #[must_use]
    pub fn greatest_mu_r(&self) -> f64 {
        let rises = self.knots.iter().skip(1);
        let rises = rises.map(|knot| rise(&Knot::default(), knot));
        rises.fold(1.0, f64::max)
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

    /// ν in m/H and dν/dB in m/(H T), at |B| = `b_t` ≥ 0, T.
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

/// Slope of B from one point to another, in multiples of vacuum's.
fn rise(from: &Knot, to: &Knot) -> f64 {
    (to.b_t - from.b_t) / (MU_0 * (to.h_a_per_m - from.h_a_per_m))
}

/// Checks whether a point may follow another in a table; the error is the problem and what is
/// allowed.
fn next(last: &Knot, knot: &Knot) -> Result<(), (String, String)> {
    let Knot { h_a_per_m, b_t, .. } = *knot;
    if !h_a_per_m.is_finite() || !b_t.is_finite() {
        return Err(("is not finite".to_owned(), "finite numbers".to_owned()));
    }
    if h_a_per_m <= last.h_a_per_m || b_t <= last.b_t {
        let allowed = "H and B above those of the point before, from 0 on";
        return Err(("does not ascend".to_owned(), allowed.to_owned()));
    }
    if b_t > MOST_B_T {
        let problem = format!("B of {b_t} T is that of no material");
        return Err((problem, format!("B of at most {MOST_B_T} T")));
    }
    let j_t = b_t - MU_0 * h_a_per_m;
    if j_t > MOST_J_T {
        let problem = format!("B - mu0 H of {j_t:.3} T is that of no material");
        let allowed = format!("at most {MOST_J_T} T: iron-cobalt has 2.45 T");
        return Err((problem, allowed));
    }
    let mu_r = rise(last, knot);
    if mu_r * ROUNDED < 1.0 {
        let allowed = "B that rises by mu0 times the rise of H or more; without this point, where it is rounded: beyond the last B rises as in vacuum";
        return Err(("rises less than in vacuum".to_owned(), allowed.to_owned()));
    }
    if mu_r > MOST_MU_R {
        let problem = format!("rises {mu_r:.1e} times as steeply as in vacuum, as no material");
        let allowed = format!("at most {MOST_MU_R:e} times");
        return Err((problem, allowed));
    }
    Ok(())
}

/// Slopes dH/dB at the knots: those of parabolas through each knot and its neighbours, and at B = 0
/// that of the first chord; reduced where necessary for each cubic to be monotone.
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
        for slope in slopes.iter_mut().skip(index).take(2) {
            *slope = slope.min(STEEPEST * secant);
        }
    }
    slopes
}

/// Hermite's cubic at the fraction `t` of the way between two knots. Its energy includes that of
/// the first knot, which is zero until computed.
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
        assert!((curve.greatest_mu_r() / (0.7 / 100.0 / MU_0) - 1.0).abs() < 1e-12);
        assert!((curve.end_mu_r() / (0.22 / 1.5e5 / MU_0) - 1.0).abs() < 1e-12);
        assert_eq!(curve.end(), [2e5, 2.32]);
        // Beyond the last point B rises as in vacuum.
        assert!((curve.at(3.32).h_a_per_m - 2e5 - 1.0 / MU_0).abs() < 1e-6);
    }

    /// The slope at 0 is that of the first chord, however sharp the following knee.
    #[test]
    fn a_sharp_knee_leaves_the_initial_permeability() {
        let curve = BhCurve::through(&[[20.0, 0.4], [1e5, 0.53]]).expect("a curve");
        assert!((curve.initial_mu_r() / (0.4 / 20.0 / MU_0) - 1.0).abs() < 1e-12);
        let slope = |step: u32| curve.at(f64::from(step) * 1e-4).slope;
        assert!((0..6_000).all(|step| slope(step) > 0.0));
    }
}
