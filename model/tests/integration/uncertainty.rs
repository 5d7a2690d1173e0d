//! The calibration's part of the uncertainty: each sensitivity against a ramp that is evaluated
//! with a wrong calibration, in `f64`.

use crate::common::plant::{Ramps, Recording, Stack, record};
use crate::common::reference::reciprocal_line;
use crate::common::rng::Rng;
use palpate_model::ramp::{LoadRatio, RampSample, Reference};
use palpate_model::uncertainty::{Budget, Calibration, OperatingPoint};
use palpate_model::units::Metre;

/// What is taken for known wrongly: fractions, and metres for the zero.
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

/// c_S/c_L, with the true c_S, as the reference estimator finds it under a wrong calibration.
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
    // c_L = c_S/kappa with the wrong c_S, in units of the true one.
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
    // Which budget entry, the wrong calibration, and the sign that the table gives.
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
    // Section 2 of the physics, at three equal springs.
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

#[test]
fn the_widened_interval_adds_in_squares_and_covers() {
    // Normal errors of both kinds: the claim must cover 95 %.
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
        let half = 1.96 * noise;
        let ratio = LoadRatio {
            value: value as f32,
            standard_error: noise as f32,
            low: (value - half) as f32,
            high: (value + half) as f32,
        };
        let claim = calibration.widen(&ratio, &at);
        assert!(claim.low < ratio.low && claim.high > ratio.high);
        covered += u32::from(f64::from(claim.low) <= truth && truth <= f64::from(claim.high));
    }
    let coverage = f64::from(covered) / f64::from(DRAWS);
    println!("coverage {coverage:.4}");
    assert!((coverage - 0.95).abs() < 0.007);
    // Nothing to add, nothing changed.
    let ratio = LoadRatio {
        value: 1.0,
        standard_error: 0.1,
        low: 0.8,
        high: 1.3,
    };
    let same = Calibration::default().widen(&ratio, &at);
    assert!((same.low - 0.8).abs() < 1e-6 && (same.high - 1.3).abs() < 1e-6);
}
