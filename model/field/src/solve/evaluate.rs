//! The field at any point of space.

use super::assembly::{Level, combine};
use crate::element::Basis;
use crate::element::shape::Placed;
use crate::geometry::{Point, length};

/// The field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldAt {
    /// B_r and B_x, T.
    pub b: [f64; 2],
    /// A_φ/r, T; multiplied by 2π r² it is the flux through the circle about the axis.
    pub w: f64,
    /// Region of the triangle that contains the point.
    pub region: u32,
}

impl FieldAt {
    /// |B|, T.
    #[must_use]
    pub fn size(&self) -> f64 {
        length(self.b)
    }
}

/// Finds the triangle that contains a point.
pub struct Locator<'l> {
    level: &'l Level,
    w: &'l [f64],
    /// Indices of the triangles in each cell of a square grid: inside the circle, then outside.
    cells: [Vec<Vec<u32>>; 2],
}

/// Number of cells along the circle's diameter. With 64, a cell usually contains a few triangles.
const CELLS: usize = 64;
/// Distance outside of a triangle, in barycentric coordinates, up to which a point still counts as
/// inside of it.
const SLACK: f64 = 1e-9;

impl<'l> Locator<'l> {
    /// Prepares the search for the triangles of a solution.
    #[must_use]
    pub fn new(level: &'l Level, w: &'l [f64]) -> Self {
        let mut locator = Self {
            level,
            w,
            cells: [
                vec![Vec::new(); CELLS * CELLS],
                vec![Vec::new(); CELLS * CELLS],
            ],
        };
        let mesh = &level.space.mesh;
        for ((triangle, nodes), number) in
            mesh.triangles.iter().zip(&level.space.nodes).zip(0_u32..)
        {
            let mut low = [usize::MAX; 2];
            let mut high = [0; 2];
            let corners = mesh.corners_of(triangle);
            // The polygon of nodes on a curved edge falls slightly short of the curve: hence the margin.
            let margin = if nodes.len() > 3 {
                0.02 * extent(&corners)
            } else {
                0.0
            };
            for node in nodes {
                for side in [-margin, margin] {
                    let cell = locator.cell([node[0] + side, node[1] + side]);
                    for axis in 0..2 {
                        low[axis] = low[axis].min(cell[axis]);
                        high[axis] = high[axis].max(cell[axis]);
                    }
                }
            }
            let exterior = usize::from(mesh.region(triangle).exterior);
            for column in low[0]..=high[0] {
                for row in low[1]..=high[1] {
                    let cells = locator.cells.get_mut(exterior);
                    if let Some(cell) = cells.and_then(|cells| cells.get_mut(row * CELLS + column))
                    {
                        cell.push(number);
                    }
                }
            }
        }
        locator
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the grid"
    )]
    fn cell(&self, [r, x]: Point) -> [usize; 2] {
        let circle = &self.level.space.mesh.circle;
        let size = 2.0 * circle.radius / CELLS as f64;
        let last = (CELLS - 1) as f64;
        let clamp = |value: f64| (value / size).floor().clamp(0.0, last) as usize;
        [clamp(r), clamp(x - circle.centre_x + circle.radius)]
    }

    /// The field at a point with r ≥ 0, including the background field.
    #[must_use]
    pub fn at(&self, point: Point) -> FieldAt {
        let circle = self.level.space.mesh.circle;
        let background = self.level.background_t;
        let distance = circle.distance(point);
        if distance <= circle.radius
            && let Some((value, slope, region)) = self.value(point, 0)
        {
            return FieldAt {
                b: [
                    -point[0] * slope[1],
                    2.0 * value + point[0] * slope[0] + background,
                ],
                w: value + 0.5 * background,
                region,
            };
        }
        self.outside(point, distance.max(circle.radius))
    }

    /// Field outside of the circle by Kelvin's transform: w(p) = (R/ρ)³ w″(c + R² (p − c)/ρ²).
    fn outside(&self, point: Point, distance: f64) -> FieldAt {
        let circle = self.level.space.mesh.circle;
        let background = self.level.background_t;
        let d = [point[0], point[1] - circle.centre_x];
        let ratio = circle.radius / distance;
        let image = [d[0] * ratio * ratio, circle.centre_x + d[1] * ratio * ratio];
        let (value, slope, region) = self.value(image, 1).unwrap_or((0.0, [0.0; 2], 0));
        let cube = ratio.powi(3);
        let radial = (d[0] * slope[0] + d[1] * slope[1]) / (distance * distance);
        let gradient = [0, 1].map(|axis: usize| {
            let turned = slope[axis] - 2.0 * d[axis] * radial;
            cube * (ratio * ratio * turned - 3.0 * d[axis] / (distance * distance) * value)
        });
        let w = cube * value;
        FieldAt {
            b: [
                -point[0] * gradient[1],
                2.0 * w + point[0] * gradient[0] + background,
            ],
            w: w + 0.5 * background,
            region,
        }
    }

    fn value(&self, point: Point, exterior: usize) -> Option<(f64, [f64; 2], u32)> {
        let (number, at) = self.find(point, exterior)?;
        let space = &self.level.space;
        let nodes = space.nodes.get(number)?;
        let unknowns = space.unknowns.get(number)?;
        let region = space.mesh.triangles.get(number)?.region;
        let (value, slope) = value_at(&space.basis, nodes, unknowns, self.w, at);
        Some((value, slope, region))
    }

    /// Index of the triangle that contains a point inside the circle.
    pub(crate) fn triangle(&self, point: Point) -> Option<usize> {
        let inside =
            self.level.space.mesh.circle.distance(point) <= self.level.space.mesh.circle.radius;
        let found = inside.then(|| self.find(point, 0)).flatten();
        found.map(|(number, _)| number)
    }

    /// Index of the triangle that contains a point, and the point's barycentric coordinates in it.
    fn find(&self, point: Point, exterior: usize) -> Option<(usize, [f64; 3])> {
        let [column, row] = self.cell(point);
        let cell = self.cells.get(exterior)?.get(row * CELLS + column)?;
        let mut best: Option<(f64, usize, [f64; 3])> = None;
        for &number in cell {
            let number = number as usize;
            let nodes = self.level.space.nodes.get(number)?;
            let at = if self.level.space.is_straight(number) {
                straight(nodes, point)
            } else {
                invert(&self.level.space.basis, nodes, point)
            };
            let inside = at.iter().copied().fold(f64::INFINITY, f64::min);
            if inside.is_finite() && best.is_none_or(|(known, _, _)| inside > known) {
                best = Some((inside, number, at));
                if inside >= -SLACK {
                    break;
                }
            }
        }
        best.map(|(_, number, at)| (number, at))
    }
}

