//! Moulds and spacers as bodies of revolution.

use core::f64::consts::TAU;

use palpate_field::design::{Design, MagneticPart};
use palpate_field::geometry::Point;
use palpate_field::geometry::shape::Shape;

/// Sides of a circle: at a radius of 30 mm a side is 5 um from it.
const SIDES: usize = 180;
/// Steps along an arc of at most a quarter of a circle.
const STEPS: u32 = 16;

/// A body to make: a closed outline in the half-plane (r, x), m, that begins and ends on the axis or beside it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Solid {
    pub(super) name: String,
    pub(super) outline: Vec<Point>,
}

/// Wall of the moulds, m, and the slope of their walls, by which castings come out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mould {
    pub(super) wall_m: f64,
    pub(super) draft: f64,
}

/// Corners of a shape, with arcs as short lines.
pub(super) fn corners(shape: &Shape) -> Vec<Point> {
    let mut corners: Vec<Point> = Vec::new();
    for path in shape.paths() {
        let straight = palpate_field::geometry::path::PathCurve::Line == path.curve;
        let steps = if straight { 1 } else { STEPS };
        // Paths on the axis are left out, so a path may begin where none ends.
        if corners.last() != Some(&path.from) {
            corners.push(path.from);
        }
        corners.extend((1..=steps).map(|step| path.at(f64::from(step) / f64::from(steps))));
    }
    if corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    corners
}

/// Volume of the body of revolution, m³, by its outline (Pappus and Guldin).
pub(super) fn volume_m3(outline: &[Point]) -> f64 {
    let edges = outline.iter().zip(outline.iter().cycle().skip(1));
    let parts = edges.map(|([r0, x0], [r1, x1])| (x1 - x0) * (r0 * r0 + r0 * r1 + r1 * r1));
    (TAU / 6.0 * parts.sum::<f64>()).abs()
}

/// Spacers: discs that fill the empty gaps along the axis between the parts.
pub(super) fn spacers(design: &Design) -> Vec<Solid> {
    let rings = design.coils.iter().flat_map(|coil| &coil.rings);
    let boards = design.boards.iter().map(|board| &board.section);
    let rectangles = rings
        .chain(boards)
        .map(|section| (section.x_m, section.r_m[1]));
    let parts = design.parts.iter().map(|part| {
        let corners = corners(&part.shape);
        let [low, high] = ends(corners.iter().map(|[_, x]| *x));
        ([low, high], ends(corners.iter().map(|[r, _]| *r))[1])
    });
    let mut things: Vec<([f64; 2], f64)> = rectangles.chain(parts).collect();
    // Of several that begin at one height the widest comes first.
    things.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(b.1.total_cmp(&a.1)));
    let mut spacers = Vec::new();
    let Some(&(mut below)) = things.first() else {
        return spacers;
    };
    for &(x_m, r_m) in &things {
        let gap = [below.0[1], x_m[0]];
        if gap[1] - gap[0] > 1e-6 {
            // As wide as the narrower neighbour.
            let r_m = r_m.min(below.1);
            spacers.push(Solid {
                name: format!("spacer_{}", spacers.len() + 1),
                outline: vec![[0.0, gap[0]], [r_m, gap[0]], [r_m, gap[1]], [0.0, gap[1]]],
            });
        }
        // Below the next gap lies the part that ends highest so far; of several, the widest.
        if x_m[1] > below.0[1] + 1e-9 || (x_m[1] > below.0[1] - 1e-9 && r_m > below.1) {
            below = (x_m, r_m);
        }
    }
    spacers
}

/// Moulds for a cast body: a cup up to its widest height, and an upside-down cup for the part above. A cup
/// opens upwards by the draft and has the body's radius at half of its height.
pub(super) fn moulds(part: &MagneticPart, mould: &Mould) -> Vec<Solid> {
    let corners = corners(&part.shape);
    let radius_m = |x: f64| -> f64 {
        let edges = corners.iter().zip(corners.iter().cycle().skip(1));
        let crossing = edges.filter(|([_, a], [_, b])| (a.min(*b)..=a.max(*b)).contains(&x));
        let at = crossing.map(|([r0, a], [r1, b])| {
            if a == b {
                r0.max(*r1)
            } else {
                r0 + (x - a) / (b - a) * (r1 - r0)
            }
        });
        at.fold(0.0, f64::max)
    };
    let mut heights: Vec<f64> = corners.iter().map(|[_, x]| *x).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let widest_m = heights.iter().map(|&x| radius_m(x)).fold(0.0, f64::max);
    // The highest of the widest, so that a cylinder needs one cup.
    let Some(parting) = heights.iter().rposition(|&x| radius_m(x) > widest_m - 1e-9) else {
        return Vec::new();
    };
    let (lower, upper) = (&heights[..=parting], &heights[parting..]);
    let upper: Vec<f64> = upper.iter().rev().copied().collect();
    let halves = [("", lower.to_vec()), ("_upper", upper)];
    let halves = halves.into_iter().filter(|(_, heights)| heights.len() > 1);
    halves
        .map(|(half, heights)| {
            let floor = heights[0];
            let mut cavity: Vec<Point> = Vec::new();
            for &x in &heights {
                let least_m = cavity.last().map_or(0.0, |[r, _]| *r);
                // An undercut would not come out: the wall goes straight up there.
                cavity.push([radius_m(x).max(least_m), (x - floor).abs()]);
            }
            let top_m = cavity[cavity.len() - 1][1];
            for [r, x] in &mut cavity {
                *r = (*r + mould.draft * (*x - 0.5 * top_m)).max(0.0);
            }
            let outer_m = cavity[cavity.len() - 1][0] + mould.wall_m;
            let mut outline = vec![
                [0.0, -mould.wall_m],
                [outer_m, -mould.wall_m],
                [outer_m, top_m],
            ];
            outline.extend(cavity.iter().rev());
            if cavity[0][0] > 0.0 {
                outline.push([0.0, 0.0]);
            }
            Solid {
                name: format!("mould_{}{half}", super::file_stem(&part.name)),
                outline,
            }
        })
        .collect()
}

fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
}

/// The body's surface as binary STL, in millimetres.
pub(super) fn stl(solid: &Solid) -> Vec<u8> {
    let corner = |[r, x]: Point, side: usize| {
        // A point on the axis is one point, whatever the side.
        let angle = TAU * (side % SIDES) as f64 / SIDES as f64;
        let (sin, cos) = if r == 0.0 {
            (0.0, 0.0)
        } else {
            angle.sin_cos()
        };
        [r * cos, r * sin, x].map(|coordinate| 1e3 * coordinate as f32)
    };
    let mut triangles: Vec<[[f32; 3]; 3]> = Vec::new();
    let outline = &solid.outline;
    for (&a, &b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
        for side in 0..SIDES {
            let [here, next] = [side, side + 1];
            if a[0] > 0.0 {
                triangles.push([corner(a, here), corner(a, next), corner(b, here)]);
            }
            if b[0] > 0.0 {
                triangles.push([corner(a, next), corner(b, next), corner(b, here)]);
            }
        }
    }
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        // Where the normal is zero, readers compute it from the corners.
        let numbers = [[0.0; 3]].into_iter().chain(triangle).flatten();
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0, 0]);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use palpate_field::design::builtin;

    use super::*;

    /// Every edge of a surface has its opposite once, and the surface encloses the volume of the outline.
    fn volume_of_closed(solid: &Solid) -> f64 {
        let bytes = stl(solid);
        let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
        let mut volume = 0.0;
        for facet in bytes[84..].chunks_exact(50) {
            let number = |at: usize| f32::from_le_bytes(facet[at..at + 4].try_into().unwrap());
            let corners = [12, 24, 36].map(|at| [0, 4, 8].map(|axis| number(at + axis) + 0.0));
            for side in 0..3 {
                let ends =
                    [corners[side], corners[(side + 1) % 3]].map(|place| place.map(f32::to_bits));
                *edges.entry(ends).or_default() += 1;
                *edges.entry([ends[1], ends[0]]).or_default() -= 1;
            }
            let [a, b, c] = corners.map(|place| place.map(f64::from));
            let cross = |axis: usize| {
                b[(axis + 1) % 3] * c[(axis + 2) % 3] - b[(axis + 2) % 3] * c[(axis + 1) % 3]
            };
            volume += (0..3).map(|axis| a[axis] * cross(axis)).sum::<f64>() / 6.0;
        }
        assert!(
            edges.values().all(|count| *count == 0),
            "{} is not closed",
            solid.name
        );
        1e-9 * volume
    }

    #[test]
    fn moulds_hold_the_casting_and_all_surfaces_are_closed() {
        let mould = Mould {
            wall_m: 2e-3,
            draft: 0.0175,
        };
        for (name, halves) in [("closed", 1), ("A", 1), ("B1", 2)] {
            let design = builtin(name).unwrap();
            let part = design.parts.iter().find(|part| part.cast).unwrap();
            let moulds = moulds(part, &mould);
            assert_eq!(moulds.len(), halves, "{name}");
            let mut cavity_m3 = 0.0;
            for mould in &moulds {
                let [r_m, top_m] = mould.outline[2];
                let whole_m3 = 0.5 * TAU * r_m * r_m * (top_m + 2e-3);
                cavity_m3 += whole_m3 - volume_of_closed(mould);
                let off = volume_of_closed(mould) / volume_m3(&mould.outline) - 1.0;
                assert!((-1e-3..0.0).contains(&off), "{name}: {off}");
            }
            // The draft leaves the volume as it is, to its second order.
            let body_m3 = volume_m3(&corners(&part.shape));
            println!("{name}: {cavity_m3} for {body_m3}");
            assert!((cavity_m3 / body_m3 - 1.0).abs() < 0.02, "{name}");
        }
    }

    #[test]
    fn spacers_fill_the_empty_spaces_and_reach_as_far_as_both_neighbours() {
        let spacers = spacers(&builtin("closed-sensing").unwrap());
        let sizes: Vec<[f64; 2]> = spacers
            .iter()
            .map(|disc| [disc.outline[1][0], disc.outline[2][1] - disc.outline[1][1]])
            .collect();
        let expected_mm = [[14.0, 4.965], [10.0, 2.0], [6.95, 1.0], [6.95, 1.0]];
        assert_eq!(sizes.len(), expected_mm.len());
        for (size_m, expected_mm) in sizes.iter().flatten().zip(expected_mm.iter().flatten()) {
            assert!((1e3 * size_m - expected_mm).abs() < 1e-9, "{sizes:?}");
        }
        assert!(spacers.iter().all(|disc| volume_of_closed(disc) > 0.0));
    }
}
