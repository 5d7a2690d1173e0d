//! Shape of triangles.

use crate::geometry::{Point, cross, distance};

/// Centre and radius of the circle through three points.
pub(super) fn circumcircle([a, b, c]: [Point; 3]) -> (Point, f64) {
    let twice = 2.0 * cross(a, b, c);
    let (p, q) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
    let (pp, qq) = (p[0] * p[0] + p[1] * p[1], q[0] * q[0] + q[1] * q[1]);
    let u = [
        (q[1] * pp - p[1] * qq) / twice,
        (p[0] * qq - q[0] * pp) / twice,
    ];
    ([a[0] + u[0], a[1] + u[1]], u[0].hypot(u[1]))
}

/// Lengths of a triangle's sides.
pub(super) fn sides([a, b, c]: [Point; 3]) -> [f64; 3] {
    [distance(a, b), distance(b, c), distance(c, a)]
}

/// Whether two segments cross between their ends.
pub(super) fn cross_each_other(a: Point, b: Point, c: Point, d: Point) -> bool {
    let opposite = |s: f64, t: f64| (s > 0.0) != (t > 0.0);
    opposite(cross(a, b, c), cross(a, b, d)) && opposite(cross(c, d, a), cross(c, d, b))
}
