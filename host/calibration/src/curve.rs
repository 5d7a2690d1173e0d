//! Force or travel of the stage against relative change of inductance, and the compliance of the
//! bench's frame.

use crate::session::{Pressed, Session};

use super::least_squares::System;
use super::samples::{self, SampleRun};
use super::{Known, Unusable};

/// Degree of the polynomial through the quick presses: 7 fits the coil's own curve between two
/// slabs as well as 9.
pub(crate) const DEGREE: usize = 7;
/// Prior standard deviations of the polynomial's terms: that of the second term, relative to the
/// greatest force, and that of each further term, relative to the term before. They keep noise of
/// the load cell from bending the curve. The test `terms_of_the_coils_curve_are_within_their_prior`
/// shows the coil's own terms, for presses of 0.3 to 0.7 mm between slabs 1 mm away.
const SECOND: f64 = 0.15;
const DECAY: f64 = 0.3;

/// A quantity that rises in a press with y = L/L0 - 1 and is zero at y = 0: the force in N, or the
/// travel of the stage on a block in m.
#[derive(Clone, Debug)]
pub(crate) struct PressCurve {
    /// Coefficients of the terms of [`chebyshev`] in y/y_greatest.
    coefficients: Vec<f64>,
    pub(crate) greatest_change: f64,
}

impl PressCurve {
    /// Fits the force against the change of inductance, from the presses onto the block.
    pub(crate) fn of_force(runs: &[SampleRun], deepest: &SampleRun) -> Result<Self, Unusable> {
        Self::of_force_with(runs, deepest, &[]).map(|(curve, _)| curve)
    }

    /// Fits the same curve with a constant. Returns the constant, N: it is below zero where the force
    /// begins after the change of inductance, as under a tilted block, which touches with its edge
    /// first.
    pub(crate) fn force_at_zero_n(
        runs: &[SampleRun],
        deepest: &SampleRun,
    ) -> Result<f64, Unusable> {
        let (_, others) = Self::of_force_with(runs, deepest, &[1.0])?;
        let missing = Unusable::Missing("press upon the block");
        others.first().copied().ok_or(missing)
    }

    /// Fits the force with further terms, which are the same for every sample.
    fn of_force_with(
        runs: &[SampleRun],
        deepest: &SampleRun,
        further: &[f64],
    ) -> Result<(Self, Vec<f64>), Unusable> {
        let presses = runs.iter().filter(|run| run.pressed == Pressed::Block);
        let presses = presses.chain([deepest]);
        let samples = presses.flat_map(|run| &run.press);
        let points: Vec<(f64, f64)> = samples
            .filter_map(|sample| Some((sample.change, sample.force_n?)))
            .collect();
        let greatest_change = points.iter().map(|(change, _)| *change).fold(0.0, f64::max);
        if greatest_change <= 0.0 {
            return Err(Unusable::Missing("press upon the block"));
        }
        let mut system = System::new(DEGREE + further.len());
        for (change, force_n) in &points {
            let terms = chebyshev(change / greatest_change).take(DEGREE);
            let row = terms.map(|(value, _)| value).chain(further.iter().copied());
            system.add(row, *force_n, 1.0);
        }
        let greatest_n = points
            .iter()
            .map(|(_, force_n)| *force_n)
            .fold(0.0, f64::max);
        let what = "force against inductance";
        Self::with_others(system, greatest_change, greatest_n, what)
    }

    /// Solves a system whose first unknowns are the curve's coefficients. Returns the curve and the
    /// remaining unknowns.
    pub(crate) fn with_others(
        mut system: System,
        greatest_change: f64,
        greatest: f64,
        what: &'static str,
    ) -> Result<(Self, Vec<f64>), Unusable> {
        let noise = system.solve(what)?.sigma;
        for k in 2..=DEGREE {
            let sigma = SECOND * greatest * DECAY.powi(k as i32 - 2);
            let mut row = vec![0.0; DEGREE];
            if let Some(entry) = row.get_mut(k - 1) {
                *entry = 1.0;
            }
            system.add(row, 0.0, noise / sigma);
        }
        let mut coefficients = system.solve(what)?.unknowns;
        let others = coefficients.split_off(DEGREE);
        let curve = Self {
            coefficients,
            greatest_change,
        };
        let steps = (0..=100).map(|step| greatest_change * f64::from(step) / 100.0);
        if steps.clone().any(|change| curve.slope(change) <= 0.0) {
            return Err(Unusable::NotRising(what));
        }
        Ok((curve, others))
    }

    /// Returns the curve multiplied by a factor.
    pub(crate) fn times(&self, factor: f64) -> Self {
        let coefficients = self.coefficients.iter();
        Self {
            coefficients: coefficients.map(|of| of * factor).collect(),
            greatest_change: self.greatest_change,
        }
    }

    /// Points of the curve, from zero to the greatest change.
    pub(crate) fn points(&self) -> Vec<(f64, f64)> {
        let changes = (0..=100).map(|step| self.greatest_change * f64::from(step) / 100.0);
        changes.map(|change| (change, self.at(change))).collect()
    }

