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
        let (low, high) = (points[0].0, points[points.len() - 1].0);
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

/// Slope, in f64, at the first of three points of the parabola through them. Here it has the sign
/// of the secants, so the limit in the crate has no effect.
fn at_the_end(points: [(f64, f64); 3]) -> f64 {
    let [(x0, y0), (x1, y1), (x2, y2)] = points;
    let (d0, d1) = ((y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1));
    d0 + (d0 - d1) * (x1 - x0) / (x2 - x0)
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
    let [a, b, c, d] = points;
    let slopes = [
        at_the_end([a, b, c]),
        fritsch_butland([a, b, c]),
        fritsch_butland([b, c, d]),
        at_the_end([d, c, b]),
    ];
    for ((x, _), expected) in points.into_iter().zip(slopes) {
        let slope = f64::from(curve.at(x as f32).slope);
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
fn names_the_offending_point() {
    let (given, capacity) = (4, 3);
    let not_finite = |index| CurveError::NotFinite { index };
    let cases: [(&[(f32, f32)], CurveError); 8] = [
        (&[], CurveError::TooFew { given: 0 }),
        (&[(0.0, 0.0)], CurveError::TooFew { given: 1 }),
        (&[(0.0, 0.0); 4], CurveError::TooMany { given, capacity }),
        (&[(0.0, 0.0), (f32::NAN, 1.0)], not_finite(1)),
        (&[(0.0, f32::INFINITY), (1.0, 1.0)], not_finite(0)),
        (&[(0.0, 0.0), (1e-38, 1e3)], not_finite(1)),
        (
            &[(1.0, 0.0), (1.0, 1.0)],
            CurveError::NotIncreasing { index: 1 },
        ),
        (
            &[(0.0, 0.0), (1.0, 1.0), (2.0, 0.5)],
            CurveError::NotMonotone { index: 2 },
        ),
    ];
    for (points, why) in cases {
        assert_eq!(MonotoneCurve::<3>::new(points), Err(why));
    }
    let text = CurveError::NotMonotone { index: 2 }.to_string();
    assert!(text.contains('2'), "{text}");
}
