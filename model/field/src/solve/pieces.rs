//! Export of the field on each triangle of the mesh, for other programs.

use super::adapt::Solved;
use super::assembly::combine;
use super::evaluate::FieldAt;
use crate::element::shape::Placed;
use crate::geometry::Point;
use crate::mesh::Region;

/// The field on a triangle inside the circle, at the points of a lattice. Neighbouring triangles do
/// not share points, since the field jumps between materials.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Region of the mesh triangle.
    pub region: Region,
    /// The lattice's points with the field there, row by row from the first side to the opposite
    /// corner.
    pub places: Vec<(Point, FieldAt)>,
    /// The small triangles between the lattice's points, as indices of their corners.
    pub triangles: Vec<[usize; 3]>,
}

impl Solved {
    /// All triangles inside the circle, with each side divided by the order of the elements.
    #[must_use]
    pub fn pieces(&self) -> Vec<Piece> {
        let space = &self.level.space;
        let order = space.basis.order();
        let lattice: Vec<[f64; 3]> = lattice(order).collect();
        let samples: Vec<_> = lattice.iter().map(|at| space.basis.sample(*at)).collect();
        let small = small_triangles(order);
        let mut placed = Placed::new(&space.basis);
        let mut pieces = Vec::new();
        let triangles = space.mesh.triangles.iter();
        for ((triangle, nodes), unknowns) in triangles.zip(&space.nodes).zip(&space.unknowns) {
            let region = space.mesh.region(triangle);
            if region.exterior {
                continue;
            }
            let mut place = |sample| {
                placed.fill(nodes, sample);
                let (value, slope) = combine(&self.w, unknowns, sample, &placed);
                let background_t = self.level.background_t;
                let r = placed.point[0];
                let field = FieldAt {
                    b: [-r * slope[1], 2.0 * value + r * slope[0] + background_t],
                    w: value + 0.5 * background_t,
                    region: triangle.region,
                };
                (placed.point, field)
            };
            pieces.push(Piece {
                region,
                places: samples.iter().map(&mut place).collect(),
                triangles: small.clone(),
            });
        }
        pieces
    }
}

/// Barycentric coordinates of the lattice's points, row by row.
fn lattice(order: u32) -> impl Iterator<Item = [f64; 3]> {
    let share = move |steps: u32| f64::from(steps) / f64::from(order);
    let row = move |row: u32| (0..=order - row).map(move |column| (column, row));
    (0..=order)
        .flat_map(row)
        .map(move |(column, row)| [share(order - row - column), share(column), share(row)])
}

/// The small triangles between the points of the lattice.
fn small_triangles(order: u32) -> Vec<[usize; 3]> {
    let order = order as usize;
    let mut triangles = Vec::new();
    let mut start = 0;
    for row in 0..order {
        let (width, next) = (order - row, start + order - row + 1);
        for column in 0..width {
            let (here, above) = (start + column, next + column);
            triangles.push([here, here + 1, above]);
            if column + 1 < width {
                triangles.push([here + 1, above + 1, above]);
            }
        }
        start = next;
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_triangles_fill_the_large_one() {
        for order in 1..=5 {
            let places: Vec<[f64; 3]> = lattice(order).collect();
            let area = |[a, b, c]: [usize; 3]| {
                let [a, b, c] = [a, b, c].map(|place| [places[place][1], places[place][2]]);
                crate::geometry::cross(a, b, c)
            };
            let areas: Vec<f64> = small_triangles(order).into_iter().map(area).collect();
            assert!(areas.iter().all(|area| *area > 0.0), "{order}: {areas:?}");
            assert!((areas.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{order}");
        }
    }
}
