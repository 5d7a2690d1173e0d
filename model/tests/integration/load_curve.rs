//! Non-linear loads: load curve and tangent stiffness along the ramp against the truth.

use crate::common::efficiency::fit;
use crate::common::plant::{LoadLaw, Ramps, Recording, Stack, record};
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

fn cubic() -> Basis {
    Basis::new(&[Term::Level, Term::Slope, Term::Quadratic, Term::Cubic]).unwrap()
}

fn quadratic_with_creep() -> Basis {
    let creep = DriftModel::Logarithmic { tau: Second(0.05) };
    Basis::new(&[
        Term::Level,
        Term::Slope,
        Term::Quadratic,
        Term::Drift(creep),
    ])
    .unwrap()
}

/// Largest deviations from the truth along the ramp, in standard errors: of the force and the
/// absolute curve, of the curve from the ramp alone, and of the tangent.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    force: f64,
    absolute: f64,
    relative: f64,
    tangent: f64,
}

fn along_the_ramp(stack: &Stack, fitted: &Fit) -> Worst {
    let mut worst = Worst::default();
    let rest = stack.at(0.0);
    for i in 0..=40 {
        let current = f64::from(i) / 40.0;
        let truth = stack.at(current);
        let h = stack.regressor(current) as f32;
        let point = fitted.load_point_within(h, SENSING, Metre(stack.total as f32));
        // Distance of the point (x_L, F) from the true curve, along F. The errors of both are
        // correlated, since they come from one deformation: x_L decreases by as much as F
        // increases.
        let off = |x: f64, f: f64| f - stack.load.force(x);
        let tangent = stack.load.tangent(truth.load);
        let sigma =
            f64::from(point.force_sigma.0) + tangent * f64::from(point.displacement_sigma.0);
        let distance = off(point.displacement.0.into(), point.force.0.into());
        worst.absolute = worst.absolute.max(distance.abs() / sigma);
        let error = f64::from(point.force.0) - truth.force;
        worst.force = worst
            .force
            .max(error.abs() / f64::from(point.force_sigma.0));
        let moved = fitted.load_point(h, SENSING);
        assert_eq!(
            (moved.force, moved.force_sigma),
            (point.force, point.force_sigma)
        );
        if i > 0 {
            let error = f64::from(moved.displacement.0) - (truth.load - rest.load);
            worst.relative = worst
                .relative
                .max(error.abs() / f64::from(moved.displacement_sigma.0));
        }
        let ratio = fitted.load_ratio_at(h).unwrap();
        let error = f64::from(ratio.value) - stack.sensing / tangent;
        worst.tangent = worst
            .tangent
            .max(error.abs() / f64::from(ratio.standard_error));
    }
    worst
}

/// Fraction of `ramps` simulated ramps in which the whole curve is within three standard errors.
fn share_within(
    ramps: u64,
    basis: Basis,
    recording: impl Fn(u64) -> (Stack, Recording),
) -> [f64; 4] {
    let mut within = [0.0; 4];
    for seed in 1..=ramps {
        let (stack, recording) = recording(seed);
        let worst = along_the_ramp(&stack, &fit(&recording, basis, Noise::Stated).unwrap());
        let all = [worst.force, worst.absolute, worst.relative, worst.tangent];
        for (within, worst) in within.iter_mut().zip(all) {
            *within += f64::from(u8::from(worst <= 3.0)) / ramps as f64;
        }
    }
    println!(
        "within 3 s.e. all along: force {:.3}, F(x_L) {:.3}, from rest {:.3}, tangent {:.3}",
        within[0], within[1], within[2], within[3]
    );
    within
}

#[test]
fn a_hardening_spring_s_curve_is_within_three_standard_errors() {
    for (eps, noise) in [(0.03, 1e-4), (0.10, 2e-5), (0.10, 1e-4), (0.5, 1e-4)] {
        println!("eps {eps}, noise {noise:e}");
        let within = share_within(400, cubic(), |seed| {
            let stack = hardening(eps);
            let recording = record(&stack, &Ramps::EIGHT, noise, |_| 0.0, &mut Rng::new(seed));
            (stack, recording)
        });
        // A cubic curve has four independent errors; by chance one of them exceeds three standard
        // errors in one ramp of a hundred.
        assert!(within.iter().all(|&share| share >= 0.97), "{within:?}");
    }
}

#[test]
fn and_under_creep() {
    let within = share_within(400, quadratic_with_creep(), |seed| {
        let stack = hardening(0.10);
        let creep = |t: f64| 0.003 * (1.0 + t / 0.05).ln();
        let recording = record(&stack, &Ramps::EIGHT, 1e-4, creep, &mut Rng::new(seed));
        (stack, recording)
    });
    assert!(within.iter().all(|&share| share >= 0.97), "{within:?}");
}

