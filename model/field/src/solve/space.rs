//! Unknowns of a mesh, and their numbering.

use std::collections::HashMap;

use super::cholesky::Element;
use super::reference::Reference;
use crate::element::Basis;
use crate::element::basis::BasisValues;
use crate::element::shape::Placed;
use crate::element::{quadrature, shape};
use crate::geometry::Point;
use crate::geometry::path::PathCurve;
use crate::mesh::{Mesh, Triangle, ascending};

/// A mesh with an element order: its unknowns, and data that every integral uses.
#[derive(Clone, Debug)]
pub struct Space {
    /// The triangulation.
    pub mesh: Mesh,
    /// The polynomial basis.
    pub basis: Basis,
    /// Numbers of the unknowns of each triangle.
    pub unknowns: Vec<Vec<u32>>,
    /// Number of unknowns.
    pub count: usize,
    /// Positions of the nodes of each triangle.
    pub nodes: Vec<Vec<Point>>,
    /// Whether all edges of each triangle are straight.
    pub(super) straight: Vec<bool>,
    /// Points of integration, with weights for a triangle of area 1.
    pub samples: Vec<(BasisValues, f64)>,
    /// Integrals for straight triangles of linear material.
    pub(super) reference: Reference,
}

impl Space {
    /// Numbers the unknowns of a mesh.
    #[must_use]
    pub fn new(mesh: Mesh, order: u32) -> Self {
        let basis = Basis::new(order);
        let inner = basis.order() as usize - 1;
        let mut count = mesh.vertices.len();
        let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
        let mut unknowns = Vec::with_capacity(mesh.triangles.len());
        for triangle in &mesh.triangles {
            let mut numbers: Vec<u32> = triangle.vertices.to_vec();
            for edge in triangle.edges() {
                let first = *edges.entry(ascending(edge)).or_insert_with(|| {
                    count += inner;
                    count - inner
                });
                let along = (first..first + inner).map(number);
                if edge[0] < edge[1] {
                    numbers.extend(along);
                } else {
                    numbers.extend(along.rev());
                }
            }
            numbers.extend((count..count + basis.interior()).map(number));
            count += basis.interior();
            unknowns.push(numbers);
        }
        let nodes = mesh
            .triangles
            .iter()
            .map(|t| shape::nodes(&mesh, t, &basis))
            .collect();
        let is_straight = |triangle: &Triangle| {
            let mut edges = triangle.edges().into_iter();
            edges.all(|edge| mesh.curve(edge) == PathCurve::Line)
        };
        let straight = mesh.triangles.iter().map(is_straight).collect();
        let samples = |count: usize| -> Vec<(BasisValues, f64)> {
            let points = quadrature::triangle(count).into_iter();
            points
                .map(|(at, weight)| (basis.sample(at), weight))
                .collect()
        };
        // In a straight triangle of linear material the integrand is of degree 2p + 1. Curved
        // triangles and ν(B) get one point more.
        let order = basis.order() as usize;
        let reference = Reference::of(&basis, &samples(order + 1));
        let samples = samples(order + 2);
        Self {
            mesh,
            basis,
            unknowns,
            count,
            nodes,
            straight,
            samples,
            reference,
        }
    }

    /// Places a sampled point in a triangle.
    pub(super) fn place(&self, triangle: usize, sample: &BasisValues, placed: &mut Placed) {
        let Some(nodes) = self.nodes.get(triangle) else {
            return;
        };
        match nodes[..] {
            [a, b, c, ..] if self.is_straight(triangle) => {
                placed.fill_straight([a, b, c], sample);
            }
            _ => placed.fill(nodes, sample),
        }
    }

    /// Whether all edges of a triangle are straight.
    pub(super) fn is_straight(&self, triangle: usize) -> bool {
        self.straight
            .get(triangle)
            .is_some_and(|straight| *straight)
    }

    /// A triangle as an element for the elimination.
    pub(super) fn element(&self, triangle: usize) -> Option<Element<'_>> {
        let (unknowns, nodes) = (self.unknowns.get(triangle)?, self.nodes.get(triangle)?);
        // The first three nodes of a triangle are its vertices.
        let centre = nodes.iter().take(3).fold([0.0; 2], |[r, x], node| {
            [r + node[0] / 3.0, x + node[1] / 3.0]
        });
        Some(Element { unknowns, centre })
    }
}

fn number(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}
