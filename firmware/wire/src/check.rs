//! Checks values against the limits of their fields.

use heapless::{String, Vec};

use crate::schema::Range;
use crate::validation::{Invalid, Problem};

/// Number and limits of a field.
#[derive(Debug)]
pub(crate) struct FieldLimits {
    /// Number of the field in its structure.
    field: u8,
    low: f32,
    high: f32,
}

impl FieldLimits {
    /// Placeholder for a whole payload, which has neither a field number nor limits.
    const NONE: Self = Self::new(0, &Range::NONE);

    /// Returns the number and the limits of a field.
    pub(crate) const fn new(field: u8, range: &Range) -> Self {
        Self {
            field,
            low: range.low,
            high: range.high,
        }
    }
}

/// A value with limits.
pub(crate) trait Check {
    /// Reports to the checker if the value is beyond its limits.
    fn check(&self, limits: &'static FieldLimits, checker: &mut Checker);
}

/// Checks a value and returns the first error.
pub(crate) fn check<T: Check>(value: &T) -> Result<(), Invalid> {
    let mut checker = Checker::default();
    value.check(&FieldLimits::NONE, &mut checker);
    checker.first.map_or(Ok(()), Err)
}

/// Keeps the first error.
#[derive(Debug, Default)]
pub(crate) struct Checker {
    first: Option<Invalid>,
    /// Index of the list item being checked.
    item: Option<u8>,
}

impl Checker {
    #[inline(never)]
    fn refuse(&mut self, limits: &FieldLimits, problem: Problem) {
        let item = self.item;
        self.first.get_or_insert(Invalid {
            item,
            ..Invalid::new(limits.field, problem)
        });
    }

    fn number(&mut self, value: f64, limits: &FieldLimits) {
        let FieldLimits { low, high, .. } = *limits;
        if !value.is_finite() {
            self.refuse(limits, Problem::NotFinite);
        } else if value < f64::from(low) || value > f64::from(high) {
            let value = value as f32;
            self.refuse(limits, Problem::OutOfRange { value, low, high });
        }
    }

    /// Reports a number that the enumeration does not contain.
    pub(crate) fn unknown_code(&mut self, number: u8, limits: &FieldLimits) {
        self.refuse(limits, Problem::UnknownCode { number });
    }

    /// Checks a rule on several fields, if each field by itself is valid.
    pub(crate) fn rule(&mut self, rule: impl FnOnce() -> Result<(), Invalid>) {
        if self.first.is_none() {
            self.first = rule().err();
        }
    }
}

macro_rules! number {
    ($($number:ident)+) => {$(
        impl Check for $number {
            // Not inlined: a copy in each field's check would take a third more code.
            #[inline(never)]
            fn check(&self, limits: &'static FieldLimits, checker: &mut Checker) {
                checker.number(f64::from(*self), limits);
            }
        }
    )+};
}

number!(u8 u16 u32 f32 f64);

impl Check for u64 {
    fn check(&self, limits: &'static FieldLimits, checker: &mut Checker) {
        checker.number(*self as f64, limits);
    }
}

impl Check for bool {
    fn check(&self, _: &'static FieldLimits, _: &mut Checker) {}
}

impl<const N: usize> Check for String<N> {
    fn check(&self, _: &'static FieldLimits, _: &mut Checker) {}
}

impl<T: Check> Check for Option<T> {
    fn check(&self, limits: &'static FieldLimits, checker: &mut Checker) {
        if let Some(value) = self {
            value.check(limits, checker);
        }
    }
}

impl<T: Check, const N: usize> Check for Vec<T, N> {
    fn check(&self, limits: &'static FieldLimits, checker: &mut Checker) {
        for (index, item) in self.iter().enumerate() {
            checker.item = u8::try_from(index).ok();
            item.check(limits, checker);
        }
        checker.item = None;
    }
}
