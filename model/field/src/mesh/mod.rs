//! Triangulations of the half-plane, with the exterior folded in.
//!
//! Inside a half-disc of radius R about the design, triangles lie where they are. All of space
//! beyond is a second half-disc of the same size, its centre standing for infinity: a point at the
//! distance ρ from the centre is drawn at R²/ρ. Both share the arc's vertices.

mod domain;
mod plan;
mod quality;
mod refine;
mod triangulate;

use std::collections::HashMap;

pub use domain::build;
pub use plan::{MeshLines, Region, Zone};

use crate::geometry::Point;
use crate::geometry::path::PathCurve;

/// About corners of permeable parts the field is singular: nearer than this no accuracy is stated, m.
pub const CORNER_M: f64 = 1e-4;

/// A triangulation.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Positions; those of the exterior in its own drawing.
    pub vertices: Vec<Point>,
    /// Triangles.
    pub triangles: Vec<Triangle>,
    /// Edges that are bent, by their vertices in ascending order.
    pub bent: HashMap<[u32; 2], PathCurve>,
    /// Edges on the arc that inside and outside share, ascending vertices.
    pub arc: Vec<[u32; 2]>,
    /// Vertices at which permeable parts have corners: the field is singular there.
    pub corners: Vec<u32>,
    /// The circle in which everything lies.
    pub circle: Circle,
    /// What the triangles belong to.
    pub regions: Vec<Region>,
}

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

/// A triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Vertices, turning left. The edge from the first to the second is halved next.
    pub vertices: [u32; 3],
    /// Index into [`Mesh::regions`].
    pub region: u32,
}

impl Triangle {
    /// Its edges, each from a vertex to the next.
    #[must_use]
    pub fn edges(&self) -> [[u32; 2]; 3] {
        let [a, b, c] = self.vertices;
        [[a, b], [b, c], [c, a]]
    }
}

/// An edge by its vertices in ascending order.
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

    /// The curve of an edge; a straight line for most.
    #[must_use]
    pub fn curve(&self, edge: [u32; 2]) -> PathCurve {
        self.bent
            .get(&ascending(edge))
            .copied()
            .unwrap_or(PathCurve::Line)
    }
}

/// Why no triangulation could be made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshError(pub String);

impl core::fmt::Display for MeshError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for MeshError {}
