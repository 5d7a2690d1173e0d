//! Further results of a fit: drifts, errors, intervals, weights, scatter.

use crate::common::efficiency::fit;
use crate::common::plant::{Ramps, Stack, record};
use crate::common::reference::reciprocal_line;
use crate::common::rng::Rng;
use palpate_model::ramp::{Basis, DriftModel, Noise, Ramp, RampSample, Reference, Scatter};
use palpate_model::units::{Metre, Second};

#[test]
fn drifts_are_what_they_say() {
    for i in 0..2000 {
        let t = i as f32 * 7.3e-3;
        let at = |drift: DriftModel| f64::from(drift.at(Second(t)));
        let t64 = f64::from(t);
        let tau = Second(0.25);
        let cases = [
            (at(DriftModel::Linear), t64),
            (at(DriftModel::Logarithmic { tau }), (1.0 + t64 / 0.25).ln()),
            (
                at(DriftModel::Exponential { tau }),
                1.0 - (-t64 / 0.25).exp(),
            ),
            (
                at(DriftModel::SawTooth { period: tau }),
                (t64 / 0.25).fract() - 0.5,
            ),
        ];
        for (ours, exact) in cases {
            assert!(
                (ours - exact).abs() <= 2.0e-7 * (1.0 + exact.abs()),
                "{t} {ours} {exact}"
            );
        }
    }
}

#[test]
fn each_drift_is_found_and_taken_out() {
    let stack = Stack::equal(2.0, 0.1);
    let tau = Second(0.2);
    let cases = [
        DriftModel::Linear,
        DriftModel::Logarithmic { tau },
        DriftModel::Exponential { tau },
        DriftModel::SawTooth {
            period: Second(1.0 / 8.0),
        },
    ];
    for drift in cases {
        // phi as the documentation defines it, independent of the crate's code.
        let phi = move |t: f64| match drift {
            DriftModel::Linear => t,
            DriftModel::Logarithmic { .. } => (1.0 + t / 0.2).ln(),
            DriftModel::Exponential { .. } => 1.0 - (-t / 0.2).exp(),
            DriftModel::SawTooth { .. } => (t * 8.0).fract() - 0.5,
        };
        // 5 % of drift, and negligible noise.
        let recording = record(
            &stack,
            &Ramps::EIGHT,
            1e-7,
            |t| 0.05 * phi(t),
            &mut Rng::new(8),
        );
        let found = fit(&recording, Basis::with_drift(drift).unwrap(), Noise::Larger).unwrap();
        let load = found.load_ratio().unwrap();
        assert!((load.value - 0.5).abs() < 2e-4, "{drift:?}: {load:?}");
        let size = found.coefficient(2).unwrap();
        assert!((size.value - 0.05).abs() < 1e-5, "{drift:?}: {size:?}");
        let plain = fit(&recording, Basis::LINEAR, Noise::Larger)
            .unwrap()
            .load_ratio();
        let off = plain.map_or(f32::INFINITY, |plain| (plain.value - 0.5).abs());
        assert!(off > 1e-3, "{drift:?} would not matter: {off}");
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
        // The drift term raises the standard error by the published ratio of 3.2 to 0.51, at eps 3
        // %.
        let plain = fit(&recording, Basis::LINEAR, Noise::Stated).unwrap();
        let [dear, cheap] = [fitted.coefficient(1), plain.coefficient(1)].map(Option::unwrap);
        let price = dear.standard_error / cheap.standard_error;
        assert!(eps != 0.03 || (price - 6.27).abs() < 0.1, "{price}");
        // With white noise of the stated size, chi-square is 397 +- 28.
        assert_eq!(fitted.degrees_of_freedom(), 397);
        assert!(
            (fitted.chi_square() - 397.0).abs() < 85.0,
            "{}",
            fitted.chi_square()
        );
        assert!(fitted.coefficient(3).is_none());
        let total = fitted.total_displacement().0;
        let expected = stack.total as f32;
        assert!((total / expected - 1.0).abs() < 0.2, "{total} {expected}");
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
        assert!(
            (f64::from(ours.low) - low).abs() < 1e-4 * whole,
            "{ours:?} {low} {high}"
        );
        assert!(
            (f64::from(ours.high) - high).abs() < 1e-4 * whole,
            "{ours:?} {low} {high}"
        );
        assert!((high - exact.kappa) / (exact.kappa - low) > 1.2);
    }
}

