//! Values of the format, field by field.
//!
//! Every type says once which fields it has, in their order, and shows them to a visitor: the
//! encoder, or the check of limits. So a firmware holds one piece of code for each structure and
//! not one for each purpose, with a library's error to hand on at every field: as `serde` and
//! `postcard` write and read the same bytes it took 9 KiB more (docs/decisions/0042-own-encoding.md).

use heapless::{String, Vec};

use crate::reader::Reader;
use crate::schema::{Described, Range};
use crate::validation::Invalid;

/// Where a value stands, and what it may be.
#[derive(Debug)]
pub struct Place {
    /// Number of the field in its structure.
    pub field: u8,
    /// Least value.
    pub low: f32,
    /// Greatest value.
    pub high: f32,
}

impl Place {
    /// Of what is no field: a whole message.
    pub(crate) const WHOLE: Self = Self::new(0, &Range::NONE);

    /// A field with its limits.
    pub(crate) const fn new(field: u8, range: &Range) -> Self {
        Self {
            field,
            low: range.low,
            high: range.high,
        }
    }
}

/// What values are shown to, one after the other in their order on the wire.
pub trait Visitor {
    /// One byte.
    fn byte(&mut self, value: u8, place: &'static Place);
    /// An integer above eight bits.
    fn integer(&mut self, value: u64, place: &'static Place);
    /// A number of 32 bits.
    fn float(&mut self, value: f32, place: &'static Place);
    /// A number of 64 bits.
    fn double(&mut self, value: f64, place: &'static Place);
    /// A number with a meaning, which this version may not know.
    fn code(&mut self, number: u8, is_known: bool, place: &'static Place);
    /// Yes or no; whether an optional value follows.
    fn flag(&mut self, value: bool);
    /// The length of the list or text that follows.
    fn length(&mut self, length: usize);
    /// The bytes of a text.
    fn text(&mut self, bytes: &[u8]);
    /// What follows is this item of a list; `None` after the last one.
    fn item(&mut self, index: Option<usize>);
    /// What concerns several fields.
    fn rule(&mut self, check: &dyn Fn() -> Result<(), Invalid>);
}

/// A value that can be shown and read.
pub(crate) trait Value: Described + Sized {
    /// Shows itself to a visitor.
    fn show(&self, place: &'static Place, to: &mut dyn Visitor);

    /// Reads itself. What the bytes do not hold the reader remembers, and gives anything.
    fn read(from: &mut Reader<'_>) -> Self;
}

impl Value for u8 {
    fn show(&self, place: &'static Place, to: &mut dyn Visitor) {
        to.byte(*self, place);
    }

    fn read(from: &mut Reader<'_>) -> Self {
        from.byte()
    }
}

macro_rules! integer {
    ($($integer:ident)+) => {$(
        impl Value for $integer {
            fn show(&self, place: &'static Place, to: &mut dyn Visitor) {
                to.integer(u64::from(*self), place);
            }

            fn read(from: &mut Reader<'_>) -> Self {
                from.integer($integer::BITS) as $integer
            }
        }
    )+};
}

integer!(u16 u32 u64);

impl Value for f32 {
    fn show(&self, place: &'static Place, to: &mut dyn Visitor) {
        to.float(*self, place);
    }

    fn read(from: &mut Reader<'_>) -> Self {
        from.float()
    }
}

impl Value for f64 {
    fn show(&self, place: &'static Place, to: &mut dyn Visitor) {
        to.double(*self, place);
    }

    fn read(from: &mut Reader<'_>) -> Self {
        from.double()
    }
}

impl Value for bool {
    fn show(&self, _: &'static Place, to: &mut dyn Visitor) {
        to.flag(*self);
    }

    fn read(from: &mut Reader<'_>) -> Self {
        from.flag()
    }
}

impl<T: Value> Value for Option<T> {
    #[inline(never)]
    fn show(&self, place: &'static Place, to: &mut dyn Visitor) {
        to.flag(self.is_some());
        if let Some(value) = self {
            value.show(place, to);
        }
    }

    fn read(from: &mut Reader<'_>) -> Self {
        from.flag().then(|| T::read(from))
    }
}

impl<T: Value, const N: usize> Value for Vec<T, N> {
    fn show(&self, place: &'static Place, to: &mut dyn Visitor) {
        to.length(self.len());
        for (index, item) in self.iter().enumerate() {
            to.item(Some(index));
            item.show(place, to);
        }
        to.item(None);
    }

    fn read(from: &mut Reader<'_>) -> Self {
        let mut items = Self::new();
        for _ in 0..from.length(N) {
            // There is room for as many as the reader allows.
            let _ = items.push(T::read(from));
        }
        items
    }
}

impl<const N: usize> Value for String<N> {
    fn show(&self, _: &'static Place, to: &mut dyn Visitor) {
        to.length(self.len());
        to.text(self.as_bytes());
    }

    fn read(from: &mut Reader<'_>) -> Self {
        let length = from.length(N);
        let mut text = Self::new();
        // There is room for as many bytes as the reader allows.
        let _ = text.push_str(from.text(length));
        text
    }
}
