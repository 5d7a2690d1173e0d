//! Estimated errors of a field, and which triangles should be finer.

use core::f64::consts::TAU;

use super::assembly::Level;
use super::evaluate::Locator;
use super::excitation::Excitation;
use super::indicator::{Jumps, jumps_of_change};
use super::space::Space;
use crate::design::Design;
use crate::element::shape::Placed;
use crate::figures::Figures;
use crate::geometry::{Point, distance};
use crate::mesh::{CORNER_M, Triangle, Zone};
use crate::plates;

/// A field on the axis below this fraction of the core's mean is weak: its error is compared with
/// this fraction of the mean instead.
pub(super) const WEAK: f64 = 0.02;
/// A field at the core's centre below this fraction of the core's mean is weak, as that of opposed
/// coils, which have no field there.
const WEAK_CENTRE: f64 = 0.5;
/// Factor by which the relative error of flux linkage and force may exceed the requested accuracy
/// of the field: at 1e-4 they are within 0.2 %.
pub(super) const WIDER: f64 = 20.0;

/// B_x along the axis within the circle, T.
pub(super) fn axis(level: &Level, w: &[f64]) -> Vec<f64> {
    const STEPS: u32 = 40;
    let circle = level.space.mesh.circle;
    let locator = Locator::new(level, w);
    (1..STEPS)
        .map(|step| 2.0 * f64::from(step) / f64::from(STEPS) - 1.0)
        .map(|share| locator.at([0.0, circle.centre_x + share * circle.radius]).b[1])
        .collect()
}

/// Marks triangles of the inner core and on the axis whose jump of the field or error of w exceeds
/// the fraction `relative` of the field. A field below a fiftieth of the core's mean counts as a
/// fiftieth. The energy in these triangles is small, since volumes near the axis are small, but
/// users read the field there. On `air` with orders 3 and 4 the error on the axis is 0.1 to 0.9 of
/// the greatest jump.
pub(super) fn rough(
    design: &Design,
    level: &Level,
    jumps: &Jumps,
    decay: &[f64],
    relative: f64,
    figures: &Figures,
) -> Vec<bool> {
    let mesh = &level.space.mesh;
    let judged = |triangle: &Triangle| {
        let on_axis = triangle
            .vertices
            .iter()
            .any(|&vertex| mesh.position(vertex)[0] == 0.0);
        on_axis || mesh.region(triangle).zone >= Zone::ThreeQuarters
    };
    // At a singular corner the field has no scale: triangles there would be halved without end.
    let at_corner = |triangle: &Triangle| {
        let places = mesh.corners_of(triangle);
        let near = |&vertex: &u32| {
            let corner = mesh.position(vertex);
            let within = |&place: &Point| distance(place, corner) <= CORNER_M;
            triangle.vertices.contains(&vertex) || places.iter().all(within)
        };
        mesh.corners.iter().any(near)
    };
    let fields = jumps.field_t.iter().zip(&jumps.size_t);
    mesh.triangles
        .iter()
        .zip(fields.zip(decay))
        .map(|(triangle, ((&jump, &size), &decay))| {
            let (safety, size) = if at_centre(design, level, triangle) {
                (SAFETY, centre_size(figures))
            } else {
                (1.0, size.max(WEAK * figures.core_mean_t))
            };
            let limit = relative * size;
            let error = safety * jump.max(2.0 * decay);
            judged(triangle) && error > limit && !at_corner(triangle)
        })
        .collect()
}

/// Estimated error of the field at the core's centre, T: [`SAFETY`] times the greatest of the jumps
/// of the field and the errors of w in the triangles there. On `pot` the error is 2.4 times the
/// jump.
pub(super) fn centre_error(design: &Design, level: &Level, jumps: &Jumps, decay: &[f64]) -> f64 {
    let triangles = level.space.mesh.triangles.iter();
    let triangles = triangles.zip(jumps.field_t.iter().zip(decay));
    let at_centre = triangles.filter(|(triangle, _)| at_centre(design, level, triangle));
    at_centre
        .map(|(_, (jump, decay))| SAFETY * jump.max(2.0 * decay))
        .fold(0.0, f64::max)
}