#[test]
fn its_errors_are_as_large_as_stated_and_no_larger() {
    // Root mean square of the errors at the peak of the ramp, in standard errors.
    let stack = hardening(0.10);
    let (truth, rest) = (stack.at(1.0), stack.at(0.0));
    let h = stack.regressor(1.0) as f32;
    let mut squares = [0.0f64; 3];
    const RAMPS: u64 = 1000;
    for seed in 0..RAMPS {
        let recording = record(&stack, &Ramps::EIGHT, 1e-4, |_| 0.0, &mut Rng::new(seed));
        let fitted = fit(&recording, cubic(), Noise::Stated).unwrap();
        let point = fitted.load_point(h, SENSING);
        let ratio = fitted.load_ratio_at(h).unwrap();
        let errors = [
            (f64::from(point.force.0) - truth.force) / f64::from(point.force_sigma.0),
            (f64::from(point.displacement.0) - (truth.load - rest.load))
                / f64::from(point.displacement_sigma.0),
            (f64::from(ratio.value) - stack.sensing / stack.load.tangent(truth.load))
                / f64::from(ratio.standard_error),
        ];
        for (squares, error) in squares.iter_mut().zip(errors) {
            *squares += error * error / RAMPS as f64;
        }
    }
    println!("rms in s.e.: {:?}", squares.map(f64::sqrt));
    // The fraction scatters by chance by 2 % (one standard deviation).
    assert!(
        squares.iter().all(|s| (s.sqrt() - 1.0).abs() < 0.08),
        "{squares:?}"
    );
}

#[test]
fn a_straight_line_would_miss_it() {
    // The curvature is needed: without it the curve is off by many standard errors.
    let stack = hardening(0.5);
    let recording = record(&stack, &Ramps::EIGHT, 2e-5, |_| 0.0, &mut Rng::new(1));
    let straight = fit(&recording, Basis::LINEAR, Noise::Stated).unwrap();
    let worst = along_the_ramp(&stack, &straight);
    assert!(worst.force > 10.0 && worst.tangent > 10.0, "{worst:?}");
    assert!(straight.reduced_chi_square().unwrap() > 1.5);
}

#[test]
fn a_linear_load_s_curve_is_a_line_through_the_origin() {
    let stack = Stack::equal(0.5, 0.1);
    let recording = record(&stack, &Ramps::EIGHT, 1e-8, |_| 0.0, &mut Rng::new(1));
    let fitted = fit(&recording, Basis::LINEAR, Noise::Larger).unwrap();
    for i in 0..=10 {
        let current = f64::from(i) / 10.0;
        let (truth, rest) = (stack.at(current), stack.at(0.0));
        let h = stack.regressor(current) as f32;
        let point = fitted.load_point_within(h, SENSING, fitted.total_displacement());
        assert!((f64::from(point.force.0) / truth.force - 1.0).abs() < 1e-6);
        assert!((f64::from(point.displacement.0) / truth.load - 1.0).abs() < 1e-5);
        let moved = f64::from(fitted.load_point(h, SENSING).displacement.0);
        let exact = truth.load - rest.load;
        assert!(
            (moved - exact).abs() <= 1e-5 * exact.abs() + 1e-12,
            "{moved:e} {exact:e}"
        );
    }
}

#[test]
fn every_sample_is_a_point_of_the_curve() {
    let stack = hardening(0.1);
    let recording = record(&stack, &Ramps::EIGHT, 1e-4, |_| 0.0, &mut Rng::new(3));
    let rest = stack.at(0.0);
    let (mut squares, mut count) = (0.0, 0.0);
    for (i, sample) in recording.samples.iter().enumerate() {
        let truth = stack.at(Ramps::EIGHT.current(i));
        let point = sample.load_point(&recording.reference, SENSING);
        let force = (f64::from(point.force.0) - truth.force) / f64::from(point.force_sigma.0);
        let moved = f64::from(point.displacement.0) - (truth.load - rest.load);
        let displacement = moved / f64::from(point.displacement_sigma.0);
        // The error of one deformation affects force and displacement, with opposite signs.
        assert!(
            (force + displacement).abs() < 0.02,
            "{force} {displacement}"
        );
        squares += force * force;
        count += 1.0;
    }
    assert!(
        (squares / count - 1.0f64).abs() < 0.2,
        "{}",
        squares / count
    );
}
