//! Error indicator: jumps of the tangential H across edges show where the mesh is too coarse.
//!
//! In the exact field the tangential H is continuous across every edge. η² = Σ h/(ν₁ + ν₂) ∫ [H_t]²
//! r ds over a triangle's edges is the classical residual estimate without its interior term, which
//! has the same size for element orders from two on.

use std::collections::{HashMap, HashSet};

use super::assembly::{Level, along, combine, on_side};
use super::scalar::dot;
use super::space::Space;
use crate::element::shape::Placed;
use crate::element::{Basis, quadrature};
use crate::material::MU_0;
use crate::mesh::{Mesh, ascending};

/// Jumps of the tangential H at the edges of each triangle.
pub(super) struct Jumps {
    /// η² of each triangle, in the unit of the energy.
    pub(super) energy: Vec<f64>,
    /// Greatest jump at an edge of each triangle (root mean square along the edge), divided by the
    /// mean dH/dB: an error of B, T.
    pub(super) field_t: Vec<f64>,
    /// The field of each triangle, root mean square over its edges, T; in the exterior it is that
    /// of the mapped field.
    pub(super) size_t: Vec<f64>,
}

/// The jumps of the field `w`.
pub(super) fn jumps(level: &Level, w: &[f64]) -> Jumps {
    jumps_without(level, w, None, &HashSet::new())
}

/// The jumps of a small change of the field `state`; background and magnets do not change.
pub(super) fn jumps_of_change(level: &Level, state: &[f64], change: &[f64]) -> Jumps {
    jumps_without(level, state, Some(change), &HashSet::new())
}

/// The jumps of a change or, if there is none, of the field itself. Edges in `left_out` are
/// skipped: a jump there is no error.
pub(super) fn jumps_without(
    level: &Level,
    state: &[f64],
    change: Option<&[f64]>,
    left_out: &HashSet<[u32; 2]>,
) -> Jumps {
    let space = &level.space;
    let rule = quadrature::gauss(space.basis.order() as usize + 1, 0.0);
    // Sorted, so that an edge has the same points when seen from either side.
    let mut rule: Vec<(f64, f64)> = rule;
    rule.sort_by(|a, b| a.0.total_cmp(&b.0));
    let samples: Vec<Vec<_>> = (0..3)
        .map(|side| {
            rule.iter()
                .map(|&(t, _)| space.basis.sample(on_side(side, t)))
                .collect()
        })
        .collect();
    let mut placed = Placed::new(&space.basis);
    let mut seen: HashMap<[u32; 2], (usize, [f64; 2], Vec<f64>)> = HashMap::new();
    let mut energy = vec![0.0; space.mesh.triangles.len()];
    let mut size_t = vec![0.0_f64; space.mesh.triangles.len()];
    let mut field_t = vec![0.0_f64; space.mesh.triangles.len()];
    for (index, triangle) in space.mesh.triangles.iter().enumerate() {
        let (Some(nodes), Some(unknowns)) = (space.nodes.get(index), space.unknowns.get(index))
        else {
            continue;
        };
        let exterior = space.mesh.region(triangle).exterior;
        for (side, edge) in triangle.edges().into_iter().enumerate() {
            let key = ascending(edge);
            let [a, b] = edge.map(|vertex| space.mesh.position(vertex));
            if (a[0] == 0.0 && b[0] == 0.0)
                || space.mesh.arc.contains(&key)
                || left_out.contains(&key)
            {
                continue;
            }
            let length = crate::geometry::distance(a, b);
            // Sums of ν and of dH/dB along the edge.
            let mut nu_sum = [0.0; 2];
            let mut values: Vec<f64> = Vec::with_capacity(rule.len());
            for sample in samples.get(side).into_iter().flatten() {
                placed.fill(nodes, sample);
                let r = placed.point[0];
                let (_, tangent) = along(nodes, sample, side);
                let speed = tangent[0].hypot(tangent[1]);
                let tangent = tangent.map(|t| t / speed);
                let field = |w: &[f64], background: f64| {
                    let (value, slope) = combine(w, unknowns, sample, &placed);
                    (
                        value,
                        slope,
                        [-r * slope[1], 2.0 * value + r * slope[0] + background],
                    )
                };
                let (_, slope, b) = match change {
                    Some(change) => field(change, 0.0),
                    None => field(state, level.background_t),
                };
                if let Some(size) = size_t.get_mut(index) {
                    *size += (b[0] * b[0] + b[1] * b[1]) / (3 * rule.len()) as f64;
                }
                if exterior {
                    let normal = slope[0] * tangent[1] - slope[1] * tangent[0];
                    values.push(r * normal / MU_0);
                    nu_sum = nu_sum.map(|sum| sum + 1.0 / MU_0);
                } else {
                    let (_, _, b_state) = field(state, level.background_t);
                    let (material, excess) = level.law_at(triangle.region as usize, b_state);
                    let law = material.reluctivity(crate::geometry::length(excess));
                    let nu = law.nu;
                    let along = law.differential(excess).map(|row| dot(&row, &tangent));
                    let along = dot(&along, &tangent);
                    let of = if change.is_some() { b } else { excess };
                    values.push(nu * (of[0] * tangent[0] + of[1] * tangent[1]));
                    nu_sum = [nu_sum[0] + nu, nu_sum[1] + along];
                }
            }
            let nu = nu_sum.map(|sum| sum / rule.len() as f64);
            match seen.remove(&key) {
                None => {
                    seen.insert(key, (index, nu, values));
                }
                Some((other, other_nu, others)) => {
                    let (mut sum, mut whole) = (0.0, 0.0);
                    let both = values.iter().zip(others.iter().rev());
                    for ((value, other), ((_, weight), sample)) in
                        both.zip(rule.iter().zip(samples.get(side).into_iter().flatten()))
                    {
                        let (point, [dr, dx]) = along(nodes, sample, side);
                        let speed = dr.hypot(dx);
                        sum += weight * speed * point[0] * (value + other).powi(2);
                        whole += weight * speed * point[0];
                    }
                    let share = length * sum / (nu[0] + other_nu[0]);
                    let jump = 2.0 * (sum / whole).sqrt() / (nu[1] + other_nu[1]);
                    for owner in [index, other] {
                        if let (Some(energy), Some(field)) =
                            (energy.get_mut(owner), field_t.get_mut(owner))
                        {
                            *energy += share;
                            *field = field.max(jump);
                        }
                    }
                }
            }
        }
    }
    size_t.iter_mut().for_each(|size| *size = size.sqrt());
    Jumps {
        energy,
        field_t,
        size_t,
    }
}

