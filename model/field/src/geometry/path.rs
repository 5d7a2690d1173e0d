//! Straight lines and elliptic arcs, and their intersections.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use super::{Point, cross, distance};

/// Curve on which a path lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathCurve {
    /// A straight line.
    Line,
    /// An ellipse: r = centre_r + semi_r cos t, x = centre_x + semi_x sin t. A path between two of
    /// its points takes the shorter way; if both are on the axis, it takes the half in r > 0.
    Ellipse {
        /// Position of the centre.
        centre: Point,
        /// Semi-axis in the direction of r.
        semi_r: f64,
        /// Semi-axis in the direction of x.
        semi_x: f64,
    },
}

impl PathCurve {
    /// The point of an ellipse at the angle `t`; `None` for a line.
    fn at(&self, t: f64) -> Option<Point> {
        match *self {
            Self::Line => None,
            Self::Ellipse {
                centre,
                semi_r,
                semi_x,
            } => Some([centre[0] + semi_r * t.cos(), centre[1] + semi_x * t.sin()]),
        }
    }

    /// Angle t of a point on the ellipse, from −π to π.
    fn angle(&self, [r, x]: Point) -> f64 {
        match *self {
            Self::Line => 0.0,
            Self::Ellipse {
                centre,
                semi_r,
                semi_x,
            } => ((x - centre[1]) / semi_x).atan2((r - centre[0]) / semi_r),
        }
    }

    /// Sign of a point's position: negative inside the ellipse, positive outside.
    fn level(&self, [r, x]: Point) -> f64 {
        match *self {
            Self::Line => 1.0,
            Self::Ellipse {
                centre,
                semi_r,
                semi_x,
            } => ((r - centre[0]) / semi_r).powi(2) + ((x - centre[1]) / semi_x).powi(2) - 1.0,
        }
    }

    /// Angle from one point to another by the shorter way.
    fn turn(&self, from: Point, to: Point) -> f64 {
        let turn = self.angle(to) - self.angle(from);
        if turn > PI {
            turn - TAU
        } else if turn < -PI {
            turn + TAU
        } else {
            turn
        }
    }

    /// Whether two curves are equal within the tolerance: arcs of one circle may have been computed
    /// from different points.
    #[must_use]
    pub fn coincides(&self, other: &Self, tolerance: f64) -> bool {
        match (*self, *other) {
            (Self::Line, Self::Line) => true,
            (
                Self::Ellipse {
                    centre,
                    semi_r,
                    semi_x,
                },
                Self::Ellipse {
                    centre: other_centre,
                    semi_r: other_r,
                    semi_x: other_x,
                },
            ) => {
                distance(centre, other_centre) <= tolerance
                    && (semi_r - other_r).abs() <= tolerance
                    && (semi_x - other_x).abs() <= tolerance
            }
            _ => false,
        }
    }

    /// The point on the curve at the fraction `s` of the way from `a` to `b`, two points of the
    /// curve.
    #[must_use]
    pub fn between(&self, a: Point, b: Point, s: f64) -> Point {
        match self.at(self.angle(a) + s * self.turn(a, b)) {
            Some(point) if s > 0.0 && s < 1.0 => point,
            _ => [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])],
        }
    }
}

