//! Effects that bend the line fitted to a train of ramps, and the error that they cause in the
//! slope. The ramps are simulated in `f64`.

use crate::common::rng::Rng;
use palpate_model::ramp::{
    Basis, Bend, Fit, Noise, Ramp, RampSample, Reference, SLOPE_BY_BEND, Term,
};
use palpate_model::units::{Metre, Second};

const X_REF_M: f64 = 0.3e-3;
const KAPPA: f64 = 1.0;
const RATIO: f64 = 1.5;
/// Relative rise of c_D at the peak of the current.
const RISE: f64 = 0.1;
const FALL_S: f64 = 0.06;

/// Stiffening relative to that at the peak. The first argument is the elapsed fraction of the fall,
/// the second one the parameter of the effect.
type Stiffening = fn(f64, f64) -> f64;

/// The calibrated stiffening (1 - s)^2 for a current that falls in a straight line; s is the
/// elapsed fraction of the fall.
fn quadratic(part: f64) -> f64 {
    (1.0 - part).powi(2)
}

/// The stiffening y with a first-order lag of `lag` times the duration of a fall, settled at the
/// peak: y = u - lag y' solved in closed form, with the quadratic stiffening u.
fn lagging(part: f64, lag: f64) -> f64 {
    let particular = |s: f64| (1.0 - s).powi(2) + 2.0 * lag * (1.0 - s) + 2.0 * lag * lag;
    particular(part) + (1.0 - particular(0.0)) * (-part / lag).exp()
}

/// The stiffening whose fraction `play` passes through a play of a quarter to either side, as in
/// the simulated plant.
fn with_play(part: f64, play: f64) -> f64 {
    let u = quadratic(part);
    (1.0 - play) * u + play * (u + 0.25).min(0.75) / 0.75
}

/// The stiffening with saturation: half of it is reached at 1/sqrt(`square`) of the peak's field.
fn saturating(part: f64, square: f64) -> f64 {
    let u = quadratic(part);
    u * (1.0 + square) / (1.0 + square * u)
}

fn rho_to_h(stiffening: f64) -> f64 {
    let rise = RISE * stiffening;
    -RATIO * rise / (1.0 + rise)
}

/// Fits a straight and a bent line to twelve falls of 60 readings with uniform noise of `noise_m`;
/// also returns the span of the regressor.
fn fits(acts: Stiffening, size: f64, noise_m: f64) -> (Fit, Fit, f32) {
    let whole = 1.0 + KAPPA + RATIO;
    let reference = Reference::new(Metre(X_REF_M as f32), RATIO as f32).unwrap();
    let basis = Basis::new(&[Term::Level, Term::Slope, Term::Quadratic]).unwrap();
    let mut ramp = Ramp::new(reference, basis);
    let mut rng = Rng::new(1);
    for reading in 0..720_u32 {
        let part = (f64::from(reading % 60) + 0.5) / 60.0;
        let noise = rng.between(-noise_m, noise_m);
        let x = X_REF_M * (whole + rho_to_h(1.0)) / (whole + rho_to_h(acts(part, size))) + noise;
        ramp.push(&RampSample {
            time: Second((f64::from(reading) * FALL_S / 60.0) as f32),
            deformation: Metre((x - X_REF_M) as f32),
            regressor: rho_to_h(quadratic(part)) as f32,
            sigma: Metre(60e-9),
        })
        .unwrap();
    }
    let straight = ramp.fit_first(2, Noise::Larger).unwrap().unwrap();
    let bent = ramp.fit(Noise::Larger).unwrap();
    let span = (rho_to_h(0.0) - rho_to_h(1.0)) as f32;
    (straight, bent, span)
}

/// Bend of the line, and relative error of the slope.
fn bend_and_error(acts: Stiffening, size: f64, noise_m: f64) -> (Bend, f64) {
    let (straight, bent, span) = fits(acts, size, noise_m);
    let whole = f64::from(straight.load_ratio().unwrap().value) + 1.0 + RATIO;
    let error = (1.0 + KAPPA + RATIO) / whole - 1.0;
    (Bend::of(&straight, &bent, span).unwrap(), error)
}

#[test]
fn a_line_that_is_straight_has_no_bend_and_no_further_uncertainty() {
    let (bend, error) = bend_and_error(|part, _| quadratic(part), 0.0, 100e-9);
    assert!(error.abs() < 5e-3, "{error:e}");
    let b = bend.relative;
    assert!(b.value.abs() < 3.0 * b.standard_error, "{b:?}");
    assert_eq!(bend.significant_uncertainty(3.5, 1.0), 0.0);
    // A bend of up to one standard error adds no uncertainty; a larger one adds at most its own
    // size, which is below three standard errors here.
    let most = SLOPE_BY_BEND * 3.5 * 3.0 * b.standard_error;
    assert!(bend.uncertainty(3.5, 1.0) < most);
}

#[test]
fn what_is_left_out_bends_the_line_by_as_much_as_is_said() {
    let lags = [0.5, 1.0, 2.0, 5.0, 10.0].map(|ms| (lagging as Stiffening, ms * 1e-3 / FALL_S));
    let plays = [0.01, 0.03, 0.1, 0.3].map(|share| (with_play as Stiffening, share));
    let saturations = [0.01, 0.1, 1.0].map(|square| (saturating as Stiffening, square));
    for (acts, size) in lags.into_iter().chain(plays).chain(saturations) {
        let (bend, error) = bend_and_error(acts, size, 0.0);
        let ratio = error.abs() / f64::from(bend.relative.value.abs());
        println!(
            "{size:.4}: error {error:+.4}, bend {:+.4}, {ratio:.2}",
            bend.relative.value
        );
        assert!(ratio <= 0.71, "{size}: {ratio}");
        assert!(ratio < 2.0 * f64::from(SLOPE_BY_BEND), "{size}: {ratio}");
    }
}

#[test]
fn the_uncertainty_grows_with_the_bend_and_shrinks_with_the_noise() {
    let (bend, _) = bend_and_error(lagging, 5e-3 / FALL_S, 0.0);
    let alone = bend.uncertainty(3.5, 1.0);
    let expected = SLOPE_BY_BEND * 3.5 * bend.relative.value.abs();
    assert!((alone / expected - 1.0).abs() < 0.1, "{alone} {expected}");
    // If the results of single ramps scatter by much more than their own errors, the bend may be
    // due to chance.
    assert!(bend.uncertainty(3.5, 10.0) < alone);
    assert_eq!(bend.uncertainty(3.5, 1e4), 0.0);
    // The uncertainty for a refusal is smaller: it equals the other uncertainty at three times the
    // noise.
    assert!(bend.significant_uncertainty(3.5, 10.0) < bend.uncertainty(3.5, 10.0));
    assert_eq!(
        bend.significant_uncertainty(3.5, 10.0),
        bend.uncertainty(3.5, 30.0)
    );
}

#[test]
fn without_a_bent_line_there_is_no_bend() {
    let (straight, bent, span) = fits(|part, _| quadratic(part), 0.0, 0.0);
    assert!(Bend::of(&straight, &straight, span).is_none());
    assert!(Bend::of(&straight, &bent, f32::NAN).is_none());
}
