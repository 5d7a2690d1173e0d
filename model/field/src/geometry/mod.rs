//! Plane geometry of the half-plane (r, x): outlines, the paths they consist of, and how all paths
//! of a design cut each other.

pub mod arrangement;
pub mod path;
pub mod shape;

/// A point [r, x], m.
pub type Point = [f64; 2];

/// Distance of two points.
#[must_use]
pub fn distance(a: Point, b: Point) -> f64 {
    length([a[0] - b[0], a[1] - b[1]])
}

/// Length of a vector. Not by `hypot`: no length or field is near the range's ends, and it takes a tenth of a
/// whole solution.
#[must_use]
pub fn length([a, b]: [f64; 2]) -> f64 {
    (a * a + b * b).sqrt()
}

/// Twice the signed area of a triangle: positive where it turns left.
#[must_use]
pub fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
