//! A quantity that differs between plants, and its allowed range.

use core::fmt;

use crate::random::Stream;

/// Distribution of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// A constant: `x = 5.0`.
    Fixed(f64),
    /// Uniform in nominal · (1 ± spread): `x = { nominal, spread }`.
    Spread {
        /// Centre of the range.
        nominal: f64,
        /// Half the width of the range, relative to its centre, 0 to below 1.
        spread: f64,
    },
    /// Uniform: `x = { min, max }`.
    Uniform {
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// Log-uniform: `x = { log_min, log_max }`.
    LogUniform {
        /// Least value, above zero.
        min: f64,
        /// Greatest value.
        max: f64,
    },
}

impl Quantity {
    /// Draws a value.
    #[must_use]
    pub fn draw(&self, stream: &mut Stream) -> f64 {
        match *self {
            Self::Fixed(value) => value,
            Self::Spread { .. } | Self::Uniform { .. } => {
                let (min, max) = self.range();
                stream.between(min, max)
            }
            Self::LogUniform { min, max } => stream.log_between(min, max),
        }
    }

    /// Centre of the range: the median of the draws.
    #[must_use]
    pub fn centre(&self) -> f64 {
        match *self {
            Self::Fixed(value) => value,
            Self::Spread { nominal, .. } => nominal,
            Self::Uniform { min, max } => 0.5 * (min + max),
            Self::LogUniform { min, max } => libm::sqrt(min * max),
        }
    }

    /// Least and greatest value that can be drawn.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        match *self {
            Self::Fixed(value) => (value, value),
            Self::Spread { nominal, spread } => {
                let half = nominal.abs() * spread;
                (nominal - half, nominal + half)
            }
            Self::Uniform { min, max } | Self::LogUniform { min, max } => (min, max),
        }
    }

    /// Checks the quantity against its allowed range; the error is a message.
    pub(super) fn check(&self, allowed: &Allowed) -> Result<(), String> {
        if let Self::Spread { nominal, spread } = *self
            && !(0.0..1.0).contains(&spread)
        {
            return Err(format!(
                "spread {spread} of {nominal} is not from 0 to below 1"
            ));
        }
        let (min, max) = self.range();
        if let Self::LogUniform { .. } = self
            && min <= 0.0
        {
            return Err(format!("log_min {min} is not above zero"));
        }
        if min > max {
            return Err(format!("the least, {min}, is above the most, {max}"));
        }
        // Written so that NaN fails.
        for end in [min, max] {
            if !(end >= allowed.min && end <= allowed.max) {
                return Err(format!("{end} is out of range"));
            }
        }
        Ok(())
    }
}

/// Formats the quantity as in a file.
impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Fixed(value) => f.write_str(&plain(value)),
            Self::Spread { nominal, spread } => {
                let nominal = plain(nominal);
                write!(f, "{{ nominal = {nominal}, spread = {spread} }}")
            }
            Self::Uniform { min, max } => {
                write!(f, "{{ min = {}, max = {} }}", plain(min), plain(max))
            }
            Self::LogUniform { min, max } => {
                write!(
                    f,
                    "{{ log_min = {}, log_max = {} }}",
                    plain(min),
                    plain(max)
                )
            }
        }
    }
}

/// Allowed range of a quantity, with its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// The unit, for messages; empty for a pure number.
    pub unit: &'static str,
}

impl Allowed {
    /// A range.
    #[must_use]
    pub const fn new(min: f64, max: f64, unit: &'static str) -> Self {
        Self { min, max, unit }
    }
}

impl Allowed {
    /// Text of the range alone, without the allowed forms of a quantity.
    #[must_use]
    pub fn bounds(&self) -> String {
        let space = if self.unit.is_empty() { "" } else { " " };
        let (min, max) = (plain(self.min), plain(self.max));
        format!("{min} to {max}{space}{}", self.unit)
    }
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.bounds())?;
        f.write_str(", as a number, { nominal, spread }, { min, max } or { log_min, log_max }")
    }
}

/// A number in its usual notation.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}
