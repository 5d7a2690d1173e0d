//! Uncertainty of kappa = c_S/c_L in the instrument's three terms.

use super::Unusable;
use super::least_squares::System;

/// Loads, kappa, at which the instrument's three terms are fitted to the uncertainty: from a rigid
/// load to one ten times as soft as the sensing layer.
const KAPPAS: [f64; 8] = [0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];

/// Fits three terms whose squares add up to a variance of kappa, none negative: a constant, one
/// proportional to kappa, and one proportional to W = 1 + kappa + c_S/c_D0. Equal relative errors
/// of the variance have equal weight.
pub(crate) fn terms(ratio: f64, variance: impl Fn(f64) -> f64) -> Result<[f64; 3], Unusable> {
    let squares = |kappa: f64| [1.0, kappa * kappa, (1.0 + kappa + ratio).powi(2)];
    // Every round removes one negative term.
    let mut used = vec![0, 1, 2];
    loop {
        let mut system = System::new(used.len());
        for kappa in KAPPAS {
            let (squares, variance) = (squares(kappa), variance(kappa));
            let row = used.iter().filter_map(|index| squares.get(*index).copied());
            system.add(row, variance, 1.0 / variance);
        }
        let found = system.solve("the uncertainty")?.unknowns;
        let lowest = found.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        match lowest {
            Some((place, value)) if *value < 0.0 => {
                used.remove(place);
            }
            _ => {
                let mut terms = [0.0; 3];
                for (index, square) in used.into_iter().zip(found) {
                    if let Some(term) = terms.get_mut(index) {
                        *term = square.sqrt();
                    }
                }
                return Ok(terms);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variance_of_the_three_terms_gives_them_back() {
        for [constant, scale, whole] in [[0.005, 0.01, 0.003], [0.0, 0.02, 0.004], [0.01, 0.0, 0.0]]
        {
            let variance = |kappa: f64| {
                let terms: [f64; 3] = [constant, scale * kappa, whole * (2.1 + kappa)];
                terms.iter().map(|term| term * term).sum()
            };
            let found = terms(1.1, variance).unwrap();
            for (found, expected) in found.into_iter().zip([constant, scale, whole]) {
                assert!((found - expected).abs() < 1e-6, "{found} {expected}");
            }
        }
    }

    #[test]
    fn what_they_cannot_follow_leaves_out_terms_below_zero() {
        // A variance with a minimum at kappa = 1, as after a check.
        let found = terms(1.1, |kappa| 1e-4 * (0.1 + (kappa - 1.0).powi(2))).unwrap();
        assert!(found.iter().all(|term| *term >= 0.0));
        assert!(found.iter().any(|term| *term > 0.0));
    }
}
