//! Cramer-Rao bound of a forward model, from numerical derivatives.

use super::linalg::least_squares;

/// Standard deviations that no unbiased estimator of `parameters` can beat, for readings
/// `model(i, parameters)` with normal noise of `sigma(i)`.
pub fn cramer_rao(
    samples: usize,
    parameters: &[f64],
    steps: &[f64],
    model: impl Fn(usize, &[f64]) -> f64,
    sigma: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let shifted = |k: usize, by: f64| {
        let mut p = parameters.to_vec();
        p[k] += by;
        p
    };
    let rows: Vec<Vec<f64>> = (0..samples)
        .map(|i| {
            (0..parameters.len())
                .map(|k| {
                    // Central difference with Richardson's extrapolation, for a step of one in the
                    // scaled parameter.
                    let difference =
                        |h: f64| (model(i, &shifted(k, h)) - model(i, &shifted(k, -h))) / (2.0 * h);
                    let h = steps[k];
                    (4.0 * difference(h / 2.0) - difference(h)) / 3.0 * h / sigma(i)
                })
                .collect()
        })
        .collect();
    // `least_squares` also returns the inverse of the Fisher matrix J'J.
    let (_, inverse) = least_squares(&rows, &vec![0.0; samples]);
    (0..parameters.len())
        .map(|k| inverse[k][k].sqrt() * steps[k])
        .collect()
}
