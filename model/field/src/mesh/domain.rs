//! The first triangulation of a design.

use std::collections::{BTreeMap, HashMap};

use super::plan::{MeshLines, MeshPlan, Region};
use super::triangulate::{KeptSegment, MeshTriangulation, QualityLimits, centroid, triangulate};
use super::{Circle, Mesh, MeshError, Triangle, ascending};
use crate::design::{Design, Rectangle};
use crate::geometry::arrangement::Piece;
use crate::geometry::path::PathCurve;
use crate::geometry::{Point, distance};

/// Largest ratio of circumradius to shortest side of a triangle: 1.3 corresponds to a smallest
/// angle of 22.6°, for which Ruppert's method is known to terminate with straight lines.
const SLENDEREST: f64 = 1.3;
/// Largest ratio of length to width of the pieces into which a narrow rectangle is divided.
const NARROW_PIECE: f64 = 12.0;
/// Replaces [`SLENDEREST`] in narrow rectangles: a little more than half of [`NARROW_PIECE`], so
/// that a piece can consist of two triangles. Triangles must not be longer, since refinement halves
/// triangles and keeps their shape: the error of a longer triangle would show late, and hardly as a
/// change from mesh to mesh.
const SLENDEREST_IN_NARROW: f64 = 0.55 * NARROW_PIECE;
/// Largest circumradius of a triangle inside of the circle, relative to the circle's radius. Coarse,
/// since refinement by the error estimate follows.
const LARGEST_INSIDE: f64 = 0.16;
/// Largest circumradius of a triangle outside of the circle, relative to the circle's radius.
const LARGEST_OUTSIDE: f64 = 0.4;
/// Edge length below which nothing is divided, relative to the circle's radius.
const SHORTEST: f64 = 1e-5;

/// Triangulates a design coarsely.
///
/// # Errors
/// [`MeshError`] if lines of the design are too close to each other.
pub fn build(design: &Design, respected: MeshLines) -> Result<Mesh, MeshError> {
    let plan = MeshPlan::of(design, respected);
    let circle = plan.circle;
    let (vertices, segments) = lines(&plan);
    let narrow: Vec<Rectangle> = plan.narrow.iter().copied().chain(gaps(design)).collect();
    let slenderest = |point: Point| {
        if narrow.iter().any(|section| holds(section, point)) {
            SLENDEREST_IN_NARROW
        } else {
            SLENDEREST
        }
    };
    let inside = triangulate(
        &vertices,
        segments,
        &QualityLimits {
            size: &|_| LARGEST_INSIDE * circle.radius,
            slenderest: &slenderest,
            shortest: SHORTEST * circle.radius,
        },
    )?;
    let mut mesh = Mesh {
        vertices: inside.vertices.clone(),
        triangles: Vec::new(),
        bent: HashMap::new(),
        arc: Vec::new(),
        corners: plan
            .corners
            .iter()
            .filter_map(|&c| u32::try_from(c).ok())
            .collect(),
        circle,
        regions: vec![Region::EXTERIOR],
    };
    for (&ends, segment) in &inside.segments {
        if segment.curve != PathCurve::Line {
            mesh.bent.insert(ends, segment.curve);
        }
        if segment.curve == arc_of(&circle) {
            mesh.arc.push(ends);
        }
    }
    fill(&mut mesh, design, &inside);
    attach_exterior(&mut mesh)?;
    Ok(mesh)
}

fn holds(section: &Rectangle, [r, x]: Point) -> bool {
    (section.r_m[0]..=section.r_m[1]).contains(&r) && (section.x_m[0]..=section.x_m[1]).contains(&x)
}

fn arc_of(circle: &Circle) -> PathCurve {
    PathCurve::Ellipse {
        centre: [0.0, circle.centre_x],
        semi_r: circle.radius,
        semi_x: circle.radius,
    }
}

