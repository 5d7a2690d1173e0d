//! The estimator against the Cramer-Rao bound: a small version of `examples/efficiency.rs`.

use crate::common::efficiency::{CASES, EfficiencyCase};
use crate::common::fisher::cramer_rao;
use crate::common::plant::{Ramps, Stack, record};
use crate::common::rng::Rng;
use crate::common::statistics::EstimateErrors;
use palpate_model::ramp::{Basis, Noise};
use palpate_model::units::NewtonPerMetre;

#[test]
fn the_bound_of_a_straight_line_is_the_textbook_s() {
    // Intercept and slope of a line through readings at 0 to 9 with unit noise: variances 0.3454
    // and 1/82.5.
    let line = |i: usize, p: &[f64]| p[0] + p[1] * i as f64;
    let bound = cramer_rao(10, &[1.0, 2.0], &[1.0, 1.0], line, |_| 1.0);
    assert!((bound[0].powi(2) - 285.0 / 825.0).abs() < 1e-9);
    assert!((bound[1].powi(2) - 1.0 / 82.5).abs() < 1e-9);
}

#[test]
fn the_bounds_are_the_published_ones() {
    for case in CASES {
        let bound = case.bound();
        println!("{}: {:.3} %", case.name, bound * 100.0);
        // The published bound has two digits, and its sampling grid is unknown.
        assert!(
            (bound / case.published - 1.0).abs() < 0.03,
            "{}: {bound}",
            case.name
        );
    }
}

/// Checks the limits for 2000 ramps. By chance alone, RMSE/bound scatters by 0.016, the mean by
/// 0.022 and the coverage by 0.005 (one standard deviation).
fn judge(case: &EfficiencyCase, errors: &EstimateErrors) {
    let (rms, mean, cover) = (errors.rms(), errors.mean(), errors.coverage());
    println!(
        "{:26} rms {rms:.4} mean {mean:+.4} coverage {cover:.4}",
        case.name
    );
    let name = case.name;
    assert_eq!((errors.count, errors.refused), (2000, 0), "{name}");
    // An error that is below the bound by more than chance means that the bound or the noise is
    // wrong.
    assert!((0.95..=1.05).contains(&rms), "{name}: RMSE/bound {rms}");
    assert!(mean.abs() <= 0.1, "{name}: mean {mean}");
    assert!((0.935..=0.965).contains(&cover), "{name}: coverage {cover}");
}

#[test]
fn efficient_unbiased_and_covering_on_several_ranges_of_seeds() {
    for case in &CASES[..3] {
        for first in [1, 100_001, 7_000_001] {
            judge(case, &case.run(first..=first + 1999, Noise::Residual));
        }
    }
}

#[test]
fn both_other_readings_of_the_noise_cover_too() {
    for noise in [Noise::Stated, Noise::Larger] {
        for case in &CASES[..3] {
            judge(case, &case.run(1..=2000, noise));
        }
    }
}

/// Coverage over simulated ramps in which the standard error of kappa is comparable to kappa.
fn coverage(ratio: f64, eps: f64, noise: f64, ramps: Ramps, seeds: u64) -> (EstimateErrors, usize) {
    let stack = Stack::equal(ratio, eps);
    let (mut errors, mut open) = (EstimateErrors::default(), 0);
    for seed in 0..seeds {
        let recording = record(&stack, &ramps, noise, |_| 0.0, &mut Rng::new(seed));
        let fit =
            crate::common::efficiency::fit(&recording, Basis::LINEAR, Noise::Residual).unwrap();
        match fit.load_stiffness(NewtonPerMetre(stack.sensing as f32)) {
            Ok(load) => {
                let truth = NewtonPerMetre((ratio * stack.sensing) as f32);
                open += usize::from(load.high().is_none());
                errors.add(0.0, load.contains(truth));
            }
            Err(_) => errors.refused += 1,
        }
    }
    (errors, open)
}

#[test]
fn intervals_cover_where_the_ratio_is_far_from_normal() {
    // A stiff load with a tenth of the stiffening: kappa = 0.2 with a standard error of 0.37.
    let (errors, open) = coverage(5.0, 0.003, 1e-3, Ramps::ONE, 4000);
    println!(
        "stiff: coverage {:.4}, {open} open, {} refused",
        errors.coverage(),
        errors.refused
    );
    assert!((errors.coverage() - 0.95).abs() < 0.015);
    assert!(open > 2000 && errors.refused < 40);
    // A soft load whose slope is only six standard errors: Fieller's interval is far from
    // symmetric.
    let (errors, _) = coverage(0.2, 0.003, 5e-4, Ramps::ONE, 4000);
    println!(
        "soft: coverage {:.4}, {} refused",
        errors.coverage(),
        errors.refused
    );
    assert!((errors.coverage() - 0.95).abs() < 0.015 && errors.refused < 20);
}

#[test]
fn intervals_from_five_samples_use_student() {
    let few = Ramps {
        samples: 5,
        teeth: 1,
        duration: 1.0,
    };
    let (errors, _) = coverage(1.0, 0.3, 1e-4, few, 8000);
    println!("five samples: coverage {:.4}", errors.coverage());
    // With the normal quantile the coverage would be 85 %.
    assert!((errors.coverage() - 0.95).abs() < 0.01);
}

#[test]
fn noisy_readings_do_not_bias() {
    // At a signal-to-noise ratio of 100 a bias of second order would be visible: the noise and the
    // stiffening are both 20 times as large.
    let stack = Stack::equal(1.0, 0.5);
    let mut errors = EstimateErrors::default();
    let mut expected: f64 = 0.0;
    for seed in 0..4000 {
        let recording = record(&stack, &Ramps::EIGHT, 1e-2, |_| 0.0, &mut Rng::new(seed));
        let fit = crate::common::efficiency::fit(&recording, Basis::LINEAR, Noise::Stated).unwrap();
        let ratio = fit.load_ratio().unwrap();
        errors.add(
            f64::from(ratio.value) - 1.0,
            ratio.low <= 1.0 && 1.0 <= ratio.high,
        );
        expected += f64::from(ratio.standard_error) / 4000.0;
    }
    let bias = errors.mean() / expected;
    println!(
        "bias of kappa {bias:+.4} standard errors, rms {:.4}",
        errors.rms() / expected
    );
    assert!(bias.abs() < 0.1);
}
