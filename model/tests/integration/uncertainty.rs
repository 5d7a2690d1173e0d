//! Contributions of the calibration to the uncertainty: each is compared with a ramp evaluated with
//! a wrong calibration, in `f64`.

use crate::common::plant::{Ramps, Recording, Stack, record};
use crate::common::reference::reciprocal_line;
use crate::common::rng::Rng;
use palpate_model::ramp::{LoadRatio, RampSample, Reference};
use palpate_model::uncertainty::{Budget, Calibration, OperatingPoint, coverage_factor};
use palpate_model::units::Metre;

/// Errors of the calibrated quantities: relative, and in metres for the zero.
#[derive(Clone, Copy, Default)]
struct Wrong {
    sensing: f64,
    actuated: f64,
    stiffening: f64,
    current: f64,
    zero: f64,
}

const RATIO: f64 = 0.7;
const EPS: f64 = 0.10;

/// The ratio c_S/c_L, with the true c_S, that the reference estimator finds with a wrong
/// calibration.
fn kappa(wrong: Wrong) -> f64 {
    let stack = Stack {
        actuated: 4e3,
        ..Stack::equal(RATIO, EPS)
    };
    let truth = record(&stack, &Ramps::ONE, 0.0, |_| 0.0, &mut Rng::new(1));
    let [c_s, c_d] = [
        stack.sensing * (1.0 + wrong.sensing),
        stack.actuated * (1.0 + wrong.actuated),
    ];
    let samples = truth.samples.iter().enumerate().map(|(i, sample)| {
        let current = Ramps::ONE.current(i) * (1.0 + wrong.current);
        let rise = EPS * (1.0 + wrong.stiffening) * current * current;
        let g = c_s / c_d / (1.0 + rise) - c_s / c_d;
        RampSample {
            regressor: g as f32,
            deformation: sample.deformation + Metre(wrong.zero as f32),
            sigma: Metre(1e-8),
            ..*sample
        }
    });
    let samples = samples.collect();
    let g_ref = (c_s / c_d) as f32;
    let reference = Reference::new(truth.reference.deformation(), g_ref).unwrap();
    let found = reciprocal_line(&Recording { reference, samples }, &[]);
    // The wrong c_L is (1 + sensing) c_S/kappa; the ratio returned is the true c_S divided by it.
    found.kappa / (1.0 + wrong.sensing)
}

fn point() -> OperatingPoint {
    let stack = Stack {
        actuated: 4e3,
        ..Stack::equal(RATIO, EPS)
    };
    OperatingPoint {
        actuated_ratio: stack.reference_ratio(),
        rise: EPS as f32,
        logarithmic_slope: 2.0,
        deformation: Metre(stack.at(0.5).sensing as f32),
    }
}

#[test]
fn each_sensitivity_is_that_of_a_wrong_calibration() {
    let e = 1e-3;
    let all = Calibration {
        force_scale: e as f32,
        sensing: e as f32,
        actuated: e as f32,
        stiffening: e as f32,
        current: e as f32,
        zero: Metre(1e-7),
    };
    let Budget {
        force_scale,
        sensing,
        actuated,
        stiffening,
        current,
        zero,
    } = all.budget((1.0 / RATIO) as f32, &point());
    let none = Wrong::default();
    // For each case: entry of the budget, wrong calibration, and sign according to the module's
    // table.
    let cases = [
        ("c_S", sensing, Wrong { sensing: e, ..none }, 1.0),
        (
            "c_D0",
            actuated,
            Wrong {
                actuated: e,
                ..none
            },
            -1.0,
        ),
        (
            "force scale",
            force_scale,
            Wrong {
                sensing: e,
                actuated: e,
                ..none
            },
            -1.0,
        ),
        (
            "stiffening",
            stiffening,
            Wrong {
                stiffening: e,
                ..none
            },
            1.0,
        ),
        ("current", current, Wrong { current: e, ..none }, 1.0),
        ("zero", zero, Wrong { zero: 1e-7, ..none }, 1.0),
    ];
    let right = kappa(none);
    assert!((right * RATIO - 1.0).abs() < 1e-4, "{right}");
    for (name, stated, wrong, sign) in cases {
        let found = (kappa(wrong) - right) * sign;
        println!("{name:12} {found:.6} stated {stated:.6}");
        assert!(
            (found / f64::from(stated) - 1.0).abs() < 0.03,
            "{name}: {found} {stated}"
        );
    }
    let squares = [force_scale, sensing, actuated, stiffening, current, zero];
    let total = squares
        .iter()
        .map(|x| f64::from(*x).powi(2))
        .sum::<f64>()
        .sqrt();
    let budget = all.budget((1.0 / RATIO) as f32, &point());
    assert!((f64::from(budget.total()) / total - 1.0).abs() < 1e-6);
}

#[test]
fn five_percent_of_eps_is_thirteen_percent_of_the_stiffness() {
    // The case of section 2 of the physics, with three equal springs.
    let at = OperatingPoint {
        actuated_ratio: 1.0,
        rise: 0.0,
        ..point()
    };
    let calibration = Calibration {
        stiffening: 0.05,
        ..Calibration::default()
    };
    let up = calibration.budget(1.0, &at).total();
    assert!((1.0 - 1.0 / (1.0 + up) - 0.13).abs() < 0.002);
}

