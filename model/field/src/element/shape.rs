//! Positions of the nodes of a triangle, with straight or curved edges.
//!
//! The nodes of an edge on a curve are on the curve. The displacement d(s) of the edge fades into
//! the triangle as d(s) · λₐλ_b / (s(1 − s)), s = (λ_b − λₐ + 1)/2, which is d(s) on the edge and
//! zero on the other edges (Szabó and Babuška's blending).

use super::Basis;
use super::basis::BasisValues;
use crate::geometry::Point;
use crate::geometry::path::PathCurve;
use crate::mesh::{Mesh, Triangle};

/// Positions of a triangle's nodes.
#[must_use]
pub fn nodes(mesh: &Mesh, triangle: &Triangle, basis: &Basis) -> Vec<Point> {
    let corners = mesh.corners_of(triangle);
    let bent: Vec<(usize, usize, PathCurve)> = [(0, 1), (1, 2), (2, 0)]
        .into_iter()
        .zip(triangle.edges())
        .map(|((a, b), edge)| (a, b, mesh.curve(edge)))
        .filter(|(_, _, curve)| *curve != PathCurve::Line)
        .collect();
    let place = |at: [f64; 3]| {
        let mut point = [0, 1].map(|axis: usize| (0..3).map(|k| at[k] * corners[k][axis]).sum());
        for &(a, b, curve) in &bent {
            let weight = at[a] * at[b];
            if weight <= 0.0 {
                continue;
            }
            let s = 0.5 * (at[b] - at[a] + 1.0);
            let on_curve = curve.between(corners[a], corners[b], s);
            for axis in 0..2 {
                let straight = corners[a][axis] + s * (corners[b][axis] - corners[a][axis]);
                point[axis] += (on_curve[axis] - straight) * weight / (s * (1.0 - s));
            }
        }
        point
    };
    basis.points().map(place).collect()
}

/// Position of a sampled point in space, and gradients of the basis functions there.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Position.
    pub point: Point,
    /// Determinant of the position's derivatives with respect to the second and third barycentric
    /// coordinate: twice the area of a straight triangle; negative if the triangle is folded.
    pub jacobian: f64,
    /// Derivatives of the functions with respect to r and x.
    pub gradients: Vec<[f64; 2]>,
}

impl Placed {
    /// Creates an empty value for [`Placed::fill`].
    #[must_use]
    pub fn new(basis: &Basis) -> Self {
        Self {
            point: [0.0; 2],
            jacobian: 0.0,
            gradients: vec![[0.0; 2]; basis.len()],
        }
    }

    /// Computes all values at a sampled point of the triangle with the given nodes.
    pub fn fill(&mut self, nodes: &[Point], sample: &BasisValues) {
        self.point = [0.0; 2];
        let mut m = [[0.0; 2]; 2];
        for ((node, value), slope) in nodes.iter().zip(&sample.values).zip(&sample.slopes) {
            for axis in 0..2 {
                self.point[axis] += value * node[axis];
                m[axis][0] += node[axis] * slope[0];
                m[axis][1] += node[axis] * slope[1];
            }
        }
        self.fill_gradients(m, sample);
    }

    /// Like [`Placed::fill`], for a triangle with straight edges.
    pub fn fill_straight(&mut self, [a, b, c]: [Point; 3], sample: &BasisValues) {
        self.point = [0, 1].map(|axis: usize| {
            sample.at[0] * a[axis] + sample.at[1] * b[axis] + sample.at[2] * c[axis]
        });
        let m = [0, 1].map(|axis: usize| [b[axis] - a[axis], c[axis] - a[axis]]);
        self.fill_gradients(m, sample);
    }

    /// Computes the gradients from the derivatives of the position with respect to the second and
    /// third barycentric coordinate.
    fn fill_gradients(&mut self, m: [[f64; 2]; 2], sample: &BasisValues) {
        self.jacobian = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        let inverse = 1.0 / self.jacobian;
        for (gradient, [s, t]) in self.gradients.iter_mut().zip(&sample.slopes) {
            *gradient = [
                (m[1][1] * s - m[1][0] * t) * inverse,
                (m[0][0] * t - m[0][1] * s) * inverse,
            ];
        }
    }
}
