//! Newest-vertex bisection: halves triangles, and those neighbours whose edges would otherwise not
//! match.
//!
//! Only finitely many shapes result from each triangle of the first mesh, so angles stay bounded
//! however often a triangle is halved.

use std::collections::HashMap;

use super::quality::sides;
use super::{Mesh, Triangle, ascending};
use crate::geometry::distance;

impl Mesh {
    /// Puts the vertices of every triangle in counterclockwise order, with its longest edge first.
    pub(super) fn orient(&mut self) {
        self.orient_from(0);
    }

    pub(super) fn orient_from(&mut self, first: usize) {
        for index in first..self.triangles.len() {
            let Some(&Triangle { vertices, region }) = self.triangles.get(index) else {
                continue;
            };
            let [a, b, c] = vertices;
            let lengths = sides(vertices.map(|vertex| self.position(vertex)));
            let vertices = if lengths[0] >= lengths[1] && lengths[0] >= lengths[2] {
                [a, b, c]
            } else if lengths[1] >= lengths[2] {
                [b, c, a]
            } else {
                [c, a, b]
            };
            if let Some(triangle) = self.triangles.get_mut(index) {
                *triangle = Triangle { vertices, region };
            }
        }
    }

    /// Halves the marked triangles, and others until all edges match. Returns, for each new
    /// triangle, the index of the old triangle that contains it.
    pub fn refine(&mut self, marked: &[bool]) -> Vec<usize> {
        let mut middles = self.edges_to_halve(marked);
        let mut edges: Vec<[u32; 2]> = middles.keys().copied().collect();
        edges.sort_unstable();
        for edge in edges {
            let middle = self.add_middle(edge);
            middles.insert(edge, middle);
        }
        let mut triangles = Vec::with_capacity(2 * self.triangles.len());
        let mut parents = Vec::with_capacity(2 * self.triangles.len());
        for (index, triangle) in self.triangles.iter().enumerate() {
            halve(triangle, &middles, &mut triangles);
            parents.resize(triangles.len(), index);
        }
        self.triangles = triangles;
        parents
    }

    /// Edges to halve: the first edges of the marked triangles and, until no more are added, the
    /// first edge of every triangle of which another edge is halved.
    fn edges_to_halve(&self, marked: &[bool]) -> HashMap<[u32; 2], u32> {
        let mut edges: HashMap<[u32; 2], u32> = HashMap::new();
        for (triangle, &marked) in self.triangles.iter().zip(marked) {
            if marked {
                edges.insert(ascending(triangle.edges()[0]), 0);
            }
        }
        loop {
            let before = edges.len();
            for triangle in &self.triangles {
                let [first, second, third] = triangle.edges().map(ascending);
                if edges.contains_key(&second) || edges.contains_key(&third) {
                    edges.insert(first, 0);
                }
            }
            if edges.len() == before {
                return edges;
            }
        }
    }

    fn add_middle(&mut self, edge: [u32; 2]) -> u32 {
        let [a, b] = edge.map(|vertex| self.position(vertex));
        let curve = self.curve(edge);
        let middle = u32::try_from(self.vertices.len()).unwrap_or(u32::MAX);
        self.vertices.push(curve.between(a, b, 0.5));
        let halves = edge.map(|end| ascending([end, middle]));
        if self.bent.remove(&edge).is_some() {
            for half in halves {
                self.bent.insert(half, curve);
            }
        }
        if let Some(place) = self.arc.iter().position(|&arc| arc == edge) {
            self.arc.swap_remove(place);
            self.arc.extend(halves);
        }
        middle
    }

    /// Halves the triangles at singular corners until their longest side is at most `size`.
    pub fn refine_corners(&mut self, size: f64) {
        self.refine_long(size, |mesh, triangle| {
            let mut vertices = triangle.vertices.iter();
            vertices.any(|vertex| mesh.corners.contains(vertex))
        });
    }

    /// Halves the triangles on a part of the axis until their longest side is at most `size`.
    pub fn refine_axis(&mut self, [from, to]: [f64; 2], size: f64) {
        self.refine_long(size, |mesh, triangle| {
            let places = mesh.corners_of(triangle);
            !mesh.region(triangle).exterior
                && places.iter().any(|place| place[0] == 0.0)
                && places.iter().any(|place| place[1] >= from)
                && places.iter().any(|place| place[1] <= to)
        });
    }

    /// Halves some triangles until their longest side is at most `size`.
    fn refine_long(&mut self, size: f64, counts: impl Fn(&Self, &Triangle) -> bool) {
        const MOST: usize = 60;
        for _ in 0..MOST {
            let long = |triangle: &Triangle| {
                let lengths = triangle.edges().map(|edge| {
                    let [a, b] = edge.map(|vertex| self.position(vertex));
                    distance(a, b)
                });
                lengths.into_iter().fold(0.0, f64::max) > size && counts(self, triangle)
            };
            let marked: Vec<bool> = self.triangles.iter().map(long).collect();
            if !marked.contains(&true) {
                return;
            }
            self.refine(&marked);
        }
    }
}

/// Halves a triangle whose first edge has a middle; its halves are halved again if their first
/// edges have a middle too.
fn halve(triangle: &Triangle, middles: &HashMap<[u32; 2], u32>, out: &mut Vec<Triangle>) {
    let [a, b, c] = triangle.vertices;
    match middles.get(&ascending([a, b])) {
        None => out.push(*triangle),
        Some(&middle) => {
            for vertices in [[c, a, middle], [b, c, middle]] {
                let part = Triangle {
                    vertices,
                    region: triangle.region,
                };
                halve(&part, middles, out);
            }
        }
    }
}
