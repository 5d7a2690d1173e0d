//! The `f32` estimator against QR in `f64` on the same inputs, over the whole range of loads and
//! stiffenings.

use crate::common::plant::{Ramps, Recording, Stack, fit, record};
use crate::common::reference::{Phi, reciprocal_line};
use crate::common::rng::Rng;
use palpate_model::ramp::{Basis, DriftModel, Noise, RampSample, Reference, Term};
use palpate_model::units::{Metre, Second};

/// Values of c_L/c from 0.1 to 10 and of eps from 0.5 to 50 %: seven each, evenly spaced on a
/// logarithmic scale.
fn range() -> impl Iterator<Item = (f64, f64)> {
    let decades =
        |low: f64, high: f64| (0..7).map(move |i| low * (high / low).powf(f64::from(i) / 6.0));
    decades(0.1, 10.0).flat_map(move |ratio| decades(0.005, 0.5).map(move |eps| (ratio, eps)))
}

/// Runs `compare` over the range of loads and stiffenings with and without noise; prints and
/// returns the largest difference.
fn largest_difference(
    ramps: &Ramps,
    drift: impl Fn(f64) -> f64,
    compare: impl Fn(&Recording) -> f64,
) -> f64 {
    let mut worst = (0.0, String::new());
    for (ratio, eps) in range() {
        for noise in [1e-9, 1e-6, 1e-5] {
            for seed in 0..5 {
                let stack = Stack::equal(ratio, eps);
                let recording = record(&stack, ramps, noise, &drift, &mut Rng::new(seed));
                let difference = compare(&recording);
                if difference.is_nan() || difference > worst.0 {
                    worst = (
                        difference,
                        format!("c_L/c {ratio:.3}, eps {eps:.4}, noise {noise:e}"),
                    );
                }
            }
        }
    }
    println!("largest relative difference {:.2e} at {}", worst.0, worst.1);
    worst.0
}

fn kappa(recording: &Recording, basis: Basis) -> f64 {
    f64::from(
        fit(recording, basis, Noise::Stated)
            .unwrap()
            .load_ratio()
            .unwrap()
            .value,
    )
}

fn relative(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}

#[test]
fn a_linear_load_as_by_qr_in_f64() {
    let worst = largest_difference(
        &Ramps::ONE,
        |_| 0.0,
        |recording| {
            relative(
                kappa(recording, Basis::LINEAR),
                reciprocal_line(recording, &[]).kappa,
            )
        },
    );
    assert!(worst <= 1e-6, "{worst:e}");
}

#[test]
fn drifts_as_by_qr_in_f64() {
    let tau = 0.05f32;
    let creep = |t: f64| (1.0 + t / f64::from(tau)).ln();
    let linear = |t: f64| t;
    for ramps in [Ramps::ONE, Ramps::EIGHT] {
        let worst = largest_difference(
            &ramps,
            |t| 0.004 * creep(t) - 0.01 * t,
            |recording| {
                let basis = Basis::new(&[
                    Term::Level,
                    Term::Slope,
                    Term::Drift(DriftModel::Linear),
                    Term::Drift(DriftModel::Logarithmic { tau: Second(tau) }),
                ]);
                let phis: [Phi<'_>; 2] = [&linear, &creep];
                relative(
                    kappa(recording, basis.unwrap()),
                    reciprocal_line(recording, &phis).kappa,
                )
            },
        );
        assert!(worst <= 1e-4, "{worst:e}");
    }
}

#[test]
fn a_far_reference_loses_only_the_rounding_of_its_deviations() {
    // All regressors are absolute (g_ref = 0), and x_ref is a fifth too low.
    let stack = Stack::equal(10.0, 0.005);
    let near = record(&stack, &Ramps::ONE, 1e-6, |_| 0.0, &mut Rng::new(3));
    let x_ref = near.reference.deformation().0;
    let g_ref = near.reference.regressor();
    let reference = Reference::new(Metre(x_ref * 0.8), 0.0).unwrap();
    let samples = near.samples.iter().map(|s| RampSample {
        deformation: Metre((x_ref + s.deformation.0) - x_ref * 0.8),
        regressor: g_ref + s.regressor,
        ..*s
    });
    let far = Recording {
        reference,
        samples: samples.collect(),
    };
    let difference = relative(kappa(&far, Basis::LINEAR), reciprocal_line(&far, &[]).kappa);
    assert!(difference < 1e-6, "{difference:e}");
}
