//! Checks that the parts of a design fit together.

use super::{Design, DesignError, Rectangle};
use crate::geometry::arrangement::{Arrangement, bounds, boxes_touch};
use crate::geometry::path::Path;
use crate::geometry::shape::{Shape, edges};
use crate::geometry::{Point, cross, distance};

/// Smallest thickness and smallest gap, m: 1 µm, below the tolerances of any such stack.
pub(super) const THINNEST_M: f64 = 1e-6;
/// Distance below which positions count as equal, m.
pub(super) const SAME_M: f64 = 1e-9;

/// Line of the design file on which each entry starts.
#[derive(Default)]
pub(super) struct Lines {
    pub(super) parts: Vec<usize>,
    pub(super) boards: Vec<usize>,
    pub(super) coils: Vec<usize>,
}

/// A solid with its location in the design file.
struct Solid {
    place: String,
    line: usize,
    shape: Shape,
    minus: Vec<Shape>,
    /// Whether it is a winding's copper, which may lie within its board.
    copper: bool,
    board: bool,
}

/// Rejects solids that overlap, and gaps that are too narrow.
pub(super) fn check(file: &str, design: &Design, lines: &Lines) -> Result<(), DesignError> {
    let refuse = |line: usize, place: &str, problem: String, allowed: &str| {
        Err(DesignError {
            file: file.to_owned(),
            line,
            place: place.to_owned(),
            problem,
            allowed: allowed.to_owned(),
        })
    };
    let (solids, bodies) = collect(design, lines);
    for group in [&solids, &bodies] {
        for (index, first) in group.iter().enumerate() {
            for second in group.iter().skip(index + 1) {
                match relation(first, second) {
                    Relation::Apart => {}
                    Relation::Overlap => {
                        let problem = format!("overlaps {}", first.place);
                        let allowed = "parts that touch or stand apart; only copper may lie within a board, and only a body may be cast around others";
                        return refuse(second.line, &second.place, problem, allowed);
                    }
                    Relation::Gap(gap) => {
                        let problem = format!("leaves a gap of {gap:e} m to {}", first.place);
                        let allowed = format!("no gap, or {THINNEST_M:e} m and more");
                        return refuse(second.line, &second.place, problem, &allowed);
                    }
                }
            }
        }
    }
    Ok(())
}

fn collect(design: &Design, lines: &Lines) -> (Vec<Solid>, Vec<Solid>) {
    let line = |lines: &[usize], index: usize| lines.get(index).copied().unwrap_or(1);
    let rectangle = |section: &Rectangle| Shape::rectangle(section.r_m, section.x_m);
    let mut solids = Vec::new();
    let mut bodies = Vec::new();
    for (index, board) in design.boards.iter().enumerate() {
        solids.push(Solid {
            place: format!("board {:?}", board.name),
            line: line(&lines.boards, index),
            shape: rectangle(&board.section),
            minus: Vec::new(),
            copper: false,
            board: true,
        });
    }
    for (index, coil) in design.coils.iter().enumerate() {
        for ring in &coil.rings {
            solids.push(Solid {
                place: format!("coil {:?}", coil.name),
                line: line(&lines.coils, index),
                shape: rectangle(ring),
                minus: Vec::new(),
                copper: true,
                board: false,
            });
        }
    }
    for (index, part) in design.parts.iter().enumerate() {
        let group = if part.cast { &mut bodies } else { &mut solids };
        let kind = if part.cast { "body" } else { "plate" };
        group.push(Solid {
            place: format!("{kind} {:?}", part.name),
            line: line(&lines.parts, index),
            shape: part.shape.clone(),
            minus: part.minus.clone(),
            copper: false,
            board: false,
        });
    }
    (solids, bodies)
}

enum Relation {
    Apart,
    Overlap,
    Gap(f64),
}

fn relation(a: &Solid, b: &Solid) -> Relation {
    if boxes_apart(&a.shape, &b.shape) {
        return Relation::Apart;
    }
    if overlap(a, b) {
        return Relation::Overlap;
    }
    let gap = a.shape.distance(&b.shape);
    if gap > SAME_M && gap < THINNEST_M {
        return Relation::Gap(gap);
    }
    Relation::Apart
}

