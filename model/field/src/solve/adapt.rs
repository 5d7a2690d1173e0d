//! Adaptive solution: solves, estimates the errors and refines the mesh until the figures settle.

use super::accuracy::Accuracy;
use super::assembly::Level;
use super::evaluate::{invert, value_at};
use super::excitation::Excitation;
use super::indicator::{decay, jumps, mark};
use super::judge::{
    Sizes, WEAK, axis, centre_error, centre_size, estimate, goal, plate_peak, rough, scores,
};
use super::newton::{Pattern, SolveError, balance};
use super::space::Space;
use super::wanted::Wanted;
use crate::design::Design;
use crate::figures::{Figures, ProfiledFigures};
use crate::mesh;

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
pub(super) const SHARE: f64 = 0.6;
/// Longest side allowed on the first mesh for triangles at corners where the field is singular,
/// relative to the radius of the circle that contains all parts (`Mesh::circle`).
const CORNER_SIZE: f64 = 0.004;
/// Newton's method ends when its last step is less than the requested accuracy times this.
const LAST_STEP: f64 = 0.1;
/// Limit of the work for the greatest field in the plates, in unknowns times linear solves (5 s).
/// Halving of triangles for that field ends when the work since the figures settled exceeds both
/// this limit and the work until then. The built-in designs need up to 4.3e5. If a material has a
/// knee from a permeability of 6e5 to that of vacuum, a hundred meshes do not find the greatest
/// field; its estimated error shows that.
const FOR_PLATES: usize = 500_000;

/// Solves a design for the field on the axis and in the inner core, and all figures.
/// [`super::solve_for`] solves for figures alone, in less time.
///
/// # Errors
/// [`SolveError`] if the design cannot be triangulated or the field does not settle.
pub fn solve(
    design: &Design,
    excitation: &Excitation,
    accuracy: &Accuracy,
) -> Result<Solved, SolveError> {
    let mut mesh = mesh::build(design, mesh::MeshLines::WithCore)?;
    mesh.refine_corners(CORNER_SIZE * mesh.circle.radius);
    let mut level = Level::new(design, Space::new(mesh, accuracy.order), excitation);
    let mut guess = vec![0.0; level.space.count];
    let mut last: Option<ProfiledFigures> = None;
    let mut changes: Option<Figures> = None;
    let mut levels = 0;
    let mut linear_solves = 0;
    // Work in unknowns times linear solves: `work` until the figures settle, `local_work` on
    // locally refined meshes afterwards.
    let (mut work, mut local_work) = (0, 0);
    let mut refined_locally = false;
    let mut last_profile: Vec<f64> = Vec::new();
    let mut axis_settled = false;
    loop {
        let pattern = Pattern::of(&level);
        let balanced = balance(&level, &pattern, guess, LAST_STEP * accuracy.relative)?;
        levels += 1;
        linear_solves += balanced.steps;
        let step_work = level.space.count * balanced.steps;
        *(if refined_locally {
            &mut local_work
        } else {
            &mut work
        }) += step_work;
        let profiled = ProfiledFigures::of(design, &level, &balanced.w, Wanted::Figures);
        let figures = profiled.figures;
        let primal = jumps(&level, &balanced.w);
        let decay = decay(&level.space, &balanced.w);
        let mut rough = rough(design, &level, &primal, &decay, accuracy.relative, &figures);
        let plates = plate_peak(
            design,
            &level,
            &balanced.w,
            figures.plate_max_t,
            &primal,
            &decay,
        );
        if local_work <= work.max(FOR_PLATES) {
            for (rough, coarse) in rough.iter_mut().zip(&plates.coarse) {
                *rough |= coarse;
            }
        }
        let estimated = last
            .as_ref()
            .map(|last| estimate(profiled.change_from(last), &figures, changes));
        changes = match (changes, estimated) {
            // If only a few triangles were refined, a small change says little about the error.
            (Some(before), Some(now)) if refined_locally => Some(now.greater_of(&before)),
            (_, now) => now,
        };
        last = Some(profiled);
        let errors = changes.map(|mut errors: Figures| {
            errors.centre_t = errors
                .centre_t
                .max(centre_error(design, &level, &primal, &decay));
            errors.plate_max_t = plates.error_t;
            errors
        });
        let profile = axis(&level, &balanced.w);
        let steady = profile.iter().zip(&last_profile).all(|(now, before)| {
            let size = before.abs().max(WEAK * figures.core_mean_t);
            (now - before).abs() <= accuracy.relative * size
        });
        // If the mesh was refined only elsewhere, an unchanged axis does not show that the axis has
        // settled.
        axis_settled = if refined_locally {
            axis_settled && steady
        } else {
            steady
        };
        last_profile = profile;
        let sizes = Sizes::of(&figures, design, &level, excitation);
        let limits = sizes.limits(accuracy.relative);
        let settled = axis_settled && changes.is_some_and(|e| e.is_within(&limits));
        let full = 2 * level.space.count > accuracy.most_unknowns;
        let reached = settled && !rough.contains(&true);
        if let Some(errors) = errors
            && (reached || full)
        {
            let report = SolveReport {
                unknowns: level.space.count,
                levels,
                newton_iterations: balanced.steps,
                linear_solves,
                reached,
            };
            return Ok(Solved {
                level,
                w: balanced.w,
                excitation: excitation.clone(),
                figures,
                errors,
                report,
            });
        }
        refined_locally = settled;
        let mut marked = rough;
        if !settled {
            let dual = pattern.solve(&balanced.factor, &goal(&level));
            let scores = scores(&level, &balanced.w, &primal, &dual);
            for (marked, coarse) in marked.iter_mut().zip(mark(&scores, SHARE)) {
                *marked |= coarse;
            }
        }
        let mut finer = level.space.mesh.clone();
        let parents = finer.refine(&marked);
        let next = Level::new(design, Space::new(finer, accuracy.order), excitation);
        guess = if level
            .materials
            .iter()
            .all(crate::material::Material::is_linear)
        {
            vec![0.0; next.space.count]
        } else {
            transfer(&level.space, &balanced.w, &next.space, &parents)
        };
        level = next;
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
