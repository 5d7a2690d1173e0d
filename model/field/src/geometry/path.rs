//! Straight lines and elliptic arcs, and where they meet.

use super::{Point, distance};

/// The curve that a path runs along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathCurve {
    /// A straight line.
    Line,
    /// An ellipse about a point of the axis: r = semi_r cos t, x = centre + semi_x sin t.
    Ellipse {
        /// Position of the centre.
        centre_x: f64,
        /// Semi-axis across the axis.
        semi_r: f64,
        /// Semi-axis along the axis.
        semi_x: f64,
    },
}

impl PathCurve {
    /// The point at the angle `t`; none for a line.
    fn at(&self, t: f64) -> Option<Point> {
        match *self {
            Self::Line => None,
            Self::Ellipse {
                centre_x,
                semi_r,
                semi_x,
            } => Some([semi_r * t.cos(), centre_x + semi_x * t.sin()]),
        }
    }

    /// The angle of a point on it, from −π/2 to π/2 where r ≥ 0.
    fn angle(&self, [r, x]: Point) -> f64 {
        match *self {
            Self::Line => 0.0,
            Self::Ellipse {
                centre_x,
                semi_r,
                semi_x,
            } => ((x - centre_x) / semi_x).atan2(r / semi_r),
        }
    }

    /// Negative inside an ellipse, positive outside.
    fn level(&self, [r, x]: Point) -> f64 {
        match *self {
            Self::Line => 1.0,
            Self::Ellipse {
                centre_x,
                semi_r,
                semi_x,
            } => (r / semi_r).powi(2) + ((x - centre_x) / semi_x).powi(2) - 1.0,
        }
    }

    /// The point a share `s` of the way from `a` to `b`, both on the curve.
    #[must_use]
    pub fn between(&self, a: Point, b: Point, s: f64) -> Point {
        let (from, to) = (self.angle(a), self.angle(b));
        match self.at(from + s * (to - from)) {
            Some(point) if s > 0.0 && s < 1.0 => point,
            _ => [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])],
        }
    }
}

/// A piece of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Its curve.
    pub curve: PathCurve,
    /// Where it begins.
    pub from: Point,
    /// Where it ends.
    pub to: Point,
}

impl Path {
    /// A straight line.
    #[must_use]
    pub fn line(from: Point, to: Point) -> Self {
        Self {
            curve: PathCurve::Line,
            from,
            to,
        }
    }

    /// An arc between two angles. Its ends are exactly on the axis where the angles are ±π/2.
    #[must_use]
    pub fn arc(curve: PathCurve, from: f64, to: f64) -> Self {
        let end = |t: f64| {
            let mut point = curve.at(t).unwrap_or([0.0; 2]);
            if t.abs() == core::f64::consts::FRAC_PI_2 {
                point[0] = 0.0;
            }
            point
        };
        Self {
            curve,
            from: end(from),
            to: end(to),
        }
    }

    /// The point a share `s` of the way along.
    #[must_use]
    pub fn at(&self, s: f64) -> Point {
        self.curve.between(self.from, self.to, s)
    }

    /// Length of its chord.
    #[must_use]
    pub fn chord(&self) -> f64 {
        distance(self.from, self.to)
    }

    /// Where along this path, from 0 to 1, `other` meets it; `tolerance` is a length.
    #[must_use]
    pub fn meetings(&self, other: &Self, tolerance: f64) -> Vec<f64> {
        let mut found = match (self.curve, other.curve) {
            (PathCurve::Line, PathCurve::Line) => self.line_with_line(other, tolerance),
            (PathCurve::Line, _) => self.line_with_ellipse(other, tolerance),
            _ if self.curve == other.curve => Vec::new(),
            _ => self.arc_with(other, tolerance),
        };
        found.extend([other.from, other.to].iter().filter_map(|&end| {
            let s = self.share_of(end);
            ((0.0..=1.0).contains(&s) && distance(self.at(s), end) <= tolerance).then_some(s)
        }));
        found
    }

