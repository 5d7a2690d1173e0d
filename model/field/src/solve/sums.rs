//! Integrals of a solved field: flux linkage, work, energy.

use core::f64::consts::TAU;

use super::adapt::Solved;
use super::assembly::At;
use super::evaluate::Locator;
use super::scalar::dot;
use crate::design::Design;
use crate::element::quadrature::gauss;
use crate::material::MU_0;

impl Solved {
    /// Calls `visit` at every point of integration inside the circle.
    pub fn visit(&self, visit: impl FnMut(&At<'_>)) {
        self.level.visit(&self.w, visit);
    }

    /// Flux linked with a coil, Wb: 2π ∫ (turns/area) A_φ r dA, with the sign of the coil's sense.
    #[must_use]
    pub fn linkage_wb(&self, design: &Design, coil: usize) -> f64 {
        let mut linkage = 0.0;
        self.visit(|at| {
            let Some([index, ring]) = at.region.ring else {
                return;
            };
            let Some(wound) = design.coils.get(coil).filter(|_| index as usize == coil) else {
                return;
            };
            if let Some(ring) = wound.rings.get(ring as usize) {
                let density = wound.sense * wound.turns / ring.area_m2();
                let w = at.w + 0.5 * self.level.background_t;
                linkage += at.weight * density * w * at.point[0].powi(2);
            }
        });
        TAU * linkage
    }

    /// Work of the currents ∫ J·A dV, J: twice the energy if there is no saturation and no magnet.
    #[must_use]
    pub fn work_j(&self, design: &Design) -> f64 {
        let linkages: Vec<f64> = (0..design.coils.len())
            .map(|k| self.linkage_wb(design, k))
            .collect();
        dot(&linkages, &self.excitation.currents_a)
    }

    /// Energy of the field ∫∫ H dB dV in all of space, J, summed point by point. In a magnet the
    /// inner integral starts at the remanence, where H is 0. Without saturation and magnets the
    /// energy is half the work of the currents; with a background it is infinite.
    #[must_use]
    pub fn energy_j(&self) -> f64 {
        let mut inside = 0.0;
        self.visit(|at| {
            let (material, excess) = self.level.law_at(at.index, at.b);
            let density = material.energy_j_per_m3(excess[0].hypot(excess[1]));
            inside += TAU * at.weight * at.point[0] * density;
        });
        inside + self.energy_outside_j()
    }

    /// Energy outside of the circle, J: ρ = R/t maps the distances from R to infinity onto (0, 1].
    fn energy_outside_j(&self) -> f64 {
        const PANELS: u32 = 24;
        let circle = self.level.space.mesh.circle;
        let locator = Locator::new(&self.level, &self.w);
        let rule = gauss(4, 0.0);
        let panels = || {
            (0..PANELS).flat_map(|panel| {
                let within = move |&(node, weight): &(f64, f64)| {
                    let count = f64::from(PANELS);
                    ((f64::from(panel) + node) / count, weight / count)
                };
                rule.iter().map(within)
            })
        };
        let mut sum = 0.0;
        for (t, t_weight) in panels() {
            let distance = circle.radius / t;
            for (share, angle_weight) in panels() {
                let (sine, cosine) = (core::f64::consts::PI * share).sin_cos();
                let b = locator.at([distance * sine, circle.centre_x + distance * cosine]);
                let density = b.size().powi(2) / (2.0 * MU_0);
                let area = core::f64::consts::PI * distance * (distance / t);
                sum += t_weight * angle_weight * area * TAU * distance * sine * density;
            }
        }
        sum
    }
}