/// A piece of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Curve.
    pub curve: PathCurve,
    /// Start.
    pub from: Point,
    /// End.
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

    /// The arc of a circle from one point through another to a third, as paths of at most a quarter
    /// of the circle each; `None` if the three points lie on a line.
    #[must_use]
    pub fn arc_through(from: Point, through: Point, to: Point) -> Option<Vec<Self>> {
        let curve = circle_through(from, through, to)?;
        let mut turn = curve.turn(from, to);
        if cross(from, through, to) > 0.0 {
            turn = turn.rem_euclid(TAU);
        } else {
            turn = -(-turn).rem_euclid(TAU);
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "1 to 4"
        )]
        let count = (turn.abs() / FRAC_PI_2 - 1e-9).ceil().clamp(1.0, 4.0) as u32;
        let start = curve.angle(from);
        let stop = |k: u32| match k {
            0 => Some(from),
            k if k == count => Some(to),
            k => curve.at(start + turn * f64::from(k) / f64::from(count)),
        };
        let piece = |k: u32| {
            Some(Self {
                curve,
                from: stop(k)?,
                to: stop(k + 1)?,
            })
        };
        (0..count).map(piece).collect()
    }

    /// The ends of the path and, for an arc, its extreme points in r and in x.
    #[must_use]
    pub fn extremes(&self) -> Vec<Point> {
        let mut points = vec![self.from, self.to];
        let quarters = (-2..2).filter_map(|quarter| self.curve.at(f64::from(quarter) * FRAC_PI_2));
        points.extend(quarters.filter(|&point| (0.0..=1.0).contains(&self.share_of(point))));
        points
    }

    /// Twice the signed area between the path and its chord.
    #[must_use]
    pub fn bulge_area(&self) -> f64 {
        match self.curve {
            PathCurve::Line => 0.0,
            PathCurve::Ellipse { semi_r, semi_x, .. } => {
                let turn = self.curve.turn(self.from, self.to);
                semi_r * semi_x * (turn - turn.sin())
            }
        }
    }

    /// Whether a point lies between the path and its chord.
    #[must_use]
    pub fn bulge_contains(&self, point: Point) -> bool {
        let side = |point: Point| cross(self.from, self.to, point) > 0.0;
        self.curve.level(point) < 0.0 && side(point) == side(self.at(0.5))
    }

    /// A path on an ellipse between two angles. Its ends are exactly on the axis if the angles are
    /// ±π/2.
    #[must_use]
    pub fn arc(curve: PathCurve, from: f64, to: f64) -> Self {
        let end = |t: f64| {
            let mut point = curve.at(t).unwrap_or([0.0; 2]);
            if t.abs() == FRAC_PI_2 {
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

    /// The point at the fraction `s` of the way along the path.
    #[must_use]
    pub fn at(&self, s: f64) -> Point {
        self.curve.between(self.from, self.to, s)
    }

    /// Distance of the path's ends.
    #[must_use]
    pub fn chord(&self) -> f64 {
        distance(self.from, self.to)
    }

    /// Positions along this path, as fractions from 0 to 1, at which `other` meets it; `tolerance`
    /// is a length.
    #[must_use]
    pub fn meetings(&self, other: &Self, tolerance: f64) -> Vec<f64> {
        // If one path ends on the other, that end is the meeting. Crossings near it are dropped:
        // where curves touch tangentially, rounding makes them seem to cross nearby too, at a
        // distance of the square root of a rounding error.
        const SAME: f64 = 1e-6;
        let on = |path: &Self, end: Point| {
            let s = path.share_of(end).clamp(0.0, 1.0);
            (distance(path.at(s), end) <= tolerance).then_some(s)
        };
        let ends = [other.from, other.to];
        let own = [self.from, self.to];
        let own = own.into_iter().filter(|&end| on(other, end).is_some());
        let met = ends.into_iter().filter(|&end| on(self, end).is_some());
        let met: Vec<Point> = own.chain(met).collect();
        let mut found = match (self.curve, other.curve) {
            (PathCurve::Line, PathCurve::Line) => self.line_with_line(other, tolerance),
            (PathCurve::Line, _) => self.line_with_ellipse(other, tolerance),
            _ if self.curve.coincides(&other.curve, tolerance) => Vec::new(),
            _ => self.arc_with(other, tolerance),
        };
        let reach = SAME * self.chord().min(other.chord());
        found.retain(|&s| met.iter().all(|&end| distance(self.at(s), end) > reach));
        found.extend(ends.into_iter().filter_map(|end| on(self, end)));
        found
    }

    /// Position of a point on the path, as a fraction of the way from 0 to 1.
    #[must_use]
    pub fn share_of(&self, point: Point) -> f64 {
        if self.curve == PathCurve::Line {
            let d = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
            let p = [point[0] - self.from[0], point[1] - self.from[1]];
            (p[0] * d[0] + p[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])
        } else {
            self.curve.turn(self.from, point) / self.curve.turn(self.from, self.to)
        }
    }

    fn line_with_line(&self, other: &Self, tolerance: f64) -> Vec<f64> {
        let d = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        let e = [other.to[0] - other.from[0], other.to[1] - other.from[1]];
        let between = [other.from[0] - self.from[0], other.from[1] - self.from[1]];
        let turn = d[0] * e[1] - d[1] * e[0];
        // Parallel lines meet only at ends, which are found separately.
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
            centre,
            semi_r,
            semi_x,
        } = other.curve
        else {
            return Vec::new();
        };
        let [p, q] = [self.from, self.to]
            .map(|end| [(end[0] - centre[0]) / semi_r, (end[1] - centre[1]) / semi_x]);
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

    /// Whether a point of the path's curve lies between the path's ends.
    fn reaches(&self, point: Point, tolerance: f64) -> bool {
        let slack = tolerance / self.chord();
        (-slack..=1.0 + slack).contains(&self.share_of(point))
    }

    /// Crossings of this arc with any path, found by changes of sign along the arc.
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

/// The circle through three points; `None` if they lie on a line. The direction of the arc does not
/// matter.
fn circle_through(from: Point, through: Point, to: Point) -> Option<PathCurve> {
    // An arc whose sagitta is less than this fraction of its chord counts as a line: a hundredth of
    // a micrometre on 10 mm.
    const FLAT: f64 = 1e-6;
    let turned = (from[0], from[1]) > (to[0], to[1]);
    let (a, c) = if turned { (to, from) } else { (from, to) };
    let twice_area = cross(a, through, c);
    if twice_area.abs() <= FLAT * distance(a, c).powi(2) {
        return None;
    }
    let [p, q] = [through, c].map(|point| [point[0] - a[0], point[1] - a[1]]);
    let [pp, qq] = [p, q].map(|p| p[0] * p[0] + p[1] * p[1]);
    let to_centre = [
        (q[1] * pp - p[1] * qq) / (2.0 * twice_area),
        (p[0] * qq - q[0] * pp) / (2.0 * twice_area),
    ];
    let radius = to_centre[0].hypot(to_centre[1]);
    Some(PathCurve::Ellipse {
        centre: [a[0] + to_centre[0], a[1] + to_centre[1]],
        semi_r: radius,
        semi_x: radius,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fillet meets both of its sides at its ends only.
    #[test]
    fn tangents_meet_where_they_touch() {
        let low = Path::line([0.0, 0.0], [0.9, 0.0]);
        let side = Path::line([1.0, 0.1], [1.0, 1.0]);
        let place = 0.1 * 0.5_f64.sqrt();
        let arc = Path::arc_through(low.to, [0.9 + place, 0.1 - place], side.from);
        let arc = arc.expect("an arc")[0];
        for (line, end) in [(low, low.to), (side, side.from)] {
            for (one, other) in [(arc, line), (line, arc)] {
                let meetings = one.meetings(&other, 1e-9);
                assert!(!meetings.is_empty());
                for s in meetings {
                    assert!(distance(one.at(s), end) < 1e-12, "{s}");
                }
            }
        }
    }
}
