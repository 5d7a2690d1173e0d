//! The first triangulation of a design.

use std::collections::{BTreeMap, HashMap};

use super::plan::{MeshPlan, Region};
use super::triangulate::{KeptSegment, MeshTriangulation, Wish, centroid, triangulate};
use super::{Circle, Mesh, MeshError, Triangle, ascending};
use crate::design::{Design, Rectangle};
use crate::geometry::arrangement::Piece;
use crate::geometry::path::{Path, PathCurve};
use crate::geometry::{Point, distance};

/// Pieces that a narrow rectangle is divided into are at most so many times longer than wide.
const NARROW_PIECE: f64 = 12.0;
/// Circumradius of the largest triangle over the circle's radius, inside and outside. Coarse:
/// refinement by the error estimate does the rest.
const LARGEST_INSIDE: f64 = 0.16;
const LARGEST_OUTSIDE: f64 = 0.4;
/// Shortest edge over the circle's radius.
const SHORTEST: f64 = 1e-5;

/// Triangulates a design, coarsely.
///
/// # Errors
/// [`MeshError`] where lines of the design come too near each other.
pub fn build(design: &Design) -> Result<Mesh, MeshError> {
    let plan = MeshPlan::of(design);
    let circle = plan.circle;
    let (vertices, segments) = lines(&plan);
    let narrow = |point: Point| plan.narrow.iter().any(|section| holds(section, point));
    let between = gaps(design);
    let exempt = |point: Point| narrow(point) || between.iter().any(|gap| holds(gap, point));
    let inside = triangulate(
        &vertices,
        segments,
        &Wish {
            size: &|_| LARGEST_INSIDE * circle.radius,
            exempt: &exempt,
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

/// The spaces between neighbouring rings of a coil, narrow as the copper is.
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

/// The plan's pieces, narrow rectangles divided across.
fn lines(plan: &MeshPlan) -> Lines {
    let mut vertices = plan.arrangement.vertices.clone();
    let mut across: Vec<Path> = Vec::new();
    for section in &plan.narrow {
        across.extend(divide(section, &vertices, plan.tolerance));
    }
    let mut find = |point: Point| match vertices
        .iter()
        .position(|&v| distance(v, point) <= 4.0 * plan.tolerance)
    {
        Some(index) => index,
        None => {
            vertices.push(point);
            vertices.len() - 1
        }
    };
    let mut pieces: Vec<([usize; 2], KeptSegment)> = Vec::new();
    for path in &across {
        let segment = KeptSegment {
            curve: PathCurve::Line,
            fixed: true,
        };
        pieces.push(([find(path.from), find(path.to)], segment));
    }
    for piece in &plan.arrangement.pieces {
        let path = plan.arrangement.path(piece);
        let middle = path.at(0.5);
        let slack = 4.0 * plan.tolerance;
        let fixed = piece.curve == PathCurve::Line
            && plan
                .narrow
                .iter()
                .any(|section| on_outline(section, middle, slack));
        let segment = KeptSegment {
            curve: piece.curve,
            fixed,
        };
        let mut stops: Vec<(f64, usize)> = Vec::new();
        if piece.curve == PathCurve::Line {
            for (index, &vertex) in vertices.iter().enumerate() {
                let share = path.share_of(vertex);
                let on = (0.0..=1.0).contains(&share) && distance(path.at(share), vertex) <= slack;
                if on && !piece.ends.contains(&index) {
                    stops.push((share, index));
                }
            }
        } else if has_chord(plan, piece) {
            vertices.push(middle);
            stops.push((0.5, vertices.len() - 1));
        }
        stops.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut last = piece.ends[0];
        for next in stops
            .into_iter()
            .map(|(_, index)| index)
            .chain([piece.ends[1]])
        {
            pieces.push(([last, next], segment));
            last = next;
        }
    }
    let mut segments = BTreeMap::new();
    for (ends, segment) in pieces {
        let ends = ends.map(|end| u32::try_from(end).unwrap_or(u32::MAX));
        if ends[0] != ends[1] {
            let known = segments.entry(ascending(ends)).or_insert(segment);
            known.fixed |= segment.fixed;
        }
    }
    (vertices, segments)
}

/// Whether another piece has the same ends, as the axis and the half-circle of a sphere: two vertices have one
/// line between them.
fn has_chord(plan: &MeshPlan, piece: &Piece) -> bool {
    let others = plan.arrangement.pieces.iter();
    let mut alike = others.filter(|other| other.ends == piece.ends);
    alike.any(|other| other.curve != piece.curve)
}

fn on_outline(section: &Rectangle, [r, x]: Point, slack: f64) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= slack;
    let [r0, r1] = section.r_m;
    let [x0, x1] = section.x_m;
    let beside = (near(r, r0) || near(r, r1)) && x >= x0 - slack && x <= x1 + slack;
    let along = (near(x, x0) || near(x, x1)) && r >= r0 - slack && r <= r1 + slack;
    beside || along
}

/// Lines across a narrow rectangle, without its ends: at every vertex on its long sides, and
/// between.
fn divide(section: &Rectangle, vertices: &[Point], tolerance: f64) -> Vec<Path> {
    let lying = section.r_m[1] - section.r_m[0] > section.x_m[1] - section.x_m[0];
    let (long, short) = if lying {
        (section.r_m, section.x_m)
    } else {
        (section.x_m, section.r_m)
    };
    let slack = 4.0 * tolerance;
    let on_long_side = |point: Point| {
        let (along, aside) = if lying {
            (point[0], point[1])
        } else {
            (point[1], point[0])
        };
        let beside = short.iter().any(|side| (aside - side).abs() <= slack);
        (beside && along >= long[0] - slack && along <= long[1] + slack).then_some(along)
    };
    let mut stops: Vec<f64> = vec![long[0], long[1]];
    stops.extend(vertices.iter().filter_map(|&vertex| on_long_side(vertex)));
    stops.sort_by(f64::total_cmp);
    stops.dedup_by(|a, b| (*a - *b).abs() <= slack);
    let longest = NARROW_PIECE * (short[1] - short[0]);
    let mut paths = Vec::new();
    let mut add = |along: f64| {
        let point = |aside: f64| {
            if lying {
                [along, aside]
            } else {
                [aside, along]
            }
        };
        paths.push(Path::line(point(short[0]), point(short[1])));
    };
    for pair in stops.windows(2) {
        let &[from, to] = pair else { continue };
        if from > long[0] {
            add(from);
        }
        let count = ((to - from) / longest).ceil().max(1.0);
        let mut step = 1.0;
        while step < count {
            add(from + step / count * (to - from));
            step += 1.0;
        }
    }
    paths
}

/// Adds the inside's triangles with their regions.
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

/// The middle of a triangle, moved with its bent sides.
fn bent_middle(mesh: &Mesh, [a, b, c]: [u32; 3], mut middle: Point) -> Point {
    for [from, to] in [[a, b], [b, c], [c, a]] {
        let (p, q) = (mesh.position(from), mesh.position(to));
        let on_curve = mesh.curve([from, to]).between(p, q, 0.5);
        for axis in 0..2 {
            // Share of an edge's bend that reaches the middle; see `element::geometry`.
            middle[axis] += 4.0 / 9.0 * (on_curve[axis] - 0.5 * (p[axis] + q[axis]));
        }
    }
    middle
}

/// Triangulates the exterior's half-disc upon the vertices of the arc.
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
        &Wish {
            size: &|_| LARGEST_OUTSIDE * circle.radius,
            exempt: &|_| false,
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
