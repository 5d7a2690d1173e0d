//! Outlines of parts.

use core::f64::consts::{FRAC_PI_2, TAU};

use super::path::{Path, PathCurve};
use super::{Point, cross, distance};

/// An outline in the half-plane; the body results from revolving it about the axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A polygon; its last corner is joined to the first.
    Polygon(Vec<Point>),
    /// Lines and arcs of less than half a circle, end to end; the last one ends where the first
    /// starts.
    Outline(Vec<Path>),
    /// A spheroid with its centre on the axis.
    Spheroid {
        /// Position of the centre on the axis, m.
        centre_x_m: f64,
        /// Semi-axis across the axis, m.
        semi_r_m: f64,
        /// Semi-axis along the axis, m.
        semi_x_m: f64,
    },
}

impl Shape {
    /// A rectangle.
    #[must_use]
    pub fn rectangle(r_m: [f64; 2], x_m: [f64; 2]) -> Self {
        let [r0, r1] = r_m;
        let [x0, x1] = x_m;
        Self::Polygon(vec![[r0, x0], [r1, x0], [r1, x1], [r0, x1]])
    }

    /// Whether a point lies inside the outline. For a point on the outline the result may be
    /// either.
    #[must_use]
    pub fn contains(&self, [r, x]: Point) -> bool {
        match self {
            Self::Polygon(corners) => {
                let mut inside = false;
                for ([r0, x0], [r1, x1]) in edges(corners) {
                    if (x0 > x) != (x1 > x) && r < r0 + (x - x0) / (x1 - x0) * (r1 - r0) {
                        inside = !inside;
                    }
                }
                inside
            }
            Self::Outline(paths) => {
                // Inside the polygon of all chords, corrected by the area between each arc and its
                // chord.
                let chords = Self::Polygon(paths.iter().map(|path| path.from).collect());
                let bulges = paths.iter().filter(|path| path.bulge_contains([r, x]));
                chords.contains([r, x]) != (bulges.count() % 2 == 1)
            }
            Self::Spheroid {
                centre_x_m,
                semi_r_m,
                semi_x_m,
            } => (r / semi_r_m).powi(2) + ((x - centre_x_m) / semi_x_m).powi(2) < 1.0,
        }
    }

    /// Paths of the outline, without those on the axis.
    #[must_use]
    pub fn paths(&self) -> Vec<Path> {
        match self {
            Self::Polygon(corners) => edges(corners)
                .filter(|(a, b)| a[0] > 0.0 || b[0] > 0.0)
                .map(|(a, b)| Path::line(a, b))
                .collect(),
            Self::Outline(paths) => {
                let on_axis = |path: &Path| {
                    path.curve == PathCurve::Line && path.from[0] == 0.0 && path.to[0] == 0.0
                };
                paths
                    .iter()
                    .filter(|path| !on_axis(path))
                    .copied()
                    .collect()
            }
            Self::Spheroid {
                centre_x_m,
                semi_r_m,
                semi_x_m,
            } => {
                let curve = PathCurve::Ellipse {
                    centre: [0.0, *centre_x_m],
                    semi_r: *semi_r_m,
                    semi_x: *semi_x_m,
                };
                vec![Path::arc(curve, -FRAC_PI_2, FRAC_PI_2)]
            }
        }
    }

    /// Points that include the extreme positions of the outline in r and in x.
    #[must_use]
    pub fn extremes(&self) -> Vec<Point> {
        match self {
            Self::Polygon(corners) => corners.clone(),
            Self::Outline(paths) => {
                let middle = paths.iter().map(|path| path.at(0.5));
                middle
                    .chain(paths.iter().flat_map(Path::extremes))
                    .collect()
            }
            Self::Spheroid {
                centre_x_m,
                semi_r_m,
                semi_x_m,
            } => (0..16)
                .map(|k| f64::from(k) / 16.0 * TAU)
                .map(|t| [semi_r_m * t.cos().abs(), centre_x_m + semi_x_m * t.sin()])
                .collect(),
        }
    }

    /// Least distance of the corners of each of the two shapes to the outline of the other, m.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        let mut least = f64::INFINITY;
        for (from, to) in [(self, other), (other, self)] {
            let paths = to.paths();
            for corner in from.extremes() {
                for path in &paths {
                    let share = path.share_of(corner).clamp(0.0, 1.0);
                    least = least.min(distance(corner, path.at(share)));
                }
            }
        }
        least
    }

    /// Area enclosed in the half-plane, m².
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        match self {
            Self::Polygon(corners) => {
                let twice: f64 = edges(corners).map(|(a, b)| cross([0.0; 2], a, b)).sum();
                0.5 * twice.abs()
            }
            Self::Outline(paths) => {
                let twice = |path: &Path| cross([0.0; 2], path.from, path.to) + path.bulge_area();
                0.5 * paths.iter().map(twice).sum::<f64>().abs()
            }
            Self::Spheroid {
                semi_r_m, semi_x_m, ..
            } => FRAC_PI_2 * semi_r_m * semi_x_m,
        }
    }
}

/// The sides of a closed polygon.
pub(crate) fn edges(corners: &[Point]) -> impl Iterator<Item = (Point, Point)> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().copied().zip(next.copied())
}
