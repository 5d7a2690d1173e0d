//! Permeability of the vacuum, and reluctivity of a material.

use crate::geometry::length;

/// Permeability of the vacuum, H/m (2018 CODATA: 1.256 637 062 12(19)·10⁻⁶; the exact value before
/// 2019 differs by 5·10⁻¹⁰ and is the one that published closed forms use).
pub const MU_0: f64 = 4e-7 * core::f64::consts::PI;

/// Reluctivity at a flux density, with its derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reluctivity {
    /// ν = H/B, m/H.
    pub nu: f64,
    /// dν/dB, m/(H T).
    pub slope: f64,
}

impl Reluctivity {
    /// Differential reluctivity dH/dB = ν + (dν/dB) B Bᵀ/|B| as a matrix, m/H, at the flux density
    /// `b_t`, T. Its second term vanishes at B = 0 for all materials of this crate.
    #[must_use]
    pub fn differential(&self, b_t: [f64; 2]) -> [[f64; 2]; 2] {
        let size = length(b_t);
        let bend = if size > 0.0 { self.slope / size } else { 0.0 };
        let off = bend * b_t[0] * b_t[1];
        [
            [self.nu + bend * b_t[0] * b_t[0], off],
            [off, self.nu + bend * b_t[1] * b_t[1]],
        ]
    }
}
