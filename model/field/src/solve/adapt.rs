//! Adaptive solution: solves, estimates the errors and refines the mesh until the requested figures
//! are accurate.

use super::accuracy::Accuracy;
use super::assembly::Level;
use super::evaluate::{invert, value_at};
use super::excitation::Excitation;
use super::finer::{Finer, raised};
use super::indicator::refined;
use super::judge::{axis, axis_is_close, centre_size, estimate, goal, limits, rough, scores};
use super::newton::{Balanced, Pattern, SolveError, balance};
use super::space::Space;
use super::wanted::Wanted;
use crate::design::Design;
use crate::figures::{Figures, ProfiledFigures};
use crate::material::Material;
use crate::mesh::{self, Mesh};

/// Report on a solution.
#[derive(Clone, Debug, PartialEq)]
pub struct SolveReport {
    /// Number of unknowns on the last mesh.
    pub unknowns: usize,
    /// Number of meshes solved.
    pub levels: usize,
    /// Number of linear solves on the last mesh.
    pub newton_iterations: usize,
    /// Number of linear solves on all meshes.
    pub linear_solves: usize,
    /// Whether the requested accuracy is reached; otherwise refinement ended at
    /// [`Accuracy::most_unknowns`].
    pub reached: bool,
}

/// A solved design.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The last mesh with its materials.
    pub level: Level,
    /// Coefficients of A_φ/r, T.
    pub w: Vec<f64>,
    /// Excitation of the field.
    pub excitation: Excitation,
    /// Figures of merit.
    pub figures: Figures,
    /// Estimated absolute error of each figure.
    pub errors: Figures,
    /// Report on the solution.
    pub report: SolveReport,
}

impl Solved {
    /// The greater of the estimated relative errors of centre and core mean. The error of the
    /// centre is relative to the field there, but at least to half of the core's mean, since
    /// opposed coils have no field at the centre.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        let centre = self.errors.centre_t / centre_size(&self.figures);
        centre.max(self.errors.core_mean_t / self.figures.core_mean_t)
    }
}

/// At each refinement, triangles are halved that together have this fraction of the total score. A
/// fraction of one half makes the number of unknowns grow by a factor of about 1.7.
const SHARE: f64 = 0.6;
/// Longest side allowed on the first mesh for triangles at corners where the field is singular,
/// relative to the radius of the circle that contains all parts (`Mesh::circle`).
const CORNER_SIZE: f64 = 0.004;
/// Newton's method ends when its last step is less than the root of the requested accuracy times
/// this. The remaining error is about the square of the last step, and contained in the estimate.
const LAST_STEP: f64 = 0.1;

/// Order of the first elements when figures are wanted: it is often enough for one figure, or for a
/// search.
const FIRST_ORDER: u32 = 2;
/// With lower orders Newton's method ends when its last step is less than this: the next order
/// changes the field by more than the remaining error.
const ROUGH_STEP: f64 = 0.03;

/// A solution on one mesh.
pub(super) struct Step {
    pub(super) level: Level,
    pub(super) pattern: Pattern,
    pub(super) balanced: Balanced,
}

/// Solves a design, accurately on the axis and in the inner core too ([`Wanted::Field`]).
///
/// # Errors
/// [`SolveError`] if the design cannot be triangulated or the field does not settle.
pub fn solve(
    design: &Design,
    excitation: &Excitation,
    accuracy: &Accuracy,
) -> Result<Solved, SolveError> {
    solve_for(design, excitation, accuracy, Wanted::Field)
}

