//! Estimated errors of a field, and which triangles should be finer.

use core::f64::consts::TAU;

use super::accuracy::Accuracy;
use super::assembly::Level;
use super::evaluate::Locator;
use super::excitation::Excitation;
use super::indicator::{decay, jumps};
use super::space::Space;
use super::wanted::{Figure, Wanted};
use crate::design::Design;
use crate::element::shape::Placed;
use crate::figures::{Figures, ProfiledFigures};
use crate::geometry::{Point, distance};
use crate::mesh::{CORNER_M, Triangle, Zone};

/// A field on the axis below this fraction of the core's mean is weak: its error is compared with
/// this fraction of the mean instead.
pub(super) const WEAK: f64 = 0.02;
/// A field at the core's centre below this fraction of the core's mean is weak, as that of opposed
/// coils, which have no field there.
const WEAK_CENTRE: f64 = 0.5;
/// Factor by which the relative error of flux linkage and force may exceed the requested accuracy
/// of the field: at 1e-4 they are within 0.2 %.
const WIDER: f64 = 20.0;
/// Factor by which the error of a peak-to-peak value may exceed the requested accuracy: it is the
/// difference of two values at points, of which one is at the edge of the core.
const OF_PEAKS: f64 = 100.0;

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
    w: &[f64],
    relative: f64,
) -> Vec<bool> {
    let mesh = &level.space.mesh;
    let figures = &ProfiledFigures::of(design, level, w, Wanted::Only(&[])).figures;
    let (jumps, decay) = (jumps(level, w), decay(&level.space, w));
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
        .zip(fields.zip(&decay))
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

/// Allowed errors of the figures; infinite where there is no limit. The error of a force that
/// nearly cancels is compared with a hundredth of the energy divided by the gap.
pub(super) fn limits(
    figures: &Figures,
    design: &Design,
    level: &Level,
    excitation: &Excitation,
    accuracy: &Accuracy,
    wanted: Wanted<'_>,
) -> Figures {
    let currents = excitation.currents_a.iter();
    let current = currents.fold(0.0_f64, |greatest, current| greatest.max(current.abs()));
    let of_currents = 0.5 * (figures.linkage_wb * current).abs();
    let energy = of_currents.max(energy_of_magnets_j(level));
    let least = 0.01 * energy / (design.core.x_m[1] - design.core.x_m[0]);
    let limit = |figure: Figure, limit: f64| {
        if wanted.has(figure) {
            limit
        } else {
            f64::INFINITY
        }
    };
    let share = |figure: Figure, limit: f64| match wanted {
        Wanted::Only(figures) if figures.contains(&figure) => limit * accuracy.relative,
        _ => f64::INFINITY,
    };
    let wider = WIDER * accuracy.relative;
    let force = wider * figures.force_n.abs().max(least);
    Figures {
        centre_t: limit(Figure::Centre, accuracy.relative * centre_size(figures)),
        core_mean_t: limit(Figure::CoreMean, accuracy.relative * figures.core_mean_t),
        cv: [
            share(Figure::CvWhole, WIDER),
            share(Figure::CvThreeQuarters, WIDER),
            share(Figure::CvHalf, WIDER),
        ],
        axial_pp: share(Figure::AxialPp, OF_PEAKS),
        radial_pp: share(Figure::RadialPp, OF_PEAKS),
        linkage_wb: limit(Figure::Linkage, wider * figures.linkage_wb.abs()),
        force_n: limit(Figure::Force, force),
        force_by_stress_n: if wanted == Wanted::Field {
            force
        } else {
            f64::INFINITY
        },
        plate_max_t: limit(Figure::PlateMax, PLATE * figures.plate_max_t),
    }
}

/// Whether the field on the axis by two solutions differs by less than the fraction `relative`.
pub(super) fn axis_is_close(axes: [Vec<f64>; 2], relative: f64, figures: &Figures) -> bool {
    let [coarse, fine] = &axes;
    coarse.iter().zip(fine).all(|(coarse, fine)| {
        let size = fine.abs().max(WEAK * figures.core_mean_t);
        (coarse - fine).abs() <= relative * size
    })
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

/// The estimated error is the change from these elements to those of the next order, times this
/// factor.
const SAFETY: f64 = 2.5;
/// Largest error of the greatest field in the plates, as a fraction of it.
const PLATE: f64 = 0.2;

/// Estimated errors, from the change to elements of the next order.
pub(super) fn estimate(change: Figures, figures: &Figures) -> Figures {
    let _ = figures;
    change.scaled(SAFETY)
}

/// Scores of the triangles for refinement, from the energies of the errors of solution and adjoint
/// solution: the error of the energy and that of the fields that users read count equally.
pub(super) fn scores(primal: &[f64], adjoint: &[f64]) -> Vec<f64> {
    let product: Vec<f64> = primal
        .iter()
        .zip(adjoint)
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
