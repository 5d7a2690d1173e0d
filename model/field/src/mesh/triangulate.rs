//! Delaunay refinement after Ruppert, with spade's constrained triangulation.
//!
//! A triangle with a small angle, or one that is too large, gets its circumcentre as a new vertex;
//! if that would be too close to a line, the line is halved instead, along its curve.

use std::collections::BTreeMap;

use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::MeshError;
use super::quality::{circumcircle, cross_each_other, sides};
use crate::geometry::path::PathCurve;
use crate::geometry::{Point, distance};

/// A line that the triangulation keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct KeptSegment {
    pub(super) curve: PathCurve,
    /// Whether it must not be divided further.
    pub(super) fixed: bool,
}

/// Requirements on the triangles of a mesh.
pub(super) struct QualityLimits<'w> {
    /// Largest circumradius at a position.
    pub(super) size: &'w dyn Fn(Point) -> f64,
    /// Largest ratio of circumradius to shortest side at a position.
    pub(super) slenderest: &'w dyn Fn(Point) -> f64,
    /// Length of a side below which nothing is divided, m.
    pub(super) shortest: f64,
}

/// Largest number of sweeps over the mesh. Each sweep halves the triangles that are too large; a
/// graded domain needs about 12.
const MOST_SWEEPS: usize = 60;
/// Largest number of vertices of a first triangulation that can be solved: there are twice as many
/// triangles, and nine times as many unknowns with cubic elements. The built-in designs need a
/// hundredth of it.
const MOST_VERTICES: usize = 40_000;

/// Vertices, triangles, and the segments of the lines that were followed.
pub(super) struct MeshTriangulation {
    pub(super) vertices: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) segments: BTreeMap<[u32; 2], KeptSegment>,
}

/// Triangulates the convex hull of `vertices`.
pub(super) fn triangulate(
    vertices: &[Point],
    segments: BTreeMap<[u32; 2], KeptSegment>,
    wish: &QualityLimits<'_>,
) -> Result<MeshTriangulation, MeshError> {
    let mut work = Work {
        delaunay: ConstrainedDelaunayTriangulation::new(),
        vertices: Vec::new(),
        segments: BTreeMap::new(),
    };
    let (vertices, segments) = straighten(vertices.to_vec(), segments, wish.shortest);
    for vertex in vertices {
        work.insert(vertex)?;
    }
    for (ends, segment) in segments {
        work.keep(ends, segment)?;
    }
    for _ in 0..MOST_SWEEPS {
        if work.sweep(wish)? == 0 {
            break;
        }
    }
    Ok(work.finish())
}

/// Halves arcs until each can be replaced by its chord: the arc is nearly flat, and no vertex lies
/// between arc and chord.
fn straighten(
    mut vertices: Vec<Point>,
    mut segments: BTreeMap<[u32; 2], KeptSegment>,
    shortest: f64,
) -> (Vec<Point>, BTreeMap<[u32; 2], KeptSegment>) {
    loop {
        let mut halved = BTreeMap::new();
        let before = vertices.len();
        for (ends, segment) in segments {
            let arc = Arc::of(&vertices, ends, &segment);
            if segment.fixed || arc.is_shorter(shortest) || arc.is_straight(&vertices) {
                halved.insert(ends, segment);
                continue;
            }
            let number = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
            vertices.push(arc.middle);
            // The newest vertex has the greatest index, so the two ends are in ascending order.
            halved.extend(ends.map(|end| ([end, number], segment)));
        }
        if vertices.len() == before {
            return (vertices, halved);
        }
        segments = halved;
    }
}

/// A segment's ends and the middle of its curve.
struct Arc {
    ends: [Point; 2],
    middle: Point,
}

impl Arc {
    fn of(vertices: &[Point], ends: [u32; 2], segment: &KeptSegment) -> Self {
        let [a, b] = ends.map(|end| vertices.get(end as usize).copied().unwrap_or([0.0; 2]));
        Self {
            ends: [a, b],
            middle: segment.curve.between(a, b, 0.5),
        }
    }

