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

/// The winding of the built-in layouts: diameters of 13.5 and 3.5 mm, ten turns, 0.6 mm below a slab
/// of 2 mm (docs/touch.md).
pub(super) const WINDING: CoilDesign = CoilDesign {
    outer_diameter_m: 13.5e-3,
    inner_diameter_m: 3.5e-3,
    turns: 10,
    sides: Sides::One,
    slab_m: 2e-3,
    gap_at_rest_m: 0.6e-3,
    relative_permeability: 3.7,
};

/// Thickness of the layer of the built-in layouts, m: the elastomer begins at its surface.
const THICKNESS_M: f64 = 5e-3;

impl Layout {
    /// One coil in the centre and three around it at 6 mm, as `palpate plan-touch three-around-one`.
    #[must_use]
    pub fn three_around_one() -> Self {
        let around = [[0.0, 6e-3], [5.196e-3, -3e-3], [-5.196e-3, -3e-3]];
        Self::around_one(&around)
    }

    /// One coil in the centre and six around it at 6 mm, as `palpate plan-touch seven`.
    #[must_use]
    pub fn seven() -> Self {
        let around = [
            [6e-3, 0.0],
            [3e-3, 5.196e-3],
            [-3e-3, 5.196e-3],
            [-6e-3, 0.0],
            [-3e-3, -5.196e-3],
            [3e-3, -5.196e-3],
        ];
        Self::around_one(&around)
    }

    fn around_one(around: &[[f64; 2]]) -> Self {
        let coil = |&centre_m: &[f64; 2]| Coil {
            centre_m,
            design: WINDING,
        };
        let mut coils = vec![coil(&[0.0; 2])];
        coils.extend(around.iter().map(coil));
        Self {
            coils,
            boundary_m: THICKNESS_M,
        }
    }
}
