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
fn a_widened_interval_is_the_root_of_the_sum_of_squares() {
    let ratio = LoadRatio {
        value: 1.0,
        standard_error: 0.1,
        low: 0.8,
        high: 1.3,
    };
    let calibration = Calibration {
        stiffening: 0.02,
        zero: Metre(1e-6),
        ..Default::default()
    };
    let further = f64::from(calibration.budget(1.0, &point()).total());
    let root = |half: f64, factor: f64| half.hypot(factor * further);
    let wide = calibration.widen(&ratio, &point());
    let exact = [
        root(0.1, 1.0),
        1.0 - root(0.2, 1.959_964),
        1.0 + root(0.3, 1.959_964),
    ];
    for (ours, exact) in [wide.standard_error, wide.low, wide.high]
        .into_iter()
        .zip(exact)
    {
        assert!((f64::from(ours) - exact).abs() < 1e-6, "{ours} {exact}");
    }
    // With errors that are uniform within limits, both halves change by the coverage factor.
    let uniform = wide.with_uniform_part(0.6 * wide.standard_error);
    let factor = coverage_factor(0.6) / coverage_factor(0.0);
    for (ours, expected) in [
        (uniform.low, 1.0 - (1.0 - wide.low) * factor),
        (uniform.high, 1.0 + (wide.high - 1.0) * factor),
        (uniform.standard_error, wide.standard_error),
    ] {
        assert!((ours - expected).abs() < 1e-6, "{ours} {expected}");
    }
    // Without calibration uncertainty, the ratio does not change.
    let same = Calibration::default().widen(&ratio, &point());
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
