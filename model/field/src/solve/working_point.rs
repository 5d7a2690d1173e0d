//! Working points of magnets.

use core::f64::consts::TAU;

use super::adapt::Solved;
use crate::design::{Design, Named};
use crate::geometry::distance;
use crate::material::MU_0;
use crate::mesh::CORNER_M;

/// Working point of a magnet on its recoil line; all values are along its magnetisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkingPoint {
    /// Mean of B over the magnet's volume, T.
    pub mean_b_t: f64,
    /// Mean of H over the magnet's volume, A/m: negative if a field demagnetises the magnet.
    pub mean_h_a_per_m: f64,
    /// Least B in the magnet, T, of all points of integration at least 0.1 mm from corners:
    /// demagnetisation starts where it is below the knee of the recoil line.
    pub least_b_t: f64,
}

impl Solved {
    /// Working point of a part; `None` if the part is not a magnet or the field was solved without
    /// magnets.
    #[must_use]
    pub fn working_point(&self, design: &Design, part: usize) -> Option<WorkingPoint> {
        let magnet = design.parts.get(part)?;
        let sense = magnet.remanence_t.signum();
        if magnet.remanence_t == 0.0 || !self.excitation.magnetised {
            return None;
        }
        let mesh = &self.level.space.mesh;
        let corners: Vec<_> = mesh.corners.iter().map(|&at| mesh.position(at)).collect();
        let (mut volume, mut flux) = (0.0, 0.0);
        let mut least_b_t = f64::INFINITY;
        self.visit(|at| {
            if Named::Part(part).takes(at.region) {
                let weight = TAU * at.weight * at.point[0];
                let b_t = sense * at.b[1];
                volume += weight;
                flux += weight * b_t;
                if corners
                    .iter()
                    .all(|&corner| distance(corner, at.point) > CORNER_M)
                {
                    least_b_t = least_b_t.min(b_t);
                }
            }
        });
        let mean_b_t = flux / volume;
        let mu = MU_0 * magnet.material.initial_mu_r();
        Some(WorkingPoint {
            mean_b_t,
            mean_h_a_per_m: (mean_b_t - magnet.remanence_t.abs()) / mu,
            least_b_t,
        })
    }
}
