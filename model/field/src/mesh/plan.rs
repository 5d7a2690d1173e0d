//! Regions of a design, and the lines that separate them.

use super::Circle;
use crate::design::{Design, Rectangle};
use crate::geometry::Point;
use crate::geometry::arrangement::{Arrangement, Piece};
use crate::geometry::path::{Path, PathCurve};
use crate::geometry::shape::Shape;

/// Distance below which positions are merged, relative to the design's radius.
const TOLERANCE: f64 = 1e-9;

/// Region of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Region {
    /// Whether it belongs to the space outside of the circle.
    pub exterior: bool,
    /// Index of the magnetic part in the design; `None` for non-magnetic regions.
    pub part: Option<u32>,
    /// Index of the coil, and of the ring within the coil; `None` outside of windings.
    pub ring: Option<[u32; 2]>,
    /// Zone of the core.
    pub zone: Zone,
    /// Whether the region lies in the range along the axis in which the stack is parted for the
    /// force, at any distance from the axis.
    pub parting: bool,
}

/// Zones of the core, by radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Zone {
    /// Outside of the core.
    None,
    /// In the core, beyond three quarters of its radius.
    Whole,
    /// In the core, from half to three quarters of its radius.
    ThreeQuarters,
    /// In the core, within half its radius.
    Half,
}

impl Zone {
    /// The zones, each with its outer radius as a fraction of the core's radius.
    pub const SHARES: [(Self, f64); 3] = [
        (Self::Whole, 1.0),
        (Self::ThreeQuarters, 0.75),
        (Self::Half, 0.5),
    ];
}

impl Region {
    /// The space outside of the circle.
    pub const EXTERIOR: Self = Self {
        exterior: true,
        part: None,
        ring: None,
        zone: Zone::None,
        parting: false,
    };

    /// Region to which a point of the design belongs.
    #[must_use]
    pub fn at(design: &Design, circle: &Circle, point: Point) -> Self {
        if point[0] < 0.0 || circle.distance(point) > circle.radius {
            return Self::EXTERIOR;
        }
        let ring = ring_at(design, point);
        let displaced = ring.is_some() || design.boards.iter().any(|b| within(&b.section, point));
        let holds = |cast: bool| {
            let mut parts = design.parts.iter();
            parts.position(|part| part.cast == cast && part.contains(point))
        };
        let [from, to] = design.core.parting_m();
        let part = if displaced {
            None
        } else {
            holds(false).or_else(|| holds(true))
        };
        Self {
            exterior: false,
            part: part.and_then(|index| u32::try_from(index).ok()),
            ring,
            zone: zone_at(design, point),
            parting: (from..to).contains(&point[1]),
        }
    }
}

fn within(section: &Rectangle, [r, x]: Point) -> bool {
    (section.r_m[0]..section.r_m[1]).contains(&r) && (section.x_m[0]..section.x_m[1]).contains(&x)
}

fn ring_at(design: &Design, point: Point) -> Option<[u32; 2]> {
    for (coil, index) in design.coils.iter().zip(0_u32..) {
        for (ring, number) in coil.rings.iter().zip(0_u32..) {
            if within(ring, point) {
                return Some([index, number]);
            }
        }
    }
    None
}

fn zone_at(design: &Design, [r, x]: Point) -> Zone {
    let core = &design.core;
    if !(core.x_m[0]..core.x_m[1]).contains(&x) {
        return Zone::None;
    }
    let shares = Zone::SHARES.iter().rev();
    let found = shares.clone().find(|(_, share)| r < share * core.r_m);
    found.map_or(Zone::None, |(zone, _)| *zone)
}

/// Lines that a triangulation follows in addition to the outlines of boards, windings and parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshLines {
    /// The boundaries of the core and of its zones.
    WithCore,
    /// No additional lines: in a wide design they cost many triangles.
    PartsAlone,
}

/// The lines that a triangulation has to follow.
#[derive(Debug)]
pub(super) struct MeshPlan {
    pub(super) circle: Circle,
    pub(super) arrangement: Arrangement,
    /// Narrow rectangles, in which triangles may be longer than elsewhere.
    pub(super) narrow: Vec<Rectangle>,
    /// Indices of the vertices at corners of permeable parts.
    pub(super) corners: Vec<usize>,
    tolerance: f64,
}

impl MeshPlan {
    pub(super) fn of(design: &Design, lines: MeshLines) -> Self {
        let circle = circle_about(design);
        let tolerance = TOLERANCE * circle.radius;
        let mut paths = paths(design, &circle);
        if lines == MeshLines::WithCore {
            paths.extend(core_paths(design, &circle));
        }
        let mut arrangement = Arrangement::of(&paths, tolerance);
        arrangement.retain(|_, left, right| {
            Region::at(design, &circle, left) != Region::at(design, &circle, right)
        });
        arrangement.simplify();
        arrangement.compact();
        let corners = corners(design, &circle, &arrangement);
        Self {
            circle,
            arrangement,
            narrow: narrow(design),
            corners,
            tolerance,
        }
    }

    /// Distance below which points are merged, m.
    pub(super) fn slack(&self) -> f64 {
        4.0 * self.tolerance
    }
}

/// Radius of the circle relative to the distance of the outermost corner. The exterior's solution
/// is exact at any radius; the cost is least with a gap of about one triangle beyond that corner.
const ROOM: f64 = 1.2;

