//! Computed equivalents of Shore hardness: the balance in `f64`, and published pairs.

use palpate_model::hardness::Scale;
use palpate_model::units::Pascal;

/// E* of an object with a reading: Sneddon's equations with the contact radius a, found by bisection.
fn reduced_pa(scale: Scale, reading: f64) -> f64 {
    let depth_m = 2.5e-3 * (1.0 - reading / 100.0);
    let (force_n, depth, area, low_m, high_m) = match scale {
        Scale::A => (
            0.55 + 0.075 * reading,
            cone_depth_m as Of,
            cone_m2 as Of,
            0.395e-3,
            3e-3,
        ),
        Scale::Double0 => (
            0.203 + 0.00908 * reading,
            ball_depth_m as Of,
            ball_m2 as Of,
            0.0,
            1.19e-3,
        ),
    };
    let (mut low_m, mut high_m) = (low_m, high_m);
    for _ in 0..60 {
        let middle_m = 0.5 * (low_m + high_m);
        let is_deeper = depth(middle_m) > depth_m;
        *(if is_deeper { &mut high_m } else { &mut low_m }) = middle_m;
    }
    force_n / area(low_m)
}

type Of = fn(f64) -> f64;
const END_M: f64 = 0.395e-3;
const BALL_M: f64 = 1.19e-3;

fn slope() -> f64 {
    1.0 / 17.5_f64.to_radians().tan()
}

fn cone_depth_m(a: f64) -> f64 {
    slope() * a * (END_M / a).acos()
}

fn cone_m2(a: f64) -> f64 {
    let b = END_M / a;
    slope() * a * a * (b.acos() + b * (1.0 - b * b).sqrt())
}

fn ball_depth_m(a: f64) -> f64 {
    0.5 * a * ((BALL_M + a) / (BALL_M - a)).ln()
}

fn ball_m2(a: f64) -> f64 {
    0.5 * (a * a + BALL_M * BALL_M) * ((BALL_M + a) / (BALL_M - a)).ln() - a * BALL_M
}

#[test]
fn the_reading_balances_spring_and_half_space() {
    for scale in [Scale::A, Scale::Double0] {
        for reading in (2..=98).step_by(4).map(f64::from) {
            let computed = f64::from(scale.reading(Pascal(reduced_pa(scale, reading) as f32)));
            assert!(
                (computed - reading).abs() < 1e-3,
                "{scale:?} {reading}: {computed}"
            );
        }
        assert_eq!(scale.reading(Pascal(1.0)), 0.0);
        assert!(scale.reading(Pascal(1e10)) > 99.9);
    }
}

/// Young's modulus in MPa of an incompressible object with a reading of Shore A, by Gent, Rubber
/// Chem. Technol. 31 (1958) 896, from the balance with a flat punch of the cone's mean radius.
fn gent_mpa(reading: f64) -> f64 {
    0.0981 * (56.0 + 7.623_36 * reading) / (0.137_505 * (254.0 - 2.54 * reading))
}

/// By Qi, Joyce, Boyce, Rubber Chem. Technol. 76 (2003) 419: finite elements, neo-Hookean, 20 to 80.
fn qi_mpa(reading: f64) -> f64 {
    10f64.powf(0.0235 * reading - 0.6403)
}

#[test]
fn shore_a_lies_beside_published_relations() {
    for reading in [20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0] {
        let equivalent =
            |young_mpa: f64| f64::from(Scale::A.reading(Pascal((young_mpa * 1e6 / 0.75) as f32)));
        let (gent, qi) = (equivalent(gent_mpa(reading)), equivalent(qi_mpa(reading)));
        println!("{reading}: from E of Gent {gent:.1}, of Qi {qi:.1}");
        assert!((gent - reading).abs() < 5.0 && (qi - reading).abs() < 8.0);
    }
}

/// Pairs of Shore A and Shore 00 of one material, from a conversion chart of the trade
/// (eng-tips.com, thread 50796).
const CHART: [[f64; 2]; 6] = [
    [5.0, 45.0],
    [10.0, 55.0],
    [15.0, 62.0],
    [20.0, 70.0],
    [25.0, 76.0],
    [30.0, 80.0],
];

#[test]
fn the_scales_belong_together_as_on_a_chart() {
    for [a, double0] in CHART {
        let reading = Scale::Double0.reading(Pascal(reduced_pa(Scale::A, a) as f32));
        println!("A {a}: computed 00 {reading:.1}, chart {double0}");
        assert!(
            (f64::from(reading) - double0).abs() < 6.0,
            "A {a}: {reading}"
        );
    }
}
