//! Description of the format as data: with it a program can print tables of the format, name fields,
//! compare two builds, and compute the largest size of a frame.
//!
//! A firmware that only encodes and decodes contains no part of this description.

use heapless::{String, Vec};

use crate::checksum::Digest;

/// Type of a field. The encoding is that of postcard: integers above eight bits as varints, floats as
/// bytes, least significant byte first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Type {
    /// One byte, 0 or 1.
    Bool,
    /// One byte.
    U8,
    /// Varint of at most 3 bytes.
    U16,
    /// Varint of at most 5 bytes.
    U32,
    /// Varint of at most 10 bytes.
    U64,
    /// Four bytes, IEEE 754.
    F32,
    /// Eight bytes, IEEE 754.
    F64,
    /// One byte, 0 or 1; after a 1 the value.
    Optional(&'static Type),
    /// Number of items as a varint of one byte, then the items.
    List {
        /// Type of an item.
        item: &'static Type,
        /// Maximum number of items, below 128.
        capacity: u8,
    },
    /// Length in bytes as a varint of one byte, then UTF-8.
    Text {
        /// Maximum length in bytes, below 128.
        capacity: u8,
    },
    /// One byte: a number with a meaning.
    Code(&'static CodeTable),
    /// The fields in order.
    Structure(&'static Structure),
}

/// Numbers of an enumeration with their meanings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CodeTable {
    /// Name of the enumeration.
    pub name: &'static str,
    /// Meaning of the enumeration.
    pub doc: &'static str,
    /// Numbers of the enumeration.
    pub entries: &'static [Entry],
}

/// A number with its meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The number; its meaning never changes.
    pub number: u8,
    /// Name of the number in text formats.
    pub name: &'static str,
    /// Meaning of the number.
    pub doc: &'static str,
}

/// Fields in their order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Structure {
    /// Name of the structure.
    pub name: &'static str,
    /// Purpose of the structure.
    pub doc: &'static str,
    /// Fields of the structure.
    pub fields: &'static [Field],
}

/// A field; its number is its index in the structure, from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Name of the field.
    pub name: &'static str,
    /// Meaning of the field.
    pub doc: &'static str,
    /// Type of the field.
    pub of: Type,
    /// Unit and limits, if it is a quantity.
    pub range: Range,
}

/// Unit and limits of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Unit; `1` for a plain number, empty for a name or an index.
    pub unit: &'static str,
    /// Smallest value.
    pub low: f32,
    /// Largest value.
    pub high: f32,
}

impl Range {
    /// Range of a field that is not a quantity.
    pub const NONE: Self = Self {
        unit: "",
        low: f32::NEG_INFINITY,
        high: f32::INFINITY,
    };
}

/// A kind of message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// Second byte of the frame.
    pub number: u8,
    /// Name of the kind in text formats.
    pub name: &'static str,
    /// Purpose of the message.
    pub doc: &'static str,
    /// Structure after the header, if there is one.
    pub payload: Option<&'static Structure>,
}

/// A value of the format with a description.
pub trait Described {
    /// Type of the value.
    const TYPE: Type;
}

macro_rules! plain {
    ($($plain:ty: $variant:ident,)+) => {$(
        impl Described for $plain {
            const TYPE: Type = Type::$variant;
        }
    )+};
}

plain! {
    bool: Bool,
    u8: U8,
    u16: U16,
    u32: U32,
    u64: U64,
    f32: F32,
    f64: F64,
}

impl<T: Described> Described for Option<T> {
    const TYPE: Type = Type::Optional(&T::TYPE);
}

impl<T: Described, const N: usize> Described for Vec<T, N> {
    const TYPE: Type = Type::List {
        item: &T::TYPE,
        capacity: capacity(N),
    };
}

impl<const N: usize> Described for String<N> {
    const TYPE: Type = Type::Text {
        capacity: capacity(N),
    };
}

/// Converts the capacity of a list or text, whose length takes one byte on the wire; evaluated at
/// compile time only.
const fn capacity(length: usize) -> u8 {
    assert!(length < 128, "a list's length has to fit one byte");
    length as u8
}

