//! Values against the limits of their fields.

use core::fmt;

use heapless::{String, Vec};

use crate::schema::{Described, Range, Type};

/// A field whose value cannot be accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Invalid {
    /// Number of the field: its place in the command, or in the item where there is one.
    pub field: u8,
    /// Name of the field.
    pub name: &'static str,
    /// Unit of the field.
    pub unit: &'static str,
    /// Place of the item in the command's list, if the field lies in one.
    pub item: Option<u8>,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
    /// A number that the field's enumeration does not contain.
    UnknownCode {
        /// The number.
        number: u8,
    },
    /// Not above the value before it in the list.
    NotIncreasing {
        /// The value.
        value: f32,
        /// The value before it.
        previous: f32,
    },
    /// At odds with another field.
    Inconsistent {
        /// What would be right.
        rule: &'static str,
    },
}

impl Invalid {
    pub(crate) const fn new(problem: Problem) -> Self {
        Self {
            field: 0,
            name: "",
            unit: "",
            item: None,
            problem,
        }
    }

    pub(crate) const fn named(self, field: u8, name: &'static str, unit: &'static str) -> Self {
        Self {
            field,
            name,
            unit,
            ..self
        }
    }

    pub(crate) fn in_item(self, index: usize) -> Self {
        Self {
            item: u8::try_from(index).ok(),
            ..self
        }
    }
}

/// What the check has found: the first thing that is wrong.
///
/// Every check writes to it, where a `Result` would be copied and asked at every field: code that
/// a firmware has to hold.
#[derive(Debug, Default)]
pub struct Verdict(Option<Invalid>);

/// A field, for the error.
#[derive(Debug)]
pub(crate) struct Place {
    pub(crate) field: u8,
    pub(crate) name: &'static str,
    pub(crate) range: Range,
}

impl Verdict {
    /// Refuses the value.
    pub(crate) fn refuse(&mut self, problem: Problem) {
        if self.0.is_none() {
            self.0 = Some(Invalid::new(problem));
        }
    }

    #[inline(never)]
    pub(crate) fn check_field<T: Described>(&mut self, value: &T, place: &'static Place) {
        if self.0.is_none() {
            value.check(&place.range, self);
            self.blame(place);
        }
    }

    /// Names the field that was refused, unless it lies in an item and has a name.
    fn blame(&mut self, place: &'static Place) {
        if let Some(invalid) = &mut self.0
            && invalid.name.is_empty()
        {
            invalid.field = place.field;
            invalid.name = place.name;
            invalid.unit = place.range.unit;
        }
    }

    /// Checks what concerns several fields, if each of them is right.
    pub(crate) fn check_rule(&mut self, rule: impl FnOnce() -> Result<(), Invalid>) {
        if self.0.is_none() {
            self.0 = rule().err();
        }
    }
}

pub(crate) fn validate<T: Described>(value: &T) -> Result<(), Invalid> {
    let mut verdict = Verdict::default();
    value.check(&Range::NONE, &mut verdict);
    verdict.0.map_or(Ok(()), Err)
}

/// Refuses a structure whose fields contradict each other; the field of the given name is blamed.
macro_rules! inconsistent {
    ($structure:ty, $field:literal, $rule:literal) => {
        Err(
            $crate::validation::Invalid::new($crate::validation::Problem::Inconsistent {
                rule: $rule,
            })
            .named(
                const { $crate::schema::field_number(&<$structure as Described>::TYPE, $field) },
                $field,
                "",
            ),
        )
    };
}
pub(crate) use inconsistent;

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)?;
        if let Some(item) = self.item {
            write!(f, " of item {item}")?;
        }
        // A plain number has the unit 1, which nobody writes.
        let (space, unit) = match self.unit {
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

impl core::error::Error for Invalid {}

impl Range {
    fn check(&self, value: f32, to: &mut Verdict) {
        if !value.is_finite() {
            to.refuse(Problem::NotFinite);
        } else if value < self.low || value > self.high {
            to.refuse(self.exceeded_by(value));
        }
    }

    const fn exceeded_by(&self, value: f32) -> Problem {
        Problem::OutOfRange {
            value,
            low: self.low,
            high: self.high,
        }
    }
}

macro_rules! integer {
    ($($integer:ident $variant:ident,)+) => {$(
        impl Described for $integer {
            const TYPE: Type = Type::$variant;

            // Limits lie below 2^24, up to which every integer is an `f32`.
            fn check(&self, range: &Range, to: &mut Verdict) {
                range.check(*self as f32, to);
            }
        }
    )+};
}

integer! {
    u8 U8,
    u16 U16,
    u32 U32,
    u64 U64,
}

impl Described for f32 {
    const TYPE: Type = Type::F32;

    fn check(&self, range: &Range, to: &mut Verdict) {
        range.check(*self, to);
    }
}

impl Described for f64 {
    const TYPE: Type = Type::F64;

    fn check(&self, range: &Range, to: &mut Verdict) {
        if !self.is_finite() {
            to.refuse(Problem::NotFinite);
        } else if *self < f64::from(range.low) || *self > f64::from(range.high) {
            to.refuse(range.exceeded_by(*self as f32));
        }
    }
}

impl Described for bool {
    const TYPE: Type = Type::Bool;

    fn check(&self, _: &Range, _: &mut Verdict) {}
}

impl<T: Described> Described for Option<T> {
    const TYPE: Type = Type::Optional(&T::TYPE);

    fn check(&self, range: &Range, to: &mut Verdict) {
        if let Some(value) = self {
            value.check(range, to);
        }
    }
}

impl<T: Described, const N: usize> Described for Vec<T, N> {
    const TYPE: Type = Type::List {
        item: &T::TYPE,
        capacity: capacity(N),
    };

    fn check(&self, range: &Range, to: &mut Verdict) {
        for (index, item) in self.iter().enumerate() {
            item.check(range, to);
            if let Some(invalid) = &mut to.0 {
                invalid.item = u8::try_from(index).ok();
                return;
            }
        }
    }
}

impl<const N: usize> Described for String<N> {
    const TYPE: Type = Type::Text {
        capacity: capacity(N),
    };

    fn check(&self, _: &Range, _: &mut Verdict) {}
}

/// A capacity that takes one byte on the wire. Evaluated by the compiler only.
const fn capacity(length: usize) -> u8 {
    assert!(length < 128, "a list's length has to fit one byte");
    length as u8
}
