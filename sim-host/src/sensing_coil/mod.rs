//! The sensing coil: a planar spiral between slabs of MSE, and the tank of coil and capacitor.
//!
//! The inductance follows from the field of circular filaments between plane layers, which has a
//! closed form under a Hankel transform (SOURCES.md section 5):
//!
//! L(d) = L0 + μ0 π ∫₀^∞ S(k)² F(k, d) dk,  S(k) = Σᵢ aᵢ J1(k aᵢ)
//!
//! with the turns' radii aᵢ and F from the reflection at the layers ([`layers`]). [`integral`]
//! evaluates it, [`curve`] makes it fast, [`tank`] turns it into a frequency.

pub mod curve;
mod filaments;
pub mod integral;
pub mod interference;
pub mod layers;
pub mod mutual;
pub mod tank;

use core::fmt;

/// Thickness of the coil's copper, m (35 µm, the commonest on flexible boards; guess).
const COPPER_M: f64 = 35e-6;

/// Sides of the coil with MSE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// A slab on one side, at the gap d.
    One,
    /// A slab on either side, both at the same gap d.
    Both,
}

/// A planar spiral coil in its layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoilDesign {
    /// Outer diameter, m, 1 mm to 100 mm.
    pub outer_diameter_m: f64,
    /// Inner diameter, m, above zero and below the outer one.
    pub inner_diameter_m: f64,
    /// Number of turns, 1 to 200.
    pub turns: u32,
    /// Sides with MSE.
    pub sides: Sides,
    /// Thickness of each slab, m, 0.1 mm to 50 mm.
    pub slab_m: f64,
    /// Distance from the turns to each slab without load, m, 0.1 mm to 3 mm.
    pub gap_at_rest_m: f64,
    /// Relative permeability of the MSE at the tank's frequency: 3.7 for about 30 % of carbonyl
    /// iron by volume (published; SOURCES.md section 1).
    pub relative_permeability: f64,
}

impl CoilDesign {
    /// The coil of the reference plants: diameters of 14 and 4 mm, 25 turns, slabs of 2 mm on both
    /// sides at a gap of 1 mm (the stacks' `[tank]`; SOURCES.md section 5).
    pub const REFERENCE: Self = Self {
        outer_diameter_m: 14e-3,
        inner_diameter_m: 4e-3,
        turns: 25,
        sides: Sides::Both,
        slab_m: 2e-3,
        gap_at_rest_m: 1e-3,
        relative_permeability: 3.7,
    };

    /// Distance between neighbouring turns, m.
    #[must_use]
    pub fn pitch_m(&self) -> f64 {
        (self.outer_diameter_m - self.inner_diameter_m) / (2.0 * f64::from(self.turns))
    }

    /// Radii of the turns at their centres, from the innermost outwards, m.
    pub fn radii_m(&self) -> impl Iterator<Item = f64> + '_ {
        let first = 0.5 * (self.inner_diameter_m + self.pitch_m());
        (0..self.turns).map(move |turn| first + f64::from(turn) * self.pitch_m())
    }

    /// Inductance without MSE, H: the sum over the turns as filaments, with tracks half a pitch wide
    /// of copper of 35 µm (which reproduces the inductances of SOURCES.md section 5).
    ///
    /// ```
    /// use palpate_sim::sensing_coil::CoilDesign;
    ///
    /// assert!((CoilDesign::REFERENCE.inductance_in_air_h() - 5.48e-6).abs() < 0.005e-6);
    /// ```
    #[must_use]
    pub fn inductance_in_air_h(&self) -> f64 {
        let radii_m: Vec<f64> = self.radii_m().collect();
        filaments::inductance_h(&radii_m, (0.5 * self.pitch_m(), COPPER_M))
    }

    /// Inductance without MSE, H, with tracks `width_m` wide (above zero, at most the pitch) in the
    /// mutual inductances too. For the reference coil this is 0.2 % more than with filaments.
    #[must_use]
    pub fn inductance_of_tracks_in_air_h(&self, width_m: f64) -> f64 {
        let radii_m: Vec<f64> = self.radii_m().collect();
        filaments::inductance_of_tracks_h(&radii_m, (width_m, COPPER_M))
    }

    /// Checks the ranges of the design.
    ///
    /// # Errors
    /// [`DesignError`] names the first quantity out of range and its range.
    pub fn check(&self) -> Result<(), DesignError> {
        let millimetres = |quantity, value_m: f64, least_mm: f64, most_mm: f64| {
            let value = value_m * 1e3;
            // The ends of the range are included, despite rounding of the factor.
            let within = value >= least_mm * (1.0 - 1e-12) && value <= most_mm * (1.0 + 1e-12);
            DesignError::unless(within, quantity, value, least_mm, most_mm)
        };
        let outer_mm = self.outer_diameter_m * 1e3;
        millimetres("do in mm", self.outer_diameter_m, 1.0, 100.0)?;
        millimetres("di in mm", self.inner_diameter_m, 0.1, 0.99 * outer_mm)?;
        millimetres("slabs in mm", self.slab_m, 0.1, 50.0)?;
        millimetres("gap in mm", self.gap_at_rest_m, 0.1, 3.0)?;
        let turns = f64::from(self.turns);
        DesignError::unless((1.0..=200.0).contains(&turns), "turns", turns, 1.0, 200.0)?;
        let mu = self.relative_permeability;
        DesignError::unless((1.0..=1e4).contains(&mu), "mu_r", mu, 1.0, 1e4)
    }
}

/// A quantity of a [`CoilDesign`] that is out of range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignError {
    /// Name of the quantity, with its unit.
    pub quantity: &'static str,
    /// Rejected value.
    pub value: f64,
    /// Least allowed value.
    pub min: f64,
    /// Greatest allowed value.
    pub max: f64,
}

impl DesignError {
    fn unless(
        fine: bool,
        quantity: &'static str,
        value: f64,
        min: f64,
        max: f64,
    ) -> Result<(), Self> {
        if fine {
            return Ok(());
        }
        Err(Self {
            quantity,
            value,
            min,
            max,
        })
    }
}

impl fmt::Display for DesignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            quantity,
            value,
            min,
            max,
        } = self;
        write!(f, "{quantity} is {value}; allowed are {min} to {max}")
    }
}

impl core::error::Error for DesignError {}
