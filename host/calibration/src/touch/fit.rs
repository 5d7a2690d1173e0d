//! Least squares over all presses.
//!
//! Errors of place, force and radius of a press are common to its readings: with the derivatives J
//! by the press and the noise, the covariance of its readings is N + J S J', whose Cholesky factor
//! whitens its rows.

use super::profile::{At, BASE, COMMON, PSI, Parameters};
use super::{Design, KnownPress};
use crate::Unusable;
use crate::least_squares::{Covariance, System};

/// Steps of the iteration: the fits of the tests settle within seven.
const MOST_STEPS: usize = 30;
/// A step that changes the predictions by less than this part of their standard errors is the last.
const SETTLED: f64 = 1e-3;

/// Standard deviation of what the profile's form leaves out, relative to a reading itself, before the
/// presses show it: 0.6 % under an array of seven coils whose currents couple them
/// (`palpate_sim::touch`), less where they do not.
pub(super) const FORM: f64 = 5e-3;
/// Error of the form relative to the largest reading of a press, over `FORM`: residuals of small readings.
pub(super) const FORM_OF_LARGEST: f64 = 0.4;
/// Prior standard deviation of the logarithm of the form's error: with four readings, errors of the bench hide it.
const FORM_SPREAD: f64 = 0.5;

/// The fitted parameters.
pub(super) struct Fitted {
    pub(super) parameters: Parameters,
    pub(super) covariance: Covariance,
    /// What the profile's form leaves out, relative to a reading ([`FORM`]).
    pub(super) form: f64,
    /// Standard deviation of a whitened residual.
    pub(super) sigma: f64,
}

/// Residuals of a press and their derivatives by the parameters, whitened.
struct Rows {
    /// Logarithm of the covariance's determinant.
    ln_determinant: f64,
    residuals: Vec<f64>,
    by_parameters: Vec<Vec<f64>>,
}

impl KnownPress {
    pub(super) fn at(&self) -> At {
        let [x, y] = self.place_m;
        [x, y, self.force_n.ln(), self.radius_m.ln()]
    }
}

impl Design {
    /// Standard errors of x, y (m), ln F and ln a of a press.
    fn press_sigmas(&self) -> [f64; 4] {
        let bench = &self.bench;
        [bench.place_m, bench.place_m, bench.force, bench.radius]
    }
}

/// Fits the presses with a weight above zero.
pub(super) fn fit(
    design: &Design,
    presses: &[KnownPress],
    weights: &mut [f64],
    (form, is_robust): (f64, bool),
) -> Result<Fitted, Unusable> {
    let mut parameters = Parameters::start(design.scales, &design.coils_m);
    let peak = [peak(presses), strongest(presses)];
    let mut last = None;
    for step in 0..MOST_STEPS {
        let mut system = System::new(parameters.values.len());
        let mut chi_squares = Vec::new();
        for (press, weight) in presses.iter().zip(weights.iter()) {
            let rows = rows(design, &parameters, press, form)?;
            let square: f64 = rows.residuals.iter().map(|of| of * of).sum();
            chi_squares.push(square / rows.residuals.len() as f64);
            if *weight > 0.0 {
                for (by, residual) in rows.by_parameters.into_iter().zip(&rows.residuals) {
                    system.add(by, *residual, weight.sqrt());
                }
            }
        }
        beforehand(design, &parameters, peak, &mut system);
        let solution = system.solve("profile, gains and places of the coils")?;
        let part = |index: usize| {
            let sigma = solution.covariance[(index, index)].sqrt();
            (solution.unknowns[index] / sigma.max(f64::MIN_POSITIVE)).abs()
        };
        let moved = (0..parameters.values.len()).map(part).fold(0.0, f64::max);
        for (value, change) in parameters.values.iter_mut().zip(&solution.unknowns) {
            *value += change;
        }
        if is_robust && step > 0 {
            reweigh(weights, &chi_squares);
        }
        let settled = step > 2 && moved < SETTLED * if is_robust { 100.0 } else { 1.0 };
        last = Some(Fitted {
            parameters: parameters.clone(),
            covariance: solution.covariance,
            form,
            sigma: solution.sigma,
        });
        if settled {
            break;
        }
    }
    last.ok_or(Unusable::Missing("presses on the array"))
}

/// Weights of Cauchy's distribution: a press far off its readings' errors counts little.
fn reweigh(weights: &mut [f64], chi_squares: &[f64]) {
    let scale = 4.0 * median(chi_squares).max(1.0);
    for (weight, chi_square) in weights.iter_mut().zip(chi_squares) {
        *weight = 1.0 / (1.0 + (chi_square / scale).powi(2));
    }
}

pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Largest reading per newton.
fn peak(presses: &[KnownPress]) -> f64 {
    let of = |press: &KnownPress| largest(&press.readings) / press.force_n;
    presses.iter().map(of).fold(f64::MIN_POSITIVE, f64::max)
}

/// Greatest force, N.
fn strongest(presses: &[KnownPress]) -> f64 {
    let forces = presses.iter().map(|press| press.force_n);
    forces.fold(f64::MIN_POSITIVE, f64::max)
}

pub(super) fn largest(readings: &[f64]) -> f64 {
    readings.iter().fold(0.0, |most, of| of.abs().max(most))
}

