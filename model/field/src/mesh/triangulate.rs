//! Delaunay refinement after Ruppert, by spade's constrained triangulation.
//!
//! Triangles with a small angle, or too large, get their circumcentre as a new vertex; where that
//! would come too near a line, the line is halved instead, along its curve. Narrow rectangles are
//! exempt: they come divided across, and their sides stay as they are.

use std::collections::BTreeMap;

use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::MeshError;
use super::quality::{circumcircle, cross_each_other, sides};
use crate::geometry::path::Curve;
use crate::geometry::{Point, distance};

/// A line that the triangulation keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) curve: Curve,
    /// It may not be divided any further.
    pub(super) fixed: bool,
}

/// What triangles are good enough.
pub(super) struct Wish<'w> {
    /// Greatest circumradius about a place.
    pub(super) size: &'w dyn Fn(Point) -> f64,
    /// Places where any triangle is good enough.
    pub(super) exempt: &'w dyn Fn(Point) -> bool,
    /// Nothing is made shorter than this.
    pub(super) shortest: f64,
}

/// Circumradius over shortest side: 1.3 stands for a least angle of 22.6°, for which Ruppert's
/// method is known to end on straight lines.
const SLENDEREST: f64 = 1.3;
/// Each sweep halves what is too large; a graded domain needs about 12.
const MOST_SWEEPS: usize = 60;
/// More vertices than any first triangulation of a real design has.
const MOST_VERTICES: usize = 400_000;

/// Vertices, triangles and the lines that were kept.
pub(super) struct Outcome {
    pub(super) vertices: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) segments: BTreeMap<[u32; 2], Segment>,
}

/// Triangulates the convex hull of `vertices`.
pub(super) fn triangulate(
    vertices: &[Point],
    segments: BTreeMap<[u32; 2], Segment>,
    wish: &Wish<'_>,
) -> Result<Outcome, MeshError> {
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

/// Halves arcs until the chord of each stands for it.
fn straighten(
    mut vertices: Vec<Point>,
    segments: BTreeMap<[u32; 2], Segment>,
    shortest: f64,
) -> (Vec<Point>, BTreeMap<[u32; 2], Segment>) {
    // Sagitta over chord: 0.05 is an arc of 23 degrees.
    const FLAT: f64 = 0.05;
    let mut done = BTreeMap::new();
    let mut open: Vec<([u32; 2], Segment)> = segments.into_iter().collect();
    while let Some((ends, segment)) = open.pop() {
        let [a, b] = ends.map(|end| vertices.get(end as usize).copied().unwrap_or([0.0; 2]));
        let middle = segment.curve.between(a, b, 0.5);
        let sagitta = distance(middle, [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
        if segment.fixed || sagitta <= FLAT * distance(a, b) || distance(a, middle) <= shortest {
            done.insert([ends[0].min(ends[1]), ends[0].max(ends[1])], segment);
            continue;
        }
        let number = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        vertices.push(middle);
        open.extend(ends.map(|end| ([end, number], segment)));
    }
    (vertices, done)
}

struct Work {
    delaunay: ConstrainedDelaunayTriangulation<Point2<f64>>,
    vertices: Vec<Point>,
    segments: BTreeMap<[u32; 2], Segment>,
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

    fn keep(&mut self, [a, b]: [u32; 2], segment: Segment) -> Result<(), MeshError> {
        if a == b || !self.delaunay.can_add_constraint(handle(a), handle(b)) {
            return Err(MeshError(format!(
                "lines cross or nearly touch between {:?} and {:?} m: move them apart, or onto each other",
                self.at(a),
                self.at(b)
            )));
        }
        self.delaunay.add_constraint(handle(a), handle(b));
        if !self.delaunay.exists_constraint(handle(a), handle(b)) {
            // A vertex lies on the line.
            return Err(MeshError(format!(
                "a corner lies on the line from {:?} to {:?} m without dividing it",
                self.at(a),
                self.at(b)
            )));
        }
        self.segments.insert([a.min(b), a.max(b)], segment);
        Ok(())
    }

    /// Halves a line along its curve.
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

    /// Improves every triangle that is bad now; tells how many changes were made.
    fn sweep(&mut self, wish: &Wish<'_>) -> Result<usize, MeshError> {
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

    fn is_bad(&self, triangle: &[u32; 3], wish: &Wish<'_>) -> bool {
        let corners = triangle.map(|vertex| self.at(vertex));
        let centroid = centroid(corners);
        let shortest = sides(corners).into_iter().fold(f64::INFINITY, f64::min);
        let (_, radius) = circumcircle(corners);
        let large = radius > (wish.size)(centroid);
        let slender = radius > SLENDEREST * shortest && shortest > wish.shortest;
        (large || slender) && !(wish.exempt)(centroid)
    }

    fn improve(&mut self, triangle: [u32; 3], wish: &Wish<'_>) -> Result<bool, MeshError> {
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

    /// The line nearest to `from` between it and `to`, or one in whose circle `to` lies.
    fn in_the_way(&self, from: Point, to: Point) -> Option<[u32; 2]> {
        let mut crossed: Option<([u32; 2], f64)> = None;
        let mut encroached = None;
        for &ends in self.segments.keys() {
            let [a, b] = ends.map(|end| self.at(end));
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            if cross_each_other(from, to, a, b) {
                let near = distance(from, middle);
                if crossed.is_none_or(|(_, least)| near < least) {
                    crossed = Some((ends, near));
                }
            } else if distance(to, middle) < 0.5 * distance(a, b) {
                encroached = Some(ends);
            }
        }
        crossed.map(|(ends, _)| ends).or(encroached)
    }

    fn finish(self) -> Outcome {
        let triangles = self.triangles();
        Outcome {
            vertices: self.vertices,
            triangles,
            segments: self.segments,
        }
    }
}

pub(super) fn centroid([a, b, c]: [Point; 3]) -> Point {
    [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0]
}