/// A ratio whose uncertainty comes from noise only.
fn of_noise(value: f64, noise: f64) -> LoadRatio {
    let half = 1.96 * noise;
    LoadRatio {
        value: value as f32,
        standard_error: noise as f32,
        low: (value - half) as f32,
        high: (value + half) as f32,
    }
}

#[test]
fn the_widened_interval_adds_in_squares_and_covers() {
    // Both noise and calibration have normal errors: the widened interval must cover 95 %.
    let calibration = Calibration {
        stiffening: 0.02,
        zero: Metre(1e-6),
        ..Default::default()
    };
    let at = point();
    let mut rng = Rng::new(11);
    let (truth, noise, mut covered) = (1.2, 0.03, 0);
    let systematic = f64::from(calibration.budget(truth as f32, &at).total());
    const DRAWS: u32 = 20_000;
    for _ in 0..DRAWS {
        let value = truth + noise * rng.normal() + systematic * rng.normal();
        let ratio = of_noise(value, noise);
        let claim = calibration.widen(&ratio, &at);
        assert!(claim.low < ratio.low && claim.high > ratio.high);
        covered += u32::from(f64::from(claim.low) <= truth && truth <= f64::from(claim.high));
    }
    let coverage = f64::from(covered) / f64::from(DRAWS);
    println!("coverage {coverage:.4}");
    assert!((coverage - 0.95).abs() < 0.007);
    // Without calibration uncertainty, the ratio does not change.
    let ratio = LoadRatio {
        value: 1.0,
        standard_error: 0.1,
        low: 0.8,
        high: 1.3,
    };
    let same = Calibration::default().widen(&ratio, &at);
    assert!((same.low - 0.8).abs() < 1e-6 && (same.high - 1.3).abs() < 1e-6);
}

/// Fraction of the errors that are within `factor` standard errors. `uniform` is the standard
/// deviation of the uniform errors divided by the standard error; all other errors are normal. The
/// uniform errors are integrated in closed form, the normal density by Simpson's rule.
fn within(factor: f64, uniform: f64) -> f64 {
    const STEPS: i32 = 400;
    let simpson = |from: f64, to: f64, of: &dyn Fn(f64) -> f64| {
        let step = (to - from) / f64::from(STEPS);
        let weights = (0..=STEPS).map(|index| match index {
            0 | STEPS => 1.0,
            odd if odd % 2 == 1 => 4.0,
            _ => 2.0,
        });
        let points = (0..=STEPS).map(|index| of(from + f64::from(index) * step));
        points
            .zip(weights)
            .map(|(value, weight)| value * weight)
            .sum::<f64>()
            * step
            / 3.0
    };
    let limit = uniform * 3_f64.sqrt();
    let normal = (1.0 - uniform * uniform).sqrt();
    let density = |z: f64| (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
    // For each normal error, the fraction of the uniform errors that keep the sum within the limit.
    let of_uniform = |z: f64| {
        let low = (-factor - z * normal).max(-limit);
        let high = (factor - z * normal).min(limit);
        density(z) * ((high - low) / (2.0 * limit)).max(0.0)
    };
    simpson(-9.0, 9.0, &of_uniform)
}

#[test]
fn the_coverage_factor_is_the_quantile_of_normal_and_uniform_errors_together() {
    for percent in (5..=95).step_by(5) {
        let uniform = f64::from(percent) / 100.0;
        let (mut low, mut high) = (1.6, 2.0);
        while high - low > 1e-6 {
            let middle = 0.5 * (low + high);
            if within(middle, uniform) < 0.95 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let found = f64::from(coverage_factor(uniform as f32));
        println!("{uniform}: {found:.4} {low:.4}");
        assert!((found - low).abs() < 0.002, "{uniform}: {found} {low}");
    }
    assert!((coverage_factor(1.0) - 0.95 * 3_f32.sqrt()).abs() < 0.002);
    assert_eq!(coverage_factor(2.0), coverage_factor(1.0));
}

#[test]
fn an_interval_of_errors_within_limits_covers_and_no_more() {
    let mut rng = Rng::new(12);
    let (truth, noise, limit) = (1.2, 0.03, 0.15);
    let uniform = limit / 3_f64.sqrt();
    const DRAWS: u32 = 20_000;
    let mut covered = [0_u32; 2];
    for _ in 0..DRAWS {
        let value = truth + noise * rng.normal() + limit * (2.0 * rng.uniform() - 1.0);
        let ratio = of_noise(value, noise);
        let all_normal = ratio.with_uncertainty(uniform as f32);
        let claims = [all_normal, all_normal.with_uniform_part(uniform as f32)];
        for (covered, claim) in covered.iter_mut().zip(claims) {
            *covered += u32::from(f64::from(claim.low) <= truth && truth <= f64::from(claim.high));
        }
    }
    let [all_normal, within_limits] = covered.map(|covered| f64::from(covered) / f64::from(DRAWS));
    println!("{all_normal:.4} {within_limits:.4}");
    assert!(all_normal > 0.97, "{all_normal}");
    assert!((within_limits - 0.95).abs() < 0.007, "{within_limits}");
}