fn circle_about(design: &Design) -> Circle {
    let mut points: Vec<Point> = Vec::new();
    let mut add = |section: &Rectangle| {
        points.push([section.r_m[1], section.x_m[0]]);
        points.push([section.r_m[1], section.x_m[1]]);
    };
    add(&Rectangle {
        r_m: [0.0, design.core.r_m],
        x_m: design.core.x_m,
    });
    design.boards.iter().for_each(|board| add(&board.section));
    design
        .coils
        .iter()
        .flat_map(|coil| &coil.rings)
        .for_each(&mut add);
    for part in &design.parts {
        points.extend(part.shape.extremes());
    }
    let extent = |x: fn(f64, f64) -> f64, start: f64| points.iter().map(|p| p[1]).fold(start, x);
    let centre_x = 0.5 * (extent(f64::min, f64::INFINITY) + extent(f64::max, f64::NEG_INFINITY));
    let reach = points
        .iter()
        .map(|p| p[0].hypot(p[1] - centre_x))
        .fold(0.0, f64::max);
    Circle {
        centre_x,
        radius: ROOM * reach,
    }
}

fn paths(design: &Design, circle: &Circle) -> Vec<Path> {
    let mut paths = Vec::new();
    let mut add = |shape: &Shape| paths.extend(shape.paths());
    for board in &design.boards {
        add(&Shape::rectangle(board.section.r_m, board.section.x_m));
    }
    for ring in design.coils.iter().flat_map(|coil| &coil.rings) {
        add(&Shape::rectangle(ring.r_m, ring.x_m));
    }
    for part in &design.parts {
        add(&part.shape);
        part.minus.iter().for_each(&mut add);
    }
    let half = core::f64::consts::FRAC_PI_2;
    let ends = [-1.0, 1.0].map(|side| [0.0, circle.centre_x + side * circle.radius]);
    paths.push(Path::line(ends[0], ends[1]));
    let curve = PathCurve::Ellipse {
        centre: [0.0, circle.centre_x],
        semi_r: circle.radius,
        semi_x: circle.radius,
    };
    paths.push(Path::arc(curve, -half, half));
    paths
}

/// The boundaries of the core's zones, and the planes at which the stack is parted for the force.
fn core_paths(design: &Design, circle: &Circle) -> Vec<Path> {
    let core = &design.core;
    let shells = Zone::SHARES
        .iter()
        .flat_map(|(_, share)| Shape::rectangle([0.0, share * core.r_m], core.x_m).paths());
    let parting = core.parting_m().map(|x| {
        let reach_squared = circle.radius.powi(2) - (x - circle.centre_x).powi(2);
        Path::line([0.0, x], [reach_squared.max(0.0).sqrt(), x])
    });
    shells.chain(parting).collect()
}

/// Ratio of the sides above which a rectangle is narrow.
const NARROW: f64 = 4.0;

fn narrow(design: &Design) -> Vec<Rectangle> {
    let rings = design
        .coils
        .iter()
        .flat_map(|coil| coil.rings.iter().copied());
    let plates = design
        .parts
        .iter()
        .filter(|part| !part.cast && part.minus.is_empty());
    let plates = plates.filter_map(|plate| match &plate.shape {
        Shape::Polygon(corners) => as_rectangle(corners),
        Shape::Outline(_) | Shape::Spheroid { .. } => None,
    });
    let slender = |section: &Rectangle| {
        let (w, h) = (
            section.r_m[1] - section.r_m[0],
            section.x_m[1] - section.x_m[0],
        );
        w.max(h) > NARROW * w.min(h)
    };
    rings.chain(plates).filter(slender).collect()
}

fn as_rectangle(corners: &[Point]) -> Option<Rectangle> {
    let &[a, b, c, d] = corners else {
        return None;
    };
    let upright = a[1] == b[1] && b[0] == c[0] && c[1] == d[1] && d[0] == a[0];
    upright.then_some(Rectangle {
        r_m: [a[0].min(c[0]), a[0].max(c[0])],
        x_m: [a[1].min(c[1]), a[1].max(c[1])],
    })
}

/// Vertices at which the boundary between two permeabilities or remanences turns or branches. On
/// the axis a boundary continues as its mirror image, so it turns if it does not meet the axis at a
/// right angle, as at a cone's tip.
fn corners(design: &Design, circle: &Circle, arrangement: &Arrangement) -> Vec<usize> {
    let law = |point: Point| {
        let region = Region::at(design, circle, point);
        let part = region.part.and_then(|part| design.parts.get(part as usize));
        part.map_or((1.0, 0.0), |part| {
            (part.material.initial_mu_r(), part.remanence_t)
        })
    };
    let mut magnetic: Vec<&Piece> = Vec::new();
    let beside = arrangement.points_beside();
    for (piece, sides) in arrangement.pieces.iter().zip(beside.chunks(2)) {
        if let [left, right] = sides
            && left[0].min(right[0]) > 0.0
            && law(*left) != law(*right)
        {
            magnetic.push(piece);
        }
    }
    let turns = |vertex: usize| {
        let at = arrangement
            .vertices
            .get(vertex)
            .copied()
            .unwrap_or([0.0; 2]);
        let leaving: Vec<Point> = magnetic
            .iter()
            .filter(|piece| piece.ends.contains(&vertex))
            .map(|piece| direction(&arrangement.path(piece), at))
            .collect();
        let straight = |a: Point, b: Point| a[0] * b[0] + a[1] * b[1] <= -0.999;
        match leaving[..] {
            [] => false,
            [a] if at[0] == 0.0 => !straight(a, [-a[0], a[1]]),
            [a, b] => !straight(a, b),
            _ => true,
        }
    };
    (0..arrangement.vertices.len())
        .filter(|&vertex| turns(vertex))
        .collect()
}

/// Direction in which a path leaves one of its ends, `end`.
fn direction(path: &Path, end: Point) -> Point {
    let near = if path.from == end {
        path.at(0.001)
    } else {
        path.at(0.999)
    };
    let step = [near[0] - end[0], near[1] - end[1]];
    let length = step[0].hypot(step[1]);
    step.map(|s| s / length)
}
