//! Greatest flux density in the plates, except magnets: shows how close soft metal is to
//! saturation.
//!
//! At corners the field is singular, so a disc of radius [`CORNER_M`] about each corner is omitted.
//! Within a part of uniform permeability |B|² has its greatest value on the boundary, and near a
//! corner that boundary is the disc's edge: the edge is sampled in addition to the points of
//! integration.

use core::f64::consts::TAU;

use crate::design::Design;
use crate::geometry::{Point, distance, length};
use crate::mesh::{CORNER_M, Region};
use crate::solve::{Level, Locator};

/// Number of points on the edge of the disc about a corner, 11 degrees apart: that is dense enough,
/// since |B| about a corner falls at most with the cube root of the distance.
const AROUND: u32 = 32;

/// Greatest |B| in the plates, T, at least 0.1 mm from corners; 0 without a plate.
#[must_use]
pub fn greatest(design: &Design, level: &Level, w: &[f64], locator: &Locator<'_>) -> f64 {
    let mut greatest = 0.0_f64;
    visit(design, level, w, locator, |_, size_t| {
        greatest = greatest.max(size_t)
    });
    greatest
}

/// Calls `found` with the index of the triangle and |B|, T, at every sampled point of the plates
/// that is at least 0.1 mm from corners.
pub(crate) fn visit(
    design: &Design,
    level: &Level,
    w: &[f64],
    locator: &Locator<'_>,
    found: impl FnMut(usize, f64),
) {
    let soft_plate = |part: usize| {
        let part = design.parts.get(part);
        part.is_some_and(|part| !part.cast && part.remanence_t == 0.0)
    };
    if (0..design.parts.len()).any(soft_plate) {
        visit_parts(level, w, locator, soft_plate, found);
    }
}

/// Like [`visit`], for the parts that `counts` selects.
pub(crate) fn visit_parts(
    level: &Level,
    w: &[f64],
    locator: &Locator<'_>,
    counts: impl Fn(usize) -> bool,
    mut found: impl FnMut(usize, f64),
) {
    let mesh = &level.space.mesh;
    let corners = mesh.corners.iter().map(|&corner| mesh.position(corner));
    let corners: Vec<Point> = corners.collect();
    let in_part = |region: &Region| region.part.is_some_and(|part| counts(part as usize));
    let far = |point: Point| {
        let far = |&corner: &Point| distance(point, corner) > CORNER_M;
        corners.iter().all(far)
    };
    level.visit_where(w, in_part, |at| {
        if far(at.point) {
            found(at.triangle, length(at.b));
        }
    });
    for corner in &corners {
        for step in 0..AROUND {
            let (sine, cosine) = (TAU * f64::from(step) / f64::from(AROUND)).sin_cos();
            let reach = CORNER_M * (1.0 + 1e-6);
            let point = [corner[0] + reach * cosine, corner[1] + reach * sine];
            if point[0] < 0.0 {
                continue;
            }
            let at = locator.at(point);
            let region = mesh.regions.get(at.region as usize);
            if let Some(triangle) = locator.triangle(point)
                && region.is_some_and(in_part)
                && far(point)
            {
                found(triangle, at.size());
            }
        }
    }
}
