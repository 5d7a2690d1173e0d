//! A second solution on the same mesh with elements of the next order: the difference shows the
//! error of the first solution.

use super::assembly::Level;
use super::cholesky::Factor;
use super::excitation::Excitation;
use super::fixed::Fixed;
use super::for_figures::Step;
use super::newton::{Balanced, Pattern, SolveError, balance};
use super::space::Space;
use crate::design::Design;
use crate::material::Material;

/// A solution with elements of the next order.
pub(super) struct Finer {
    pub(super) level: Level,
    pub(super) w: Vec<f64>,
    pattern: Pattern,
    factor: Factor,
    entries: Vec<f64>,
    /// Change of w from the coarser solution.
    change: Vec<f64>,
}

impl Finer {
    /// Takes one step of Newton's method from a solution on the same mesh. For linear materials
    /// that is the solution; otherwise its error is about the square of the change.
    pub(super) fn of(
        design: &Design,
        excitation: &Excitation,
        step: &Step,
    ) -> Result<Self, SolveError> {
        let coarse = &step.level.space;
        let space = Space::new(coarse.mesh.clone(), coarse.basis.order() + 1);
        let start = raised(coarse, &step.balanced.w, &space);
        let level = Level::new(design, space, excitation);
        let pattern = Pattern::of(&level);
        let (residual, entries) = pattern.assemble(&level, &Fixed::NONE, &start, true);
        let factor = pattern.factor(&entries)?;
        let mut change = pattern.solve(&factor, &residual);
        change.iter_mut().for_each(|change| *change = -*change);
        let w = start.iter().zip(&change).map(|(w, change)| w + change);
        Ok(Self {
            w: w.collect(),
            level,
            pattern,
            factor,
            entries,
            change,
        })
    }

    /// Turns this solution into the step whose error is estimated next.
    pub(super) fn into_step(self, last_step: f64) -> Result<Step, SolveError> {
        let Self {
            level, pattern, w, ..
        } = self;
        if !level.materials.iter().all(Material::is_linear) {
            let balanced = balance(&level, &pattern, w, last_step)?;
            return Ok(Step {
                level,
                pattern,
                balanced,
            });
        }
        let balanced = Balanced {
            w,
            factor: self.factor,
            steps: 1,
        };
        Ok(Step {
            level,
            pattern,
            balanced,
        })
    }

    /// Energy of the change in each triangle.
    pub(super) fn energy_of_change(&self) -> Vec<f64> {
        self.energy_of(&self.change)
    }

    /// Energy in each triangle of the change of the adjoint solution for a goal, which is given by
    /// its derivative with respect to the coefficients of w.
    pub(super) fn energy_of_adjoint(
        &self,
        step: &Step,
        goal: impl Fn(&Level) -> Vec<f64>,
    ) -> Vec<f64> {
        let coarse = step
            .pattern
            .solve(&step.balanced.factor, &goal(&step.level));
        let mut change = self.pattern.solve(&self.factor, &goal(&self.level));
        let coarse = raised(&step.level.space, &coarse, &self.level.space);
        for (change, coarse) in change.iter_mut().zip(coarse) {
            *change -= coarse;
        }
        self.energy_of(&change)
    }

    /// vᵀ K v of each triangle, with the tangent K.
    fn energy_of(&self, v: &[f64]) -> Vec<f64> {
        let mut entries = self.entries.iter();
        let of_triangle = |unknowns: &Vec<u32>| {
            let at = |&unknown: &u32| v.get(unknown as usize).copied().unwrap_or(0.0);
            let values: Vec<f64> = unknowns.iter().map(at).collect();
            let mut energy = 0.0;
            for (i, row) in values.iter().enumerate() {
                for (column, entry) in values.iter().take(i).zip(&mut entries) {
                    energy += 2.0 * row * column * entry;
                }
                energy += row * row * entries.next().copied().unwrap_or(0.0);
            }
            energy.max(0.0)
        };
        self.level.space.unknowns.iter().map(of_triangle).collect()
    }
}

/// Transfers a function to a space of another order on the same mesh, by its values at the nodes.
pub(super) fn raised(from: &Space, w: &[f64], to: &Space) -> Vec<f64> {
    let weights: Vec<Vec<f64>> = (to.basis.points())
        .map(|at| from.basis.sample(at).values)
        .collect();
    let mut transferred = vec![0.0; to.count];
    for (old, new) in from.unknowns.iter().zip(&to.unknowns) {
        for (&unknown, weights) in new.iter().zip(&weights) {
            let at = |&old: &u32| w.get(old as usize).copied().unwrap_or(0.0);
            if let Some(entry) = transferred.get_mut(unknown as usize) {
                *entry = old
                    .iter()
                    .zip(weights)
                    .map(|(old, weight)| at(old) * weight)
                    .sum();
            }
        }
    }
    transferred
}
