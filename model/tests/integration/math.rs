//! Every function of `math`, compared with `f64`: its errors are within the bound that its doc
//! states.

use crate::common::rng::Rng;
use palpate_model::math::{self, Wide, student};

/// Positive normal numbers between two limits, evenly spaced in their bit patterns.
fn positives(low: f32, high: f32) -> impl Iterator<Item = f32> {
    (low.to_bits()..=high.to_bits())
        .step_by(997)
        .map(f32::from_bits)
}

/// Positive and negative normal numbers between two limits.
fn both_signs(low: f32, high: f32) -> impl Iterator<Item = f32> {
    positives(low, high).flat_map(|x| [x, -x])
}

/// Asserts that the largest error is below the budget, but above a quarter of it: otherwise the
/// stated bound would be too wide.
fn within(budget: f64, name: &str, errors: impl Iterator<Item = (f32, f64)>) {
    let (at, worst) = errors.fold((f32::NAN, -1.0), |worst, (x, error)| {
        if error <= worst.1 { worst } else { (x, error) }
    });
    println!("{name:10} {worst:.2e} of {budget:.1e} at {at:e}");
    assert!(worst <= budget, "{name}: {worst:e} at {at:e}");
    assert!(
        worst > budget / 4.0,
        "{name}: budget {budget:e} is idle, {worst:e}"
    );
}

fn relative(f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64) -> impl Fn(f32) -> (f32, f64) {
    move |x| (x, (f64::from(f(x)) / exact(f64::from(x)) - 1.0).abs())
}

#[test]
fn roots() {
    let all = || positives(f32::MIN_POSITIVE, f32::MAX);
    within(6.0e-8, "sqrt", all().map(relative(math::sqrt, f64::sqrt)));
    assert!(math::sqrt(-1.0).is_nan());
}

#[test]
fn logarithms() {
    let all = || positives(f32::MIN_POSITIVE, f32::MAX).filter(|&x| x != 1.0);
    within(1.2e-7, "ln", all().map(relative(math::ln, f64::ln)));
    let small = || both_signs(1e-30, 0.999).chain(positives(0.999, 1e30));
    within(
        1.2e-7,
        "ln_1p",
        small().map(relative(math::ln_1p, f64::ln_1p)),
    );
}

#[test]
fn exponentials() {
    let normal = || both_signs(1e-30, 87.0);
    within(1.2e-7, "exp", normal().map(relative(math::exp, f64::exp)));
    let range = || both_signs(1e-30, 80.0);
    within(
        1.2e-7,
        "exp_m1",
        range().map(relative(math::exp_m1, f64::exp_m1)),
    );
}

#[test]
fn arc_tangents() {
    let all = || both_signs(1e-30, 1e30);
    within(1.2e-7, "atan", all().map(relative(math::atan, f64::atan)));
}

#[test]
fn hypotenuse() {
    let mut rng = Rng::new(1);
    let mut draw = || (10f64.powf(rng.between(-20.0, 20.0)) * (rng.uniform() - 0.5)) as f32;
    let pairs: Vec<_> = (0..200_000)
        .map(|_| {
            let a = draw();
            (a, a * draw().abs().min(1e3))
        })
        .collect();
    let errors = pairs.iter().map(|&(a, b)| {
        let exact = f64::from(a).hypot(f64::from(b));
        (a, (f64::from(math::hypot(a, b)) / exact - 1.0).abs())
    });
    within(2.0e-7, "hypot", errors);
    assert_eq!(math::hypot(0.0, 0.0), 0.0);
    assert_eq!(math::hypot(3e30, -4e30), 5e30);
    assert_eq!(
        (math::hypot(1e-10, 1e25), math::hypot(-1e25, 1e-10)),
        (1e25, 1e25)
    );
}

#[test]
fn whole_parts_are_exact() {
    for x in both_signs(1e-10, 1e10) {
        assert_eq!(f64::from(math::floor(x)), f64::from(x).floor());
    }
}

/// Distribution function of Student's t, by Simpson's rule in the angle atan(t/sqrt(n)).
fn student_distribution(t: f64, degrees: f64) -> f64 {
    let density = |angle: f64| angle.cos().powf(degrees - 1.0);
    let simpson = |to: f64| {
        let n = 20_000;
        let h = to / f64::from(n);
        let inner: f64 = (1..n)
            .map(|i| f64::from(2 + 2 * (i % 2)) * density(f64::from(i) * h))
            .sum();
        (density(0.0) + inner + density(to)) * h / 3.0
    };
    let angle = (t / degrees.sqrt()).atan();
    0.5 + 0.5 * simpson(angle) / simpson(std::f64::consts::FRAC_PI_2)
}

#[test]
fn student_quantiles() {
    let error = |n: u32| {
        let quantile = f64::from(student::quantile_975(n));
        let n64 = f64::from(n);
        // One Newton step from the tested quantile to the point at which the integral is 97.5 %.
        let slope = (student_distribution(quantile * 1.001, n64)
            - student_distribution(quantile * 0.999, n64))
            / 0.002;
        let error = (student_distribution(quantile, n64) - 0.975) / slope;
        (n as f32, error.abs())
    };
    within(2.0e-4, "student", (1..8).map(error));
    let many = (8..60).chain([100, 398, 1000, 100_000]);
    within(1.5e-5, "from 8 on", many.map(error));
}