/// For each triangle, the probable difference of w from its exact values, T.
///
/// Two parts of w, s_p that the highest order p adds and s_(p−1) that the previous order added,
/// show how fast the polynomials converge locally: the next order would add about s_p ·
/// s_p/s_(p−1). Jumps do not show this, since w is continuous.
pub(super) fn decay(space: &Space, w: &[f64]) -> Vec<f64> {
    let order = space.basis.order();
    let surplus =
        [order - 1, order.saturating_sub(2).max(1)].map(|lower| without(&space.basis, lower));
    let added = |values: &[f64], matrix: &[Vec<f64>]| {
        let at = |(row, value): (&Vec<f64>, &f64)| (value - dot(row, values)).abs();
        matrix.iter().zip(values).map(at).fold(0.0, f64::max)
    };
    let triangle = |unknowns: &Vec<u32>| {
        let at = |&unknown: &u32| w.get(unknown as usize).copied().unwrap_or(0.0);
        let values: Vec<f64> = unknowns.iter().map(at).collect();
        let [last, before] = [&surplus[0], &surplus[1]].map(|matrix| added(&values, matrix));
        if before > 0.0 {
            last * (last / before).min(1.0)
        } else {
            0.0
        }
    };
    space.unknowns.iter().map(triangle).collect()
}

/// The matrix that lowers a polynomial's order: from its values at the nodes of `basis` to those of
/// the polynomial of order `lower` that equals it at the nodes of that order.
fn without(basis: &Basis, lower: u32) -> Vec<Vec<f64>> {
    let lower = Basis::new(lower);
    let onto: Vec<Vec<f64>> = lower.points().map(|at| basis.sample(at).values).collect();
    let row = |at: [f64; 3]| {
        let weights = lower.sample(at).values;
        let entry = |column: usize| {
            let terms = weights.iter().zip(&onto);
            terms
                .map(|(weight, row)| weight * row.get(column).copied().unwrap_or(0.0))
                .sum()
        };
        (0..basis.len()).map(entry).collect()
    };
    basis.points().map(row).collect()
}

/// Marks the triangles with the largest scores, as many as together have the fraction `share` of
/// the total.
pub(super) fn mark(scores: &[f64], share: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    let score = |index: usize| scores.get(index).copied().unwrap_or(0.0);
    order.sort_by(|&a, &b| score(b).total_cmp(&score(a)));
    let whole: f64 = scores.iter().sum();
    let mut marked = vec![false; scores.len()];
    let mut sum = 0.0;
    for index in order {
        if sum >= share * whole {
            break;
        }
        sum += score(index);
        if let Some(mark) = marked.get_mut(index) {
            *mark = true;
        }
    }
    marked
}

/// Smallest ratio of the numbers of triangles of successive meshes: if a mesh is hardly finer, a
/// small change says little about the error.
const GROWTH: f64 = 1.3;
/// Score of each half of a halved triangle, relative to the score of the whole: the true ratio is a
/// sixteenth in smooth fields with cubic polynomials, and a half at singular corners.
const HALVED: f64 = 0.25;

/// Returns a mesh with [`GROWTH`] times as many triangles, finer where the scores are high, and for
/// each of its triangles the index of the old triangle that contains it.
pub(super) fn refined(mesh: &Mesh, mut scores: Vec<f64>, share: f64) -> (Mesh, Vec<usize>) {
    let mut finer = mesh.clone();
    let mut parents: Vec<usize> = (0..mesh.triangles.len()).collect();
    while (finer.triangles.len() as f64) < GROWTH * mesh.triangles.len() as f64 {
        let halved = finer.refine(&mark(&scores, share));
        if halved.len() == scores.len() {
            // All scores are 0: there is no field.
            break;
        }
        // The pieces of one old triangle are adjacent.
        let parts = halved.chunk_by(|a, b| a == b);
        (scores, parents) = parts
            .zip(scores.iter().zip(&parents))
            .flat_map(|(parts, (score, &parent))| {
                let score = score * HALVED.powf(f64::from(parts.len().ilog2()));
                parts.iter().map(move |_| (score, parent))
            })
            .unzip();
    }
    (finer, parents)
}
