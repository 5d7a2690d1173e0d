//! Further results of a fit: drifts, errors, intervals, weights, scatter.

use crate::common::plant::{Ramps, Stack, fit, record};
use crate::common::reference::reciprocal_line;
use crate::common::rng::Rng;
use palpate_model::ramp::{Basis, DriftModel, Noise, Scatter};
use palpate_model::units::Second;

/// A drift with its phi as the documentation defines it, independent of the crate's code.
type Drift = (DriftModel, fn(f64) -> f64);

fn drifts() -> [Drift; 4] {
    let tau = Second(0.25);
    let period = Second(0.125);
    [
        (DriftModel::Linear, |t| t),
        (DriftModel::Logarithmic { tau }, |t| (1.0 + t / 0.25).ln()),
        (DriftModel::Exponential { tau }, |t| 1.0 - (-t / 0.25).exp()),
        (DriftModel::SawTooth { period }, |t| (t * 8.0).fract() - 0.5),
    ]
}

#[test]
fn each_drift_is_what_it_says_and_is_taken_out() {
    let stack = Stack::equal(2.0, 0.1);
    for (drift, phi) in drifts() {
        for t in (0..2000).map(|i| i as f32 * 7.3e-3) {
            let (ours, exact) = (f64::from(drift.at(Second(t))), phi(t.into()));
            let error = (ours - exact).abs();
            assert!(error <= 2.0e-7 * (1.0 + exact.abs()), "{t} {ours} {exact}");
        }
        // 5 % of drift, and negligible noise.
        let mut rng = Rng::new(8);
        let recording = record(&stack, &Ramps::EIGHT, 1e-7, |t| 0.05 * phi(t), &mut rng);
        let found = fit(&recording, Basis::with_drift(drift).unwrap(), Noise::Larger).unwrap();
        let load = found.load_ratio().unwrap();
        assert!((load.value - 0.5).abs() < 2e-4, "{drift:?}: {load:?}");
        let size = found.coefficient(2).unwrap();
        assert!((size.value - 0.05).abs() < 1e-5, "{drift:?}: {size:?}");
        assert!(found.coefficient(3).is_none());
    }
}

#[test]
fn errors_and_diagnostics_are_those_of_the_reference() {
    let creep = |t: f64| (1.0 + t / 0.05).ln();
    let drift = DriftModel::Logarithmic { tau: Second(0.05) };
    for (ratio, eps) in [(0.2, 0.3), (1.0, 0.03), (5.0, 0.1)] {
        let stack = Stack::equal(ratio, eps);
        let recording = record(&stack, &Ramps::ONE, 1e-4, |_| 0.0, &mut Rng::new(2));
        let fitted = fit(&recording, Basis::with_drift(drift).unwrap(), Noise::Stated).unwrap();
        let exact = reciprocal_line(&recording, &[&creep]);
        let ours = fitted.load_ratio().unwrap();
        let error = f64::from(ours.standard_error) / exact.standard_error - 1.0;
        assert!(error.abs() < 1e-5, "{error:e}");
        // With white noise of the stated size, chi-square is 397 +- 28.
        let chi_square = fitted.reduced_chi_square().unwrap() * 397.0;
        assert!((chi_square - 397.0).abs() < 85.0, "{chi_square}");
    }
}

#[test]
fn the_interval_is_fieller_s() {
    // With a slope of six standard errors, the ends of the interval are 35 % and 50 % from the
    // estimate.
    let stack = Stack::equal(0.2, 0.003);
    for seed in 0..20 {
        let recording = record(&stack, &Ramps::ONE, 5e-4, |_| 0.0, &mut Rng::new(seed));
        let ours = fit(&recording, Basis::LINEAR, Noise::Stated)
            .unwrap()
            .load_ratio()
            .unwrap();
        let exact = reciprocal_line(&recording, &[]);
        let (low, high) = exact.interval(1.959_963_985);
        let whole = exact.kappa + 2.0;
        for (ours, exact) in [(ours.low, low), (ours.high, high)] {
            let off = (f64::from(ours) - exact).abs();
            assert!(off < 1e-4 * whole, "{ours} {exact}");
        }
        assert!((high - exact.kappa) / (exact.kappa - low) > 1.2);
    }
}

#[test]
fn weights_follow_sigma() {
    // Every second sample is ten times noisier: only a weighted fit gives the right result.
    let stack = Stack::equal(1.0, 0.1);
    let mut recording = record(&stack, &Ramps::ONE, 1e-4, |_| 0.0, &mut Rng::new(12));
    let mut rng = Rng::new(13);
    for s in recording.samples.iter_mut().step_by(2) {
        s.sigma = s.sigma * 10.0;
        s.deformation = s.deformation + s.sigma * rng.normal() as f32;
    }
    let fitted = fit(&recording, Basis::LINEAR, Noise::Stated).unwrap();
    let ours = fitted.load_ratio().unwrap();
    let exact = reciprocal_line(&recording, &[]);
    assert!((f64::from(ours.value) / exact.kappa - 1.0).abs() < 1e-6);
    assert!((f64::from(ours.standard_error) / exact.standard_error - 1.0).abs() < 1e-5);
    // The centre is the weighted mean of the regressor.
    let x_ref = f64::from(recording.reference.deformation().0);
    let (mut weights, mut sum) = (0.0, 0.0);
    for s in &recording.samples {
        let x = x_ref + f64::from(s.deformation.0);
        let weight = x.powi(4) / f64::from(s.sigma.0).powi(2);
        weights += weight;
        sum += weight * f64::from(s.regressor);
    }
    assert!((f64::from(fitted.centre()) / (sum / weights) - 1.0).abs() < 1e-5);
}

