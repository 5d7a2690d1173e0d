//! Errors of values.

use core::fmt;

use crate::schema::{Field, Structure, Type};

/// A field with an invalid value, identified by its number, since the device needs no names.
/// [`named`](Self::named) adds the name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    /// Number of the field: its index in the command, or in the item if it is in one.
    pub field: u8,
    /// Index of the item in the command's list, if the field is in one.
    pub item: Option<u8>,
    /// Error of the value.
    pub problem: Problem,
}

/// An invalid field with its name, for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvalidField {
    /// The field; `None` if the payload has no field with this number.
    pub field: Option<&'static Field>,
    /// Error of the field.
    pub invalid: Invalid,
}

/// Error of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Problem {
    /// Infinite or NaN.
    NotFinite,
    /// Beyond the field's limits.
    OutOfRange {
        /// The value, rounded to `f32`.
        value: f32,
        /// Least value allowed.
        low: f32,
        /// Greatest value allowed.
        high: f32,
    },
    /// The field's enumeration does not contain the number.
    UnknownCode {
        /// The number.
        number: u8,
    },
    /// Not larger than the previous value in the list.
    NotIncreasing {
        /// The value.
        value: f32,
        /// The previous value.
        previous: f32,
    },
    /// Contradicts another field.
    Inconsistent {
        /// The violated rule.
        rule: &'static str,
    },
}

impl Invalid {
    pub(crate) const fn new(field: u8, problem: Problem) -> Self {
        Self {
            field,
            item: None,
            problem,
        }
    }

    /// Adds the field's description from the payload that was checked.
    ///
    /// ```
    /// use palpate_wire::command::DriveCoil;
    /// use palpate_wire::{Command, Message};
    /// let far = Command::DriveCoil(DriveCoil { to_a: 50.0, over_s: 1.0, trace_interval_s: 0.0 });
    /// let invalid = far.validate().unwrap_err();
    /// assert_eq!(invalid.to_string(), "field 0 is 50; allowed are -20 to 20");
    /// let named = invalid.named(far.payload());
    /// assert_eq!(named.to_string(), "to_a is 50 A; allowed are -20 to 20 A");
    /// ```
    pub fn named(self, payload: Option<&Structure>) -> InvalidField {
        let item = |field: &Field| match field.of {
            Type::List { item, .. } => item.structure(),
            _ => None,
        };
        let field = payload.and_then(|payload| {
            let of_item = self
                .item
                .and_then(|_| payload.fields.iter().find_map(item))
                .unwrap_or(payload);
            of_item.fields.get(usize::from(self.field))
        });
        let invalid = self;
        InvalidField { field, invalid }
    }

    /// Writes the error as text, for a field with this name and unit.
    fn write(
        &self,
        f: &mut fmt::Formatter<'_>,
        name: fmt::Arguments<'_>,
        unit: &str,
    ) -> fmt::Result {
        f.write_fmt(name)?;
        if let Some(item) = self.item {
            write!(f, " of item {item}")?;
        }
        // A plain number has the unit 1, which is not written.
        let (space, unit) = match unit {
            "" | "1" => ("", ""),
            unit => (" ", unit),
        };
        match self.problem {
            Problem::NotFinite => f.write_str(" is infinite or not a number"),
            Problem::OutOfRange { value, low, high } => {
                write!(
                    f,
                    " is {value}{space}{unit}; allowed are {low} to {high}{space}{unit}"
                )
            }
            Problem::UnknownCode { number } => write!(f, " has the unknown number {number}"),
            Problem::NotIncreasing { value, previous } => write!(
                f,
                " is {value}{space}{unit}, not above the {previous}{space}{unit} before it"
            ),
            Problem::Inconsistent { rule } => write!(f, ": {rule}"),
        }
    }
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, format_args!("field {}", self.field), "")
    }
}

impl fmt::Display for InvalidField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.field {
            Some(Field { name, range, .. }) => {
                self.invalid.write(f, format_args!("{name}"), range.unit)
            }
            None => self.invalid.fmt(f),
        }
    }
}

impl core::error::Error for Invalid {}

impl core::error::Error for InvalidField {}

/// Refuses a structure whose fields contradict each other, and names this field.
macro_rules! inconsistent {
    ($structure:ty, $field:literal, $rule:literal) => {
        Err($crate::validation::Invalid::new(
            const { $crate::schema::field_number(&<$structure as Described>::TYPE, $field) },
            $crate::validation::Problem::Inconsistent { rule: $rule },
        ))
    };
}
pub(crate) use inconsistent;