    /// Whether half of the arc is at most `shortest` long, m.
    fn is_shorter(&self, shortest: f64) -> bool {
        distance(self.ends[0], self.middle) <= shortest
    }

    /// Whether the chord can replace the arc.
    fn is_straight(&self, vertices: &[Point]) -> bool {
        // Largest sagitta of a flat arc as a fraction of its chord: 0.05 is an arc of 23 degrees.
        const FLAT: f64 = 0.05;
        // Sagitta as a fraction of the chord that is below the resolution of coordinates in metres.
        const STRAIGHT: f64 = 1e-12;
        let [a, b] = self.ends;
        let foot = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let sagitta = distance(self.middle, foot) / distance(a, b);
        // Intersection of the tangents at the arc's ends: the arc lies in the triangle of its ends
        // and this point.
        let tip = [0, 1].map(|axis| 2.0 * self.middle[axis] - foot[axis]);
        sagitta <= STRAIGHT
            || (sagitta <= FLAT
                && !vertices
                    .iter()
                    .any(|vertex| ![a, b].contains(vertex) && is_within([a, tip, b], *vertex)))
    }
}

/// Whether a point lies within a triangle, or on its edge.
fn is_within([a, b, c]: [Point; 3], point: Point) -> bool {
    let side = |from: Point, to: Point| {
        (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0])
    };
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

struct Work {
    delaunay: ConstrainedDelaunayTriangulation<Point2<f64>>,
    vertices: Vec<Point>,
    segments: BTreeMap<[u32; 2], KeptSegment>,
}

fn handle(vertex: u32) -> FixedVertexHandle {
    FixedVertexHandle::from_index(vertex as usize)
}

impl Work {
    fn at(&self, vertex: u32) -> Point {
        self.vertices
            .get(vertex as usize)
            .copied()
            .unwrap_or([0.0; 2])
    }

    fn insert(&mut self, point: Point) -> Result<u32, MeshError> {
        if self.vertices.len() >= MOST_VERTICES {
            return Err(MeshError(format!(
                "the geometry asks for more than {MOST_VERTICES} vertices: its smallest detail is too small for its size"
            )));
        }
        let inserted = self.delaunay.insert(Point2::new(point[0], point[1]));
        let index = inserted
            .map_err(|error| MeshError(error.to_string()))?
            .index();
        if index != self.vertices.len() {
            return Err(MeshError(format!("two vertices coincide at {point:?} m")));
        }
        self.vertices.push(point);
        u32::try_from(index).map_err(|error| MeshError(error.to_string()))
    }

    fn keep(&mut self, [a, b]: [u32; 2], segment: KeptSegment) -> Result<(), MeshError> {
        if a == b || !self.delaunay.can_add_constraint(handle(a), handle(b)) {
            return Err(self.touching(a, b));
        }
        self.delaunay.add_constraint(handle(a), handle(b));
        if !self.delaunay.exists_constraint(handle(a), handle(b)) {
            // A vertex lies on the segment.
            return Err(self.touching(a, b));
        }
        self.segments.insert([a.min(b), a.max(b)], segment);
        Ok(())
    }

    /// Error for a curve that touches a line without crossing it: the gap between them ends in an
    /// angle of zero.
    fn touching(&self, a: u32, b: u32) -> MeshError {
        let [r_mm, x_mm] = [0, 1].map(|axis| 500.0 * (self.at(a)[axis] + self.at(b)[axis]));
        MeshError(format!(
            "two outlines, or an outline and the edge of the core (its whole, three quarters and half of its radius), touch near r = {r_mm:.4} mm, x = {x_mm:.4} mm without crossing: change one of them by 0.01 mm or more"
        ))
    }

