//! Sources of the field.

use crate::design::Design;

/// Excitation of the field.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// Current of each coil, A; multiplied by the coil's sense.
    pub currents_a: Vec<f64>,
    /// Uniform field along the axis, T.
    pub background_t: f64,
    /// Whether materials saturate. If not, they have their initial permeability.
    pub saturating: bool,
    /// Whether magnets have their remanence. If not, they only have their permeability.
    pub magnetised: bool,
}

impl Excitation {
    /// A current in all driven coils of a design, in series, as the only source: the design's
    /// background, the remanence of its magnets and the own currents of its coils are left out.
    /// Materials stay far below saturation, so every figure is proportional to a power of the
    /// current.
    #[must_use]
    pub fn small(design: &Design, current_a: f64) -> Self {
        Self {
            currents_a: design
                .coils
                .iter()
                .map(|coil| if coil.driven { current_a } else { 0.0 })
                .collect(),
            background_t: 0.0,
            saturating: false,
            magnetised: false,
        }
    }

    /// The current in all driven coils, with saturating materials, the design's background, its
    /// magnets, and the coils that carry currents of their own.
    #[must_use]
    pub fn saturating(design: &Design, current_a: f64) -> Self {
        Self {
            currents_a: design
                .coils
                .iter()
                .map(|coil| match coil.own_current_a {
                    Some(own_a) => own_a,
                    None if coil.driven => current_a,
                    None => 0.0,
                })
                .collect(),
            background_t: design.background_t,
            saturating: true,
            magnetised: true,
        }
    }
}