/// Whether a triangle touches the axis at the core's centre.
fn at_centre(design: &Design, level: &Level, triangle: &Triangle) -> bool {
    let mesh = &level.space.mesh;
    let middle = design.core.middle_m();
    let corners = mesh.corners_of(triangle);
    let [low, high] = [f64::min, f64::max].map(|pick| {
        let along = corners.map(|corner| corner[1]);
        along.into_iter().reduce(pick).unwrap_or(f64::NAN)
    });
    let on_axis = corners.iter().any(|corner| corner[0] == 0.0);
    on_axis && low <= middle && middle <= high && !mesh.region(triangle).exterior
}

/// Field to which the error at the core's centre is relative, T: the field there, but at least half
/// of the core's mean.
pub(super) fn centre_size(figures: &Figures) -> f64 {
    figures
        .centre_t
        .abs()
        .max(WEAK_CENTRE * figures.core_mean_t)
}

/// Sizes to which the errors of figures are relative. The error of a force that nearly cancels is
/// compared with a hundredth of the energy divided by the gap.
pub(super) struct Sizes {
    centre_t: f64,
    core_mean_t: f64,
    linkage_wb: f64,
    force_n: f64,
}

impl Sizes {
    pub(super) fn of(
        figures: &Figures,
        design: &Design,
        level: &Level,
        excitation: &Excitation,
    ) -> Self {
        let currents = excitation.currents_a.iter();
        let current = currents.fold(0.0_f64, |greatest, current| greatest.max(current.abs()));
        let of_currents = 0.5 * (figures.linkage_wb * current).abs();
        let energy = of_currents.max(energy_of_magnets_j(level));
        let least = 0.01 * energy / (design.core.x_m[1] - design.core.x_m[0]);
        Self {
            centre_t: centre_size(figures),
            core_mean_t: figures.core_mean_t.abs(),
            linkage_wb: figures.linkage_wb.abs(),
            force_n: figures.force_n.abs().max(least),
        }
    }

    /// Allowed errors: `relative` for centre and mean field, and [`WIDER`] times it for flux linkage
    /// and force. The other figures have no limit.
    pub(super) fn limits(&self, relative: f64) -> Figures {
        let (force_n, none) = (WIDER * relative * self.force_n, f64::INFINITY);
        Figures {
            centre_t: relative * self.centre_t,
            core_mean_t: relative * self.core_mean_t,
            cv: [none; 3],
            axial_pp: none,
            radial_pp: none,
            linkage_wb: WIDER * relative * self.linkage_wb,
            force_n,
            force_by_stress_n: force_n,
            plate_max_t: none,
        }
    }
}

/// Upper bound of the field energy outside of the magnets, J: B_r²/8μ times their volume, which is
/// reached if B is half of B_r.
fn energy_of_magnets_j(level: &Level) -> f64 {
    if level.remanences_t.iter().all(|remanence| *remanence == 0.0) {
        return 0.0;
    }
    let mut energy_j = 0.0;
    level.visit(&[], |at| {
        let (material, [_, below]) = level.law_at(at.index, [0.0; 2]);
        let volume = TAU * at.weight * at.point[0];
        energy_j += 0.25 * volume * material.energy_j_per_m3(below.abs());
    });
    energy_j
}

/// The estimated error is the change from mesh to mesh times this safety factor. If meshes improve
/// fast, the change is nearly the error of the coarser mesh. At the edge of a permeable plate
/// meshes improve slowly, and the error of the finer mesh is up to 2.3 times the change (found on
/// `C1in` against fourth order at 3e-6): hence a factor of 3 everywhere.
pub(super) const SAFETY: f64 = 3.0;
/// Fraction of each earlier estimate that the estimated error includes, since a change may vanish
/// by chance, and a change after a local refinement means little. In 68 solutions of the built-in
/// designs, at accuracies of 1e-3 to 3e-5, the true error of a homogeneity or a profile exceeds the
/// estimate in 6 solutions with a fraction of 0.25, in 2 with 0.4, and in none with 0.5.
const MEMORY: f64 = 0.5;
/// Least relative errors of the core's mean, the homogeneity and the force, as multiples of the
/// linkage's relative error. The flux linkage is an energy, whose error has one sign and falls on
/// every mesh; no other integral is more accurate. In the same 68 solutions their true errors are up
/// to 0.14, 1.8 and 1.1 of the linkage's.
const LEAST_OF_LINKAGE: LinkageShares = LinkageShares {
    core_mean: 0.25,
    cv: 2.0,
    force: 1.5,
};

