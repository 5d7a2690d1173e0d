//! The monotone curve: monotone for any points, exact at them, and smooth between them.

use palpate_model::calibration_curve::{CurveError, MonotoneCurve};
use proptest::prelude::*;

/// Points whose random steps span nine decades in argument and value; the values rise or fall.
fn points() -> impl Strategy<Value = Vec<(f32, f32)>> {
    let step = (-6i32..3, 1.0f32..10.0).prop_map(|(decade, digit)| digit * 10f32.powi(decade));
    let steps = prop::collection::vec((step.clone(), step), 2..15);
    let points = (steps, -1e3f32..1e3, -1e3f32..1e3, any::<bool>());
    let points = points.prop_map(|(steps, x0, y0, rising)| {
        let mut points = vec![(x0, y0)];
        for (dx, dy) in steps {
            let (x, y) = points[points.len() - 1];
            let next = (x + dx, if rising { y + dy } else { y - dy });
            // A step below the last digit of the number would not give a new point.
            if next.0 > x && next.1 != y {
                points.push(next);
            }
        }
        points
    });
    points.prop_filter("at least three points", |points| points.len() >= 3)
}

/// Arguments to test between two points: evenly spaced, and next to the ends.
fn arguments(a: f32, b: f32) -> Vec<f32> {
    let between = |i: i32| a + (b - a) * (i as f32 / 200.0);
    let mut all: Vec<f32> = (0..=200).map(between).collect();
    for end in [a, b, a + (b - a) / 2.0] {
        let bits = end.to_bits();
        all.extend((bits.saturating_sub(20)..bits + 20).map(f32::from_bits));
    }
    all.retain(|x| (a..=b).contains(x));
    all.sort_by(f32::total_cmp);
    all
}

fn ulp(x: f32) -> f32 {
    f32::from_bits(x.abs().to_bits() + 1) - x.abs()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn never_turns_back(points in points()) {
        let curve = MonotoneCurve::<16>::new(&points).unwrap();
        let sign = (points[1].1 - points[0].1).signum();
        for pair in points.windows(2) {
            let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
            let slack = 6.0 * ulp(y0.abs().max(y1.abs()));
            let mut before = y0;
            for x in arguments(x0, x1) {
                let point = curve.at(x);
                prop_assert!(sign * (point.value - before) >= -slack, "{x} {} {before}", point.value);
                prop_assert!(sign * point.slope >= 0.0 && !point.extrapolated);
                prop_assert!(sign * (point.value - y0) >= 0.0 && sign * (y1 - point.value) >= 0.0);
                before = point.value;
            }
        }
    }

    #[test]
    fn is_exact_at_the_points_and_goes_on_straight_beyond(points in points()) {
        let curve = MonotoneCurve::<16>::new(&points).unwrap();
        for &(x, y) in &points {
            prop_assert_eq!(curve.at(x).value, y);
        }
        let (low, high) = curve.domain();
        prop_assert_eq!((low, high), (points[0].0, points[points.len() - 1].0));
        for (end, outside) in [(low, low - 1.0), (high, high + 1.0)] {
            prop_assert!(curve.at(outside).extrapolated);
            prop_assert_eq!(curve.at(outside).slope, curve.at(end).slope);
        }
    }

    #[test]
    fn refuses_points_that_turn_back(points in points(), at in 0usize..14, back in 0f32..2.0) {
        let at = 1 + at % (points.len() - 2);
        let mut bent = points.clone();
        // A value that reverses the direction of the previous ones, or equals the previous one if
        // `back` is zero.
        let (_, before) = bent[at - 1];
        bent[at].1 = before - back * (bent[at].1 - before);
        let refused = MonotoneCurve::<16>::new(&bent);
        prop_assert!(matches!(refused, Err(CurveError::NotMonotone { .. })), "{refused:?}");
    }
}

/// Slope at the middle of three points by the published weights, in f64.
fn fritsch_butland(points: [(f64, f64); 3]) -> f64 {
    let [(x0, y0), (x1, y1), (x2, y2)] = points;
    let (h0, h1) = (x1 - x0, x2 - x1);
    let (d0, d1) = ((y1 - y0) / h0, (y2 - y1) / h1);
    3.0 * (h0 + h1) / ((2.0 * h1 + h0) / d0 + (h1 + 2.0 * h0) / d1)
}

