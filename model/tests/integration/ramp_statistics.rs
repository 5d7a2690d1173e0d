//! Errors of many simulated ramps: scatter, mean and coverage of the stated intervals.

use std::ops::Range;

use crate::common::plant::{Ramps, Stack, fit, record};
use crate::common::rng::Rng;
use palpate_model::ramp::{Basis, DriftModel, LoadRatio, Noise, RampRefusal};
use palpate_model::units::{NewtonPerMetre, Second};

/// Statistics of the estimates of one load.
#[derive(Debug, Default)]
struct Errors {
    sum: f64,
    squares: f64,
    covered: f64,
    /// Intervals of the stiffness without an upper end.
    open: u32,
    refused: u32,
}

/// A load on simulated ramps.
struct World {
    stack: Stack,
    ramps: Ramps,
    noise: f64,
    drift: fn(f64) -> f64,
    basis: Basis,
}

impl World {
    fn without_drift(stack: Stack, ramps: Ramps, noise: f64) -> Self {
        Self {
            stack,
            ramps,
            noise,
            drift: |_| 0.0,
            basis: Basis::LINEAR,
        }
    }

    fn ratio(&self, seed: u64, noise: Noise) -> Result<LoadRatio, RampRefusal> {
        let mut rng = Rng::new(seed);
        let recording = record(&self.stack, &self.ramps, self.noise, self.drift, &mut rng);
        fit(&recording, self.basis, noise)?.load_ratio()
    }

    /// Errors of c_L relative to its true value, over ramps with these seeds.
    fn errors(&self, seeds: Range<u64>, noise: Noise) -> Errors {
        let sensing = NewtonPerMetre(self.stack.sensing as f32);
        let truth = self.stack.load.tangent(0.0);
        let count = (seeds.end - seeds.start) as f64;
        let mut errors = Errors::default();
        for seed in seeds {
            let ratio = self.ratio(seed, noise);
            let Ok(load) = ratio.and_then(|ratio| ratio.stiffness(sensing)) else {
                errors.refused += 1;
                continue;
            };
            let within = load.contains(NewtonPerMetre(truth as f32));
            errors.covered += f64::from(u8::from(within)) / count;
            let Some(value) = load.value() else {
                errors.open += 1;
                continue;
            };
            let error = f64::from(value.0) / truth - 1.0;
            errors.sum += error / count;
            errors.squares += error * error / count;
        }
        errors
    }
}

/// The published cases: 400 readings, a stiffening of 3 %, noise of 1e-4 of x and three equal
/// springs. The bounds are those of Cramer and Rao for c_L's standard error, relative to c_L, from
/// numerical derivatives of the plant in `f64`; published as 0.51, 2.1 and 0.51 %.
fn published() -> [(&'static str, f64, World); 3] {
    let stack = Stack::equal(1.0, 0.03);
    let tau = Second(0.05);
    let [linear, creep] = [DriftModel::Linear, DriftModel::Logarithmic { tau }]
        .map(|drift| Basis::with_drift(drift).unwrap());
    let plain = |ramps| World::without_drift(stack, ramps, 1e-4);
    [
        ("no drift term", 0.00510, plain(Ramps::ONE)),
        (
            "linear drift",
            0.02051,
            World {
                drift: |t| -0.01 * t,
                basis: linear,
                ..plain(Ramps::ONE)
            },
        ),
        (
            "creep, eight ramps",
            0.00507,
            World {
                drift: |t| 0.0033 * (1.0 + t / 0.05).ln(),
                basis: creep,
                ..plain(Ramps::EIGHT)
            },
        ),
    ]
}

/// By chance alone, RMSE/bound scatters by 0.016, the mean by 0.022 and the coverage by 0.005 (one
/// standard deviation). An error that is below the bound by more than chance would mean that the
/// bound or the noise is wrong.
#[test]
fn efficient_unbiased_and_covering() {
    for (name, bound, world) in published() {
        for (first, noise) in [
            (1, Noise::Residual),
            (100_001, Noise::Stated),
            (7_000_001, Noise::Larger),
        ] {
            let errors = world.errors(first..first + 2000, noise);
            let (rms, mean) = (errors.squares.sqrt() / bound, errors.sum / bound);
            let cover = errors.covered;
            println!(
                "{name:18} {noise:?}: RMSE/bound {rms:.4} mean {mean:+.4} coverage {cover:.4}"
            );
            assert_eq!((errors.refused, errors.open), (0, 0), "{name}");
            assert!((0.95..=1.05).contains(&rms), "{name}: RMSE/bound {rms}");
            assert!(mean.abs() <= 0.1, "{name}: mean {mean}");
            assert!((0.935..=0.965).contains(&cover), "{name}: coverage {cover}");
        }
    }
}

#[test]
fn intervals_cover_where_the_ratio_is_far_from_normal() {
    // A stiff load with a tenth of the stiffening: kappa = 0.2 with a standard error of 0.37.
    let stiff = World::without_drift(Stack::equal(5.0, 0.003), Ramps::ONE, 1e-3);
    let errors = stiff.errors(0..4000, Noise::Residual);
    println!("stiff: {errors:?}");
    assert!((errors.covered - 0.95).abs() < 0.015);
    assert!(errors.open > 2000 && errors.refused < 40);
    // A soft load whose slope is only six standard errors: Fieller's interval is far from
    // symmetric.
    let soft = World::without_drift(Stack::equal(0.2, 0.003), Ramps::ONE, 5e-4);
    let errors = soft.errors(0..4000, Noise::Residual);
    println!("soft: {errors:?}");
    assert!((errors.covered - 0.95).abs() < 0.015 && errors.refused < 20);
}

#[test]
fn intervals_from_five_samples_use_student() {
    let few = Ramps {
        samples: 5,
        teeth: 1,
        duration: 1.0,
    };
    let world = World::without_drift(Stack::equal(1.0, 0.3), few, 1e-4);
    let covered = world.errors(0..8000, Noise::Residual).covered;
    println!("five samples: coverage {covered:.4}");
    // With the normal quantile the coverage would be 85 %.
    assert!((covered - 0.95).abs() < 0.01);
}
