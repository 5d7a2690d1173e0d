//! Quantities as newtypes over `f32` in SI units, for the boundaries of the model.
//!
//! Formulas use the plain number (`.0`), interfaces the quantity, so that a stiffness cannot be
//! mistaken for a length. There is no general dimensional analysis; only the products that the
//! model's formulas need are defined.
//!
//! ```
//! use palpate_model::units::{Metre, Newton, NewtonPerMetre};
//! let force: Newton = NewtonPerMetre(6_000.0) * Metre(0.3e-3);
//! assert!((force.0 - 1.8).abs() < 1e-6);
//! assert!(NewtonPerMetre::positive(-1.0).is_err());
//! ```

use core::fmt;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Requirement that a checked constructor makes on its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requirement {
    /// Finite and at least zero.
    NonNegative,
    /// Finite and above zero.
    Positive,
}

impl Requirement {
    /// Whether `value` meets the requirement.
    pub const fn met_by(self, value: f32) -> bool {
        value.is_finite()
            && match self {
                Self::NonNegative => value >= 0.0,
                Self::Positive => value > 0.0,
            }
    }
}

/// Error: a number that a quantity cannot have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// The number.
    pub value: f32,
    /// Unit of the number, empty for a pure number.
    pub unit: &'static str,
    /// The requirement that it does not meet.
    pub requirement: Requirement,
}

impl OutOfRange {
    /// Checks a pure number.
    pub const fn check(value: f32, requirement: Requirement) -> Result<f32, Self> {
        Self::check_in(value, "", requirement)
    }

    #[inline(never)]
    const fn check_in(
        value: f32,
        unit: &'static str,
        requirement: Requirement,
    ) -> Result<f32, Self> {
        if requirement.met_by(value) {
            Ok(value)
        } else {
            Err(Self {
                value,
                unit,
                requirement,
            })
        }
    }
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let wanted = match self.requirement {
            Requirement::NonNegative => "finite and at least zero",
            Requirement::Positive => "finite and above zero",
        };
        write!(f, "{} {} must be {wanted}", self.value, self.unit)
    }
}

impl core::error::Error for OutOfRange {}

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f32);

        impl $name {
            /// Symbol of the unit.
            pub const UNIT: &'static str = $unit;

            /// Accepts finite numbers from zero upwards.
            pub const fn non_negative(value: f32) -> Result<Self, OutOfRange> {
                Self::checked(value, Requirement::NonNegative)
            }

            /// Accepts finite numbers above zero.
            pub const fn positive(value: f32) -> Result<Self, OutOfRange> {
                Self::checked(value, Requirement::Positive)
            }

            /// Accepts numbers that meet `requirement`.
            pub const fn checked(
                value: f32,
                requirement: Requirement,
            ) -> Result<Self, OutOfRange> {
                match OutOfRange::check_in(value, $unit, requirement) {
                    Ok(value) => Ok(Self(value)),
                    Err(error) => Err(error),
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
    };
}

/// Implements sums, multiples and ratios for a quantity whose zero is not arbitrary.
macro_rules! ratio_scale {
    ($($name:ident),+) => {$(
        impl Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }
        impl Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }
        impl Neg for $name {
            type Output = Self;
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }
        impl Mul<f32> for $name {
            type Output = Self;
            fn mul(self, factor: f32) -> Self {
                Self(self.0 * factor)
            }
        }
        impl Div<f32> for $name {
            type Output = Self;
            fn div(self, divisor: f32) -> Self {
                Self(self.0 / divisor)
            }
        }
        impl Div for $name {
            type Output = f32;
            fn div(self, other: Self) -> f32 {
                self.0 / other.0
            }
        }
    )+};
}

quantity!(/// Electric current.
    Ampere, "A");
quantity!(/// Temperature on the Celsius scale; differences are in [`Kelvin`].
    Celsius, "degC");
quantity!(/// Frequency.
    Hertz, "Hz");
quantity!(/// Heat capacity.
    JoulePerKelvin, "J/K");
quantity!(/// Temperature difference.
    Kelvin, "K");
quantity!(/// Thermal resistance.
    KelvinPerWatt, "K/W");
quantity!(/// Length, deformation, displacement.
    Metre, "m");
quantity!(/// Force.
    Newton, "N");
quantity!(/// Stiffness of a spring.
    NewtonPerMetre, "N/m");
quantity!(/// Electric resistance.
    Ohm, "ohm");
quantity!(/// Pressure, modulus of elasticity.
    Pascal, "Pa");
quantity!(/// Time since an origin that the context names, or a duration.
    Second, "s");
quantity!(/// Magnetic flux density.
    Tesla, "T");
quantity!(/// Power.
    Watt, "W");

ratio_scale!(
    Ampere,
    Hertz,
    JoulePerKelvin,
    Kelvin,
    KelvinPerWatt,
    Metre,
    Newton,
    NewtonPerMetre,
    Ohm,
    Pascal,
    Second,
    Tesla,
    Watt
);

impl Sub for Celsius {
    type Output = Kelvin;
    fn sub(self, other: Self) -> Kelvin {
        Kelvin(self.0 - other.0)
    }
}

impl Add<Kelvin> for Celsius {
    type Output = Self;
    fn add(self, difference: Kelvin) -> Self {
        Self(self.0 + difference.0)
    }
}

/// Force: F = c x.
impl Mul<Metre> for NewtonPerMetre {
    type Output = Newton;
    fn mul(self, displacement: Metre) -> Newton {
        Newton(self.0 * displacement.0)
    }
}

/// Displacement: x = F / c.
impl Div<NewtonPerMetre> for Newton {
    type Output = Metre;
    fn div(self, stiffness: NewtonPerMetre) -> Metre {
        Metre(self.0 / stiffness.0)
    }
}
