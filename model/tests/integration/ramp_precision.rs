//! The `f32` estimator against `f64` references on the same inputs, over the whole range of loads
//! and stiffenings, and against eq. (2).

use crate::common::efficiency::fit;
use crate::common::plant::{Ramps, Recording, Stack, record};
use crate::common::reference::{Phi, equation_2, maximum_likelihood, reciprocal_line};
use crate::common::rng::Rng;
use palpate_model::ramp::{Basis, DriftModel, Noise, Ramp, RampSample, Reference, Term};
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
fn as_maximum_likelihood_in_f64_at_low_noise() {
    let creep = |t: f64| (1.0 + t / 0.05).ln();
    let worst = largest_difference(
        &Ramps::EIGHT,
        |t| 0.004 * creep(t),
        |recording| {
            let drift = DriftModel::Logarithmic { tau: Second(0.05) };
            let ours = fit(recording, Basis::with_drift(drift).unwrap(), Noise::Stated).unwrap();
            let ours = ours.load_ratio().unwrap();
            let best = maximum_likelihood(recording, &[&creep]);
            // The two estimates differ in second order of the noise, far less than their standard
            // error.
            let errors = (f64::from(ours.standard_error) / best.standard_error - 1.0).abs();
            // The weights omit the drift, so standard errors are off by its size, 1.2 % here.
            assert!(errors < 0.012, "standard error off by {errors:e}");
            let apart = (f64::from(ours.value) - best.kappa).abs();
            (apart - 0.002 * best.standard_error).max(0.0) / best.kappa
        },
    );
    assert!(worst <= 1e-4, "{worst:e}");
}

#[test]
fn long_runs_lose_nothing() {
    let stack = Stack::equal(10.0, 0.005);
    let ramps = Ramps {
        samples: 400_000,
        teeth: 80,
        duration: 400.0,
    };
    let recording = record(&stack, &ramps, 1e-6, |_| 0.0, &mut Rng::new(1));
    let ours = kappa(&recording, Basis::LINEAR);
    let reference = reciprocal_line(&recording, &[]).kappa;
    assert!(
        relative(ours, reference) < 1e-6,
        "{:e}",
        relative(ours, reference)
    );
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

#[test]
fn two_samples_are_equation_2() {
    let mut rng = Rng::new(7);
    let mut worst: f64 = 0.0;
    for (ratio, eps) in range() {
        for _ in 0..200 {
            let stack = Stack::equal(ratio, eps);
            let g_ref = rng.between(0.2, 5.0) as f32;
            let x_ref = rng.between(1e-4, 1e-3) as f32;
            let first = [0.0, 0.0];
            // The second state, which noise moves off the exact solution.
            let h = (f64::from(g_ref) * (1.0 / (1.0 + eps) - 1.0)) as f32;
            let whole = 1.0 + 1.0 / ratio + f64::from(g_ref);
            let u = f64::from(x_ref) * (whole / (whole + f64::from(h)) - 1.0);
            let second = [(u * rng.between(0.999, 1.001)) as f32, h];
            // The closed formula in c_D = c_S/g, on the same f32 inputs.
            let c_d = [0.0, h].map(|h| stack.sensing / (f64::from(g_ref) + f64::from(h)));
            let x = [0.0, second[0]].map(|u| f64::from(x_ref) + f64::from(u));
            let closed = equation_2(stack.sensing, c_d, x);

            let reference = Reference::new(Metre(x_ref), g_ref).unwrap();
            let mut ramp = Ramp::new(reference, Basis::LINEAR);
            for ([u, h], sigma) in [(first, 3e-8), (second, 5e-8)] {
                let sample = RampSample {
                    time: Second(0.0),
                    deformation: Metre(u),
                    regressor: h,
                    sigma: Metre(sigma),
                };
                ramp.push(&sample).unwrap();
            }
            let kappa = ramp.fit(Noise::Stated).unwrap().load_ratio();
            // With noise, two samples of a soft load may leave the signal's sign in doubt: then
            // there is no value.
            if let Ok(kappa) = kappa {
                worst = worst.max(relative(stack.sensing / f64::from(kappa.value), closed));
            }
        }
    }
    println!("largest relative difference from eq. (2): {worst:.2e}");
    assert!(worst <= 1e-6 && worst > 0.0, "{worst:e}");
}