/// Whether the bounding boxes of two shapes are farther apart than the smallest gap.
fn boxes_apart(a: &Shape, b: &Shape) -> bool {
    let bounds = |shape: &Shape, axis: usize| {
        let values = shape.extremes().into_iter().map(move |point| point[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
    };
    (0..2).any(|axis| {
        let ((a0, a1), (b0, b1)) = (bounds(a, axis), bounds(b, axis));
        a0 > b1 + THINNEST_M || b0 > a1 + THINNEST_M
    })
}

/// Whether two solids overlap. Cuts both outlines at each other; the solids overlap if a point just
/// beside one of the pieces lies in both.
fn overlap(a: &Solid, b: &Solid) -> bool {
    let within = |solid: &Solid, point| {
        solid.shape.contains(point) && !solid.minus.iter().any(|hole| hole.contains(point))
    };
    let mut paths = Vec::new();
    for solid in [a, b] {
        paths.extend(solid.shape.paths());
        paths.extend(solid.minus.iter().flat_map(Shape::paths));
    }
    let points = Arrangement::of(&paths, SAME_M).points_beside();
    let (board, copper) = if a.board { (a, b) } else { (b, a) };
    if board.board && copper.copper {
        // Copper within its board or on it is allowed.
        let mut copper = points
            .iter()
            .filter(|&&point| within(copper, point))
            .peekable();
        let inside = copper.peek().is_some_and(|&&point| within(board, point));
        return copper.any(|&point| within(board, point) != inside);
    }
    points
        .iter()
        .any(|&point| within(a, point) && within(b, point))
}

/// Rejects an outline that is not a simple polygon.
pub(super) fn outline(shape: &Shape, most: usize) -> Result<(), (String, String)> {
    let corners = match shape {
        Shape::Polygon(corners) => corners,
        Shape::Outline(paths) => return curved(shape, paths, most),
        Shape::Spheroid { .. } => return Ok(()),
    };
    let allowed = format!("3 to {most} corners [r, x] of a polygon that does not cross itself");
    if corners.len() < 3 || corners.len() > most {
        return Err((format!("has {} corners", corners.len()), allowed));
    }
    let sides: Vec<_> = edges(corners).collect();
    if let Some(index) = sides
        .iter()
        .position(|(a, b)| distance(*a, *b) < THINNEST_M)
    {
        return Err((format!("side {} has no length", index + 1), allowed));
    }
    let longest = sides
        .iter()
        .map(|(a, b)| distance(*a, *b))
        .fold(0.0, f64::max);
    if shape.area_m2() < THINNEST_M * longest {
        return Err(("has zero thickness".to_owned(), allowed));
    }
    for (index, &(a, b)) in sides.iter().enumerate() {
        for (other, &(c, d)) in sides.iter().enumerate().skip(index + 1) {
            let neighbours = other == index + 1 || (index == 0 && other == sides.len() - 1);
            let opposite = |s: f64, t: f64| (s > 0.0) != (t > 0.0);
            let crossing = opposite(cross(a, b, c), cross(a, b, d))
                && opposite(cross(c, d, a), cross(c, d, b));
            if !neighbours && crossing {
                return Err((
                    format!("sides {} and {} cross", index + 1, other + 1),
                    allowed,
                ));
            }
        }
    }
    Ok(())
}

/// Rejects an outline with arcs that is not simple.
fn curved(shape: &Shape, paths: &[Path], most: usize) -> Result<(), (String, String)> {
    let allowed =
        format!("up to {most} lines and arcs that do not touch each other but at corners");
    let refuse = |problem: String| Err((problem, allowed.clone()));
    if paths.len() > most {
        return refuse(format!("has {} lines and arcs", paths.len()));
    }
    let near = |[r, x]: Point| format!("near r = {:.4} mm, x = {:.4} mm", 1e3 * r, 1e3 * x);
    if let Some(path) = paths.iter().find(|path| path.chord() < THINNEST_M) {
        return refuse(format!("has a side without length {}", near(path.from)));
    }
    let longest = paths.iter().map(Path::chord).fold(0.0, f64::max);
    if shape.area_m2() < THINNEST_M * longest {
        return refuse("has zero thickness".to_owned());
    }
    let boxed: Vec<_> = paths.iter().map(|path| (path, bounds(path))).collect();
    for (index, (path, box_about)) in boxed.iter().enumerate() {
        for (other, other_box) in boxed.iter().skip(index + 1) {
            if !boxes_touch(box_about, other_box, SAME_M) {
                continue;
            }
            let corner = |point: Point| {
                let ends = [path.from, path.to].into_iter();
                let mut common = ends.filter(|end| [other.from, other.to].contains(end));
                common.any(|end| distance(end, point) < THINNEST_M)
            };
            let meetings = path.meetings(other, SAME_M).into_iter();
            if let Some(point) = meetings.map(|s| path.at(s)).find(|&point| !corner(point)) {
                return refuse(format!("touches or crosses itself {}", near(point)));
            }
        }
    }
    Ok(())
}