#[test]
fn the_centre_is_the_weighted_mean() {
    let stack = Stack::equal(1.0, 0.1);
    let mut recording = record(&stack, &Ramps::ONE, 1e-4, |_| 0.0, &mut Rng::new(2));
    recording
        .samples
        .iter_mut()
        .step_by(3)
        .for_each(|s| s.sigma = s.sigma * 3.0);
    let fitted = fit(&recording, Basis::LINEAR, Noise::Stated).unwrap();
    let x_ref = f64::from(recording.reference.deformation().0);
    let (mut weights, mut sum) = (0.0, 0.0);
    for s in &recording.samples {
        let x = x_ref + f64::from(s.deformation.0);
        let weight = x.powi(4) / f64::from(s.sigma.0).powi(2);
        weights += weight;
        sum += weight * f64::from(s.regressor);
    }
    assert!((f64::from(fitted.centre()) / (sum / weights) - 1.0).abs() < 1e-5);
    let here = fitted.load_ratio_at(fitted.centre()).unwrap();
    assert_eq!(fitted.load_ratio(), Ok(here));
}

#[test]
fn unstated_noise_widens_and_luck_does_not_narrow() {
    let stack = Stack::equal(1.0, 0.1);
    // The sigma of half of the samples is wrong by a factor of four: chi-square shows that, and
    // Birge's rule widens the interval.
    let mut recording = record(&stack, &Ramps::ONE, 4e-4, |_| 0.0, &mut Rng::new(6));
    let width = |recording: &_, noise| {
        let ratio = fit(recording, Basis::LINEAR, noise)
            .unwrap()
            .load_ratio()
            .unwrap();
        ratio.high - ratio.low
    };
    let honest = width(&recording, Noise::Stated);
    recording
        .samples
        .iter_mut()
        .for_each(|s| s.sigma = s.sigma / 4.0);
    assert!((width(&recording, Noise::Stated) / honest - 0.25).abs() < 0.01);
    assert!((width(&recording, Noise::Larger) / honest - 1.0).abs() < 0.1);
    assert!((width(&recording, Noise::Residual) / honest - 1.0).abs() < 0.1);
    recording
        .samples
        .iter_mut()
        .for_each(|s| s.sigma = s.sigma * 16.0);
    assert!((width(&recording, Noise::Larger) / honest - 4.0).abs() < 0.1);
    let mut ramp = Ramp::new(recording.reference, Basis::LINEAR);
    recording.samples.iter().for_each(|s| ramp.push(s).unwrap());
    let sigma = ramp.residual_sigma().unwrap().0;
    assert!((sigma / (4e-4 * 3e-4) - 1.0).abs() < 0.15, "{sigma}");
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
    let ours = fit(&recording, Basis::LINEAR, Noise::Stated)
        .unwrap()
        .load_ratio()
        .unwrap();
    let exact = reciprocal_line(&recording, &[]);
    assert!((f64::from(ours.value) / exact.kappa - 1.0).abs() < 1e-6);
    assert!((f64::from(ours.standard_error) / exact.standard_error - 1.0).abs() < 1e-5);
    let mut unweighted = recording;
    unweighted
        .samples
        .iter_mut()
        .for_each(|s| s.sigma = Metre(3e-8));
    let plain = fit(&unweighted, Basis::LINEAR, Noise::Stated)
        .unwrap()
        .load_ratio()
        .unwrap();
    assert!((plain.value - ours.value).abs() > 1e-3);
}

