//! Tank, springs, magnetorheological law and units, each against `f64` or a published figure.

use crate::common::reference::equation_2;
use crate::common::rng::Rng;
use palpate_model::calibration_curve::MonotoneCurve;
use palpate_model::magnetorheological::{
    Changed, Factors, Saturating, Stiffening, Tabulated, attraction, deviation,
};
use palpate_model::springs::two_state_load;
use palpate_model::tank;
use palpate_model::units::*;

fn relative(ours: f32, exact: f64) -> f64 {
    (f64::from(ours) / exact - 1.0).abs()
}

#[test]
fn codes_keep_their_digits() {
    let mut rng = Rng::new(2);
    let mut worst = [0.0f64; 2];
    for _ in 0..200_000 {
        let reference = rng.between(2e6, 2.6e8) as u32;
        // Changes from one count up to half of the reference code.
        let size = 10f64.powf(rng.between(0.0, f64::from(reference / 2).log10()));
        let count = (size as u32).max(1);
        let code = if rng.uniform() < 0.5 {
            reference - count
        } else {
            reference + count
        };
        let exact_delta = (f64::from(code) - f64::from(reference)) / f64::from(reference);
        let ours = tank::relative_frequency_change(reference, code);
        worst[0] = worst[0].max(relative(ours, exact_delta));
        // Computed from the rounded frequency change, so that only this function's error is
        // measured.
        let delta = f64::from(ours);
        let inductance = -delta * (2.0 + delta) / ((1.0 + delta) * (1.0 + delta));
        let found = tank::relative_inductance_change(ours);
        worst[1] = worst[1].max(relative(found, inductance));
    }
    println!("codes {:.2e}, inductance {:.2e}", worst[0], worst[1]);
    for (worst, budget) in worst.into_iter().zip([1.8e-7, 6.0e-7]) {
        assert!(
            worst <= budget && worst > budget / 4.0,
            "{worst:e} of {budget:e}"
        );
    }
    assert_eq!(tank::relative_frequency_change(0, 5), 0.0);
    assert_eq!(tank::relative_frequency_change(7, 0), -1.0);
}

#[test]
fn equation_2_as_published() {
    // For large changes `f32` suffices: compared with the published form in `f64` on the same
    // inputs.
    let mut rng = Rng::new(4);
    for _ in 0..10_000 {
        let [s, d1, d2] = [(); 3].map(|()| rng.between(1e3, 1e5) as f32);
        let [x1, x2] = [(); 2].map(|()| rng.between(1e-4, 1e-3) as f32);
        let closed = equation_2(s.into(), [d1.into(), d2.into()], [x1.into(), x2.into()]);
        let d = [NewtonPerMetre(d1), NewtonPerMetre(d2)];
        let ours = two_state_load(NewtonPerMetre(s), d, [Metre(x1), Metre(x2)]).0;
        // For nearly every random state the two terms of the denominator cancel, so 1/c_L is
        // compared.
        let scale = 1.0 / f64::from(s);
        let size = (f64::from(x1) + f64::from(x2)) / (f64::from(x1) - f64::from(x2)).abs();
        assert!((1.0 / f64::from(ours) - 1.0 / closed).abs() < 1e-5 * scale * size * size * 10.0);
    }
}

#[test]
fn stiffening_as_published() {
    // E(B) = E0 [1 + R B^2/(B^2 + Bc^2)]: relative rise in % at 20.4, 64, 137 mT for three rubbers.
    let rubbers = [
        (1.0, 0.35, [0.34, 3.2, 13.0]),
        (3.0, 0.30, [1.4, 13.0, 52.0]),
        (15.0, 0.25, [9.9, 92.0, 346.0]),
    ];
    for (r, half, percents) in rubbers {
        // The law of one rubber, defined by its rise at 137 mT and 10 A; it is evaluated at the
        // currents of the other fields.
        let at_peak: f32 = r * 0.137 * 0.137 / (0.137 * 0.137 + half * half);
        let law = Saturating::new(NewtonPerMetre(1e3), at_peak, Ampere(10.0)).unwrap();
        let law = law.saturating(Tesla(0.137), Tesla(half)).unwrap();
        for (field, percent) in [0.0204f32, 0.064, 0.137].into_iter().zip(percents) {
            let rise = law.rise(Ampere(-10.0 * field / 0.137)).value * 100.0;
            assert!((rise / percent - 1.0).abs() < 0.03, "{rise} {percent}");
        }
    }
}