/// Solves a design until what is wanted is accurate.
///
/// # Errors
/// As for [`solve`].
pub fn solve_for(
    design: &Design,
    excitation: &Excitation,
    accuracy: &Accuracy,
    wanted: Wanted<'_>,
) -> Result<Solved, SolveError> {
    let mut mesh = mesh::build(design, mesh::MeshLines::WithCore)?;
    mesh.refine_corners(CORNER_SIZE * mesh.circle.radius);
    let mut solver = Solver {
        design,
        excitation,
        last_step: LAST_STEP * accuracy.relative.sqrt(),
        linear_solves: 0,
    };
    // The field between the figures needs the requested order.
    let first_order = match wanted {
        Wanted::Field => accuracy.order,
        Wanted::Figures | Wanted::Only(_) => FIRST_ORDER.min(accuracy.order),
    };
    let mut step = solver.first(mesh, first_order)?;
    let mut levels = 1;
    loop {
        let Step {
            level, balanced, ..
        } = &step;
        let full = 2 * level.space.count > accuracy.most_unknowns;
        if wanted == Wanted::Field && !full {
            let marked = rough(design, level, &balanced.w, accuracy.relative);
            if marked.contains(&true) {
                let mut mesh = level.space.mesh.clone();
                let parents = mesh.refine(&marked);
                step = solver.on(mesh, &parents, &step)?;
                levels += 1;
                continue;
            }
        }
        let finer = Finer::of(design, excitation, &step)?;
        solver.linear_solves += 1;
        let profiled = ProfiledFigures::of(design, level, &balanced.w, wanted);
        let finer_profiled = ProfiledFigures::of(design, &finer.level, &finer.w, wanted);
        let figures = profiled.figures;
        let errors = estimate(finer_profiled.change_from(&profiled), &figures);
        let limits = limits(&figures, design, level, excitation, accuracy, wanted);
        let mut reached = errors.is_within(&limits);
        if wanted == Wanted::Field {
            let axes = [axis(level, &balanced.w), axis(&finer.level, &finer.w)];
            reached &= axis_is_close(axes, accuracy.relative, &figures);
        }
        if reached || full {
            let report = SolveReport {
                unknowns: level.space.count,
                levels,
                newton_iterations: balanced.steps,
                linear_solves: solver.linear_solves,
                reached,
            };
            return Ok(Solved {
                level: step.level,
                w: step.balanced.w,
                excitation: excitation.clone(),
                figures,
                errors,
                report,
            });
        }
        step = if level.space.basis.order() < accuracy.order {
            solver.raised(finer)?
        } else {
            let energy = finer.energy_of_change();
            let adjoint = finer.energy_of_adjoint(&step, goal);
            drop(finer);
            let (mesh, parents) = refined(&level.space.mesh, scores(&energy, &adjoint), SHARE);
            solver.on(mesh, &parents, &step)?
        };
        levels += 1;
    }
}

/// A design with its excitation, and what was done for its solution.
struct Solver<'d> {
    design: &'d Design,
    excitation: &'d Excitation,
    last_step: f64,
    linear_solves: usize,
}

impl Solver<'_> {
    /// Solves on the first mesh. With saturation, solutions of lower orders come first, since most
    /// steps of Newton's method are then taken with few unknowns.
    fn first(&mut self, mesh: Mesh, order: u32) -> Result<Step, SolveError> {
        let level = |order| Level::new(self.design, Space::new(mesh.clone(), order), self.excitation);
        let last = level(order);
        let mut guess = vec![0.0; last.space.count];
        if !last.materials.iter().all(Material::is_linear) {
            let mut coarse = level(1);
            let mut w = vec![0.0; coarse.space.count];
            for order in 1..order {
                let pattern = Pattern::of(&coarse);
                let balanced = balance(&coarse, &pattern, w, ROUGH_STEP)?;
                self.linear_solves += balanced.steps;
                let next = level(order + 1);
                w = raised(&coarse.space, &balanced.w, &next.space);
                coarse = next;
            }
            guess = w;
        }
        self.step(last, guess)
    }

    /// Solves on one mesh.
    fn step(&mut self, level: Level, guess: Vec<f64>) -> Result<Step, SolveError> {
        let pattern = Pattern::of(&level);
        let balanced = balance(&level, &pattern, guess, self.last_step)?;
        self.linear_solves += balanced.steps;
        Ok(Step {
            level,
            pattern,
            balanced,
        })
    }

    /// Continues with the solution of the next order.
    fn raised(&mut self, finer: Finer) -> Result<Step, SolveError> {
        let step = finer.into_step(self.last_step)?;
        self.linear_solves += step.balanced.steps - 1;
        Ok(step)
    }

    /// Solves on a refined mesh, given with the triangles of the old mesh that contain those of the
    /// new one.
    fn on(&mut self, mesh: Mesh, parents: &[usize], old: &Step) -> Result<Step, SolveError> {
        let Step {
            level, balanced, ..
        } = old;
        let order = level.space.basis.order();
        let next = Level::new(self.design, Space::new(mesh, order), self.excitation);
        let guess = if level.materials.iter().all(Material::is_linear) {
            vec![0.0; next.space.count]
        } else {
            transfer(&level.space, &balanced.w, &next.space, parents)
        };
        self.step(next, guess)
    }
}

/// Transfers a solution to a finer mesh by its values at the new mesh's nodes.
pub(super) fn transfer(old: &Space, w: &[f64], new: &Space, parents: &[usize]) -> Vec<f64> {
    let mut transferred = vec![0.0; new.count];
    for ((unknowns, nodes), &parent) in new.unknowns.iter().zip(&new.nodes).zip(parents) {
        let (Some(old_nodes), Some(old_unknowns)) =
            (old.nodes.get(parent), old.unknowns.get(parent))
        else {
            continue;
        };
        for (&unknown, &node) in unknowns.iter().zip(nodes) {
            let at = invert(&old.basis, old_nodes, node);
            let (value, _) = value_at(&old.basis, old_nodes, old_unknowns, w, at);
            if let Some(entry) = transferred.get_mut(unknown as usize) {
                *entry = value;
            }
        }
    }
    transferred
}
