//! Newton's method with a line search, each step by a sparse Cholesky factorisation.

use core::fmt;

use super::assembly::{Level, Local, add_product};
use super::cholesky::{Dissection, Element, Factor, NotPositive};
use super::fixed::Fixed;
use super::scalar::dot;
use crate::element::shape::Placed;

/// Reason why there is no solution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SolveError {
    /// The design could not be triangulated.
    Mesh(crate::mesh::MeshError),
    /// The matrix is not positive definite.
    Factor,
    /// Newton's method did not converge.
    Diverged {
        /// Number of steps taken.
        steps: usize,
    },
}

impl fmt::Display for SolveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mesh(error) => error.fmt(f),
            Self::Factor => f.write_str("the matrix is not positive definite"),
            Self::Diverged { steps } => write!(
                f,
                "the field did not settle in {steps} Newton steps: lower the current, the exponent of the material, or the steps in its table"
            ),
        }
    }
}

impl core::error::Error for SolveError {}

impl From<crate::mesh::MeshError> for SolveError {
    fn from(error: crate::mesh::MeshError) -> Self {
        Self::Mesh(error)
    }
}

/// Structure of a mesh's matrix: the entries whose sum it is, and the order of elimination.
pub(super) struct Pattern {
    elimination: Dissection,
    entries: usize,
    /// For each edge of the arc between inside and outside, its triangle and its matrix.
    arc: Vec<(usize, Vec<f64>)>,
}

impl Pattern {
    pub(super) fn of(level: &Level) -> Self {
        let arc = level.arc();
        let space = &level.space;
        let triangles = 0..space.unknowns.len();
        let of_arc = arc.iter().map(|&(triangle, _)| triangle);
        let elements: Vec<_> = triangles
            .chain(of_arc)
            .filter_map(|triangle| space.element(triangle))
            .collect();
        Self {
            elimination: Dissection::of(&elements, space.count),
            entries: elements.iter().map(Element::entries).sum(),
            arc,
        }
    }

    /// Computes the residual and, on request, the entries of the tangent in the pattern's order.
    /// Contributions in `fixed` are not computed again.
    pub(super) fn assemble(
        &self,
        level: &Level,
        fixed: &Fixed,
        w: &[f64],
        tangent: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let mut residual = vec![0.0; level.space.count];
        let mut entries = Vec::with_capacity(if tangent { self.entries } else { 0 });
        let mut placed = Placed::new(&level.space.basis);
        let mut local = Local::new(level.space.basis.len(), tangent);
        for (index, unknowns) in level.space.unknowns.iter().enumerate() {
            let of_triangle = match fixed.of_triangle(index) {
                Some(known) => {
                    local.residual.clone_from(&known.residual);
                    add_product(&known.tangent, unknowns, w, &mut local.residual);
                    &known.tangent
                }
                _ => {
                    level.local(index, w, &mut placed, &mut local);
                    &local.tangent
                }
            };
            scatter(&mut residual, unknowns, &local.residual);
            if tangent {
                entries.extend_from_slice(of_triangle);
            }
        }
        for (triangle, matrix) in &self.arc {
            let Some(unknowns) = level.space.unknowns.get(*triangle) else {
                continue;
            };
            for (i, row) in matrix.chunks(unknowns.len()).enumerate() {
                let product = row.iter().zip(unknowns).map(|(entry, &unknown)| {
                    entry * w.get(unknown as usize).copied().unwrap_or(0.0)
                });
                let product: f64 = product.sum();
                let unknown = unknowns
                    .get(i)
                    .map_or(usize::MAX, |&unknown| unknown as usize);
                if let Some(residual) = residual.get_mut(unknown) {
                    *residual += product;
                }
                if tangent {
                    entries.extend(row.iter().take(i + 1));
                }
            }
        }
        (residual, entries)
    }

    /// Factors the matrix with the given entries.
    pub(super) fn factor(&self, entries: &[f64]) -> Result<Factor, SolveError> {
        let factor = self.elimination.factor(entries);
        factor.map_err(|NotPositive| SolveError::Factor)
    }

    /// Solves a system of equations whose matrix has this pattern and has been factored.
    pub(super) fn solve(&self, factor: &Factor, rhs: &[f64]) -> Vec<f64> {
        self.elimination.solve(factor, rhs)
    }
}