/// Adds the prior knowledge: gains near one with a mean of one, coils near their nominal places, a
/// profile of a few peaks at most, and a Psi that is small beside it.
fn beforehand(
    design: &Design,
    parameters: &Parameters,
    [peak, greatest_n]: [f64; 2],
    system: &mut System,
) {
    let count = parameters.values.len();
    let mut add = |index: usize, mean: f64, sigma: f64| {
        let mut row = vec![0.0; count];
        row[index] = 1.0;
        system.add(row, mean - parameters.values[index], 1.0 / sigma);
    };
    for index in 0..BASE {
        add(index, 0.0, 3.0 * peak);
    }
    for index in BASE..PSI {
        add(index, 0.0, peak);
    }
    // Psi may change the largest reading by half at the greatest force.
    for index in PSI..COMMON {
        add(index, 0.0, 0.5 * peak / greatest_n);
    }
    for (coil, nominal_m) in design.coils_m.iter().enumerate() {
        add(parameters.gain(coil), 0.0, design.gain_tolerance);
        for (index, nominal_m) in parameters.place(coil).zip(nominal_m) {
            add(index, *nominal_m, design.place_tolerance_m);
        }
    }
    let mut row = vec![0.0; count];
    let mut sum = 0.0;
    for coil in 0..parameters.coils {
        row[parameters.gain(coil)] = 1.0;
        sum += parameters.values[parameters.gain(coil)];
    }
    system.add(row, -sum, 1e6);
}

fn rows(
    design: &Design,
    parameters: &Parameters,
    press: &KnownPress,
    form: f64,
) -> Result<Rows, Unusable> {
    let predicted: Vec<_> = (0..parameters.coils)
        .map(|coil| parameters.predict(coil, press.at()))
        .collect();
    let sigmas = design.press_sigmas();
    let of_largest = FORM_OF_LARGEST * largest(&press.readings);
    let variance = |i: usize, j: usize| {
        let common: f64 = (0..4)
            .map(|of| {
                let [a, b] = [i, j].map(|coil| predicted[coil].by_press[of] * sigmas[of]);
                a * b
            })
            .sum();
        let reading = press.readings.get(i).copied().unwrap_or(0.0);
        let left_out = form * reading.hypot(of_largest);
        let own = design.noise * design.noise + left_out * left_out;
        common + if i == j { own } else { 0.0 }
    };
    let lower = cholesky(parameters.coils, variance)
        .ok_or(Unusable::Undetermined("errors of the readings"))?;
    let mut residuals: Vec<f64> = predicted
        .iter()
        .zip(&press.readings)
        .map(|(predicted, reading)| reading - predicted.value)
        .collect();
    let mut by_parameters: Vec<Vec<f64>> =
        predicted.into_iter().map(|of| of.by_parameters).collect();
    // Forward substitution.
    for i in 0..lower.len() {
        for j in 0..i {
            let factor = lower[i][j];
            residuals[i] -= factor * residuals[j];
            let (done, rest) = by_parameters.split_at_mut(i);
            for (to, from) in rest[0].iter_mut().zip(&done[j]) {
                *to -= factor * from;
            }
        }
        residuals[i] /= lower[i][i];
        by_parameters[i]
            .iter_mut()
            .for_each(|of| *of /= lower[i][i]);
    }
    let diagonal = (0..lower.len()).map(|i| lower[i][i].ln());
    Ok(Rows {
        ln_determinant: 2.0 * diagonal.sum::<f64>(),
        residuals,
        by_parameters,
    })
}

/// Chi-square per reading of a press.
pub(super) fn misfit(
    design: &Design,
    parameters: &Parameters,
    press: &KnownPress,
    form: f64,
) -> f64 {
    rows(design, parameters, press, form).map_or(f64::INFINITY, |rows| {
        let square: f64 = rows.residuals.iter().map(|of| of * of).sum();
        square / rows.residuals.len() as f64
    })
}

/// The most likely error of the form, by the residuals of a fit: their likelihood, with the number of
/// readings that the parameters leave, and the distribution beforehand.
pub(super) fn most_likely_form(
    design: &Design,
    fitted: &Fitted,
    presses: &[KnownPress],
    weights: &[f64],
) -> Result<f64, Unusable> {
    let used = presses
        .iter()
        .zip(weights)
        .filter(|(_, weight)| **weight > 0.0);
    let used: Vec<_> = used.map(|(press, _)| press).collect();
    let readings = (used.len() * design.coils_m.len()) as f64;
    let freedom = (readings - fitted.parameters.values.len() as f64).max(1.0);
    let mut best = (f64::INFINITY, FORM);
    for step in -20..=20 {
        let spread = f64::from(step) / 10.0;
        let form = FORM * spread.exp();
        let mut cost = (spread / FORM_SPREAD).powi(2);
        for press in &used {
            let rows = rows(design, &fitted.parameters, press, form)?;
            let square: f64 = rows.residuals.iter().map(|of| of * of).sum();
            cost += rows.ln_determinant + square * readings / freedom;
        }
        if cost < best.0 {
            best = (cost, form);
        }
    }
    Ok(best.1)
}

/// Rows l of the lower triangle with l l' = the matrix.
pub(super) fn cholesky(size: usize, entry: impl Fn(usize, usize) -> f64) -> Option<Vec<Vec<f64>>> {
    let mut lower = vec![vec![0.0; size]; size];
    for i in 0..size {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let rest = entry(i, j) - known;
            lower[i][j] = if i > j {
                rest / lower[j][j]
            } else if rest > 0.0 {
                rest.sqrt()
            } else {
                return None;
            };
        }
    }
    Some(lower)
}
