//! Payloads as bytes, made from the schema alone. The tests compare them with the encoding of the types.

use palpate_wire::schema::{Field, Kind, Structure, Type};
use palpate_wire::{Header, Message};
use proptest::collection::vec;
use proptest::prelude::*;
use serde::Serialize;

/// Returns a single value as postcard encodes it.
pub(crate) fn encoded(value: &impl Serialize) -> Vec<u8> {
    let mut buffer = [0; 64];
    let bytes = postcard::to_slice(value, &mut buffer).expect("the value is small");
    bytes.to_vec()
}

/// Returns the payload of a kind, its fields made by `value`.
pub(crate) fn payload_of(kind: &Kind, value: fn(&Type) -> Vec<u8>) -> Vec<u8> {
    kind.payload.map_or_else(Vec::new, |structure| {
        fields(structure, |field| value(&field.of))
    })
}

/// Returns the fields of a structure, one after the other.
pub(crate) fn fields(structure: &Structure, value: impl FnMut(&Field) -> Vec<u8>) -> Vec<u8> {
    structure.fields.iter().flat_map(value).collect()
}

/// Returns the value with the fewest bytes, all of them zero.
pub(crate) fn smallest(of: &Type) -> Vec<u8> {
    match of {
        Type::F32 => vec![0; 4],
        Type::F64 => vec![0; 8],
        Type::Structure(structure) => fields(structure, |field| smallest(&field.of)),
        _ => vec![0],
    }
}

/// Returns the value with the most bytes, none of them zero.
pub(crate) fn largest(of: &Type) -> Vec<u8> {
    match of {
        Type::Bool => vec![1],
        Type::U8 | Type::Code(_) => vec![u8::MAX],
        Type::U16 => encoded(&u16::MAX),
        Type::U32 => encoded(&u32::MAX),
        Type::U64 => encoded(&u64::MAX),
        Type::F32 => encoded(&1.1_f32),
        Type::F64 => encoded(&1.1_f64),
        Type::Optional(of) => [vec![1], largest(of)].concat(),
        Type::List { item, capacity } => list(&vec![largest(item); usize::from(*capacity)]),
        Type::Text { capacity } => list(&vec![vec![b'x']; usize::from(*capacity)]),
        Type::Structure(structure) => fields(structure, |field| largest(&field.of)),
    }
}

/// Returns a list of these items.
pub(crate) fn list(items: &[Vec<u8>]) -> Vec<u8> {
    let length = u8::try_from(items.len()).expect("a short list");
    [vec![length], items.concat()].concat()
}

/// A header, a kind and a payload for it.
pub(crate) type Parts = (Header, &'static Kind, Vec<u8>);

/// Any message. If `finite`, its floats are finite; otherwise they have any bits.
pub(crate) fn any_parts<M: Message>(finite: bool) -> impl Strategy<Value = Parts> {
    let kind = (0..M::KINDS.len()).prop_map(|index| &M::KINDS[index]);
    (any_header(), kind).prop_flat_map(move |(header, kind)| {
        let payload = match kind.payload {
            Some(structure) => any_value(&Type::Structure(structure), finite),
            None => Just(Vec::new()).boxed(),
        };
        (Just(header), Just(kind), payload)
    })
}

prop_compose! {
    fn any_header()(
        boot_id: u32,
        sequence: u32,
        time_us: u64,
        shift in 0..64,
        dropped: u32,
    ) -> Header {
        Header { boot_id, sequence, time_us: time_us >> shift, dropped }
    }
}

fn any_value(of: &Type, finite: bool) -> BoxedStrategy<Vec<u8>> {
    match *of {
        Type::Bool => any::<bool>().prop_map(|value| encoded(&value)).boxed(),
        Type::U8 | Type::Code(_) => any::<u8>().prop_map(|value| vec![value]).boxed(),
        Type::U16 => any_integer(16),
        Type::U32 => any_integer(32),
        Type::U64 => any_integer(64),
        Type::F32 if finite => prop::num::f32::NORMAL
            .prop_map(|value| encoded(&value))
            .boxed(),
        Type::F32 => any::<[u8; 4]>().prop_map(Vec::from).boxed(),
        Type::F64 if finite => prop::num::f64::NORMAL
            .prop_map(|value| encoded(&value))
            .boxed(),
        Type::F64 => any::<[u8; 8]>().prop_map(Vec::from).boxed(),
        Type::Optional(of) => prop::option::of(any_value(of, finite))
            .prop_map(|value| value.map_or(vec![0], |value| [vec![1], value].concat()))
            .boxed(),
        Type::List { item, capacity } => vec(any_value(item, finite), 0..=usize::from(capacity))
            .prop_map(|items| list(&items))
            .boxed(),
        // A letter has up to four bytes.
        Type::Text { capacity } => vec(any::<char>(), 0..=usize::from(capacity / 4))
            .prop_map(|letters| encoded(&String::from_iter(letters)))
            .boxed(),
        Type::Structure(structure) => {
            let fields = structure.fields.iter();
            let values: Vec<_> = fields.map(|field| any_value(&field.of, finite)).collect();
            values.prop_map(|values| values.concat()).boxed()
        }
    }
}

/// Any integer of up to `bits` bits; those with few bits are as frequent as others.
fn any_integer(bits: u32) -> BoxedStrategy<Vec<u8>> {
    (any::<u64>(), 64 - bits..64)
        .prop_map(|(value, shift)| encoded(&(value >> shift)))
        .boxed()
}
