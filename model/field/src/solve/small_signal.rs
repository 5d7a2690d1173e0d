//! How figures change with the current, about a solved field.

use super::adapt::Solved;
use super::assembly::Level;
use super::newton::{Excitation, Pattern, SolveError};
use crate::design::Design;
use crate::figures::Figures;

/// Share of the current by which the field is moved each way: what is cubic in it is left out of the
/// derivative, a millionth.
const STEP: f64 = 1e-3;

impl Solved {
    /// The derivative of every figure by the current of all coils in series, per ampere, about the
    /// field as it is: by the differential permeability of every part. That of the flux linkage is the
    /// differential inductance, H.
    ///
    /// # Errors
    /// As [`super::solve`].
    pub fn by_current(&self, design: &Design) -> Result<Figures, SolveError> {
        let slope = self.field_by_current(design)?;
        let current_a = self.excitation.currents_a.first().copied().unwrap_or(0.0);
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

    /// The derivative of w by the current, T/A: the tangent's answer to an ampere more.
    fn field_by_current(&self, design: &Design) -> Result<Vec<f64>, SolveError> {
        let currents_a = self
            .excitation
            .currents_a
            .iter()
            .map(|current| current + 1.0);
        let more = Excitation {
            currents_a: currents_a.collect(),
            ..self.excitation.clone()
        };
        let more = Level::new(design, self.level.space.clone(), &more);
        let pattern = Pattern::of(&self.level);
        let (residual, entries) = pattern.assemble(&self.level, &self.w, true);
        let (with_more, _) = pattern.assemble(&more, &self.w, false);
        let factor = pattern.factor(&entries)?;
        let driven = residual.iter().zip(&with_more);
        let driven: Vec<f64> = driven.map(|(now, more)| now - more).collect();
        Ok(pattern.solve(&factor, &driven))
    }
}
