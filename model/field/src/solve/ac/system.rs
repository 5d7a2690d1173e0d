//! The equations of an alternating field on one mesh.
//!
//! The unknowns are the phasors w = A_φ/r and, for each single-turn ring, u = V/(iω), where V is
//! the voltage around the ring. For all v and v_u: Σ ∫ ν′ curl w · curl v + iω σ (r w − u/2πr)(r v
//! − v_u/2πr) r dA = Σ I v_u/2π + ∫ J v r² dA. The second term is that of the eddy currents. The
//! matrix is complex and symmetric, and its real and imaginary parts are positive semidefinite. A
//! ring of several turns carries its current evenly.
//!
//! If the skin depth is far below a part's thickness, the inside of the part is left out, and its
//! surface has the impedance of a half-space: H_t = A √(iωσν). The inside keeps a billionth of the
//! vacuum's energy, so that its unknowns are defined.

use core::f64::consts::TAU;
use std::collections::HashSet;

use num_complex::Complex64;

use super::region::{AcRegion, Winding, ring_unknowns, solid_rings};
use crate::design::Design;
use crate::element::shape::Placed;
use crate::geometry::distance;
use crate::mesh::{Triangle, ascending};
use crate::solve::assembly::Level;
use crate::solve::cholesky::{Dissection, Element, Factor, NotPositive};
use crate::solve::newton::SolveError;

/// The equations on one mesh.
pub(super) struct System<'l> {
    pub(super) level: &'l Level,
    /// The constant field about which materials are linearised.
    pub(super) state: &'l [f64],
    pub(super) omega: f64,
    regions: Vec<AcRegion>,
    /// For each triangle: the numbers of its unknowns w, and of the unknown u of its ring.
    pub(super) unknowns: Vec<Vec<u32>>,
    /// Total number of unknowns.
    pub(super) count: usize,
    elimination: Dissection,
    /// Index of the coil, number of the unknown u, and sense, of each single-turn ring.
    rings: Vec<(usize, u32, f64)>,
    /// Edges on the surface of parts whose currents flow in the surface.
    pub(super) surface: HashSet<[u32; 2]>,
    /// The edges in `surface`, and all edges inside of these parts.
    pub(super) left_out: HashSet<[u32; 2]>,
    /// For each edge of the arc between inside and outside, its triangle and its matrix.
    arc: Vec<(usize, Vec<f64>)>,
}

/// A matrix as a sum over elements: the lower half of each element's matrix, one after the other.
pub(super) struct Assembled {
    pub(super) entries: Vec<Complex64>,
    /// For each coil, the right-hand side for one ampere in it.
    pub(super) driven: Vec<Vec<f64>>,
}

/// Largest height of a triangle, in skin depths, that resolves the decay of currents: a cubic
/// polynomial over two skin depths has the energy within 1e-3, and the change from mesh to mesh
/// then shows the error.
const SKIN_DEPTHS: f64 = 2.0;

impl<'l> System<'l> {
    /// Sets up the equations about a constant field, for an angular frequency in rad/s. Fields are
    /// driven by `coils`.
    pub(super) fn of(
        design: &Design,
        level: &'l Level,
        state: &'l [f64],
        omega: f64,
        coils: &[usize],
    ) -> Self {
        let space = &level.space;
        let (first_rings, count) = ring_unknowns(design, space.count);
        let regions = space.mesh.regions.iter().zip(&level.materials);
        let regions: Vec<AcRegion> = regions
            .map(|(region, material)| {
                AcRegion::of(design, region, material.clone(), &first_rings, omega, coils)
            })
            .collect();
        let mut unknowns = space.unknowns.clone();
        for (triangle, unknowns) in space.mesh.triangles.iter().zip(&mut unknowns) {
            let region = regions.get(triangle.region as usize);
            if let Some(Winding::Solid { unknown }) = region.map(|region| region.winding) {
                unknowns.push(unknown);
            }
        }
        let arc = level.arc();
        let of_triangles = unknowns.iter().enumerate();
        let of_arc = arc.iter().filter_map(|&(triangle, _)| {
            let unknowns = space.unknowns.get(triangle)?;
            Some((triangle, unknowns))
        });
        let elements = of_triangles
            .chain(of_arc)
            .filter_map(|(triangle, unknowns)| {
                let centre = space.element(triangle)?.centre;
                Some(Element { unknowns, centre })
            });
        let elimination = Dissection::of(&elements.collect::<Vec<_>>(), count);
        let mut surface = HashSet::new();
        let mut left_out = HashSet::new();
        for triangle in &space.mesh.triangles {
            let region = regions.get(triangle.region as usize);
            if region.is_some_and(|region| region.in_surface) {
                for edge in triangle.edges().map(ascending) {
                    left_out.insert(edge);
                    // An edge that two triangles of such a part share is no edge of the part's surface.
                    if !surface.insert(edge) {
                        surface.remove(&edge);
                    }
                }
            }
        }
        Self {
            level,
            state,
            omega,
            regions,
            unknowns,
            count,
            elimination,
            rings: solid_rings(design, &first_rings),
            surface,
            left_out,
            arc,
        }
    }

