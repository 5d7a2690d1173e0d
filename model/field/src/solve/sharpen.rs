//! Refinement of a solved field at points of interest.

use super::adapt::{Solved, transfer};
use super::assembly::Level;
use super::evaluate::Locator;
use super::indicator::{decay, jumps};
use super::judge::WEAK;
use super::newton::{Pattern, SolveError, balance};
use super::space::Space;
use crate::design::Design;
use crate::figures::Figures;
use crate::geometry::{Point, distance};
use crate::mesh::CORNER_M;

/// Largest number of rounds of refinement. Each halves the area of triangles, so eight rounds
/// reduce their size to a sixteenth.
const MOST_ROUNDS: usize = 16;
/// Weight of a triangle's error at a point beside the triangle, relative to its weight at a point
/// inside: with a fifth, the profiles named in docs/field.md are within half of the stated error;
/// without it, one of them is seven times off.
const BESIDE: f64 = 0.2;
/// Newton's method ends when its last step is less than this; the remaining error is about its
/// square.
const LAST_STEP: f64 = 1e-4;
/// Refinement ends at this number of unknowns, whatever the errors.
const MOST_UNKNOWNS: usize = 300_000;

impl Solved {
    /// Refines the mesh until, at each point, the jumps of the field and the decay of its
    /// polynomials in the triangles there and nearby show an error below the fraction `relative` of
    /// |B|. A field below a fiftieth of the core's mean counts as a fiftieth. Points within 0.1 mm
    /// of a corner of a permeable part are ignored.
    ///
    /// If that takes too many unknowns, the report states that the accuracy is not reached.
    ///
    /// [`super::solve`] refines for the core: elsewhere the field that it computes is off by a few
    /// per cent.
    ///
    /// # Errors
    /// As for [`super::solve`].
    pub fn sharpened(
        mut self,
        design: &Design,
        points: &[Point],
        relative: f64,
    ) -> Result<Self, SolveError> {
        let mesh = &self.level.space.mesh;
        let corners: Vec<Point> = mesh.corners.iter().map(|&c| mesh.position(c)).collect();
        let far = |point: &&Point| corners.iter().all(|&c| distance(c, **point) > CORNER_M);
        let points: Vec<Point> = points.iter().filter(far).copied().collect();
        let mut rounds = 0;
        loop {
            let marked = self.blurred(&points, relative);
            let sharp = !marked.contains(&true);
            if sharp || rounds == MOST_ROUNDS || self.level.space.count > MOST_UNKNOWNS {
                self.report.reached &= sharp;
                break;
            }
            rounds += 1;
            let mut finer = self.level.space.mesh.clone();
            let parents = finer.refine(&marked);
            let order = self.level.space.basis.order();
            let next = Level::new(design, Space::new(finer, order), &self.excitation);
            let guess = transfer(&self.level.space, &self.w, &next.space, &parents);
            let balanced = balance(&next, &Pattern::of(&next), guess, LAST_STEP)?;
            self.w = balanced.w;
            self.level = next;
            self.report.levels += 1;
            self.report.linear_solves += balanced.steps;
        }
        self.report.unknowns = self.level.space.count;
        self.figures = Figures::of(design, &self.level, &self.w);
        Ok(self)
    }

    /// Marks the triangles that make the field at a point too inaccurate: the one that contains the
    /// point, and others whose errors reach it. Outside of a triangle its error acts like a dipole,
    /// so it falls with the square of the distance.
    fn blurred(&self, points: &[Point], relative: f64) -> Vec<bool> {
        let jumps = jumps(&self.level, &self.w);
        let decay = decay(&self.level.space, &self.w);
        let locator = Locator::new(&self.level, &self.w);
        let weak = WEAK * self.figures.core_mean_t;
        let limits: Vec<(Point, Option<usize>, f64)> = points
            .iter()
            .map(|&point| {
                let limit = relative * locator.at(point).size().max(weak);
                (point, locator.triangle(point), limit)
            })
            .collect();
        let mesh = &self.level.space.mesh;
        let errors = jumps.field_t.iter().zip(&decay);
        mesh.triangles
            .iter()
            .zip(errors)
            .enumerate()
            .map(|(index, (triangle, (&jump, &decay)))| {
                let corners = mesh.corners_of(triangle);
                let [a, b, c] = corners;
                let size = distance(a, b).max(distance(b, c)).max(distance(c, a));
                let centre =
                    [0, 1].map(|axis| corners.iter().map(|at| at[axis]).sum::<f64>() / 3.0);
                let error = jump.max(2.0 * decay);
                // The exterior is mapped, so distances in it are not true ones.
                let exterior = mesh.region(triangle).exterior;
                limits.iter().any(|&(point, holder, limit)| {
                    let reach = if holder == Some(index) {
                        1.0
                    } else if exterior {
                        0.0
                    } else {
                        BESIDE * (size / distance(point, centre).max(size)).powi(2)
                    };
                    error * reach > limit
                })
            })
            .collect()
    }
}
