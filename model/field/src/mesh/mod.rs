//! Triangulations of the half-plane, including the exterior.
//!
//! Inside a half-disc of radius R about the design, triangles are at their true positions. The
//! space outside is a second half-disc of the same size, with infinity at its centre: a point at
//! the distance ρ from the centre is mapped to the distance R²/ρ. Both half-discs share the
//! vertices on the arc.

mod circle;
mod domain;
mod plan;
mod quality;
mod refine;
mod triangulate;

use std::collections::HashMap;

pub use circle::Circle;
pub use domain::build;
pub use plan::{MeshLines, Region, Zone};

use crate::geometry::Point;
use crate::geometry::path::PathCurve;

/// Distance from corners of permeable parts below which no accuracy is stated, m: the field is
/// singular there.
pub const CORNER_M: f64 = 1e-4;

/// A triangulation.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Positions of the vertices; for the exterior, the mapped positions.
    pub vertices: Vec<Point>,
    /// Triangles.
    pub triangles: Vec<Triangle>,
    /// Curves of the curved edges; the key is the edge's vertices in ascending order.
    pub bent: HashMap<[u32; 2], PathCurve>,
    /// Edges on the arc between inside and outside, with vertices in ascending order.
    pub arc: Vec<[u32; 2]>,
    /// Vertices at corners of permeable parts, where the field is singular.
    pub corners: Vec<u32>,
    /// The circle that contains all parts.
    pub circle: Circle,
    /// Regions of the triangles.
    pub regions: Vec<Region>,
}

/// A triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Vertices in counterclockwise order. The edge from the first to the second is the one that is
    /// halved next.
    pub vertices: [u32; 3],
    /// Index into [`Mesh::regions`].
    pub region: u32,
}

impl Triangle {
    /// The three edges, each from one vertex to the next.
    #[must_use]
    pub fn edges(&self) -> [[u32; 2]; 3] {
        let [a, b, c] = self.vertices;
        [[a, b], [b, c], [c, a]]
    }
}

/// An edge as its vertices in ascending order.
#[must_use]
pub fn ascending([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl Mesh {
    /// Position of a vertex.
    #[must_use]
    pub fn position(&self, vertex: u32) -> Point {
        self.vertices
            .get(vertex as usize)
            .copied()
            .unwrap_or([0.0; 2])
    }

    /// Positions of a triangle's vertices.
    #[must_use]
    pub fn corners_of(&self, triangle: &Triangle) -> [Point; 3] {
        triangle.vertices.map(|vertex| self.position(vertex))
    }

    /// The region of a triangle.
    #[must_use]
    pub fn region(&self, triangle: &Triangle) -> Region {
        let region = self.regions.get(triangle.region as usize);
        region.copied().unwrap_or(Region::EXTERIOR)
    }

    /// Curve of an edge; usually a straight line.
    #[must_use]
    pub fn curve(&self, edge: [u32; 2]) -> PathCurve {
        self.bent
            .get(&ascending(edge))
            .copied()
            .unwrap_or(PathCurve::Line)
    }
}

/// Reason why triangulation failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshError(pub String);

impl core::fmt::Display for MeshError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for MeshError {}