fn scatter(global: &mut [f64], unknowns: &[u32], local: &[f64]) {
    for (&unknown, value) in unknowns.iter().zip(local) {
        if let Some(entry) = global.get_mut(unknown as usize) {
            *entry += value;
        }
    }
}

/// A solution, the last factor of the matrix, and the number of steps taken.
pub(super) struct Balanced {
    pub(super) w: Vec<f64>,
    pub(super) factor: Factor,
    pub(super) steps: usize,
}

/// Largest number of steps of Newton's method.
const MOST_STEPS: usize = 60;

/// Finds the w whose residual is zero, starting from a guess. The residual is the derivative of a
/// convex energy, so the slope of the energy rises along each step: the line search looks for a
/// small slope. The last step is at most `last_step` of the field, by energy; the remaining error
/// is about the square of that.
pub(super) fn balance(
    level: &Level,
    pattern: &Pattern,
    guess: Vec<f64>,
    last_step: f64,
) -> Result<Balanced, SolveError> {
    let linear = level
        .materials
        .iter()
        .all(crate::material::Material::is_linear);
    let mut w = guess;
    if linear {
        return in_one_step(level, pattern, w);
    }
    let fixed = Fixed::of(level);
    let (at_rest, _) = pattern.assemble(level, &fixed, &vec![0.0; w.len()], false);
    let mut scale = 0.0_f64;
    for step in 1..=MOST_STEPS {
        let (residual, entries) = pattern.assemble(level, &fixed, &w, true);
        let factor = pattern.factor(&entries)?;
        let direction = downhill(pattern, &factor, &residual);
        let slope = dot(&direction, &residual);
        let slope_at = |share: f64| {
            let trial: Vec<f64> = w
                .iter()
                .zip(&direction)
                .map(|(w, d)| w + share * d)
                .collect();
            dot(
                &direction,
                &pattern.assemble(level, &fixed, &trial, false).0,
            )
        };
        let share = line_search(slope_at, slope);
        for (w, d) in w.iter_mut().zip(&direction) {
            *w += share * d;
        }
        // Twice the work of the currents, an upper bound of wᵀKw.
        scale = scale.max(slope.abs()).max(dot(&at_rest, &w).abs());
        if slope.abs() <= last_step.powi(2) * scale {
            return Ok(Balanced {
                w,
                factor,
                steps: step,
            });
        }
    }
    Err(SolveError::Diverged { steps: MOST_STEPS })
}

/// Solves a linear problem in one step.
fn in_one_step(level: &Level, pattern: &Pattern, mut w: Vec<f64>) -> Result<Balanced, SolveError> {
    let (residual, entries) = pattern.assemble(level, &Fixed::NONE, &w, true);
    let factor = pattern.factor(&entries)?;
    let direction = downhill(pattern, &factor, &residual);
    w.iter_mut().zip(&direction).for_each(|(w, d)| *w += d);
    Ok(Balanced {
        w,
        factor,
        steps: 1,
    })
}

/// Newton's step: the negative residual divided by the tangent.
fn downhill(pattern: &Pattern, factor: &Factor, residual: &[f64]) -> Vec<f64> {
    let mut direction = pattern.solve(factor, residual);
    direction.iter_mut().for_each(|d| *d = -*d);
    direction
}

/// Fraction of the step at which the slope has fallen to a tenth.
fn line_search(slope_at: impl Fn(f64) -> f64, slope: f64) -> f64 {
    let (mut low, mut high) = ((0.0, slope), (1.0, slope_at(1.0)));
    let mut widening = 0;
    while high.1 < -0.5 * slope.abs() && widening < 3 {
        // The slope is still steep: extend the step.
        low = high;
        high = (2.0 * high.0, slope_at(2.0 * high.0));
        widening += 1;
    }
    for _ in 0..12 {
        if high.1.abs() <= 0.1 * slope.abs() || high.1 < 0.0 {
            return high.0;
        }
        // The slope is steep beyond the bend of the curve, so false position converges slowly: take
        // the mean of its point and that of bisection.
        let secant = low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1);
        let middle = 0.5 * (secant + 0.5 * (low.0 + high.0));
        let at = (middle, slope_at(middle));
        if at.1.abs() <= 0.1 * slope.abs() {
            return middle;
        }
        if at.1 < 0.0 { low = at } else { high = at }
    }
    low.0.max(1e-3)
}
