//! Cost of one reading: `cargo bench -p palpate-model`.

use divan::{Bencher, black_box};
use palpate_model::calibration_curve::MonotoneCurve;
use palpate_model::contact::{Detector, Watch};
use palpate_model::magnetorheological::{Saturating, Stiffening};
use palpate_model::ramp::{Basis, DriftModel, Noise, Ramp, RampSample, Reference, Term};
use palpate_model::units::{Ampere, Metre, NewtonPerMetre, Second};

#[path = "../tests/integration/common/pipeline.rs"]
#[allow(dead_code, unreachable_pub)]
mod pipeline;

fn main() {
    divan::main();
}

const CREEP: DriftModel = DriftModel::Logarithmic { tau: Second(0.05) };

/// Samples of a ramp; their values do not change the cost.
fn samples() -> Vec<RampSample> {
    let sample = |i: usize| {
        let h = -0.1 * (1.0 - i as f32 / 400.0);
        RampSample {
            time: Second(i as f32 * 2e-3),
            deformation: Metre(-3e-4 * h / (3.0 + h)),
            regressor: h,
            sigma: Metre(3e-8),
        }
    };
    (0..400).map(sample).collect()
}

fn ramp(basis: Basis) -> Ramp {
    Ramp::new(Reference::new(Metre(3e-4), 1.0).unwrap(), basis)
}

fn push(bencher: Bencher<'_, '_>, basis: Basis) {
    let samples = samples();
    bencher
        .counter(divan::counter::ItemsCount::new(samples.len()))
        .bench_local(|| {
            let mut ramp = ramp(basis);
            for sample in black_box(&samples) {
                let _ = ramp.push(sample);
            }
            ramp
        });
}

fn fit(bencher: Bencher<'_, '_>, basis: Basis) {
    let mut ramp = ramp(basis);
    samples()
        .iter()
        .for_each(|sample| ramp.push(sample).unwrap());
    bencher.bench_local(|| {
        black_box(&ramp)
            .fit(Noise::Larger)
            .and_then(|fit| fit.load_ratio())
    });
}

/// Each iteration pushes 400 samples; divan prints the rate of samples.
mod push_400_samples {
    use super::*;

    #[divan::bench]
    fn linear(bencher: Bencher<'_, '_>) {
        push(bencher, Basis::LINEAR);
    }

    #[divan::bench]
    fn linear_drift(bencher: Bencher<'_, '_>) {
        push(bencher, Basis::with_drift(DriftModel::Linear).unwrap());
    }

    #[divan::bench]
    fn creep(bencher: Bencher<'_, '_>) {
        push(bencher, Basis::with_drift(CREEP).unwrap());
    }

    #[divan::bench]
    fn quadratic_and_two_drifts(bencher: Bencher<'_, '_>) {
        let drifts = [Term::Drift(DriftModel::Linear), Term::Drift(CREEP)];
        let [a, b] = drifts;
        push(
            bencher,
            Basis::new(&[Term::Level, Term::Slope, Term::Quadratic, a, b]).unwrap(),
        );
    }
}

mod solve {
    use super::*;

    #[divan::bench]
    fn linear(bencher: Bencher<'_, '_>) {
        fit(bencher, Basis::LINEAR);
    }

    #[divan::bench]
    fn creep(bencher: Bencher<'_, '_>) {
        fit(bencher, Basis::with_drift(CREEP).unwrap());
    }
}

mod one_reading {
    use super::*;

    #[divan::bench]
    fn regressor(bencher: Bencher<'_, '_>) {
        let law = Saturating::new(NewtonPerMetre(4e3), 0.1, Ampere(10.0)).unwrap();
        bencher.bench_local(|| law.regressor(NewtonPerMetre(6e3), black_box(Ampere(4.0))));
    }

    #[divan::bench]
    fn calibration_curve(bencher: Bencher<'_, '_>) {
        let points: Vec<(f32, f32)> = (0..16).map(|i| (i as f32, (i * i + i) as f32)).collect();
        let curve = MonotoneCurve::<16>::new(&points).unwrap();
        bencher.bench_local(|| curve.at(black_box(7.3)));
    }

    #[divan::bench]
    fn contact(bencher: Bencher<'_, '_>) {
        let mut detector = Detector::new(Watch::new(Metre(1e-8))).unwrap();
        bencher.bench_local(|| detector.push(Second(1e-3), black_box(Metre(1e-9))));
    }
}

/// A scan of seven coils.
mod touch {
    use palpate_model::touch::Indenter;

    use super::*;

    #[divan::bench]
    fn without_a_press_before(bencher: Bencher<'_, '_>) {
        let array = pipeline::array(1.0).unwrap();
        bencher
            .bench_local(|| array.estimate(black_box(&pipeline::READ), &Indenter::Unknown, None));
    }

    #[divan::bench]
    fn with_the_press_before(bencher: Bencher<'_, '_>) {
        let array = pipeline::array(1.0).unwrap();
        let estimate = |last| array.estimate(black_box(&pipeline::READ), &Indenter::Unknown, last);
        let last = *estimate(None).claimed().unwrap();
        bencher.bench_local(|| estimate(Some(&last)));
    }
}