#[test]
fn the_regressor_s_noise_is_put_into_sigma() {
    let reference = Reference::new(Metre(3e-4), 1.0).unwrap();
    let quiet = RampSample {
        time: Second(0.0),
        deformation: Metre(1e-5),
        regressor: -0.1,
        sigma: Metre(3e-8),
    };
    let noisy = quiet.with_regressor_sigma(&reference, 1e-3);
    // x sigma_g/(1 + g) = 0.31 mm x 1e-3 / 1.9, added in squares to 30 nm.
    let expected = (3e-8f64.powi(2) + (3.1e-4 * 1e-3 / 1.9f64).powi(2)).sqrt();
    assert!((f64::from(noisy.sigma.0) / expected - 1.0).abs() < 1e-5);
    assert_eq!(quiet.with_regressor_sigma(&reference, 0.0), quiet);
}

/// For a slow disturbance, the stated error of the mean agrees with the scatter of the mean from
/// train to train.
#[test]
fn what_turns_slowly_is_not_averaged_out() {
    let mut rng = Rng::new(23);
    let stated = 0.02;
    // `turn` is the advance of the phase from one of twelve estimates to the next, `size` the
    // amplitude.
    let mut trains = |turn: f64, size: f64| -> (f64, f64) {
        let (mut errors, mut factors) = (0.0, 0.0);
        for _ in 0..2000 {
            let phase = std::f64::consts::TAU * rng.uniform();
            let mut scatter = Scatter::default();
            for ramp in 0..12 {
                let angle = phase + turn * f64::from(ramp);
                let value = 3.0 + stated * rng.normal() + size * angle.sin();
                scatter.add(value as f32, stated as f32);
            }
            errors += (f64::from(scatter.mean()) - 3.0).powi(2);
            factors += f64::from(scatter.of_mean().unwrap()).powi(2);
        }
        let of_mean = stated / 12.0_f64.sqrt();
        (
            (errors / 2000.0).sqrt() / of_mean,
            (factors / 2000.0).sqrt(),
        )
    };
    let (noise, stated_of_noise) = trains(0.0, 0.0);
    assert!((noise - 1.0).abs() < 0.05);
    assert!((1.0..1.35).contains(&stated_of_noise), "{stated_of_noise}");
    // Ramps at 10 Hz: a vibration at 9.5 Hz changes its phase by a twentieth of a turn from ramp to
    // ramp.
    let (slow, stated_of_slow) = trains(-0.05 * std::f64::consts::TAU, 0.1);
    assert!(
        (0.8..2.0).contains(&(stated_of_slow / slow)),
        "{slow} {stated_of_slow}"
    );
    // Successive estimates have opposite signs: the stated error is then larger than the true one.
    let (quick, stated_of_quick) = trains(0.45 * std::f64::consts::TAU, 0.1);
    assert!(stated_of_quick > quick, "{quick} {stated_of_quick}");
}

#[test]
fn scatter_shows_what_white_noise_does_not() {
    let mut rng = Rng::new(21);
    let (mut white, mut coloured) = (Scatter::default(), Scatter::default());
    for _ in 0..2000 {
        let error = 0.01 + 0.02 * rng.uniform();
        let noise = error * rng.normal();
        white.add((3.0 + noise) as f32, error as f32);
        coloured.add((3.0 + noise + 0.05 * rng.normal()) as f32, error as f32);
    }
    assert!(
        (white.birge_ratio().unwrap() - 1.0).abs() < 0.06,
        "{white:?}"
    );
    assert!((white.mean() - 3.0).abs() < 0.002);
    assert!(coloured.birge_ratio().unwrap() > 2.5);
    assert!((white.chi_square() / 2000.0 - 1.0).abs() < 0.12);
    let before = white;
    for bad in [
        (f32::NAN, 1.0),
        (1.0, 0.0),
        (1.0, f32::NAN),
        (f32::INFINITY, 1.0),
    ] {
        white.add(bad.0, bad.1);
    }
    assert_eq!(white, before);
    assert_eq!(Scatter::default().birge_ratio(), None);
    assert_eq!(Scatter::default().of_mean(), None);
}