    /// Value at a change of inductance, N or m.
    pub(crate) fn at(&self, change: f64) -> f64 {
        let terms = chebyshev(change / self.greatest_change);
        let terms = terms.zip(&self.coefficients);
        terms
            .map(|((value, _), coefficient)| value * coefficient)
            .sum()
    }

    /// Slope over y, N or m.
    pub(crate) fn slope(&self, change: f64) -> f64 {
        let terms = chebyshev(change / self.greatest_change);
        let terms = terms.zip(&self.coefficients);
        let sum: f64 = terms
            .map(|((_, slope), coefficient)| slope * coefficient)
            .sum();
        sum / self.greatest_change
    }
}

/// T_k(2u - 1) - T_k(-1) for k from 1, with slopes: polynomials that vanish at u = 0 and are of
/// similar size up to u = 1.
pub(crate) fn chebyshev(u: f64) -> impl Iterator<Item = (f64, f64)> {
    let t = 2.0 * u - 1.0;
    // Values and slopes of T_k and T_(k+1).
    let (mut value, mut slope) = ((1.0, t), (0.0, 2.0));
    (1_u32..).map(move |k| {
        let term = (value.1 - if k % 2 == 0 { 1.0 } else { -1.0 }, slope.1);
        slope = (slope.1, 2.0 * t * slope.1 + 4.0 * value.1 - slope.0);
        value = (value.1, 2.0 * t * value.1 - value.0);
        term
    })
}

/// Deformation of the sensing layer at which the force on the block begins, m, by the nominal c_S;
/// above zero where the block is tilted in all presses.
///
/// # Errors
/// If the presses onto the block do not determine it.
pub fn zero_shift_m(session: &Session, known: &Known) -> Result<f64, Unusable> {
    let (runs, deepest) = samples::of_session(session, known)?;
    zero_shift_of(&runs, &deepest, known)
}

/// As [`zero_shift_m`], from prepared runs.
pub(crate) fn zero_shift_of(
    runs: &[SampleRun],
    deepest: &SampleRun,
    known: &Known,
) -> Result<f64, Unusable> {
    let force_n = PressCurve::force_at_zero_n(runs, deepest)?;
    Ok(-force_n / known.sensing_n_per_m)
}

/// Compliance of the bench's frame, m/N, from forces in N and positions of the stage in m, block on
/// block.
///
/// # Errors
/// If the presses do not determine it.
pub fn frame(bare: &[(f64, f64)]) -> Result<f64, Unusable> {
    let mut system = System::new(2);
    for (force_n, stage_m) in bare {
        system.add([1.0, *force_n], *stage_m, 1.0);
    }
    let solution = system.solve("the bench's frame")?;
    let slope = solution.unknowns.get(1).copied();
    // The scale's noise may give a negative value for a very stiff frame.
    slope
        .map(|slope| slope.max(0.0))
        .ok_or(Unusable::Missing("press of block upon block"))
}

#[cfg(test)]
mod tests {
    use palpate_sim::sensing_coil::CoilDesign;
    use palpate_sim::sensing_coil::curve::CoilCurve;

    use super::*;

    /// Deformation against change of inductance of the simulated coil, in the terms of the curve.
    fn terms(deepest_m: f64) -> (f64, Vec<f64>) {
        let curve = CoilCurve::shared(&CoilDesign::REFERENCE, None);
        let at_rest_h = curve.at(1e-3).0;
        let change = |x_m: f64| curve.at(1e-3 - x_m).0 / at_rest_h - 1.0;
        let greatest_change = change(deepest_m);
        let mut system = System::new(DEGREE);
        for step in 1..=1000 {
            let x_m = deepest_m * f64::from(step) * 1e-3;
            let terms = chebyshev(change(x_m) / greatest_change).take(DEGREE);
            let terms = terms.map(|(value, _)| value);
            system.add(terms, x_m / deepest_m, 1.0);
        }
        let solution = system.solve("the coil's curve").unwrap();
        (solution.sigma, solution.unknowns)
    }

    #[test]
    fn terms_of_the_coils_curve_are_within_their_prior() {
        for deepest_m in [0.3e-3, 0.5e-3, 0.7e-3] {
            let (sigma, terms) = terms(deepest_m);
            println!("{deepest_m}: {sigma:e} {terms:?}");
            assert!(sigma < 1e-6, "{deepest_m}: {sigma}");
            for (index, term) in terms.iter().enumerate().skip(1) {
                let prior = SECOND * DECAY.powi(index as i32 - 1);
                assert!(term.abs() < prior, "{deepest_m}, {index}: {term} {prior}");
            }
        }
    }

    #[test]
    fn terms_vanish_at_zero_and_have_their_slopes() {
        let at = |u: f64| chebyshev(u).take(DEGREE).collect::<Vec<_>>();
        assert!(at(0.0).iter().all(|(value, _)| value.abs() < 1e-12));
        let (u, step) = (0.37, 1e-6);
        let around = at(u - step).into_iter().zip(at(u + step)).zip(at(u));
        for (((before, _), (after, _)), (_, slope)) in around {
            let secant = (after - before) / (2.0 * step);
            assert!(
                (secant - slope).abs() < 1e-6 * (1.0 + slope.abs()),
                "{secant} {slope}"
            );
        }
    }
}
