//! Presses that contradict the others.

use super::fit::{Fitted, median, misfit};
use super::{Design, KnownPress};

/// A press that contradicts the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspect {
    /// Index of the press.
    pub press: usize,
    /// Chi-square of its readings by the calibration from the others.
    pub chi_square: f64,
    /// What would explain it.
    pub cause: Cause,
}

/// What would explain the readings of a press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// Another place, m: the wrong hole.
    Place([f64; 2]),
    /// Another force, N: the wrong weight.
    Force(f64),
    /// Neither: the tip slipped or tilted, or something else touched the sensor.
    Unknown,
}

/// Greatest chi-square per reading: the quantile for one press in 10,000 (Wilson and Hilferty).
fn greatest(readings: usize) -> f64 {
    const NORMAL: f64 = 3.719;
    let part = 2.0 / (9.0 * readings as f64);
    (1.0 - part + NORMAL * part.sqrt()).powi(3)
}

/// Factor on the form's error for a single press: at the smallest contacts it is 4 to 7 times its root
/// mean square.
const FORM_OF_ONE: f64 = 4.0;

/// Chi-square per reading of each press.
fn chi_squares(design: &Design, fitted: &Fitted, presses: &[KnownPress]) -> Vec<f64> {
    let form = FORM_OF_ONE * fitted.form;
    let of = |press| misfit(design, &fitted.parameters, press, form);
    presses.iter().map(of).collect()
}

/// Greatest chi-square per reading of a press. It rises with the median if the median exceeds its
/// value for right errors, 0.84 to 0.91 with four to eight readings.
fn limit(chi_squares: &[f64], readings: usize) -> f64 {
    greatest(readings) * (median(chi_squares) / 0.87).max(1.0)
}

/// Whether each press contradicts the others.
pub(super) fn left_out(design: &Design, fitted: &Fitted, presses: &[KnownPress]) -> Vec<bool> {
    let squares = chi_squares(design, fitted, presses);
    let limit = limit(&squares, design.coils_m.len());
    // NaN contradicts too.
    let fits = |square: &f64| *square <= limit;
    squares.iter().map(|square| !fits(square)).collect()
}

/// The presses with a weight of zero, each with its cause.
pub(super) fn explain(
    design: &Design,
    fitted: &Fitted,
    presses: &[KnownPress],
    weights: &[f64],
) -> Vec<Suspect> {
    let readings = design.coils_m.len();
    let squares = chi_squares(design, fitted, presses);
    let limit = limit(&squares, readings);
    let out = (0..presses.len()).filter(|index| weights[*index] == 0.0);
    out.map(|index| Suspect {
        press: index,
        chi_square: squares[index] * readings as f64,
        cause: cause(design, fitted, (presses, index), limit),
    })
    .collect()
}

fn cause(
    design: &Design,
    fitted: &Fitted,
    (presses, index): (&[KnownPress], usize),
    limit: f64,
) -> Cause {
    let form = FORM_OF_ONE * fitted.form;
    let press = &presses[index];
    let placed = |[x, y]: [f64; 2]| KnownPress {
        place_m: [x, y],
        ..press.clone()
    };
    let off = |place_m: [f64; 2]| misfit(design, &fitted.parameters, &placed(place_m), form);
    let holes = presses.iter().map(|other| other.place_m);
    let hole = holes.min_by(|a, b| off(*a).total_cmp(&off(*b)));
    let place_m = lowest(hole.unwrap_or(press.place_m), 1e-3, off);
    let forced = |[ln_force, _]: [f64; 2]| {
        let other = KnownPress {
            force_n: ln_force.exp(),
            ..press.clone()
        };
        misfit(design, &fitted.parameters, &other, form)
    };
    let ln_force = lowest([press.force_n.ln(), 0.0], 0.3, forced);
    let [by_place, by_force] = [off(place_m), forced(ln_force)];
    if by_place.min(by_force) > limit {
        Cause::Unknown
    } else if by_place < by_force {
        Cause::Place(place_m)
    } else {
        Cause::Force(ln_force[0].exp())
    }
}

/// Lowest point near a start, by steps along both axes that are halved where none leads down.
fn lowest(start: [f64; 2], step: f64, of: impl Fn([f64; 2]) -> f64) -> [f64; 2] {
    let (mut at, mut value, mut step) = (start, of(start), step);
    for _ in 0..60 {
        let [x, y] = at;
        let around = [[x + step, y], [x - step, y], [x, y + step], [x, y - step]];
        let best = around.into_iter().min_by(|a, b| of(*a).total_cmp(&of(*b)));
        match best.filter(|best| of(*best) < value) {
            Some(best) => (at, value) = (best, of(best)),
            None => step *= 0.5,
        }
    }
    at
}
