//! Non-linear loads: load curve along the ramp and tangent stiffness against the truth.

use crate::common::plant::{LoadLaw, Ramps, Stack, fit, record};
use crate::common::rng::Rng;
use palpate_model::ramp::{Basis, DriftModel, Fit, Noise, Term};
use palpate_model::units::{Metre, NewtonPerMetre, Second};

const SENSING: NewtonPerMetre = NewtonPerMetre(6e3);

/// A load that hardens with the cube of x: at 0.3 mm, the deformation of the press, the slope of
/// its tangent is twice that of its secant.
fn hardening(eps: f64) -> Stack {
    let k = 3e3;
    let x = 0.3e-3;
    // k3 x^2 = k at this deformation, so F = 2 k x and dF/dx = 4 k there.
    let load = LoadLaw::Hardening { k, k3: k / (x * x) };
    Stack {
        load,
        total: x + 2.0 * k * x * 2.0 / 6e3,
        ..Stack::equal(1.0, eps)
    }
}

/// Errors of the force, and of the point from the curve, at one current, in standard errors.
fn at(stack: &Stack, fitted: &Fit, current: f64) -> [f64; 2] {
    let truth = stack.at(current);
    let h = stack.regressor(current) as f32;
    let point = fitted.load_point_within(h, SENSING, Metre(stack.total as f32));
    // Distance of the point (x_L, F) from the true curve, along F. The errors of both are
    // correlated, since they come from one deformation: x_L decreases by as much as F increases.
    let off = f64::from(point.force.0) - stack.load.force(point.displacement.0.into());
    let sigma = f64::from(point.force_sigma.0)
        + stack.load.tangent(truth.load) * f64::from(point.displacement_sigma.0);
    let error = f64::from(point.force.0) - truth.force;
    [error / f64::from(point.force_sigma.0), off / sigma]
}

/// Error of the tangent at the ramp's centre, in standard errors.
fn of_tangent(stack: &Stack, fitted: &Fit) -> f64 {
    // The current at which the regressor has the centre's deviation.
    let h = f64::from(fitted.centre());
    let rise = -h / (stack.sensing / stack.actuated + h);
    let tangent = stack.load.tangent(stack.at((rise / stack.eps).sqrt()).load);
    let ratio = fitted.load_ratio().unwrap();
    (f64::from(ratio.value) - stack.sensing / tangent) / f64::from(ratio.standard_error)
}

/// Simulates ramps. Asserts that force, curve and tangent are within three standard errors in 97 %
/// of the ramps, all along the ramp: a cubic curve has four independent errors, and by chance one
/// of them exceeds three standard errors in one ramp of a hundred. Also asserts that force at the
/// peak and tangent scatter by as much as stated; the scatter has a standard deviation of 2.2 %.
fn assert_sound(stack: &Stack, basis: Basis, noise: f64, creep: f64) {
    const RAMPS: u64 = 1000;
    let (mut within, mut squares) = ([0.0; 3], [0.0; 2]);
    let drift = |t: f64| creep * (1.0 + t / 0.05).ln();
    for seed in 1..=RAMPS {
        let recording = record(stack, &Ramps::EIGHT, noise, drift, &mut Rng::new(seed));
        let fitted = fit(&recording, basis, Noise::Stated).unwrap();
        let tangent = of_tangent(stack, &fitted);
        let mut worst = [0.0, 0.0, tangent.abs()];
        for step in 0..=40 {
            let errors = at(stack, &fitted, f64::from(step) / 40.0);
            for (worst, error) in worst.iter_mut().zip(errors) {
                *worst = error.abs().max(*worst);
            }
        }
        for (within, worst) in within.iter_mut().zip(worst) {
            *within += f64::from(u8::from(worst <= 3.0)) / RAMPS as f64;
        }
        let [at_the_peak, _] = at(stack, &fitted, 1.0);
        for (square, error) in squares.iter_mut().zip([at_the_peak, tangent]) {
            *square += error * error / RAMPS as f64;
        }
    }
    let rms = squares.map(f64::sqrt);
    let eps = stack.eps;
    println!("eps {eps}: within 3 s.e. {within:.3?}, rms {rms:.3?}");
    assert!(within.iter().all(|&share| share >= 0.97), "{within:?}");
    assert!(rms.iter().all(|rms| (rms - 1.0).abs() < 0.08), "{rms:?}");
}

#[test]
fn a_hardening_spring_s_curve_is_within_three_standard_errors() {
    let basis = [Term::Level, Term::Slope, Term::Quadratic, Term::Cubic];
    let basis = Basis::new(&basis).unwrap();
    for (eps, noise) in [(0.03, 1e-4), (0.10, 2e-5), (0.10, 1e-4), (0.5, 1e-4)] {
        assert_sound(&hardening(eps), basis, noise, 0.0);
    }
}

#[test]
fn and_under_creep() {
    let creep = Term::Drift(DriftModel::Logarithmic { tau: Second(0.05) });
    let basis = [Term::Level, Term::Slope, Term::Quadratic, creep];
    assert_sound(&hardening(0.10), Basis::new(&basis).unwrap(), 1e-4, 0.003);
}

#[test]
fn a_linear_load_s_curve_is_a_line_through_the_origin() {
    let stack = Stack::equal(0.5, 0.1);
    let recording = record(&stack, &Ramps::EIGHT, 1e-8, |_| 0.0, &mut Rng::new(1));
    let fitted = fit(&recording, Basis::LINEAR, Noise::Larger).unwrap();
    for i in 0..=10 {
        let current = f64::from(i) / 10.0;
        let truth = stack.at(current);
        let h = stack.regressor(current) as f32;
        let point = fitted.load_point_within(h, SENSING, fitted.total_displacement());
        assert!((f64::from(point.force.0) / truth.force - 1.0).abs() < 1e-6);
        assert!((f64::from(point.displacement.0) / truth.load - 1.0).abs() < 1e-5);
    }
}
