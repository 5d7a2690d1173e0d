//! Solution for figures alone: on each mesh a second solution with elements of the next order shows
//! the error of every figure, and the mesh is refined until the requested ones are accurate.

use super::accuracy::Accuracy;
use super::adapt::{SolveReport, Solved, transfer};
use super::assembly::Level;
use super::excitation::Excitation;
use super::finer::{Finer, raised};
use super::indicator::{decay, jumps, refined};
use super::judge::{PLATE, Sizes, WIDER, goal, plate_peak, scores_of};
use super::newton::{Balanced, Pattern, SolveError, balance};
use super::space::Space;
use super::wanted::{Figure, Wanted};
use crate::design::Design;
use crate::figures::{Figures, ProfiledFigures, change_of_triangles};
use crate::material::Material;
use crate::mesh::{self, Mesh};

/// Order of the first elements, which is often enough for a search.
const FIRST_ORDER: u32 = 2;
/// Below this accuracy the first elements have one order more: those of [`FIRST_ORDER`] hardly ever
/// reach it, and take a sixth of the time.
const FINE: f64 = 1e-3;
/// Longest side allowed on the first mesh for triangles at corners where the field is singular,
/// relative to the radius of the circle that contains all parts. With 0.004 C1in, C3in and CAin take
/// up to twice as long for the core's mean, with 0.002 most other designs a tenth longer.
const CORNER_SIZE: f64 = 0.003;
/// Newton's method ends when its last step is less than the root of the requested accuracy times
/// this. The remaining error is about the square of the last step, and part of the estimate.
const LAST_STEP: f64 = 0.1;
/// Longest side allowed on the first mesh for triangles on the core's axis, relative to the core's
/// length, if the field at the centre is wanted: it is that of single triangles, while all other
/// figures are sums over many. Without this limit A, A10, C1in, closed, pot and 15 variants of B1 take
/// 2.4 times as long together, with half of it 5 % longer.
const AXIS_SIZE: f64 = 0.25;
/// At each refinement, triangles are halved that together have this fraction of the total score.
const SHARE: f64 = 0.4;
/// With lower orders Newton's method ends when its last step is less than this: the next order
/// changes the field by more than the remaining error.
const ROUGH_STEP: f64 = 0.03;

/// A solution on one mesh.
pub(super) struct Step {
    pub(super) level: Level,
    pub(super) pattern: Pattern,
    pub(super) balanced: Balanced,
}

