//! Refusals of the estimator, with their reasons.

use crate::common::plant::{Ramps, Stack, record};
use crate::common::rng::Rng;
use palpate_model::ramp::{
    Basis, BasisError, DriftModel, Noise, Ramp, RampRefusal, RampSample, Reference, Rejected, Term,
};
use palpate_model::units::{Metre, NewtonPerMetre, Second};

fn reference() -> Reference {
    Reference::new(Metre(3e-4), 1.0).unwrap()
}

fn sample(deformation: f32, regressor: f32) -> RampSample {
    RampSample {
        time: Second(0.0),
        deformation: Metre(deformation),
        regressor,
        sigma: Metre(3e-8),
    }
}

#[test]
fn too_few() {
    let mut ramp = Ramp::new(reference(), Basis::LINEAR);
    let refusal = |ramp: &Ramp, noise| ramp.fit(noise).err();
    assert_eq!(
        refusal(&ramp, Noise::Stated),
        Some(RampRefusal::TooFewSamples { have: 0, need: 2 })
    );
    ramp.push(&sample(0.0, 0.0)).unwrap();
    assert_eq!(
        refusal(&ramp, Noise::Larger),
        Some(RampRefusal::TooFewSamples { have: 1, need: 2 })
    );
    ramp.push(&sample(1e-5, -0.1)).unwrap();
    assert_eq!(
        refusal(&ramp, Noise::Residual),
        Some(RampRefusal::TooFewSamples { have: 2, need: 3 })
    );
    assert_eq!(refusal(&ramp, Noise::Larger), None);
    assert_eq!(ramp.fit(Noise::Stated).unwrap().reduced_chi_square(), None);
}

#[test]
fn a_constant_current_and_a_drift_like_the_signal() {
    let mut ramp = Ramp::new(reference(), Basis::LINEAR);
    for i in 0..100 {
        ramp.push(&sample(i as f32 * 1e-8, -0.1)).unwrap();
    }
    assert_eq!(
        ramp.fit(Noise::Stated).err(),
        Some(RampRefusal::IllConditioned { term: 1 })
    );

    // A regressor that changes only in its last digit counts as constant.
    let mut ramp = Ramp::new(reference(), Basis::LINEAR);
    for i in 0..100 {
        let last_digit = f32::from_bits(0.1f32.to_bits() + i % 2);
        ramp.push(&sample(i as f32 * 1e-8, -last_digit)).unwrap();
    }
    assert_eq!(
        ramp.fit(Noise::Stated).err(),
        Some(RampRefusal::IllConditioned { term: 1 })
    );

    // If c_D is linear in time, a linear drift cannot be distinguished from it.
    let mut ramp = Ramp::new(reference(), Basis::with_drift(DriftModel::Linear).unwrap());
    for i in 0..100 {
        let h = -0.1 * (1.0 - i as f32 / 99.0);
        let x = 9e-4 / (3.0 + h);
        // The column of the drift is phi/x, so here phi/x must be linear in h.
        let time = Second(h * x / 3e-4);
        ramp.push(&RampSample {
            time,
            ..sample(x - 3e-4, h)
        })
        .unwrap();
    }
    let refusal = ramp.fit(Noise::Stated).err();
    assert!(
        matches!(refusal, Some(RampRefusal::IllConditioned { .. })),
        "{refusal:?}"
    );
}