/// Value and gradient at a point of a triangle, given by its barycentric coordinates.
pub(super) fn value_at(
    basis: &Basis,
    nodes: &[Point],
    unknowns: &[u32],
    w: &[f64],
    at: [f64; 3],
) -> (f64, [f64; 2]) {
    let sample = basis.sample(at);
    let mut placed = Placed::new(basis);
    placed.fill(nodes, &sample);
    combine(w, unknowns, &sample, &placed)
}

fn extent(corners: &[Point; 3]) -> f64 {
    let side = |axis: usize| {
        let values = corners.iter().map(|corner| corner[axis]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    side(0).max(side(1))
}

/// Barycentric coordinates of a point, by Newton's method; a straight triangle needs only one step.
pub(super) fn invert(basis: &Basis, nodes: &[Point], point: Point) -> [f64; 3] {
    let mut at = straight(nodes, point);
    // Far outside of a triangle, its curved edges say nothing about the position.
    let order = basis.order() as usize;
    let bent = order > 1 && is_bent(basis, nodes);
    if !bent || at.iter().any(|&share| share < -0.5) {
        return at;
    }
    let mut placed = Placed::new(basis);
    for _ in 0..20 {
        let sample = basis.sample(at);
        placed.fill(nodes, &sample);
        let miss = [point[0] - placed.point[0], point[1] - placed.point[1]];
        let mut m = [[0.0; 2]; 2];
        for (node, slope) in nodes.iter().zip(&sample.slopes) {
            for axis in 0..2 {
                m[axis][0] += node[axis] * slope[0];
                m[axis][1] += node[axis] * slope[1];
            }
        }
        let step = [
            (m[1][1] * miss[0] - m[0][1] * miss[1]) / placed.jacobian,
            (m[0][0] * miss[1] - m[1][0] * miss[0]) / placed.jacobian,
        ];
        at = [at[0] - step[0] - step[1], at[1] + step[0], at[2] + step[1]];
        if step[0].abs() + step[1].abs() < 1e-14 {
            break;
        }
    }
    at
}

fn straight(nodes: &[Point], point: Point) -> [f64; 3] {
    let &[a, b, c, ..] = nodes else {
        return [f64::NAN; 3];
    };
    let cross = crate::geometry::cross;
    let whole = cross(a, b, c);
    let (second, third) = (cross(a, point, c) / whole, cross(a, b, point) / whole);
    [1.0 - second - third, second, third]
}

fn is_bent(basis: &Basis, nodes: &[Point]) -> bool {
    let &[a, b, c, ..] = nodes else {
        return false;
    };
    let size = extent(&[a, b, c]);
    basis.points().zip(nodes).any(|(at, node)| {
        let flat = [0, 1].map(|axis: usize| at[0] * a[axis] + at[1] * b[axis] + at[2] * c[axis]);
        crate::geometry::distance(flat, *node) > 1e-12 * size
    })
}