#[test]
fn the_regressor_keeps_its_digits_at_half_a_percent() {
    let mut rng = Rng::new(5);
    let mut worst = [0.0f64; 3];
    for _ in 0..100_000 {
        let eps = 10f64.powf(rng.between(-3.0, 0.0)) as f32;
        let [peak, half] = [rng.between(0.01, 0.2) as f32, rng.between(0.2, 0.4) as f32];
        let [s, d] = [(); 2].map(|()| rng.between(1e3, 1e5) as f32);
        let current = rng.between(-10.0, 10.0) as f32;
        let law = Saturating::new(NewtonPerMetre(d), eps, Ampere(10.0)).unwrap();
        let law = law.saturating(Tesla(peak), Tesla(half)).unwrap();
        let field = |i: f64| f64::from(peak) * i / 10.0;
        let shape = |b: f64| b * b / (b * b + f64::from(half).powi(2));
        let rise = |i: f64| f64::from(eps) * shape(field(i)) / shape(f64::from(peak));
        let i = f64::from(current);
        worst[0] = worst[0].max(relative(law.rise(Ampere(current)).value, rise(i)));
        // Computed from the rounded rise, so that only the regressor's error is measured.
        let rho = f64::from(law.rise(Ampere(current)).value);
        let g0 = f64::from(s) / f64::from(d);
        let found = law.regressor(NewtonPerMetre(s), Ampere(current));
        worst[1] = worst[1].max(relative(found.deviation, g0 / (1.0 + rho) * -rho));
        let g = |i: f64| g0 / (1.0 + rise(i));
        let numeric = (g(i + 1e-4) - g(i - 1e-4)) / 2e-4;
        worst[2] =
            worst[2].max((f64::from(found.per_ampere) - numeric).abs() / (g0 * f64::from(eps)));
        let spring = law.spring(Ampere(current)).0;
        assert!(relative(spring, f64::from(d) * (1.0 + rho)) < 2e-7);
        let numeric = (rise(i * 1.0001) - rise(i * 0.9999)) / rise(i) / 2e-4;
        assert!(relative(law.logarithmic_slope(Ampere(current)), numeric) < 1e-5);
    }
    println!(
        "rise {:.2e}, regressor {:.2e}, derivative {:.2e}",
        worst[0], worst[1], worst[2]
    );
    assert!(worst[0] <= 6.0e-7 && worst[1] <= 4.0e-7 && worst[2] < 1e-6);
    assert!(Saturating::new(NewtonPerMetre(1e3), 0.0, Ampere(1.0)).is_err());
    let law = Saturating::new(NewtonPerMetre(1e3), 0.1, Ampere(1.0)).unwrap();
    assert!(law.saturating(Tesla(0.1), Tesla(0.0)).is_err());
}

#[test]
fn a_table_of_the_law_is_the_law() {
    let law = Saturating::new(NewtonPerMetre(4e3), 0.1, Ampere(10.0)).unwrap();
    let points: Vec<(f32, f32)> = (0..=20)
        .map(|i| i as f32 / 2.0)
        .map(|i| (i, 0.1 * i * i / 100.0))
        .collect();
    let curve = MonotoneCurve::<21>::new(&points).unwrap();
    let table = Tabulated::new(NewtonPerMetre(4e3), curve).unwrap();
    for i in -100..=100 {
        let current = Ampere(i as f32 / 10.0);
        let (a, b) = (law.rise(current), table.rise(current));
        assert!(
            (a.value - b.value).abs() < 2e-5,
            "{current}: {} {}",
            a.value,
            b.value
        );
        assert!(
            (a.per_ampere - b.per_ampere).abs() < 6e-4,
            "{current}: {a:?} {b:?}"
        );
    }
    assert!(Tabulated::new(NewtonPerMetre(0.0), curve).is_err());
}