    /// Halves a segment along its curve.
    fn halve(&mut self, [a, b]: [u32; 2]) -> Result<(), MeshError> {
        let Some(segment) = self.segments.remove(&[a, b]) else {
            return Ok(());
        };
        let edge = self.delaunay.get_edge_from_neighbors(handle(a), handle(b));
        if let Some(edge) = edge.map(|edge| edge.as_undirected().fix()) {
            self.delaunay.remove_constraint_edge(edge);
        }
        let middle = self.insert(segment.curve.between(self.at(a), self.at(b), 0.5))?;
        self.keep([a, middle], segment)?;
        self.keep([middle, b], segment)
    }

    /// Improves every triangle that is bad when the sweep starts; returns the number of changes.
    fn sweep(&mut self, wish: &QualityLimits<'_>) -> Result<usize, MeshError> {
        let bad: Vec<[u32; 3]> = self
            .triangles()
            .into_iter()
            .filter(|triangle| self.is_bad(triangle, wish))
            .collect();
        let mut changes = 0;
        for triangle in bad {
            if self.exists(triangle) && self.improve(triangle, wish)? {
                changes += 1;
            }
        }
        Ok(changes)
    }

    fn triangles(&self) -> Vec<[u32; 3]> {
        let faces = self.delaunay.inner_faces();
        #[allow(clippy::cast_possible_truncation, reason = "bounded by MOST_VERTICES")]
        let triangles = faces.map(|face| face.vertices().map(|vertex| vertex.index() as u32));
        triangles.collect()
    }

    fn exists(&self, [a, b, c]: [u32; 3]) -> bool {
        let edge = self.delaunay.get_edge_from_neighbors(handle(a), handle(b));
        edge.is_some_and(|edge| edge.next().to().fix() == handle(c))
    }

    fn is_bad(&self, triangle: &[u32; 3], wish: &QualityLimits<'_>) -> bool {
        let corners = triangle.map(|vertex| self.at(vertex));
        let centroid = centroid(corners);
        let shortest = sides(corners).into_iter().fold(f64::INFINITY, f64::min);
        let (_, radius) = circumcircle(corners);
        let large = radius > (wish.size)(centroid);
        let slender = radius > (wish.slenderest)(centroid) * shortest && shortest > wish.shortest;
        large || slender
    }

    fn improve(&mut self, triangle: [u32; 3], wish: &QualityLimits<'_>) -> Result<bool, MeshError> {
        let corners = triangle.map(|vertex| self.at(vertex));
        let (centre, _) = circumcircle(corners);
        if let Some(ends) = self.in_the_way(centroid(corners), centre) {
            let [a, b] = ends.map(|end| self.at(end));
            let fixed = self.segments.get(&ends).is_none_or(|segment| segment.fixed);
            if fixed || distance(a, b) < 2.0 * wish.shortest {
                return Ok(false);
            }
            self.halve(ends)?;
        } else {
            self.insert(centre)?;
        }
        Ok(true)
    }

    /// The segment between `from` and `to` that is nearest to `from`; if there is none, a segment
    /// whose diametral circle contains `to`.
    fn in_the_way(&self, from: Point, to: Point) -> Option<[u32; 2]> {
        let mut crossed: Option<([u32; 2], f64)> = None;
        let mut encroached = None;
        let square = |p: Point, q: Point| (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
        let reach = square(from, to);
        for &ends in self.segments.keys() {
            let [a, b] = ends.map(|end| self.at(end));
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            // Most segments are far from both points: this test without a square root takes a tenth
            // of the time.
            let (half, apart) = (0.25 * square(a, b), square(to, middle));
            if apart > 2.0 * (half + reach) {
                continue;
            }
            if cross_each_other(from, to, a, b) {
                let near = distance(from, middle);
                if crossed.is_none_or(|(_, least)| near < least) {
                    crossed = Some((ends, near));
                }
            } else if apart < half {
                encroached = Some(ends);
            }
        }
        crossed.map(|(ends, _)| ends).or(encroached)
    }

    fn finish(self) -> MeshTriangulation {
        let triangles = self.triangles();
        MeshTriangulation {
            vertices: self.vertices,
            triangles,
            segments: self.segments,
        }
    }
}

pub(super) fn centroid([a, b, c]: [Point; 3]) -> Point {
    [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0]
}
