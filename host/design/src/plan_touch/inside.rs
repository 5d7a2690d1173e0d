//! The inside of a layout: the presses that its figures count.

/// Shape about the coils' centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// Disc about the mean of the centres, through the outermost ones.
    Disc,
    /// Convex hull of the centres.
    Hull,
}

/// A shape about the coils' centres, with a margin.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Inside {
    pub(super) shape: Shape,
    /// Distance by which the shape is widened; narrowed if it is negative, m.
    pub(super) margin_m: f64,
    /// Mean of the centres, m.
    pub(super) middle_m: [f64; 2],
    /// Greatest distance of a centre from the mean, m.
    pub(super) outermost_m: f64,
    /// Corners of the hull, counter-clockwise, m.
    hull: Vec<[f64; 2]>,
}

/// Places from the middle to each side: a symmetric lattice, which has the lines of symmetry in it.
const HALF: i32 = 40;
/// Points of an outline.
const OUTLINE: u32 = 180;

impl Inside {
    pub(super) fn new(shape: Shape, margin_m: f64, centres: &[[f64; 2]]) -> Self {
        let mean = |of: fn(&[f64; 2]) -> f64| {
            centres.iter().map(of).sum::<f64>() / centres.len().max(1) as f64
        };
        let middle_m = [mean(|at| at[0]), mean(|at| at[1])];
        let distances = centres.iter().map(|at| distance(*at, middle_m));
        Self {
            shape,
            margin_m,
            middle_m,
            outermost_m: distances.fold(0.0, f64::max),
            hull: hull(centres),
        }
    }

    /// Whether a press lies inside.
    pub(super) fn contains(&self, at: [f64; 2]) -> bool {
        // Tolerance for rounding, so that the edge counts as inside.
        const EDGE_M: f64 = 1e-9;
        let beyond_m = match self.shape {
            Shape::Disc => distance(at, self.middle_m) - self.outermost_m,
            Shape::Hull => beyond(&self.hull, at),
        };
        beyond_m <= self.margin_m + EDGE_M
    }

    /// Radius of a circle about the middle that contains the inside, m.
    pub(super) fn reach_m(&self) -> f64 {
        (self.outermost_m + self.margin_m).max(0.0)
    }

    /// Distance between neighbouring places, m.
    pub(super) fn step_m(&self) -> f64 {
        self.reach_m() / f64::from(HALF)
    }

    /// Presses on a square lattice, m; none if the inside has no area.
    pub(super) fn places(&self) -> Vec<[f64; 2]> {
        let step_m = self.step_m();
        if step_m <= 0.0 {
            return Vec::new();
        }
        let rows = (-HALF..=HALF).flat_map(|row| (-HALF..=HALF).map(move |column| (row, column)));
        let places = rows.map(|(row, column)| {
            let [x, y] = self.middle_m;
            [x + f64::from(column) * step_m, y + f64::from(row) * step_m]
        });
        places.filter(|at| self.contains(*at)).collect()
    }

    /// The edge as a closed line, m. It is the farthest point inside in each direction from the middle.
    pub(super) fn outline(&self) -> Vec<[f64; 2]> {
        let point = |index: u32| {
            let angle = core::f64::consts::TAU * f64::from(index) / f64::from(OUTLINE);
            let at = |far_m: f64| {
                let [x, y] = self.middle_m;
                [x + far_m * angle.cos(), y + far_m * angle.sin()]
            };
            let (mut near_m, mut far_m) = (0.0, self.reach_m() + 1e-9);
            // Bisection to a thousandth of the reach.
            for _ in 0..10 {
                let half_m = 0.5 * (near_m + far_m);
                if self.contains(at(half_m)) {
                    near_m = half_m;
                } else {
                    far_m = half_m;
                }
            }
            at(far_m)
        };
        (0..=OUTLINE).map(point).collect()
    }
}

fn distance([x, y]: [f64; 2], [to_x, to_y]: [f64; 2]) -> f64 {
    (x - to_x).hypot(y - to_y)
}

/// Twice the area of a triangle, positive if it is counter-clockwise.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    let chain = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..] {
                if turn(a, b, *point) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(*point);
        }
        // The last point is the first one of the other chain.
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter());
    hull.extend(chain(&mut sorted.iter().rev()));
    if hull.is_empty() { sorted } else { hull }
}

/// Distance of a point from a hull, m, negative inside.
fn beyond(hull: &[[f64; 2]], at: [f64; 2]) -> f64 {
    let next = hull.iter().cycle().skip(1);
    let edges = hull.iter().zip(next).map(|(from, to)| (*from, *to));
    let nearest = |(from, to): ([f64; 2], [f64; 2])| {
        let along = [to[0] - from[0], to[1] - from[1]];
        let square = along[0] * along[0] + along[1] * along[1];
        let share = (at[0] - from[0]) * along[0] + (at[1] - from[1]) * along[1];
        let share = if square > 0.0 {
            (share / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        distance(at, [from[0] + share * along[0], from[1] + share * along[1]])
    };
    let distance_m = edges.clone().map(nearest).fold(f64::INFINITY, f64::min);
    let is_inside = edges
        .map(|(from, to)| turn(from, to, at))
        .all(|turn| turn > 0.0);
    if is_inside { -distance_m } else { distance_m }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f64; 2]; 4] = [[-5.0, -5.0], [5.0, -5.0], [-5.0, 5.0], [5.0, 5.0]];

    #[test]
    fn the_distance_from_a_hull_is_signed() {
        let hull = hull(&[&SQUARE[..], &[[0.0, 0.0], [5.0, 0.0]]].concat());
        assert_eq!(hull.len(), 4);
        for (at, expected) in [
            ([0.0, 0.0], -5.0),
            ([4.0, 1.0], -1.0),
            ([7.0, 0.0], 2.0),
            ([8.0, 9.0], 5.0),
        ] {
            assert!((beyond(&hull, at) - expected).abs() < 1e-12, "{at:?}");
        }
        // Coils on a line, and a single one.
        let line = super::hull(&[[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]);
        assert_eq!(beyond(&line, [3.0, 1.0]), 1.0);
        assert_eq!(beyond(&super::hull(&[[1.0, 1.0]]), [4.0, 5.0]), 5.0);
    }

    #[test]
    fn places_cover_the_area_and_the_lines_of_symmetry() {
        for (shape, margin, area) in [
            (Shape::Hull, 0.0, 100.0),
            (Shape::Hull, -1.0, 64.0),
            (Shape::Disc, 0.0, core::f64::consts::PI * 50.0),
        ] {
            let inside = Inside::new(shape, margin, &SQUARE);
            let places = inside.places();
            let covered = places.len() as f64 * inside.step_m().powi(2);
            assert!((covered / area - 1.0).abs() < 0.05, "{shape:?}: {covered}");
            let on_line = places.iter().filter(|at| at[0] == 0.0).count();
            assert!(on_line > 40, "{on_line}");
            let edge = inside.outline();
            assert!(edge.iter().all(|at| {
                let nearer = [0.98, 1.02].map(|by| inside.contains([by * at[0], by * at[1]]));
                nearer == [true, false]
            }));
        }
        assert!(Inside::new(Shape::Disc, -8.0, &SQUARE).places().is_empty());
    }
}
