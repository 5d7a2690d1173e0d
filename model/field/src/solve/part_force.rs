//! Forces along the axis on single parts, by two methods.

use core::f64::consts::TAU;

use super::adapt::Solved;
use super::assembly::combine;
use crate::design::Named;
use crate::element::shape::Placed;
use crate::geometry::length;
use crate::material::Material;
use crate::mesh::Region;

impl Solved {
    /// Force along the axis on a part, N, by virtual work (Coulomb 1983): the part is moved rigidly
    /// with its flux, and the triangles that touch it are stretched. The result is Maxwell's
    /// stress, averaged over these triangles. Its error is not estimated. `None` if the part
    /// touches magnetic material: the force on their common face depends on the gap that would open
    /// there.
    #[must_use]
    pub fn force_on_n(&self, part: Named) -> Option<f64> {
        let space = &self.level.space;
        let mesh = &space.mesh;
        let belongs = |region: &Region| part.takes(region);
        let mut moved = vec![false; mesh.vertices.len()];
        for triangle in mesh.triangles.iter().filter(|t| belongs(&mesh.region(t))) {
            for &vertex in &triangle.vertices {
                if let Some(moved) = moved.get_mut(vertex as usize) {
                    *moved = true;
                }
            }
        }
        let places: Vec<[f64; 3]> = space.basis.points().collect();
        let mut placed = Placed::new(&space.basis);
        let mut force_n = 0.0;
        let triangles = mesh.triangles.iter().zip(&space.nodes).zip(&space.unknowns);
        for ((triangle, nodes), unknowns) in triangles {
            let region = mesh.region(triangle);
            let corners = triangle
                .vertices
                .map(|vertex| moved.get(vertex as usize) == Some(&true));
            if region.exterior || belongs(&region) || !corners.contains(&true) {
                continue;
            }
            // Fraction of the part's displacement by which each node moves.
            let shares = |at: &[f64; 3]| -> f64 {
                let near = at.iter().zip(corners).filter(|(_, moved)| *moved);
                near.map(|(share, _)| share).sum()
            };
            let shares: Vec<f64> = places.iter().map(shares).collect();
            let index = triangle.region as usize;
            let remanence_t = self.level.remanences_t.get(index).copied();
            let material = self.level.materials.get(index);
            let material = material.unwrap_or(&Material::VACUUM);
            if *material != Material::VACUUM || remanence_t.unwrap_or(0.0) != 0.0 {
                return None;
            }
            let current = self.level.currents_a_per_m2.get(index);
            for (sample, weight) in &space.samples {
                placed.fill(nodes, sample);
                let (value, slope) = combine(&self.w, unknowns, sample, &placed);
                let r = placed.point[0];
                let b = [
                    -r * slope[1],
                    2.0 * value + r * slope[0] + self.level.background_t,
                ];
                let size = length(b);
                let nu = material.reluctivity(size).nu;
                let mut share = 0.0;
                let mut stretch = [0.0; 2];
                for ((of_node, phi), gradient) in
                    shares.iter().zip(&sample.values).zip(&placed.gradients)
                {
                    share += of_node * phi;
                    stretch[0] += of_node * gradient[0];
                    stretch[1] += of_node * gradient[1];
                }
                let along = material.energy_j_per_m3(size) - nu * b[0] * b[0];
                let across = nu * b[0] * b[1];
                // The current in copper that is stretched has a force of its own, which is
                // subtracted.
                let lorentz = -current.copied().unwrap_or(0.0) * b[0];
                let density = across * stretch[0] + along * stretch[1] + share * lorentz;
                force_n -= TAU * 0.5 * placed.jacobian * weight * r * density;
            }
        }
        Some(force_n)
    }

    /// Lorentz force along the axis on a coil, N.
    #[must_use]
    pub fn lorentz_force_n(&self, coil: usize) -> f64 {
        let mut force_n = 0.0;
        self.visit(|at| {
            if at.region.ring.is_some_and(|[of, _]| of as usize == coil) {
                let current = self.level.currents_a_per_m2.get(at.index);
                let density = -current.copied().unwrap_or(0.0) * at.b[0];
                force_n += TAU * at.weight * at.point[0] * density;
            }
        });
        force_n
    }
}