#[test]
fn has_the_published_slopes() {
    let points = [(0.0, 0.0), (1.0, 3.0), (1.5, 3.2), (4.0, 9.0)];
    let curve = MonotoneCurve::<4>::new(&points.map(|(x, y)| (x as f32, y as f32))).unwrap();
    for middle in [1, 2] {
        let expected = fritsch_butland([points[middle - 1], points[middle], points[middle + 1]]);
        let slope = f64::from(curve.at(points[middle].0 as f32).slope);
        assert!((slope / expected - 1.0).abs() < 1e-6, "{slope} {expected}");
    }
}

#[test]
fn the_slope_is_the_derivative_and_carries_sigma() {
    let curve = MonotoneCurve::<4>::new(&[(0.0, 0.0), (1.0, 3.0), (1.5, 3.2), (4.0, 9.0)]).unwrap();
    for i in 1..400 {
        let x = i as f32 / 100.0;
        let (before, after) = (curve.at(x - 1.0 / 1024.0), curve.at(x + 1.0 / 1024.0));
        let numeric = (after.value - before.value) * 512.0;
        let point = curve.at(x);
        assert!(
            (point.slope - numeric).abs() < 0.02 * point.slope.max(0.5),
            "{x}"
        );
        assert_eq!(point.sigma(0.25), point.slope * 0.25);
    }
    let falling = MonotoneCurve::<2>::new(&[(0.0, 1.0), (1.0, -1.0)]).unwrap();
    assert_eq!(falling.at(0.5).sigma(0.1), 0.2);
}

#[test]
fn follows_a_smooth_curve_with_the_third_power_of_the_spacing() {
    // The law of a coil, L/L0 - 1 as an exponential of the closing of the gap: 9 points, then 17.
    let error = |n: usize| {
        let law = |x: f64| 0.3 * (x.exp() - 1.0);
        let points: Vec<(f32, f32)> = (0..n)
            .map(|i| i as f64 / (n - 1) as f64)
            .map(|x| (x as f32, law(x) as f32))
            .collect();
        let curve = MonotoneCurve::<32>::new(&points).unwrap();
        (0..1000)
            .map(|i| f64::from(i) / 1000.0)
            .map(|x| (f64::from(curve.at(x as f32).value) - law(f64::from(x as f32))).abs())
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(9), error(17));
    println!("{coarse:.2e} {fine:.2e}");
    assert!(coarse < 2e-4 && fine < coarse / 5.0, "{coarse:e} {fine:e}");
}

#[test]
fn names_the_offending_point() {
    let new = MonotoneCurve::<3>::new;
    assert_eq!(new(&[]), Err(CurveError::TooFew { given: 0 }));
    assert_eq!(new(&[(0.0, 0.0)]), Err(CurveError::TooFew { given: 1 }));
    let four = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)];
    assert_eq!(
        new(&four),
        Err(CurveError::TooMany {
            given: 4,
            capacity: 3
        })
    );
    assert_eq!(
        new(&[(0.0, 0.0), (f32::NAN, 1.0)]),
        Err(CurveError::NotFinite { index: 1 })
    );
    assert_eq!(
        new(&[(0.0, f32::INFINITY), (1.0, 1.0)]),
        Err(CurveError::NotFinite { index: 0 })
    );
    assert_eq!(
        new(&[(0.0, 0.0), (1e-38, 1e3)]),
        Err(CurveError::NotFinite { index: 1 })
    );
    assert_eq!(
        new(&[(1.0, 0.0), (1.0, 1.0)]),
        Err(CurveError::NotIncreasing { index: 1 })
    );
    assert_eq!(
        new(&[(0.0, 0.0), (1.0, 1.0), (2.0, 0.5)]),
        Err(CurveError::NotMonotone { index: 2 }),
    );
    let text = CurveError::NotMonotone { index: 2 }.to_string();
    assert!(text.contains('2'), "{text}");
}