#[test]
fn unstated_noise_widens_and_luck_does_not_narrow() {
    let stack = Stack::equal(1.0, 0.1);
    // The sigma of all samples is wrong by a factor of four: chi-square shows that, and Birge's
    // rule widens the interval.
    let mut recording = record(&stack, &Ramps::ONE, 4e-4, |_| 0.0, &mut Rng::new(6));
    let width = |recording: &_, noise| {
        let ratio = fit(recording, Basis::LINEAR, noise)
            .unwrap()
            .load_ratio()
            .unwrap();
        ratio.high - ratio.low
    };
    let honest = width(&recording, Noise::Stated);
    let mut rescale = |factor: f32| {
        recording
            .samples
            .iter_mut()
            .for_each(|s| s.sigma = s.sigma * factor);
        [Noise::Stated, Noise::Larger, Noise::Residual]
            .map(|noise| width(&recording, noise) / honest)
    };
    let [stated, larger, residual] = rescale(0.25);
    assert!((stated - 0.25).abs() < 0.01);
    assert!((larger - 1.0).abs() < 0.1);
    assert!((residual - 1.0).abs() < 0.1);
    let [_, larger, residual] = rescale(16.0);
    assert!((larger - 4.0).abs() < 0.1);
    assert!((residual - 1.0).abs() < 0.1);
}

/// Birge ratio and the factor of the mean's error, from the definitions in two passes.
fn scatter(estimates: &[(f32, f32)]) -> (f64, f64, f64) {
    let estimates: Vec<(f64, f64)> = estimates
        .iter()
        .map(|&(value, error)| (value.into(), f64::from(error).powi(2)))
        .collect();
    let count = estimates.len() as f64;
    let weights: f64 = estimates.iter().map(|(_, variance)| 1.0 / variance).sum();
    let mean = estimates.iter().map(|(x, v)| x / v).sum::<f64>() / weights;
    let chi_square: f64 = estimates.iter().map(|(x, v)| (x - mean).powi(2) / v).sum();
    let successive: f64 = estimates
        .windows(2)
        .map(|pair| (pair[1].0 - pair[0].0).powi(2) / (pair[0].1 + pair[1].1))
        .sum();
    let birge_ratio = (chi_square / (count - 1.0)).sqrt();
    let alike = (1.0 - successive / chi_square).max(0.0);
    let beyond_noise = (alike * alike - 1.0 / count).max(0.0).sqrt();
    let turns = (1.0 + beyond_noise) / (1.0 - beyond_noise);
    (mean, birge_ratio, birge_ratio * turns.min(count).sqrt())
}

#[test]
fn scatter_is_as_defined() {
    let mut rng = Rng::new(23);
    let mut limited = 0;
    for turn in [0.0, 0.003, 0.05, 0.45].repeat(100) {
        // Twelve estimates with a disturbance whose phase advances by `turn` from each to the next.
        let (phase, size) = (rng.uniform(), rng.between(0.0, 0.3));
        let estimates: Vec<(f32, f32)> = (0..12)
            .map(|ramp| {
                let angle = std::f64::consts::TAU * (phase + turn * f64::from(ramp));
                let error = rng.between(0.01, 0.03);
                let value = 3.0 + error * rng.normal() + size * angle.sin();
                (value as f32, error as f32)
            })
            .collect();
        let mut found = Scatter::default();
        for &(value, error) in &estimates {
            found.add(value, error);
        }
        let (mean, birge_ratio, of_mean) = scatter(&estimates);
        limited += u32::from(of_mean > 3.4 * birge_ratio);
        for (ours, exact) in [
            (found.mean(), mean),
            (found.birge_ratio().unwrap(), birge_ratio),
            (found.of_mean().unwrap(), of_mean),
        ] {
            assert!(
                (f64::from(ours) / exact - 1.0).abs() < 1e-3,
                "{turn}: {ours} {exact}"
            );
        }
        let before = found;
        for bad in [
            (f32::NAN, 1.0),
            (1.0, 0.0),
            (1.0, f32::NAN),
            (f32::INFINITY, 1.0),
        ] {
            found.add(bad.0, bad.1);
        }
        assert_eq!(found, before);
    }
    println!("error of the mean limited to that of one estimate: {limited} of 400");
    assert_eq!(Scatter::default().birge_ratio(), None);
    assert_eq!(Scatter::default().of_mean(), None);
}
