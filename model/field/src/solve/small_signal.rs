//! Derivatives of the figures with respect to the current, about a solved field.

use super::adapt::Solved;
use super::assembly::Level;
use super::excitation::Excitation;
use super::fixed::Fixed;
use super::newton::{Pattern, SolveError};
use crate::design::Design;
use crate::figures::Figures;

/// Fraction of the current by which the field is changed up and down: the derivative neglects terms
/// of the third order, a millionth.
const STEP: f64 = 1e-3;

impl Solved {
    /// Derivative of every figure with respect to the current of all coils in series, per ampere,
    /// about the solved field, with the differential permeability of every part. The derivative of
    /// the flux linkage is the differential inductance, H.
    ///
    /// # Errors
    /// As for [`super::solve`].
    pub fn by_current(&self, design: &Design) -> Result<Figures, SolveError> {
        let slope = self.field_by_current(design)?;
        let driven = self.excitation.currents_a.iter().zip(&design.coils);
        let mut driven = driven.filter(|(_, coil)| coil.driven);
        let current_a = driven.next().map_or(0.0, |(current, _)| *current);
        let step_a = STEP
            * if current_a == 0.0 {
                1.0
            } else {
                current_a.abs()
            };
        let at = |side: f64| {
            let moved = self.w.iter().zip(&slope);
            let moved: Vec<f64> = moved.map(|(w, slope)| w + side * step_a * slope).collect();
            Figures::of(design, &self.level, &moved)
        };
        Ok(at(1.0).less(&at(-1.0)).scaled(0.5 / step_a))
    }

    /// Derivative of w with respect to the current, T/A, computed with the tangent.
    fn field_by_current(&self, design: &Design) -> Result<Vec<f64>, SolveError> {
        let one_more_a = Excitation::small(design, 1.0).currents_a;
        let (_, field) = response(design, &self.level, &self.excitation, &self.w, &one_more_a)?;
        Ok(field)
    }
}

/// Right-hand side for an additional current in each coil, A, about a field `w`, and the resulting
/// change of that field, T, which is proportional to the currents.
pub(super) fn response(
    design: &Design,
    level: &Level,
    excitation: &Excitation,
    w: &[f64],
    more_a: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), SolveError> {
    let currents_a = excitation.currents_a.iter().zip(more_a);
    let more = Excitation {
        currents_a: currents_a.map(|(current, more)| current + more).collect(),
        ..excitation.clone()
    };
    let more = Level::new(design, level.space.clone(), &more);
    let pattern = Pattern::of(level);
    let (residual, entries) = pattern.assemble(level, &Fixed::NONE, w, true);
    let (with_more, _) = pattern.assemble(&more, &Fixed::NONE, w, false);
    let factor = pattern.factor(&entries)?;
    let driven = residual.iter().zip(&with_more);
    let driven: Vec<f64> = driven.map(|(now, more)| now - more).collect();
    let field = pattern.solve(&factor, &driven);
    Ok((driven, field))
}