    /// Properties of a triangle's region.
    pub(super) fn region(&self, triangle: &Triangle) -> AcRegion {
        let region = self.regions.get(triangle.region as usize);
        region.cloned().unwrap_or(AcRegion::VACUUM)
    }

    /// For each triangle, its height in units of [`SKIN_DEPTHS`] skin depths, or 0 if this ratio is
    /// below one. A layer of triangles that is too high carries the same current with less loss, in
    /// proportion to its height.
    pub(super) fn coarse(&self) -> Vec<f64> {
        let mesh = &self.level.space.mesh;
        let coarse = |triangle: &Triangle| {
            let region = self.region(triangle);
            let [a, b, c] = mesh.corners_of(triangle);
            let longest = distance(a, b).max(distance(b, c)).max(distance(c, a));
            let height = crate::geometry::cross(a, b, c).abs() / longest;
            let ratio = height / (SKIN_DEPTHS * region.skin_depth_m);
            if region.in_surface || ratio <= 1.0 {
                0.0
            } else {
                ratio
            }
        };
        mesh.triangles.iter().map(coarse).collect()
    }

    /// Computes the matrix, and the right-hand side of each coil.
    pub(super) fn assemble(&self, coils: usize) -> Assembled {
        let mut assembled = Assembled {
            entries: Vec::new(),
            driven: vec![vec![0.0; self.count]; coils],
        };
        let mut placed = Placed::new(&self.level.space.basis);
        for triangle in 0..self.unknowns.len() {
            self.add_triangle(triangle, &mut placed, &mut assembled);
        }
        for &(coil, unknown, sense) in &self.rings {
            let driven = assembled.driven.get_mut(coil);
            if let Some(entry) = driven.and_then(|driven| driven.get_mut(unknown as usize)) {
                *entry = sense / TAU;
            }
        }
        for (_, matrix) in &self.arc {
            let size = matrix.len().isqrt().max(1);
            for (row, entries) in matrix.chunks(size).enumerate() {
                let lower = entries.iter().take(row + 1).map(Complex64::from);
                assembled.entries.extend(lower);
            }
        }
        assembled
    }

    /// Factors the matrix.
    pub(super) fn factor(&self, assembled: &Assembled) -> Result<Factor<Complex64>, SolveError> {
        let factor = self.elimination.factor(&assembled.entries);
        factor.map_err(|NotPositive| SolveError::Factor)
    }

    /// Field for one ampere in a coil.
    pub(super) fn solve(&self, factor: &Factor<Complex64>, driven: &[f64]) -> Vec<Complex64> {
        let driven: Vec<Complex64> = driven.iter().map(Complex64::from).collect();
        self.elimination.solve(factor, &driven)
    }

    /// The form x̄ᵀ A x for each triangle's matrix A.
    pub(super) fn forms(&self, assembled: &Assembled, x: &[Complex64]) -> Vec<Complex64> {
        let mut start = 0;
        let mut forms = Vec::with_capacity(self.unknowns.len());
        let mut values: Vec<Complex64> = Vec::new();
        for unknowns in &self.unknowns {
            values.clear();
            let at = |unknown: &u32| x.get(*unknown as usize).copied().unwrap_or_default();
            values.extend(unknowns.iter().map(at));
            let mut entries = assembled.entries.iter().skip(start);
            let mut form = Complex64::default();
            for (row, a) in values.iter().enumerate() {
                for (column, (b, entry)) in
                    values.iter().take(row + 1).zip(&mut entries).enumerate()
                {
                    let both = a.conj() * b;
                    // The entries of the lower half represent those of both halves.
                    form += entry
                        * if row == column {
                            both.re
                        } else {
                            2.0 * both.re
                        };
                }
            }
            start += unknowns.len() * (unknowns.len() + 1) / 2;
            forms.push(form);
        }
        forms
    }
}
