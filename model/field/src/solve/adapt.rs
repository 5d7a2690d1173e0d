//! Solve, estimate, refine, until the figures stand still.

use super::assembly::{At, Level};
use super::evaluate::{Locator, invert, value_at};
use super::indicator::{Jumps, decay, jumps, mark};
use super::newton::{Excitation, Pattern, SolveError, back_substitute, balance, dot};
use super::space::Space;
use crate::design::Design;
use crate::element::shape::Placed;
use crate::figures::Figures;
use crate::mesh::{self, Triangle, Zone};

/// How accurate a solution is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Estimated relative error of centre and core mean at which refinement ends.
    pub relative: f64,
    /// Order of the elements, 2 to 5.
    pub order: u32,
    /// Refinement ends at so many unknowns in any case.
    pub most_unknowns: usize,
}

impl Default for Accuracy {
    /// 10⁻⁴ by cubic elements; see the benchmark in docs/field.md for the choice of the order.
    fn default() -> Self {
        Self {
            relative: 1e-4,
            order: 3,
            most_unknowns: 400_000,
        }
    }
}

/// How a solution came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Unknowns on the last mesh.
    pub unknowns: usize,
    /// Meshes that were solved on.
    pub levels: usize,
    /// Linear solves on the last mesh.
    pub newton_iterations: usize,
    /// Linear solves on all meshes.
    pub linear_solves: usize,
}

/// A solved design.
#[derive(Debug)]
pub struct Solved {
    /// The last mesh with its materials.
    pub level: Level,
    /// Coefficients of A_φ/r, T.
    pub w: Vec<f64>,
    /// What was driven.
    pub excitation: Excitation,
    /// Figures of merit.
    pub figures: Figures,
    /// Estimated absolute error of each figure.
    pub errors: Figures,
    /// How it came about.
    pub report: Report,
}

/// Share of the indicator that is refined at a time. Half makes the unknowns grow by about 1.7.
const SHARE: f64 = 0.6;
/// Size of the triangles at singular corners on the first mesh, relative to the circle's radius.
const CORNER_SIZE: f64 = 0.004;
/// Relative to the core's mean, below which a field on the axis is weak.
const WEAK: f64 = 0.02;
/// How much less accurate inductance and force may be than the field: at 1e-4 they are within 0.2 %.
const WIDER: f64 = 20.0;
/// A difference between meshes may vanish by chance; so much of the one before still counts.
const MEMORY: f64 = 0.25;

