//! Arrangement of all paths of a design, cut at each other; paths that do not separate two regions
//! are removed.

use super::path::{Path, PathCurve};
use super::{Point, cross, distance};

/// A piece of a path between two vertices, without crossings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Indices of the two vertices.
    pub ends: [usize; 2],
    /// Curve of the piece.
    pub curve: PathCurve,
}

/// Vertices and the pieces between them.
#[derive(Clone, Debug, Default)]
pub struct Arrangement {
    /// Positions.
    pub vertices: Vec<Point>,
    /// Pieces, each listed once.
    pub pieces: Vec<Piece>,
}

impl Arrangement {
    /// Cuts paths at each other. Points closer than `tolerance` are merged.
    #[must_use]
    pub fn of(paths: &[Path], tolerance: f64) -> Self {
        let mut arrangement = Self::default();
        let boxes: Vec<[Point; 2]> = paths.iter().map(bounds).collect();
        for (index, (path, bounds)) in paths.iter().zip(&boxes).enumerate() {
            let mut shares = vec![0.0, 1.0];
            for (other_index, (other, other_bounds)) in paths.iter().zip(&boxes).enumerate() {
                if other_index != index && boxes_touch(bounds, other_bounds, tolerance) {
                    shares.extend(path.meetings(other, tolerance));
                }
            }
            shares.sort_by(f64::total_cmp);
            let mut last = arrangement.vertex(path.from, tolerance);
            for &share in shares.iter().skip(1) {
                let next = arrangement.vertex(path.at(share), tolerance);
                arrangement.add(last, next, path.curve, tolerance);
                last = next;
            }
        }
        arrangement
    }

    fn vertex(&mut self, point: Point, tolerance: f64) -> usize {
        let found = self
            .vertices
            .iter()
            .position(|&other| distance(point, other) <= 2.0 * tolerance);
        found.unwrap_or_else(|| {
            self.vertices.push(point);
            self.vertices.len() - 1
        })
    }

    fn add(&mut self, a: usize, b: usize, curve: PathCurve, tolerance: f64) {
        let ends = [a.min(b), a.max(b)];
        let known = self
            .pieces
            .iter()
            .any(|piece| piece.ends == ends && piece.curve.coincides(&curve, tolerance));
        if a != b && !known {
            self.pieces.push(Piece { ends, curve });
        }
    }

    /// The path of a piece.
    #[must_use]
    pub fn path(&self, piece: &Piece) -> Path {
        let at = |end: usize| self.vertices.get(end).copied().unwrap_or([0.0; 2]);
        Path {
            curve: piece.curve,
            from: at(piece.ends[0]),
            to: at(piece.ends[1]),
        }
    }

    /// Points just beside the middles of all pieces, on both sides: every face of the arrangement
    /// contains at least one of them.
    #[must_use]
    pub fn points_beside(&self) -> Vec<Point> {
        let pieces = self.pieces.iter();
        pieces.flat_map(|piece| beside(&self.path(piece))).collect()
    }

    /// Keeps the pieces for which `keep` returns true. Its arguments are the path of a piece and
    /// the points just left and right of the path's middle.
    pub fn retain(&mut self, keep: impl Fn(&Path, Point, Point) -> bool) {
        let paths: Vec<Path> = self.pieces.iter().map(|piece| self.path(piece)).collect();
        let mut paths = paths.iter();
        self.pieces.retain(|_| {
            paths.next().is_some_and(|path| {
                let [left, right] = beside(path);
                keep(path, left, right)
            })
        });
    }
}

impl Arrangement {
    /// Joins two straight pieces to one if they continue each other at a vertex where no other
    /// piece ends.
    pub fn simplify(&mut self) {
        for vertex in 0..self.vertices.len() {
            let mut meeting = self.pieces.iter().enumerate();
            let meeting = meeting
                .by_ref()
                .filter(|(_, piece)| piece.ends.contains(&vertex));
            let meeting: Vec<(usize, Piece)> = meeting.map(|(i, piece)| (i, *piece)).collect();
            let &[(first, a), (second, b)] = meeting.as_slice() else {
                continue;
            };
            let far = |piece: &Piece| piece.ends[0] + piece.ends[1] - vertex;
            let at = |end: usize| self.vertices.get(end).copied().unwrap_or([0.0; 2]);
            let (p, q) = (at(far(&a)), at(far(&b)));
            let straight = a.curve == PathCurve::Line && b.curve == PathCurve::Line;
            let turn = cross(p, at(vertex), q).abs();
            if straight && turn <= 1e-9 * distance(p, at(vertex)) * distance(at(vertex), q) {
                let ends = [far(&a).min(far(&b)), far(&a).max(far(&b))];
                self.pieces.remove(second);
                if let Some(piece) = self.pieces.get_mut(first) {
                    piece.ends = ends;
                }
            }
        }
    }
}

impl Arrangement {
    /// Removes the vertices at which no piece ends.
    pub fn compact(&mut self) {
        let mut kept = Vec::new();
        let mut number = vec![None; self.vertices.len()];
        for piece in &mut self.pieces {
            for end in &mut piece.ends {
                if let (Some(number), Some(&vertex)) =
                    (number.get_mut(*end), self.vertices.get(*end))
                {
                    *end = *number.get_or_insert_with(|| {
                        kept.push(vertex);
                        kept.len() - 1
                    });
                }
            }
            piece.ends.sort_unstable();
        }
        self.vertices = kept;
    }
}

/// Points just left and just right of the middle of a path.
fn beside(path: &Path) -> [Point; 2] {
    let (a, middle, b) = (path.at(0.499), path.at(0.5), path.at(0.501));
    // A millionth of the path's length: far less than the distance of the next path, and far more
    // than the rounding of a position.
    let step = 1e-6 * path.chord() / distance(a, b);
    let normal = [-(b[1] - a[1]) * step, (b[0] - a[0]) * step];
    [1.0, -1.0].map(|side| [middle[0] + side * normal[0], middle[1] + side * normal[1]])
}

/// Whether two boxes touch.
pub(crate) fn boxes_touch(a: &[Point; 2], b: &[Point; 2], tolerance: f64) -> bool {
    (0..2).all(|axis| {
        let overlap = |p: &[Point; 2], q: &[Point; 2]| p[0][axis] <= q[1][axis] + tolerance;
        overlap(a, b) && overlap(b, a)
    })
}

/// Bounding box of a path: its lowest and its highest coordinates.
pub(crate) fn bounds(path: &Path) -> [Point; 2] {
    let mut low = path.from;
    let mut high = path.from;
    for point in path.extremes() {
        for axis in 0..2 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    [low, high]
}
