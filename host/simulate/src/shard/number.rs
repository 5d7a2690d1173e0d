//! Numbers in JSON lines of a shard: exact, with the infinite ones and NaN, which JSON lacks.

use std::num::ParseFloatError;

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Number {
    Finite(f64),
    /// inf, -inf or NaN.
    Other(String),
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        if value.is_finite() {
            Self::Finite(value)
        } else {
            Self::Other(value.to_string())
        }
    }
}

impl TryFrom<Number> for f64 {
    type Error = ParseFloatError;

    fn try_from(number: Number) -> Result<Self, Self::Error> {
        match number {
            Number::Finite(value) => Ok(value),
            Number::Other(text) => text.parse(),
        }
    }
}

/// Writes a number.
pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    Number::from(*value).serialize(serializer)
}

/// Reads a number.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let number = Number::deserialize(deserializer)?;
    number.try_into().map_err(Error::custom)
}

/// The same for a number that may be absent.
pub mod optional {
    use super::{Deserialize, Deserializer, Error, Number, Serialize, Serializer};

    /// Writes a number or null.
    pub fn serialize<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        value.map(Number::from).serialize(serializer)
    }

    /// Reads a number or null.
    pub fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<f64>, D::Error> {
        let number = Option::<Number>::deserialize(deserializer)?;
        number.map(f64::try_from).transpose().map_err(Error::custom)
    }
}
