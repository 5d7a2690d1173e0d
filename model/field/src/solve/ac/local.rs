//! Contribution of each triangle to the equations of an alternating field.

use core::f64::consts::TAU;

use num_complex::Complex64;

use super::region::{AcRegion, Winding};
use super::system::{Assembled, System};
use crate::element::basis::BasisValues;
use crate::element::quadrature;
use crate::element::shape::Placed;
use crate::material::MU_0;
use crate::mesh::{Triangle, ascending};
use crate::solve::assembly::{along, combine, on_side};

/// Fraction of vacuum's reluctivity that remains inside a part whose surface carries all currents,
/// so that the unknowns there are defined.
const LEFT_OUT: f64 = 1e-9;

impl System<'_> {
    /// Adds the matrix entries of a triangle, and the sources of the coils in it.
    pub(super) fn add_triangle(
        &self,
        index: usize,
        placed: &mut Placed,
        assembled: &mut Assembled,
    ) {
        let space = &self.level.space;
        let (Some(triangle), Some(nodes), Some(unknowns)) = (
            space.mesh.triangles.get(index),
            space.nodes.get(index),
            self.unknowns.get(index),
        ) else {
            return;
        };
        let exterior = space.mesh.region(triangle).exterior;
        let region = self.region(triangle);
        let size = unknowns.len();
        let mut matrix = vec![Complex64::default(); size * (size + 1) / 2];
        let mut vectors = vec![[0.0; 2]; size];
        let mut electric = vec![0.0; size];
        for (sample, weight) in &space.samples {
            placed.fill(nodes, sample);
            let r = placed.point[0];
            let area = 0.5 * placed.jacobian.abs() * weight;
            if exterior {
                vectors.clone_from(&placed.gradients);
                let scale = Complex64::from(area * r * r * r / MU_0);
                add_magnetic(&mut matrix, scale, [[1.0, 0.0], [0.0, 1.0]], &vectors);
                continue;
            }
            let of_nodes = placed.gradients.iter().zip(&sample.values);
            for ((vector, electric), (gradient, phi)) in
                vectors.iter_mut().zip(&mut electric).zip(of_nodes)
            {
                *vector = [-r * gradient[1], 2.0 * phi + r * gradient[0]];
                *electric = r * phi;
            }
            if let Winding::Solid { .. } = region.winding
                && let Some(of_ring) = electric.last_mut()
            {
                *of_ring = -1.0 / (TAU * r);
            }
            if region.in_surface {
                let scale = Complex64::from(LEFT_OUT / MU_0 * area * r);
                add_magnetic(&mut matrix, scale, [[1.0, 0.0], [0.0, 1.0]], &vectors);
                continue;
            }
            let law = self.reluctivity(&region, unknowns, sample, placed);
            add_magnetic(
                &mut matrix,
                region.reluctivity_factor * (area * r),
                law,
                &vectors,
            );
            let loss = self.omega * region.conductivity_s_per_m;
            if loss > 0.0 {
                add_products(&mut matrix, Complex64::I * (loss * area * r), &electric);
            }
            if let Winding::Stranded { coil, turns_per_m2 } = region.winding
                && let Some(driven) = assembled.driven.get_mut(coil)
            {
                for (unknown, phi) in unknowns.iter().zip(&sample.values) {
                    if let Some(entry) = driven.get_mut(*unknown as usize) {
                        *entry += area * r * r * turns_per_m2 * phi;
                    }
                }
            }
        }
        if region.in_surface {
            self.add_surface(index, triangle, &region, placed, &mut matrix);
        }
        assembled.entries.extend(matrix);
    }

    /// Differential reluctivity at a sampled point.
    fn reluctivity(
        &self,
        region: &AcRegion,
        unknowns: &[u32],
        sample: &BasisValues,
        placed: &Placed,
    ) -> [[f64; 2]; 2] {
        let r = placed.point[0];
        let (value, slope) = combine(self.state, unknowns, sample, placed);
        let background = self.level.background_t;
        let b = [-r * slope[1], 2.0 * value + r * slope[0] + background];
        region
            .material
            .reluctivity(b[0].hypot(b[1]))
            .differential(b)
    }

    /// Adds the surface currents on the sides of a triangle that are part of its part's surface.
    fn add_surface(
        &self,
        index: usize,
        triangle: &Triangle,
        region: &AcRegion,
        placed: &mut Placed,
        matrix: &mut [Complex64],
    ) {
        let space = &self.level.space;
        let (Some(nodes), Some(unknowns)) = (space.nodes.get(index), space.unknowns.get(index))
        else {
            return;
        };
        let rule = quadrature::gauss(space.basis.order() as usize + 2, 0.0);
        for (side, edge) in triangle.edges().into_iter().enumerate() {
            if !self.surface.contains(&ascending(edge)) {
                continue;
            }
            for &(t, weight) in &rule {
                let sample = space.basis.sample(on_side(side, t));
                placed.fill(nodes, &sample);
                let (point, tangent) = along(nodes, &sample, side);
                let speed = tangent[0].hypot(tangent[1]);
                let [dr, dx] = tangent.map(|t| t / speed);
                let law = self.reluctivity(region, unknowns, &sample, placed);
                let along_surface =
                    dr * (law[0][0] * dr + law[0][1] * dx) + dx * (law[1][0] * dr + law[1][1] * dx);
                let induced = Complex64::I * self.omega * region.conductivity_s_per_m;
                let admittance = (induced * region.reluctivity_factor * along_surface).sqrt();
                let scale = admittance * (weight * speed * point[0].powi(3));
                add_products(matrix, scale, &sample.values);
            }
        }
    }
}

/// Adds scale · vᵢᵀ D vⱼ to the lower half of a matrix.
fn add_magnetic(
    matrix: &mut [Complex64],
    scale: Complex64,
    law: [[f64; 2]; 2],
    vectors: &[[f64; 2]],
) {
    let mut entries = matrix.iter_mut();
    for (row, v) in vectors.iter().enumerate() {
        let dv = [0, 1].map(|axis: usize| law[axis][0] * v[0] + law[axis][1] * v[1]);
        for (u, entry) in vectors.iter().take(row + 1).zip(&mut entries) {
            *entry += scale * (dv[0] * u[0] + dv[1] * u[1]);
        }
    }
}

/// Adds scale · fᵢ fⱼ to the lower half of a matrix, where f are the `factors`.
fn add_products(matrix: &mut [Complex64], scale: Complex64, factors: &[f64]) {
    let mut entries = matrix.iter_mut();
    for (row, a) in factors.iter().enumerate() {
        for (b, entry) in factors.iter().take(row + 1).zip(&mut entries) {
            *entry += scale * (a * b);
        }
    }
}
