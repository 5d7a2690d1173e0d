//! Plane geometry of the half-plane (r, x): outlines, their paths, and the crossings of all paths
//! of a design.

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

/// Length of a vector. Does not use `hypot`: no length or field is near the limits of `f64`, and
/// `hypot` would take a tenth of the time of a whole solution.
#[must_use]
pub fn length([a, b]: [f64; 2]) -> f64 {
    (a * a + b * b).sqrt()
}

/// Twice the signed area of a triangle: positive if its corners are in counterclockwise order.
#[must_use]
pub fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
