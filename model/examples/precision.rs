//! Shows why the estimator uses wide sums: compares fits with sums of `f32` with the same fit by QR
//! in `f64`: `cargo run --release -p palpate-model --example precision`.

#[path = "../tests/integration/common/mod.rs"]
mod common;

use common::plant::{Ramps, Recording, Stack, fit, record};
use common::reference::{Phi, reciprocal_line};
use common::rng::Rng;
use palpate_model::ramp::{Basis, DriftModel, Noise};
use palpate_model::units::Second;

/// Fits 1/x against g with a drift term and weights x^4/sigma^2, by centred (Welford) sums of
/// `f32`.
fn centred_f32(recording: &Recording, phi: impl Fn(f32) -> f32) -> f32 {
    let x_ref = recording.reference.deformation().0;
    let (mut weight, mut means, mut products) = (0.0f32, [0.0f32; 3], [[0.0f32; 3]; 3]);
    for s in &recording.samples {
        // z = x_ref/x - 1, computed from the deviation of x without loss of digits.
        let relative = s.deformation.0 / x_ref;
        let z = -relative / (1.0 + relative);
        let column = [s.regressor, phi(s.time.0) * (1.0 + z), z];
        let w = (1.0 + relative).powi(4) * (3e-8 / s.sigma.0).powi(2);
        let total = weight + w;
        let deviation: [f32; 3] = std::array::from_fn(|i| column[i] - means[i]);
        for i in 0..3 {
            means[i] += deviation[i] * (w / total);
            for j in 0..3 {
                products[i][j] += deviation[i] * deviation[j] * (w * (weight / total));
            }
        }
        weight = total;
    }
    let [[gg, gd, gz], [_, dd, dz], _] = products;
    let slope = if dd > 0.0 {
        (gz * dd - gd * dz) / (gg * dd - gd * gd)
    } else {
        gz / gg
    };
    let drift = if dd > 0.0 {
        (dz - gd * slope) / dd
    } else {
        0.0
    };
    let level = means[2] - slope * means[0] - drift * means[1];
    (1.0 + level) / slope - 1.0 - recording.reference.regressor()
}

/// Fits 1/x against g without a drift term, by sums of `f32` without centring.
fn plain_f32(recording: &Recording) -> f32 {
    let [mut s, mut sg, mut sy, mut sgg, mut sgy] = [0.0f32; 5];
    for sample in &recording.samples {
        let x = recording.reference.deformation().0 + sample.deformation.0;
        let g = recording.reference.regressor() + sample.regressor;
        let (y, w) = (1e-4 / x, (x / 3e-4).powi(4));
        s += w;
        sg += w * g;
        sy += w * y;
        sgg += w * g * g;
        sgy += w * g * y;
    }
    let slope = (s * sgy - sg * sy) / (s * sgg - sg * sg);
    (sy - slope * sg) / s / slope - 1.0
}

fn main() {
    let creep = |t: f64| (1.0 + t / 0.05).ln();
    let basis = Basis::with_drift(DriftModel::Logarithmic { tau: Second(0.05) }).unwrap();
    println!("relative difference of c_L from QR in f64, same f32 inputs, noise 1e-6, worst of 20");
    println!(
        "{:>6} {:>7} | {:>9} {:>9} {:>9} | {:>9} {:>9}  one ramp with a creep term",
        "c_L/c", "eps", "ours", "centred", "plain", "ours", "centred"
    );
    for ratio in [0.1, 1.0, 10.0] {
        for eps in [0.005, 0.03, 0.5] {
            let mut worst = [0.0f64; 5];
            for seed in 0..20 {
                let mut rng = Rng::new(seed);
                let stack = Stack::equal(ratio, eps);
                let off = |ours: f32, exact: f64| (exact / f64::from(ours) - 1.0).abs();
                let kappa = |recording: &Recording| {
                    fit(recording, Basis::LINEAR, Noise::Stated)
                        .unwrap()
                        .load_ratio()
                        .unwrap()
                        .value
                };
                let quiet = record(&stack, &Ramps::ONE, 1e-6, |_| 0.0, &mut rng);
                let exact = reciprocal_line(&quiet, &[]).kappa;
                let crept = record(&stack, &Ramps::ONE, 1e-6, |t| 0.003 * creep(t), &mut rng);
                let phis: [Phi<'_>; 1] = [&creep];
                let exact_crept = reciprocal_line(&crept, &phis).kappa;
                let ours = fit(&crept, basis, Noise::Stated)
                    .unwrap()
                    .load_ratio()
                    .unwrap()
                    .value;
                let found = [
                    off(kappa(&quiet), exact),
                    off(centred_f32(&quiet, |_| 0.0), exact),
                    off(plain_f32(&quiet), exact),
                    off(ours, exact_crept),
                    off(centred_f32(&crept, |t| (t / 0.05).ln_1p()), exact_crept),
                ];
                for (worst, found) in worst.iter_mut().zip(found) {
                    *worst = worst.max(found);
                }
            }
            let [a, b, c, d, e] = worst;
            println!("{ratio:6} {eps:7} | {a:9.1e} {b:9.1e} {c:9.1e} | {d:9.1e} {e:9.1e}");
        }
    }
}