/// Wide numbers of many magnitudes whose bits are all in use.
fn wides(count: usize) -> Vec<Wide> {
    let mut rng = Rng::new(2);
    let mut digits = || {
        let sign = if rng.uniform() < 0.5 { -1.0 } else { 1.0 };
        Wide::from_f32((sign * 10f64.powf(rng.between(-6.0, 6.0))) as f32)
    };
    (0..count)
        .map(|_| digits() * digits() * digits() + digits())
        .collect()
}

/// The integer mantissa x 2^(exponent + by); `None` if exponent + by is negative or above 63.
fn integer((mantissa, exponent): (i64, i32), by: i32) -> Option<i128> {
    let shift = u32::try_from(exponent + by)
        .ok()
        .filter(|&shift| shift < 64)?;
    Some(i128::from(mantissa) << shift)
}

/// Relative errors of an operation on random pairs, compared with exact integers.
fn of_pairs(exact: impl Fn(Wide, Wide) -> Option<f64>) -> impl Iterator<Item = (f32, f64)> {
    let numbers = wides(400_000);
    let errors: Vec<_> = numbers
        .chunks(2)
        .filter_map(|pair| Some((pair[0].to_f32(), exact(pair[0], pair[1])?)))
        .collect();
    assert!(errors.len() > 50_000, "{}", errors.len());
    errors.into_iter()
}

#[test]
fn wide_sums_products_and_quotients() {
    let sum = |a: Wide, b: Wide, found: Wide, sign: i128| {
        // Both operands and the result, as integers in units of the smallest of their last bits.
        let [x, y, z] = [a.parts(), b.parts(), found.parts()];
        let by = -x.1.min(y.1).min(z.1);
        let [x, y, z] = [integer(x, by)?, sign * integer(y, by)?, integer(z, by)?];
        Some((x + y - z).abs() as f64 / x.abs().max(y.abs()) as f64)
    };
    within(8.7e-19, "sum", of_pairs(|a, b| sum(a, b, a + b, 1)));
    within(8.7e-19, "difference", of_pairs(|a, b| sum(a, b, a - b, -1)));
    let product = |a: Wide, b: Wide| {
        let ((x, e), (y, f), (z, g)) = (a.parts(), b.parts(), (a * b).parts());
        let exact = i128::from(x) * i128::from(y);
        let found = i128::from(z) << u32::try_from(g - e - f).ok()?;
        Some((exact - found).abs() as f64 / exact.abs() as f64)
    };
    within(2.7e-18, "product", of_pairs(product));
    let quotient = |a: Wide, b: Wide| {
        // x 2^n = z y + remainder, where the remainder is the error.
        let ((x, e), (y, f), (z, g)) = (a.parts(), b.parts(), (a / b).parts());
        let scaled = i128::from(x) << u32::try_from(e - f - g).ok()?;
        let rest = scaled - i128::from(z) * i128::from(y);
        Some(rest.abs() as f64 / scaled.abs() as f64)
    };
    within(8.7e-19, "quotient", of_pairs(quotient));
}

#[test]
fn wide_numbers_come_from_f32_exactly_and_go_back_to_the_nearest() {
    let smallest = f32::from_bits(1);
    for x in both_signs(f32::MIN_POSITIVE, f32::MAX).chain([0.0, f32::MAX]) {
        let wide = Wide::from_f32(x);
        assert_eq!(wide.to_f32(), x);
        assert_eq!((-wide).to_f32(), -x);
        assert_eq!(wide - wide, Wide::ZERO);
        assert_eq!(wide + Wide::ZERO, wide);
    }
    assert_eq!(
        (Wide::from_f32(smallest) * Wide::from_f32(1e30)).to_f32(),
        smallest * 1e30
    );
    assert_eq!(
        (Wide::from_f32(1e-30) * Wide::from_f32(1e-30)).to_f32(),
        0.0
    );
    assert_eq!(
        (Wide::from_f32(-1e30) * Wide::from_f32(1e30)).to_f32(),
        f32::NEG_INFINITY
    );
    assert_eq!(Wide::ONE, Wide::from_f32(1.0));
    for wide in wides(100_000) {
        let (mantissa, exponent) = wide.parts();
        let exact = mantissa as f64 * 2f64.powi(exponent);
        // Compared with the exact value in `f64`, whose own rounding matters only for a tie.
        let error = (f64::from(wide.to_f32()) / exact - 1.0).abs();
        assert!(error <= 6.0e-8, "{error:e}");
        assert!((1 << 61..1 << 62).contains(&mantissa.unsigned_abs()));
    }
}

#[test]
fn a_long_sum_s_errors_do_not_all_point_one_way() {
    // Adds a million numbers whose last bits are below those of a sum near 2^40.
    let mut rng = Rng::new(5);
    let mut sum = Wide::from_f32(2f32.powi(40));
    let mut exact = 0i128;
    for _ in 0..1_000_000 {
        let digits = (rng.next_u64() >> 40) as u32;
        exact += i128::from(digits);
        sum = sum + Wide::from_f32(digits as f32 * 2f32.powi(-33));
    }
    let (mantissa, exponent) = (sum - Wide::from_f32(2f32.powi(40))).parts();
    let found = i128::from(mantissa) >> -(exponent + 33);
    // In units of the sum's last bit, 2^-21: truncation would lose half a unit each time.
    let off = (found - exact).abs() >> 12;
    assert!(off < 2000, "{off}");
}