/// The spaces between neighbouring rings of a coil, which are as thin as the copper.
fn gaps(design: &Design) -> Vec<Rectangle> {
    let mut gaps = Vec::new();
    for coil in &design.coils {
        for pair in coil.rings.windows(2) {
            if let [a, b] = pair
                && b.r_m[0] - a.r_m[1] > 4.0 * (a.x_m[1] - a.x_m[0])
            {
                gaps.push(Rectangle {
                    r_m: [a.r_m[1], b.r_m[0]],
                    x_m: a.x_m,
                });
            }
        }
    }
    gaps
}

type Lines = (Vec<Point>, BTreeMap<[u32; 2], KeptSegment>);

/// The lines of the plan as straight or curved segments, with the sides of narrow rectangles
/// divided.
fn lines(plan: &MeshPlan) -> Lines {
    let mut vertices = plan.arrangement.vertices.clone();
    for section in &plan.narrow {
        for point in divide(section, &vertices, plan.slack()) {
            let known = |&vertex: &Point| distance(vertex, point) <= plan.slack();
            if !vertices.iter().any(known) {
                vertices.push(point);
            }
        }
    }
    let mut segments = BTreeMap::new();
    for piece in &plan.arrangement.pieces {
        let segment = KeptSegment {
            curve: piece.curve,
            fixed: false,
        };
        let stops = stops(plan, piece, &mut vertices);
        for pair in stops.windows(2) {
            if let &[a, b] = pair {
                let ends = [a, b].map(|end| u32::try_from(end).unwrap_or(u32::MAX));
                segments.insert(ascending(ends), segment);
            }
        }
    }
    (vertices, segments)
}

/// The vertices along a piece of a line, including its ends.
fn stops(plan: &MeshPlan, piece: &Piece, vertices: &mut Vec<Point>) -> Vec<usize> {
    let [from, to] = piece.ends;
    let path = plan.arrangement.path(piece);
    if piece.curve != PathCurve::Line {
        if !has_chord(plan, piece) {
            return vec![from, to];
        }
        vertices.push(path.at(0.5));
        return vec![from, vertices.len() - 1, to];
    }
    let share = |(index, vertex): (usize, &Point)| {
        let share = path.share_of(*vertex);
        let on = (0.0..=1.0).contains(&share) && distance(path.at(share), *vertex) <= plan.slack();
        (on && !piece.ends.contains(&index)).then_some((share, index))
    };
    let mut between: Vec<(f64, usize)> = vertices.iter().enumerate().filter_map(share).collect();
    between.sort_by(|a, b| a.0.total_cmp(&b.0));
    let between = between.into_iter().map(|(_, index)| index);
    [from].into_iter().chain(between).chain([to]).collect()
}

/// Points on both long sides of a narrow rectangle, opposite each other: one beside every vertex of
/// either side, and others between them.
fn divide(section: &Rectangle, vertices: &[Point], slack: f64) -> Vec<Point> {
    let lying = section.r_m[1] - section.r_m[0] > section.x_m[1] - section.x_m[0];
    let (long, short) = if lying {
        (section.r_m, section.x_m)
    } else {
        (section.x_m, section.r_m)
    };
    let turned = |[r, x]: Point| if lying { [r, x] } else { [x, r] };
    let on_long_side = |vertex: &Point| {
        let [along, aside] = turned(*vertex);
        let beside = short.iter().any(|side| (aside - side).abs() <= slack);
        (beside && along > long[0] + slack && along < long[1] - slack).then_some(along)
    };
    let mut ends = vec![long[0], long[1]];
    ends.extend(vertices.iter().filter_map(on_long_side));
    ends.sort_by(f64::total_cmp);
    let longest = NARROW_PIECE * (short[1] - short[0]);
    let mut places = Vec::new();
    for pair in ends.windows(2) {
        let &[from, to] = pair else { continue };
        let count = ((to - from) / longest).ceil().max(1.0);
        let mut step = 0.0;
        while step < count {
            places.push(from + step / count * (to - from));
            step += 1.0;
        }
    }
    let across = places
        .into_iter()
        .skip(1)
        .flat_map(|along| short.map(|aside| turned([along, aside])));
    across.collect()
}

