//! Stiffness of a layer bonded between two rigid plates.
//!
//! Rubber keeps its volume, so a bonded layer can only yield by bulging at its rim, and a wide thin
//! layer can hardly bulge. By Gent and Lindley (*The compression of bonded rubber blocks*, Proc.
//! Inst. Mech. Eng. 173, 1959), the apparent modulus is
//!
//! E_a = E (1 + 2 S^2), S = loaded area / free area, which is r/(2 h) for a disc,
//!
//! and the stiffness is c = E_a A / h. A disc of r = 30 mm, h = 5 mm is 19 times as stiff as E A /
//! h. The formula holds for E much below the bulk modulus (S up to about 10) and small strain.

use crate::units::{Metre, NewtonPerMetre, OutOfRange, Pascal};
use core::f32::consts::PI;

/// A disc of elastomer bonded on both faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BondedDisc {
    radius: Metre,
    height: Metre,
}

impl BondedDisc {
    /// Creates a disc; both lengths above zero.
    pub const fn new(radius: Metre, height: Metre) -> Result<Self, OutOfRange> {
        match (Metre::positive(radius.0), Metre::positive(height.0)) {
            (Ok(radius), Ok(height)) => Ok(Self { radius, height }),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }

    /// Shape factor S = r/(2 h).
    pub fn shape_factor(&self) -> f32 {
        self.radius / (self.height * 2.0)
    }

    /// Stiffness c = E (1 + 2 S^2) pi r^2 / h. Relative error at most 6.0e-7.
    ///
    /// ```
    /// use palpate_model::{layer::BondedDisc, units::{Metre, Pascal}};
    /// let layer = BondedDisc::new(Metre(30e-3), Metre(5e-3)).unwrap();
    /// assert!((layer.stiffness(Pascal(0.1e6)).0 - 1.074e6).abs() < 1e3);
    /// ```
    pub fn stiffness(&self, modulus: Pascal) -> NewtonPerMetre {
        let factor = self.shape_factor();
        let apparent = modulus.0 * (1.0 + 2.0 * factor * factor);
        NewtonPerMetre(apparent * PI * self.radius.0 * (self.radius / self.height))
    }
}

/// Apparent modulus E_a = E (1 + 2 S^2) of a layer of any shape, given its shape factor S.
pub fn apparent_modulus(modulus: Pascal, shape_factor: f32) -> Pascal {
    modulus * (1.0 + 2.0 * shape_factor * shape_factor)
}