/// A law modified by factors equals the law whose spring and rise have been multiplied, whatever
/// the law's form.
#[test]
fn a_changed_law_is_that_of_changed_parameters() {
    let by = Factors::at(-12.5, -2e-3, 4e-3);
    let (springs, rise) = ((0.025_f64).exp(), (-0.05_f64).exp());
    let saturating = |at_rest: f64, rise: f64| {
        Saturating::new(NewtonPerMetre(at_rest as f32), rise as f32, Ampere(10.0))
            .and_then(|law| law.saturating(Tesla(0.1), Tesla(0.25)))
            .unwrap()
    };
    let table = |at_rest: f64, rise: f64| {
        let points = [0.0, 0.3, 1.0].map(|part| (10.0 * part as f32, (rise * part * part) as f32));
        let curve = MonotoneCurve::<3>::new(&points).unwrap();
        Tabulated::new(NewtonPerMetre(at_rest as f32), curve).unwrap()
    };
    let near = |found: f32, expected: f32| {
        assert!(
            (found - expected).abs() <= 1e-6 * expected.abs(),
            "{found} {expected}"
        );
    };
    let agree = |changed: &dyn Stiffening, expected: &dyn Stiffening| {
        for current in [-10.0, -2.0, 0.0, 1.0, 7.5, 10.0].map(Ampere) {
            near(changed.spring(current).0, expected.spring(current).0);
            near(changed.rise(current).value, expected.rise(current).value);
            near(
                changed.rise(current).per_ampere,
                expected.rise(current).per_ampere,
            );
        }
    };
    let law = saturating(4e3, 0.1);
    agree(&Changed { law, by }, &saturating(4e3 * springs, 0.1 * rise));
    let law = table(4e3, 0.1);
    agree(&Changed { law, by }, &table(4e3 * springs, 0.1 * rise));
    assert_eq!(Factors::at(0.0, -2e-3, 4e-3), Factors::NONE);
}

#[test]
fn an_attraction_is_a_part_of_the_regressor() {
    // The pull f shortens the actuated layer by p = f/c_D. With kappa = c_S/c_L and g = c_S/c_D the
    // lengths add up to x_0/x = 1 + kappa + g + p/x, for any pull.
    let law = Saturating::new(NewtonPerMetre(4e3), 0.1, Ampere(10.0)).unwrap();
    let (c_s, c_l, x_0) = (6e3, 3e3, 1e-3);
    for i in 0..=10 {
        let pull = 0.3e-3 * f64::from(i * i);
        let c_d = 4e3 * (1.0 + 0.1 * f64::from(i * i) / 100.0);
        let x = (x_0 - pull / c_d) / (1.0 + c_s / c_l + c_s / c_d);
        let (pull, x) = (Newton(pull as f32), Metre(x as f32));
        let h = attraction(pull, law.spring(Ampere(i as f32)), x)
            + law
                .regressor(NewtonPerMetre(6e3), Ampere(i as f32))
                .deviation;
        let whole = 1.0 + c_s / c_l + 6.0 / 4.0 + f64::from(h);
        assert!((whole * f64::from(x.0) / x_0 - 1.0).abs() < 3e-7);
    }
}

#[test]
fn a_deviation_is_that_of_the_stiffened_layer() {
    assert!((f64::from(deviation(1.5, 0.25)) - (1.5 / 1.25 - 1.5)).abs() < 1e-7);
}

#[test]
fn quantities_check_and_name_themselves() {
    assert_eq!(NewtonPerMetre::positive(5.0), Ok(NewtonPerMetre(5.0)));
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(NewtonPerMetre::positive(bad).is_err());
    }
    assert!(Kelvin::non_negative(0.0).is_ok() && Kelvin::non_negative(-0.1).is_err());
    let error = Metre::positive(-0.5).unwrap_err();
    assert_eq!(error.to_string(), "-0.5 m must be finite and above zero");
    assert_eq!(format!("{:.1}", Ampere(2.54)), "2.5 A");
    assert_eq!(NewtonPerMetre(6.0) * Metre(0.5), Newton(3.0));
    assert_eq!(Newton(3.0) / NewtonPerMetre(6.0), Metre(0.5));
    assert_eq!(Celsius(30.0) - Celsius(20.0), Kelvin(10.0));
    assert_eq!(Celsius(20.0) + Kelvin(-5.0), Celsius(15.0));
    assert_eq!(Second(3.0) / Second(2.0), 1.5);
    assert_eq!(
        (Second(3.0) - Second(1.0)) * 2.0 / 4.0 + -Second(1.0),
        Second(0.0)
    );
}