/// Solves a design until the requested figures are accurate. [`super::solve`] also makes the field
/// accurate on the axis and in the inner core.
///
/// # Errors
/// As for [`super::solve`].
pub fn solve_for(
    design: &Design,
    excitation: &Excitation,
    accuracy: &Accuracy,
    wanted: Wanted<'_>,
) -> Result<Solved, SolveError> {
    let mut mesh = mesh::build(design, mesh::MeshLines::WithCore)?;
    mesh.refine_corners(CORNER_SIZE * mesh.circle.radius);
    if wanted.has(Figure::Centre) {
        let [from, to] = design.core.x_m;
        mesh.refine_axis([from, to], AXIS_SIZE * (to - from));
    }
    let mut solver = Solver {
        design,
        excitation,
        last_step: LAST_STEP * accuracy.relative.sqrt(),
        linear_solves: 0,
    };
    let first_order = FIRST_ORDER + u32::from(accuracy.relative < FINE);
    let mut step = solver.first(mesh, first_order.min(accuracy.order))?;
    let mut before: Option<(Figures, f64)> = None;
    let mut levels = 1;
    loop {
        let Step {
            level, balanced, ..
        } = &step;
        let finer = Finer::of(design, excitation, &step)?;
        solver.linear_solves += 1;
        let profiled = ProfiledFigures::of(design, level, &balanced.w, wanted);
        let finer_profiled = ProfiledFigures::of(design, &finer.level, &finer.w, wanted);
        let figures = profiled.figures;
        let change = Figures {
            centre_t: finer_profiled.change_about_centre_t(&profiled),
            ..finer_profiled.change_from(&profiled)
        };
        let raised = raised(&level.space, &balanced.w, &finer.level.space);
        let of_triangles = change_of_triangles(&finer.level, [&raised, &finer.w]);
        let errors = estimate(change, &of_triangles, &figures, before);
        let limits = limits(&figures, design, level, excitation, accuracy, wanted);
        let reached = errors.is_within(&limits);
        if reached || 2 * level.space.count > accuracy.most_unknowns {
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
        let raises = level.space.basis.order() < accuracy.order;
        before = Some((
            errors,
            if raises {
                OF_LOWER_ORDER
            } else {
                OF_COARSER_MESH
            },
        ));
        step = if raises {
            solver.raised(finer)?
        } else {
            let but_plates = Figures {
                plate_max_t: f64::INFINITY,
                ..limits
            };
            let at_peak = if errors.is_within(&but_plates) {
                solver.at_plate_peak(&step, figures.plate_max_t)
            } else {
                Vec::new()
            };
            let (mesh, parents) = if at_peak.contains(&true) {
                let mut mesh = level.space.mesh.clone();
                let parents = mesh.refine(&at_peak);
                (mesh, parents)
            } else {
                let adjoint = finer.energy_of_adjoint(&step, goal);
                let scores = scores_of(&finer.energy_of_change(), &adjoint);
                refined(&level.space.mesh, scores, SHARE)
            };
            drop(finer);
            solver.on(mesh, &parents, &step)?
        };
        levels += 1;
    }
}

/// An estimate includes this fraction of the estimate for elements one order lower, since a change
/// may vanish by chance.
const OF_LOWER_ORDER: f64 = 0.02;
/// An estimate includes this fraction of the estimate on the coarser mesh.
const OF_COARSER_MESH: f64 = 0.1;
/// Error of a figure over its change to elements of the next order. At edges of metal the next order
/// is hardly better: there the error is 2.3 to 2.5 times the change.
const OF_CHANGE: f64 = 4.0;
/// Error of mean and homogeneity over the sum of the changes that the single triangles make.
/// At the edges of thin discs of high permeability these changes may cancel each other, and the
/// errors do not: in 150 designs drawn by the test `drawn` (seeds 1001 to 1060, 2001 to 2060 and
/// 3001 to 3030), four errors are 3 to 40 times the change, and 0.03 to 0.26 of the sum.
const OF_TRIANGLES: f64 = 0.25;
/// Error of a peak-to-peak value over twice the greatest change of its profile: half of 2.3, since
/// the error is at one end of the profile.
const OF_PROFILE: f64 = 1.15;
/// Least relative error of the greatest field in the plates, by the distance of sampled points.
const SAMPLED: f64 = 0.01;
/// Least relative error of the force, as a multiple of that of the linkage. The linkage is an energy,
/// whose error has one sign and is found most surely. Without this least value one estimate for the
/// same designs is 1.08 times the error.
const LEAST_OF_LINKAGE: f64 = 0.08;

/// Estimated errors: [`OF_CHANGE`] times the change to elements of the next order, and at least
/// [`OF_TRIANGLES`] of the changes of single triangles.
fn estimate(
    change: Figures,
    of_triangles: &Figures,
    figures: &Figures,
    before: Option<(Figures, f64)>,
) -> Figures {
    let mut errors = change.scaled(OF_CHANGE);
    errors = errors.greater_of(&of_triangles.scaled(OF_TRIANGLES));
    errors.axial_pp = OF_PROFILE * change.axial_pp;
    errors.radial_pp = OF_PROFILE * change.radial_pp;
    // Points of another mesh are elsewhere.
    let sampled = SAMPLED * figures.plate_max_t;
    errors.plate_max_t = errors.plate_max_t.max(sampled);
    if let Some((before, share)) = before {
        errors = errors.greater_of(&before.scaled(share));
    }
    let least = LEAST_OF_LINKAGE * errors.linkage_wb / figures.linkage_wb.abs();
    // A design without a coil has no flux linkage.
    if least.is_finite() {
        errors.force_n = errors.force_n.max(least * figures.force_n.abs());
    }
    // Corners of metal far from the core change centre and mean alike.
    let mean = errors.core_mean_t / figures.core_mean_t;
    if mean.is_finite() {
        errors.centre_t = errors.centre_t.max(mean * figures.centre_t.abs());
    }
    errors
}

/// Factor by which the error of a peak-to-peak value may exceed the requested accuracy: it is the
/// difference between two single points, one of them at the edge of the core.
const OF_PEAKS: f64 = 100.0;

/// Allowed errors of the figures; infinite where there is no limit.
fn limits(
    figures: &Figures,
    design: &Design,
    level: &Level,
    excitation: &Excitation,
    accuracy: &Accuracy,
    wanted: Wanted<'_>,
) -> Figures {
    let limits = Sizes::of(figures, design, level, excitation).limits(accuracy.relative);
    let limit = |figure, limit| {
        if wanted.has(figure) {
            limit
        } else {
            f64::INFINITY
        }
    };
    // These have a limit only if named: at an edge of metal they hardly settle.
    let share = |figure, factor: f64| match wanted {
        Wanted::Only(figures) if figures.contains(&figure) => factor * accuracy.relative,
        Wanted::Only(_) | Wanted::Figures => f64::INFINITY,
    };
    Figures {
        centre_t: limit(Figure::Centre, limits.centre_t),
        core_mean_t: limit(Figure::CoreMean, limits.core_mean_t),
        cv: [Figure::CvWhole, Figure::CvThreeQuarters, Figure::CvHalf].map(|cv| share(cv, WIDER)),
        axial_pp: share(Figure::AxialPp, OF_PEAKS),
        radial_pp: share(Figure::RadialPp, OF_PEAKS),
        linkage_wb: limit(Figure::Linkage, limits.linkage_wb),
        force_n: limit(Figure::Force, limits.force_n),
        force_by_stress_n: f64::INFINITY,
        plate_max_t: limit(Figure::PlateMax, PLATE * figures.plate_max_t),
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
        let level = |order| {
            Level::new(
                self.design,
                Space::new(mesh.clone(), order),
                self.excitation,
            )
        };
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

    /// Marks the triangles in which the greatest field in the plates may be.
    fn at_plate_peak(&self, step: &Step, greatest_t: f64) -> Vec<bool> {
        let (level, w) = (&step.level, &step.balanced.w);
        let (jumps, decay) = (jumps(level, w), decay(&level.space, w));
        plate_peak(self.design, level, w, greatest_t, &jumps, &decay).coarse
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