impl Type {
    /// Returns the largest number of bytes of a value.
    pub const fn max_size(&self) -> usize {
        match self {
            Self::Bool | Self::U8 | Self::Code(_) => 1,
            Self::U16 => 3,
            Self::U32 => 5,
            Self::U64 => 10,
            Self::F32 => 4,
            Self::F64 => 8,
            Self::Optional(of) => 1 + of.max_size(),
            Self::List { item, capacity } => 1 + *capacity as usize * item.max_size(),
            Self::Text { capacity } => 1 + *capacity as usize,
            Self::Structure(structure) => structure.max_size(),
        }
    }

    /// Returns the structure, if it is one.
    pub const fn structure(&self) -> Option<&'static Structure> {
        match self {
            Self::Structure(structure) => Some(structure),
            _ => None,
        }
    }

    pub(crate) const fn absorbed_by(&self, digest: Digest) -> Digest {
        match self {
            Self::Bool => absorb(digest, "bool"),
            Self::U8 => absorb(digest, "u8"),
            Self::U16 => absorb(digest, "u16"),
            Self::U32 => absorb(digest, "u32"),
            Self::U64 => absorb(digest, "u64"),
            Self::F32 => absorb(digest, "f32"),
            Self::F64 => absorb(digest, "f64"),
            Self::Optional(of) => of.absorbed_by(absorb(digest, "optional")),
            Self::List { item, capacity } => {
                item.absorbed_by(absorb_byte(absorb(digest, "list"), *capacity))
            }
            Self::Text { capacity } => absorb_byte(absorb(digest, "text"), *capacity),
            Self::Code(table) => table.absorbed_by(digest),
            Self::Structure(structure) => structure.absorbed_by(digest),
        }
    }
}

impl Structure {
    /// Returns the largest number of bytes of a value.
    pub const fn max_size(&self) -> usize {
        let mut rest = self.fields;
        let mut size = 0;
        while let [field, others @ ..] = rest {
            size += field.of.max_size();
            rest = others;
        }
        size
    }

    const fn absorbed_by(&self, digest: Digest) -> Digest {
        let mut digest = absorb(digest, self.name);
        let mut rest = self.fields;
        while let [field, others @ ..] = rest {
            digest = absorb(absorb(digest, field.name), field.range.unit);
            digest = field.of.absorbed_by(digest);
            rest = others;
        }
        absorb(digest, "end")
    }
}

impl CodeTable {
    const fn absorbed_by(&self, digest: Digest) -> Digest {
        let mut digest = absorb(digest, self.name);
        let mut rest = self.entries;
        while let [entry, others @ ..] = rest {
            digest = absorb(absorb_byte(digest, entry.number), entry.name);
            rest = others;
        }
        absorb(digest, "end")
    }
}

const fn absorb(mut digest: Digest, text: &str) -> Digest {
    digest.update(text.as_bytes());
    // A zero byte ends each name. No name contains one, so different descriptions never give the same
    // bytes.
    digest.update(&[0]);
    digest
}

pub(crate) const fn absorb_byte(mut digest: Digest, byte: u8) -> Digest {
    digest.update(&[byte]);
    digest
}

pub(crate) const fn absorb_kinds(mut digest: Digest, mut rest: &[Kind]) -> Digest {
    while let [kind, others @ ..] = rest {
        digest = absorb(absorb_byte(digest, kind.number), kind.name);
        if let Some(payload) = kind.payload {
            digest = payload.absorbed_by(digest);
        }
        rest = others;
    }
    digest
}

/// Returns the index of a field in a structure, at compile time: a wrong name does not compile.
pub const fn field_number(of: &Type, name: &str) -> u8 {
    if let Type::Structure(structure) = of {
        let mut rest = structure.fields;
        let mut number = 0;
        while let [field, others @ ..] = rest {
            if equal(field.name.as_bytes(), name.as_bytes()) {
                return number;
            }
            number += 1;
            rest = others;
        }
    }
    panic!("no field has this name")
}

const fn equal(mut one: &[u8], mut other: &[u8]) -> bool {
    while let ([a, rest_of_one @ ..], [b, rest_of_other @ ..]) = (one, other) {
        if *a != *b {
            return false;
        }
        (one, other) = (rest_of_one, rest_of_other);
    }
    one.is_empty() && other.is_empty()
}

/// Returns the largest payload of some kinds.
pub(crate) const fn max_payload(mut rest: &[Kind]) -> usize {
    let mut greatest = 0;
    while let [kind, others @ ..] = rest {
        if let Some(payload) = kind.payload
            && payload.max_size() > greatest
        {
            greatest = payload.max_size();
        }
        rest = others;
    }
    greatest
}