/// Solves a design.
///
/// # Errors
/// [`SolveError`] where the design cannot be triangulated or the field does not settle.
pub fn solve(
    design: &Design,
    excitation: &Excitation,
    accuracy: &Accuracy,
) -> Result<Solved, SolveError> {
    let mut mesh = mesh::build(design)?;
    mesh.refine_corners(CORNER_SIZE * mesh.circle.radius);
    let mut level = Level::new(design, Space::new(mesh, accuracy.order), excitation);
    let mut guess = vec![0.0; level.space.count];
    let mut history: Vec<Figures> = Vec::new();
    let mut linear_solves = 0;
    let mut changes: Option<Figures> = None;
    let mut refined_locally = false;
    let mut last_profile: Vec<f64> = Vec::new();
    let mut axis_settled = false;
    loop {
        let pattern = Pattern::of(&level)?;
        let balanced = balance(&level, &pattern, guess)?;
        linear_solves += balanced.steps;
        let figures = Figures::of(design, &level, &balanced.w, excitation);
        history.push(figures);
        let primal = jumps(&level, &balanced.w, &balanced.w, level.background_t);
        let decay = decay(&level.space, &balanced.w);
        let rough = rough(
            &level,
            &primal,
            &decay,
            accuracy.relative,
            figures.core_mean_t,
        );
        let estimated = estimate(&history);
        changes = match (changes, estimated) {
            // Where only a few triangles were refined, little change says little.
            (Some(before), Some(now)) if refined_locally => Some(now.greater_of(&before)),
            (_, now) => now,
        };
        let errors = changes.map(|mut errors: Figures| {
            errors.centre_t = errors
                .centre_t
                .max(centre_error(design, &level, &primal, &decay));
            errors
        });
        let profile = axis(&level, &balanced.w);
        let steady = profile.iter().zip(&last_profile).all(|(now, before)| {
            let size = before.abs().max(WEAK * figures.core_mean_t);
            (now - before).abs() <= accuracy.relative * size
        });
        // A local refinement elsewhere cannot show that the axis has settled.
        axis_settled = if refined_locally {
            axis_settled && steady
        } else {
            steady
        };
        last_profile = profile;
        let settled = axis_settled
            && changes.is_some_and(|e| close(&e, &figures, design, excitation, accuracy));
        let full = 2 * level.space.count > accuracy.most_unknowns;
        if let Some(errors) = errors
            && ((settled && !rough.contains(&true)) || full)
        {
            let report = Report {
                unknowns: level.space.count,
                levels: history.len(),
                newton_iterations: balanced.steps,
                linear_solves,
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
            let dual = back_substitute(&balanced.factor, &goal(&level));
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

/// B_x along the axis within the circle, T.
fn axis(level: &Level, w: &[f64]) -> Vec<f64> {
    const STEPS: u32 = 40;
    let circle = level.space.mesh.circle;
    let locator = Locator::new(level, w);
    (1..STEPS)
        .map(|step| 2.0 * f64::from(step) / f64::from(STEPS) - 1.0)
        .map(|share| locator.at([0.0, circle.centre_x + share * circle.radius]).b[1])
        .collect()
}

/// Triangles of the inner core and on the axis at whose edges the field jumps, or where w is
/// wrong, by more than the share `relative` of it, or of a fiftieth of the core's where it is weak. The energy there is
/// small, since volumes near the axis are, but that is where users look.
/// On `air` with orders 3 and 4 the error on the axis is 0.1 to 0.9 of the greatest jump.
fn rough(
    level: &Level,
    jumps: &Jumps,
    decay: &[f64],
    relative: f64,
    core_mean_t: f64,
) -> Vec<bool> {
    let mesh = &level.space.mesh;
    let judged = |triangle: &Triangle| {
        let on_axis = triangle
            .vertices
            .iter()
            .any(|&vertex| mesh.position(vertex)[0] == 0.0);
        on_axis || mesh.region(triangle).zone >= Zone::ThreeQuarters
    };
    let at_corner =
        |triangle: &Triangle| triangle.vertices.iter().any(|v| mesh.corners.contains(v));
    let fields = jumps.field_t.iter().zip(&jumps.size_t);
    mesh.triangles
        .iter()
        .zip(fields.zip(decay))
        .map(|(triangle, ((&jump, &size), &decay))| {
            let limit = relative * size.max(WEAK * core_mean_t);
            jump.max(2.0 * decay) > limit && judged(triangle) && !at_corner(triangle)
        })
        .collect()
}

/// Jumps of the field, or errors of w, about the triangles at the core's centre.
fn centre_error(design: &Design, level: &Level, jumps: &Jumps, decay: &[f64]) -> f64 {
    let mesh = &level.space.mesh;
    let middle = design.core.middle_m();
    let at_centre = |triangle: &Triangle| {
        let [low, high] = [f64::min, f64::max].map(|pick| {
            let along = mesh.corners_of(triangle).map(|corner| corner[1]);
            along.into_iter().reduce(pick).unwrap_or(f64::NAN)
        });
        let on_axis = mesh
            .corners_of(triangle)
            .iter()
            .any(|corner| corner[0] == 0.0);
        on_axis && low <= middle && middle <= high && !mesh.region(triangle).exterior
    };
    let triangles = mesh.triangles.iter().zip(jumps.field_t.iter().zip(decay));
    let at_centre = triangles.filter(|(triangle, _)| at_centre(triangle));
    at_centre
        .map(|(_, (jump, decay))| jump.max(2.0 * decay))
        .fold(0.0, f64::max)
}

/// Solves on one mesh as it is: for convergence studies.
///
/// # Errors
/// As [`solve`].
pub fn solve_on(
    design: &Design,
    mesh: mesh::Mesh,
    order: u32,
    excitation: &Excitation,
) -> Result<(Level, Vec<f64>), SolveError> {
    let level = Level::new(design, Space::new(mesh, order), excitation);
    let guess = vec![0.0; level.space.count];
    let balanced = balance(&level, &Pattern::of(&level)?, guess)?;
    Ok((level, balanced.w))
}

/// Whether the estimated errors are small enough: centre and mean field as asked for, integrals over
/// the whole of the field [`WIDER`] times that. A force that cancels is held to a hundredth of the
/// energy over the gap.
fn close(
    errors: &Figures,
    figures: &Figures,
    design: &Design,
    excitation: &Excitation,
    accuracy: &Accuracy,
) -> bool {
    let within = |error: f64, size: f64| error <= accuracy.relative * size.abs();
    let current = excitation.currents_a.first().copied().unwrap_or(0.0);
    let energy = 0.5 * figures.inductance_h * current * current;
    let least = 0.01 * energy / (design.core.x_m[1] - design.core.x_m[0]);
    let force = WIDER * figures.force_n.abs().max(least);
    within(errors.core_mean_t, figures.core_mean_t)
        && within(errors.centre_t, figures.centre_t)
        && within(errors.inductance_h, WIDER * figures.inductance_h)
        && within(errors.force_n, force)
        && within(errors.force_by_stress_n, force)
}

/// The change from mesh to mesh is nearly the error of the coarser one where meshes become better
/// fast. At the edge of a permeable plate they do not, and the finer one's error is up to 2.3 times
/// the change (found on `C1in` against fourth order at 3e-6): hence a factor of 3 everywhere.
const SAFETY: f64 = 3.0;

fn estimate(history: &[Figures]) -> Option<Figures> {
    let last = history.last()?;
    let before = history
        .len()
        .checked_sub(2)
        .and_then(|index| history.get(index))?;
    let change = last.change_from(before).scaled(SAFETY);
    Some(
        match history
            .len()
            .checked_sub(3)
            .and_then(|index| history.get(index))
        {
            Some(earlier) => {
                change.greater_of(&before.change_from(earlier).scaled(SAFETY * MEMORY))
            }
            None => change,
        },
    )
}

/// The energy's error and that of the fields which users look at count alike.
fn scores(level: &Level, w: &[f64], primal: &Jumps, dual: &[f64]) -> Vec<f64> {
    let primal = &primal.energy;
    let dual = jumps(level, w, dual, 0.0).energy;
    let product: Vec<f64> = primal
        .iter()
        .zip(&dual)
        .map(|(p, d)| (p * d).sqrt())
        .collect();
    let (energy, goal): (f64, f64) = (primal.iter().sum(), product.iter().sum());
    let score =
        |(p, g): (&f64, &f64)| p / energy.max(f64::MIN_POSITIVE) + g / goal.max(f64::MIN_POSITIVE);
    primal.iter().zip(&product).map(score).collect()
}

/// The derivative of the mean of B_x over the core, plus that of its mean along the axis inside
/// the circle: over the triangles there, each weighted by its share of the axis.
fn goal(level: &Level) -> Vec<f64> {
    let space = &level.space;
    let mut core = vec![0.0; space.count];
    let mut axis = vec![0.0; space.count];
    let mut core_volume = 0.0;
    for (index, triangle) in space.mesh.triangles.iter().enumerate() {
        let region = space.mesh.region(triangle);
        let on_axis: Vec<f64> = space
            .mesh
            .corners_of(triangle)
            .iter()
            .filter(|corner| corner[0] == 0.0)
            .map(|corner| corner[1])
            .collect();
        let length = match on_axis[..] {
            [a, b] if !region.exterior => (a - b).abs(),
            _ => 0.0,
        };
        if region.zone != Zone::None {
            core_volume += add_mean(space, index, 1.0, &mut core);
        }
        if length > 0.0 {
            let volume = add_mean(space, index, 0.0, &mut []);
            add_mean(
                space,
                index,
                length / (2.0 * space.mesh.circle.radius * volume),
                &mut axis,
            );
        }
    }
    core.iter()
        .zip(&axis)
        .map(|(core, axis)| core / core_volume + axis)
        .collect()
}

/// Adds a factor times the derivative of ∫ B_x r dr dx over a triangle; returns ∫ r dr dx.
fn add_mean(space: &Space, index: usize, factor: f64, goal: &mut [f64]) -> f64 {
    let (Some(nodes), Some(unknowns)) = (space.nodes.get(index), space.unknowns.get(index)) else {
        return 0.0;
    };
    let mut placed = Placed::new(&space.basis);
    let mut volume = 0.0;
    for (sample, weight) in &space.samples {
        placed.fill(nodes, sample);
        let r = placed.point[0];
        let area = 0.5 * placed.jacobian * weight;
        volume += area * r;
        for ((&unknown, phi), gradient) in
            unknowns.iter().zip(&sample.values).zip(&placed.gradients)
        {
            if let Some(entry) = goal.get_mut(unknown as usize) {
                *entry += factor * area * r * (2.0 * phi + r * gradient[0]);
            }
        }
    }
    volume
}

/// A solution on a finer mesh, by its values at the new nodes.
fn transfer(old: &Space, w: &[f64], new: &Space, parents: &[usize]) -> Vec<f64> {
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

impl Solved {
    /// Calls `visit` at every point of integration within the circle.
    pub fn visit(&self, visit: impl FnMut(&At<'_>)) {
        self.level.visit(&self.w, visit);
    }

    /// Flux linked with a coil, Wb: 2π ∫ (turns/area) A_φ r dA, its sense included.
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
        core::f64::consts::TAU * linkage
    }

    /// Work of the currents ∫ J·A dV, J: twice the energy, if nothing saturates.
    #[must_use]
    pub fn work_j(&self, design: &Design) -> f64 {
        let linkages: Vec<f64> = (0..design.coils.len())
            .map(|k| self.linkage_wb(design, k))
            .collect();
        dot(&linkages, &self.excitation.currents_a)
    }
}