    /// The share at which a point on the path lies.
    #[must_use]
    pub fn share_of(&self, point: Point) -> f64 {
        if self.curve == PathCurve::Line {
            let d = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
            let p = [point[0] - self.from[0], point[1] - self.from[1]];
            (p[0] * d[0] + p[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])
        } else {
            let (from, to) = (self.curve.angle(self.from), self.curve.angle(self.to));
            (self.curve.angle(point) - from) / (to - from)
        }
    }

    fn line_with_line(&self, other: &Self, tolerance: f64) -> Vec<f64> {
        let d = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        let e = [other.to[0] - other.from[0], other.to[1] - other.from[1]];
        let between = [other.from[0] - self.from[0], other.from[1] - self.from[1]];
        let turn = d[0] * e[1] - d[1] * e[0];
        // Parallel lines meet at ends only, which are looked for anyway.
        if turn.abs() <= 1e-12 * self.chord() * other.chord() {
            return Vec::new();
        }
        let s = (between[0] * e[1] - between[1] * e[0]) / turn;
        let t = (between[0] * d[1] - between[1] * d[0]) / turn;
        let (ds, dt) = (tolerance / self.chord(), tolerance / other.chord());
        let within = (-ds..=1.0 + ds).contains(&s) && (-dt..=1.0 + dt).contains(&t);
        within.then_some(s.clamp(0.0, 1.0)).into_iter().collect()
    }

    fn line_with_ellipse(&self, other: &Self, tolerance: f64) -> Vec<f64> {
        let PathCurve::Ellipse {
            centre_x,
            semi_r,
            semi_x,
        } = other.curve
        else {
            return Vec::new();
        };
        let p = [self.from[0] / semi_r, (self.from[1] - centre_x) / semi_x];
        let q = [self.to[0] / semi_r, (self.to[1] - centre_x) / semi_x];
        let d = [q[0] - p[0], q[1] - p[1]];
        let a = d[0] * d[0] + d[1] * d[1];
        let b = p[0] * d[0] + p[1] * d[1];
        let c = p[0] * p[0] + p[1] * p[1] - 1.0;
        let root = b * b - a * c;
        if root <= 0.0 {
            return Vec::new();
        }
        let slack = tolerance / self.chord();
        [-b - root.sqrt(), -b + root.sqrt()]
            .iter()
            .map(|numerator| numerator / a)
            .filter(|s| (-slack..=1.0 + slack).contains(s))
            .map(|s| s.clamp(0.0, 1.0))
            .filter(|&s| other.reaches(self.at(s), tolerance))
            .collect()
    }

    /// Whether a point of its curve lies between its ends.
    fn reaches(&self, point: Point, tolerance: f64) -> bool {
        let slack = tolerance / self.chord();
        (-slack..=1.0 + slack).contains(&self.share_of(point))
    }

    /// Crossings of an arc with anything, by signs along it.
    fn arc_with(&self, other: &Self, tolerance: f64) -> Vec<f64> {
        if other.curve == PathCurve::Line {
            let found = other.line_with_ellipse(self, tolerance);
            return found
                .iter()
                .map(|&s| self.share_of(other.at(s)).clamp(0.0, 1.0))
                .collect();
        }
        const STEPS: u32 = 256;
        let level = |s: f64| other.curve.level(self.at(s));
        let mut found = Vec::new();
        for step in 0..STEPS {
            let (mut low, mut high) = (
                f64::from(step) / f64::from(STEPS),
                f64::from(step + 1) / f64::from(STEPS),
            );
            if (level(low) < 0.0) == (level(high) < 0.0) {
                continue;
            }
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if (level(low) < 0.0) == (level(middle) < 0.0) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            if other.reaches(self.at(low), tolerance) {
                found.push(low);
            }
        }
        found
    }
}