/// Whether another piece with a different curve has the same ends, as the axis and the half-circle
/// of a sphere have: there can be only one line between two vertices.
fn has_chord(plan: &MeshPlan, piece: &Piece) -> bool {
    let others = plan.arrangement.pieces.iter();
    let mut alike = others.filter(|other| other.ends == piece.ends);
    alike.any(|other| other.curve != piece.curve)
}

/// Adds the triangles of the inside with their regions.
fn fill(mesh: &mut Mesh, design: &Design, inside: &MeshTriangulation) {
    let mut known: HashMap<Region, u32> = HashMap::new();
    for &vertices in &inside.triangles {
        let corners = vertices.map(|vertex| mesh.position(vertex));
        let middle = bent_middle(mesh, vertices, centroid(corners));
        let mut region = Region::at(design, &mesh.circle, middle);
        region.exterior = false;
        let index = *known.entry(region).or_insert_with(|| {
            mesh.regions.push(region);
            u32::try_from(mesh.regions.len() - 1).unwrap_or(0)
        });
        mesh.triangles.push(Triangle {
            vertices,
            region: index,
        });
    }
    mesh.orient();
}

/// The middle of a triangle, moved along with its curved sides.
fn bent_middle(mesh: &Mesh, [a, b, c]: [u32; 3], mut middle: Point) -> Point {
    for [from, to] in [[a, b], [b, c], [c, a]] {
        let (p, q) = (mesh.position(from), mesh.position(to));
        let on_curve = mesh.curve([from, to]).between(p, q, 0.5);
        for axis in 0..2 {
            // Fraction of an edge's displacement that reaches the triangle's middle; see
            // `element::shape`.
            middle[axis] += 4.0 / 9.0 * (on_curve[axis] - 0.5 * (p[axis] + q[axis]));
        }
    }
    middle
}

/// Triangulates the half-disc of the exterior, starting from the vertices on the arc.
fn attach_exterior(mesh: &mut Mesh) -> Result<(), MeshError> {
    let circle = mesh.circle;
    let curve = arc_of(&circle);
    let mut shared: Vec<u32> = mesh.arc.iter().flatten().copied().collect();
    shared.sort_unstable();
    shared.dedup();
    let vertices: Vec<Point> = shared.iter().map(|&vertex| mesh.position(vertex)).collect();
    let local = |vertex: u32| shared.binary_search(&vertex).unwrap_or(0);
    let mut segments = BTreeMap::new();
    for ends in &mesh.arc {
        let ends = ends.map(|end| u32::try_from(local(end)).unwrap_or(0));
        segments.insert(ascending(ends), KeptSegment { curve, fixed: true });
    }
    let mut poles: Vec<u32> = (0..)
        .zip(&vertices)
        .filter(|(_, v)| v[0] == 0.0)
        .map(|(i, _)| i)
        .collect();
    poles.truncate(2);
    if let &[low, high] = poles.as_slice() {
        let axis = KeptSegment {
            curve: PathCurve::Line,
            fixed: false,
        };
        segments.insert(ascending([low, high]), axis);
    }
    let outside = triangulate(
        &vertices,
        segments,
        &QualityLimits {
            size: &|_| LARGEST_OUTSIDE * circle.radius,
            slenderest: &|_| SLENDEREST,
            shortest: SHORTEST * circle.radius,
        },
    )?;
    let first = mesh.vertices.len();
    mesh.vertices
        .extend(outside.vertices.iter().skip(shared.len()));
    let global = |vertex: u32| match shared.get(vertex as usize) {
        Some(&known) => known,
        None => u32::try_from(first + vertex as usize - shared.len()).unwrap_or(0),
    };
    let before = mesh.triangles.len();
    for triangle in &outside.triangles {
        mesh.triangles.push(Triangle {
            vertices: triangle.map(global),
            region: 0,
        });
    }
    mesh.orient_from(before);
    Ok(())
}
