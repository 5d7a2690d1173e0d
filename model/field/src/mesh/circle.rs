//! Circle around the design.

use crate::geometry::Point;

/// The circle about a design, with its centre on the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Position of its centre, m.
    pub centre_x: f64,
    /// Radius, m.
    pub radius: f64,
}

impl Circle {
    /// Distance of a point from the centre.
    #[must_use]
    pub fn distance(&self, [r, x]: Point) -> f64 {
        r.hypot(x - self.centre_x)
    }
}