#[test]
fn no_signal_a_reversed_one_and_a_negative_spring() {
    let stack = Stack::equal(1.0, 0.1);
    let load = |noise: f64, change: fn(&RampSample) -> RampSample| {
        let recording = record(&stack, &Ramps::ONE, noise, |_| 0.0, &mut Rng::new(4));
        let mut ramp = Ramp::new(recording.reference, Basis::LINEAR);
        recording
            .samples
            .iter()
            .for_each(|s| ramp.push(&change(s)).unwrap());
        ramp.fit(Noise::Stated).unwrap().load_ratio()
    };
    let small = load(0.2, |s| *s);
    assert!(
        matches!(small, Err(RampRefusal::SignalTooSmall { significance }) if significance < 2.0)
    );
    let reversed = load(1e-4, |s| RampSample {
        deformation: -s.deformation,
        ..*s
    });
    assert!(
        matches!(reversed, Err(RampRefusal::SignalReversed { significance }) if significance < -50.0)
    );
    // One and a half times the largest signal that three springs can give: kappa becomes negative.
    let strong = load(1e-4, |s| RampSample {
        deformation: s.deformation * 1.6,
        ..*s
    })
    .unwrap();
    assert!(strong.value < 0.0 && strong.high < 0.0);
    let refused = strong.stiffness(NewtonPerMetre(6e3));
    assert_eq!(
        refused,
        Err(RampRefusal::NegativeStiffness {
            highest_load_ratio: strong.high
        })
    );
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("negative stiffness")
    );
}

/// A change that makes a sample senseless, and why it is rejected.
type Case = (fn(&mut RampSample), Rejected);

#[test]
fn senseless_samples_leave_the_sums_alone() {
    let mut ramp = Ramp::new(reference(), Basis::with_drift(DriftModel::Linear).unwrap());
    ramp.push(&sample(0.0, 0.0)).unwrap();
    let before = ramp;
    let cases: [Case; 10] = [
        (|s| s.deformation = Metre(f32::NAN), Rejected::NotFinite),
        (
            |s| s.deformation = Metre(f32::INFINITY),
            Rejected::NotFinite,
        ),
        (|s| s.regressor = f32::INFINITY, Rejected::NotFinite),
        (|s| s.time = Second(f32::NAN), Rejected::NotFinite),
        (|s| s.sigma = Metre(f32::INFINITY), Rejected::NotFinite),
        (|s| s.deformation = Metre(-3e-4), Rejected::Unpressed),
        (|s| s.deformation = Metre(-1.0), Rejected::Unpressed),
        (|s| s.deformation = Metre(f32::MAX), Rejected::Sigma),
        (|s| s.sigma = Metre(0.0), Rejected::Sigma),
        (|s| s.sigma = Metre(-3e-8), Rejected::Sigma),
    ];
    for (spoil, why) in cases {
        let mut bad = sample(1e-5, -0.1);
        spoil(&mut bad);
        assert_eq!(ramp.push(&bad), Err(why), "{bad:?}");
        assert_eq!(ramp, before);
    }
    let mut empty = Ramp::new(reference(), Basis::LINEAR);
    let sigma = Metre(0.0);
    let bad = RampSample {
        sigma,
        ..sample(1e-5, -0.1)
    };
    assert_eq!(empty.push(&bad), Err(Rejected::Sigma));
    assert_eq!(empty.samples(), 0);
}

#[test]
fn a_basis_must_make_sense() {
    let creep = |tau| Term::Drift(DriftModel::Logarithmic { tau: Second(tau) });
    let [level, slope] = [Term::Level, Term::Slope];
    assert_eq!(Basis::new(&[level]), Err(BasisError::LevelAndSlopeFirst));
    assert_eq!(
        Basis::new(&[slope, level]),
        Err(BasisError::LevelAndSlopeFirst)
    );
    assert_eq!(
        Basis::new(&[level, slope, level]),
        Err(BasisError::Repeated { index: 2 })
    );
    let twice = Basis::new(&[level, slope, creep(0.1), creep(0.1)]);
    assert_eq!(twice, Err(BasisError::Repeated { index: 3 }));
    assert!(Basis::new(&[level, slope, creep(0.1), creep(1.0)]).is_ok());
    for tau in [0.0, -1.0, f32::NAN] {
        assert!(matches!(
            Basis::new(&[level, slope, creep(tau)]),
            Err(BasisError::TimeConstant(_))
        ));
        let saw = Term::Drift(DriftModel::SawTooth {
            period: Second(tau),
        });
        assert!(matches!(
            Basis::new(&[level, slope, saw]),
            Err(BasisError::TimeConstant(_))
        ));
    }
}