struct LinkageShares {
    core_mean: f64,
    cv: f64,
    force: f64,
}

/// Estimated errors on a mesh, from the change since the previous mesh and the estimates there.
pub(super) fn estimate(change: Figures, figures: &Figures, before: Option<Figures>) -> Figures {
    let mut errors = change.scaled(SAFETY);
    if let Some(before) = before {
        errors = errors.greater_of(&before.scaled(MEMORY));
    }
    let energy = errors.linkage_wb / figures.linkage_wb.abs();
    // A design without a coil has no flux linkage.
    if energy.is_finite() {
        let least = LEAST_OF_LINKAGE;
        let raise = |error: &mut f64, size: f64| *error = error.max(energy * size.abs());
        raise(
            &mut errors.core_mean_t,
            least.core_mean * figures.core_mean_t,
        );
        raise(&mut errors.cv[0], least.cv);
        raise(&mut errors.force_n, least.force * figures.force_n);
        raise(
            &mut errors.force_by_stress_n,
            least.force * figures.force_by_stress_n,
        );
    }
    errors
}

/// Accuracy of the greatest field in the plates, on one mesh.
pub(super) struct PlatePeak {
    /// Estimated error, T.
    pub(super) error_t: f64,
    /// Whether each triangle may contain a greater field, so that it has to be halved.
    pub(super) coarse: Vec<bool>,
}

/// Largest error of the greatest field in the plates, as a fraction of it: triangles are halved
/// until it is reached. On C1in, C1out, backplates and pot, a limit of a twentieth takes 1.5 times
/// as long and halves the true error, which is at most a quarter of the estimate: 1.6 % on C1in.
pub(super) const PLATE: f64 = 0.2;

/// Estimates the error of the greatest field in the plates from the jumps and the probable error of
/// w in each triangle there.
pub(super) fn plate_peak(
    design: &Design,
    level: &Level,
    w: &[f64],
    greatest_t: f64,
    jumps: &Jumps,
    decay: &[f64],
) -> PlatePeak {
    let mut peak = PlatePeak {
        error_t: 0.0,
        coarse: vec![false; level.space.mesh.triangles.len()],
    };
    let locator = Locator::new(level, w);
    plates::visit(design, level, w, &locator, |triangle, size_t| {
        let of = |errors: &[f64]| errors.get(triangle).copied().unwrap_or(0.0);
        let error_t = SAFETY * of(&jumps.field_t).max(2.0 * of(decay));
        let most_t = size_t + error_t;
        let is_greatest = size_t >= greatest_t;
        peak.error_t = peak.error_t.max(most_t - greatest_t);
        if let Some(coarse) = peak.coarse.get_mut(triangle)
            && error_t > PLATE * greatest_t
            && (most_t > greatest_t || is_greatest)
        {
            *coarse = true;
        }
    });
    peak
}

/// Scores of the triangles for refinement: the error of the energy and that of the fields that
/// users read count equally.
pub(super) fn scores(level: &Level, w: &[f64], primal: &Jumps, dual: &[f64]) -> Vec<f64> {
    scores_of(&primal.energy, &jumps_of_change(level, w, dual).energy)
}

/// Scores from the energies of the errors of solution and adjoint solution in each triangle.
pub(super) fn scores_of(primal: &[f64], dual: &[f64]) -> Vec<f64> {
    let product: Vec<f64> = primal
        .iter()
        .zip(dual)
        .map(|(p, d)| (p * d).sqrt())
        .collect();
    let (energy, goal): (f64, f64) = (primal.iter().sum(), product.iter().sum());
    let score =
        |(p, g): (&f64, &f64)| p / energy.max(f64::MIN_POSITIVE) + g / goal.max(f64::MIN_POSITIVE);
    primal.iter().zip(&product).map(score).collect()
}

/// Derivative of the goal with respect to the coefficients of w. The goal is the mean of B_x over
/// the core plus its mean along the axis inside the circle. The latter is taken over the triangles
/// on the axis, each weighted by its length there.
pub(super) fn goal(level: &Level) -> Vec<f64> {
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

/// Adds `factor` times the derivative of ∫ B_x r dr dx over a triangle to `goal`; returns ∫ r dr
/// dx.
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
