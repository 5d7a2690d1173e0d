//! Matrices of straight triangles of linear material, from integrals over one reference triangle.
//!
//! On a straight triangle r, r² and r³ are polynomials of third order at most: sums of their values
//! at the ten nodes of cubic elements, times the polynomials L of these nodes. Gradients of the
//! basis functions are linear in their slopes along two sides. So the matrix of every such triangle
//! is a sum of the same 60 matrices, the integrals of L times a product of values or slopes.

use super::scalar::dot;
use crate::element::Basis;
use crate::element::basis::BasisValues;
use crate::geometry::Point;

/// Number of products of two functions; see [`products`].
const PRODUCTS: usize = 6;
/// Number of integrals for each pair of functions: one for each product and each cubic polynomial.
const INTEGRALS: usize = 10 * PRODUCTS;

/// Integrals over a triangle of area 1.
#[derive(Clone, Debug)]
pub(super) struct Reference {
    /// Barycentric coordinates of the nodes of cubic elements.
    nodes: Vec<[f64; 3]>,
    /// Integrals for each pair of functions, in the order of a lower half, row by row.
    pairs: Vec<[f64; INTEGRALS]>,
    /// Integrals of each function times each cubic polynomial.
    functions: Vec<Vec<f64>>,
}

/// Products of two functions, each given by its value and its slopes.
fn products((p, [ps, pt]): (f64, [f64; 2]), (q, [qs, qt]): (f64, [f64; 2])) -> [f64; PRODUCTS] {
    [
        ps * qs,
        ps * qt + pt * qs,
        pt * qt,
        p * qs + ps * q,
        p * qt + pt * q,
        p * q,
    ]
}

impl Reference {
    /// Integrates with points that are exact for straight triangles of linear material.
    pub(super) fn of(basis: &Basis, samples: &[(BasisValues, f64)]) -> Self {
        let cubic = Basis::new(3);
        let size = basis.len();
        let mut pairs = vec![[0.0; INTEGRALS]; size * (size + 1) / 2];
        let mut functions = vec![vec![0.0; cubic.len()]; size];
        for (sample, weight) in samples {
            let mut weights = cubic.sample(sample.at).values;
            weights.iter_mut().for_each(|value| *value *= weight);
            let of_functions = || {
                sample
                    .values
                    .iter()
                    .copied()
                    .zip(sample.slopes.iter().copied())
            };
            let products = of_functions().enumerate().flat_map(|(row, p)| {
                let columns = of_functions().take(row + 1);
                columns.map(move |q| products(p, q))
            });
            for (integrals, products) in pairs.iter_mut().zip(products) {
                for (integrals, weight) in integrals.chunks_mut(PRODUCTS).zip(&weights) {
                    let both = integrals.iter_mut().zip(products);
                    both.for_each(|(integral, product)| *integral += weight * product);
                }
            }
            for (integrals, value) in functions.iter_mut().zip(&sample.values) {
                let both = integrals.iter_mut().zip(&weights);
                both.for_each(|(integral, weight)| *integral += weight * value);
            }
        }
        Self {
            nodes: cubic.points().collect(),
            pairs,
            functions,
        }
    }

    /// Computes the lower half of ν ∫ curl · curl r, where the curl of w is (−r ∂w/∂x, 2 w + r
    /// ∂w/∂r); in the exterior, that of ν ∫ ∇w · ∇w r³.
    pub(super) fn tangent(
        &self,
        corners: [Point; 3],
        nu: f64,
        exterior: bool,
        tangent: &mut [f64],
    ) {
        let [a, b, c] = corners;
        let [to_b, to_c] = [b, c].map(|end| [end[0] - a[0], end[1] - a[1]]);
        let jacobian = to_b[0] * to_c[1] - to_b[1] * to_c[0];
        // Derivatives by r and x of the coordinates along the two sides.
        let by_r = [to_c[1], -to_b[1]].map(|along| along / jacobian);
        let by_x = [-to_c[0], to_b[0]].map(|along| along / jacobian);
        let metric = |i: usize, j: usize| by_r[i] * by_r[j] + by_x[i] * by_x[j];
        let metric = [metric(0, 0), metric(0, 1), metric(1, 1)];
        let scale = 0.5 * jacobian.abs() * nu;
        let inside = if exterior { 0.0 } else { scale };
        let mut factors = [0.0; INTEGRALS];
        for (factors, r) in factors.chunks_mut(PRODUCTS).zip(self.radii(corners)) {
            let [cube, square, first] = [scale * r * r * r, 2.0 * inside * r * r, 4.0 * inside * r];
            let values = [
                cube * metric[0],
                cube * metric[1],
                cube * metric[2],
                square * by_r[0],
                square * by_r[1],
                first,
            ];
            factors.copy_from_slice(&values);
        }
        for (entry, integrals) in tangent.iter_mut().zip(&self.pairs) {
            *entry = dot(&factors, integrals);
        }
    }

    /// Subtracts the source ∫ J w r² of a current density, A/m², from a residual.
    pub(super) fn subtract_current(&self, corners: [Point; 3], density: f64, residual: &mut [f64]) {
        let [a, b, c] = corners;
        let area = 0.5 * crate::geometry::cross(a, b, c).abs();
        let factors: Vec<f64> = self
            .radii(corners)
            .map(|r| density * area * r * r)
            .collect();
        for (residual, integrals) in residual.iter_mut().zip(&self.functions) {
            *residual -= dot(&factors, integrals);
        }
    }

    /// Distances of the nodes from the axis.
    fn radii(&self, corners: [Point; 3]) -> impl Iterator<Item = f64> {
        let [a, b, c] = corners.map(|corner| corner[0]);
        self.nodes
            .iter()
            .map(move |at| at[0] * a + at[1] * b + at[2] * c)
    }
}
