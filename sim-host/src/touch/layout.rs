//! Layouts of sensing coils under one layer.

use crate::sensing_coil::{CoilDesign, Sides};

/// Coils under one layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Coils, in the order of their channels: 0 to 3 on the first converter, 4 to 7 on the second.
    pub coils: Vec<Coil>,
    /// Height above the layer's base at which the magnetic elastomer begins, m, up to the layer's
    /// thickness. The elastomer is as thick as the first coil's `slab_m`; its part above the layer bends
    /// with the surface. A boundary within a twentieth of the thickness from the surface counts as the
    /// surface.
    pub boundary_m: f64,
}

/// A sensing coil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coil {
    /// Place of its axis, m.
    pub centre_m: [f64; 2],
    /// The coil; `gap_at_rest_m` is the depth of its turns below the elastomer's boundary, 0.1 mm to
    /// 20 mm. One side has elastomer.
    pub design: CoilDesign,
}

impl Coil {
    /// Place of its axis from that of another coil, m.
    pub(super) fn seen_from(&self, other: &Self) -> [f64; 2] {
        let ([x_m, y_m], [from_x_m, from_y_m]) = (self.centre_m, other.centre_m);
        [x_m - from_x_m, y_m - from_y_m]
    }
}

/// The winding of the built-in layouts: diameters of 10 and 3.5 mm, ten turns, 3 mm below a slab of 2 mm
/// (docs/touch.md).
pub(super) const WINDING: CoilDesign = CoilDesign {
    outer_diameter_m: 10e-3,
    inner_diameter_m: 3.5e-3,
    turns: 10,
    sides: Sides::One,
    slab_m: 2e-3,
    gap_at_rest_m: 3e-3,
    relative_permeability: 3.7,
};

/// Thickness of the layer of the built-in layouts, m: the elastomer begins at its surface.
const THICKNESS_M: f64 = 5e-3;

/// Distance of neighbouring centres, m: coils of this winding that overlap so far have hardly any mutual
/// inductance, as in phased arrays of magnetic resonance (Roemer et al. 1990).
const PITCH_M: f64 = 5.6e-3;

impl Layout {
    /// One coil in the centre and three around it, as `palpate plan-touch three-around-one`.
    #[must_use]
    pub fn three_around_one() -> Self {
        Self::of([None, Some(90.0), Some(-30.0), Some(-150.0)])
    }

    /// One coil in the centre and six around it, as `palpate plan-touch seven`. Coils that are converted
    /// at the same time lie opposite to each other; the centre is converted alone.
    #[must_use]
    pub fn seven() -> Self {
        let first = [Some(0.0), Some(60.0), Some(120.0), None];
        let second = [Some(180.0), Some(240.0), Some(300.0)];
        Self::of(first.into_iter().chain(second))
    }

    /// Coils around the centre at these directions, in degrees, or in the centre.
    fn of(directions: impl IntoIterator<Item = Option<f64>>) -> Self {
        let coil = |direction: Option<f64>| {
            let place = direction.map(|degrees: f64| {
                let angle = degrees.to_radians();
                [PITCH_M * libm::cos(angle), PITCH_M * libm::sin(angle)]
            });
            Coil {
                centre_m: place.unwrap_or_default(),
                design: WINDING,
            }
        };
        Self {
            coils: directions.into_iter().map(coil).collect(),
            boundary_m: THICKNESS_M,
        }
    }
}
