//! A second implementation of the encoding, from the description of the format alone: it shares no code
//! with serde, postcard, cobs and crc.

use palpate_wire::schema::{Described, Field, Kind, Structure, Type};
use palpate_wire::{Header, VERSION};
use proptest::prelude::*;

use super::random::Random;

/// A value of any type. Floats are stored as bits, so that every NaN keeps its bits.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Bool(bool),
    Unsigned(u64),
    F32(u32),
    F64(u64),
    Optional(Option<Box<Value>>),
    List(Vec<Value>),
    Text(String),
    Fields(Vec<Value>),
}

/// Encodes a value.
pub(crate) fn write(value: &Value, to: &mut Vec<u8>, of: &Type) {
    match (value, of) {
        (Value::Bool(value), Type::Bool) => to.push(u8::from(*value)),
        (Value::Unsigned(value), Type::U8 | Type::Code(_)) => {
            to.push(u8::try_from(*value).expect("a byte"));
        }
        (Value::Unsigned(value), Type::U16 | Type::U32 | Type::U64) => {
            write_varint(*value, to);
        }
        (Value::F32(bits), Type::F32) => to.extend(bits.to_le_bytes()),
        (Value::F64(bits), Type::F64) => to.extend(bits.to_le_bytes()),
        (Value::Optional(None), Type::Optional(_)) => to.push(0),
        (Value::Optional(Some(value)), Type::Optional(of)) => {
            to.push(1);
            write(value, to, of);
        }
        (Value::List(items), Type::List { item, .. }) => {
            to.push(u8::try_from(items.len()).expect("a short list"));
            for value in items {
                write(value, to, item);
            }
        }
        (Value::Text(text), Type::Text { .. }) => {
            to.push(u8::try_from(text.len()).expect("a short text"));
            to.extend(text.as_bytes());
        }
        (Value::Fields(values), Type::Structure(structure)) => {
            assert_eq!(values.len(), structure.fields.len());
            for (value, field) in values.iter().zip(structure.fields) {
                write(value, to, &field.of);
            }
        }
        (value, of) => panic!("{value:?} is no {of:?}"),
    }
}

/// Encodes an integer above eight bits.
fn write_varint(value: u64, to: &mut Vec<u8>) {
    let mut rest = value;
    while rest > 0x7F {
        to.push(rest as u8 | 0x80);
        rest >>= 7;
    }
    to.push(rest as u8);
}

/// Decodes and removes a value at the start of the bytes; `None` if they contain none.
pub(crate) fn read(bytes: &mut &[u8], of: &Type) -> Option<Value> {
    Some(match of {
        Type::Bool => Value::Bool(read_flag(bytes)?),
        Type::U8 | Type::Code(_) => Value::Unsigned(read_byte(bytes)?.into()),
        Type::U16 => Value::Unsigned(read_varint(bytes, 16)?),
        Type::U32 => Value::Unsigned(read_varint(bytes, 32)?),
        Type::U64 => Value::Unsigned(read_varint(bytes, 64)?),
        Type::F32 => Value::F32(u32::from_le_bytes(take(bytes, 4)?.try_into().ok()?)),
        Type::F64 => Value::F64(u64::from_le_bytes(take(bytes, 8)?.try_into().ok()?)),
        Type::Optional(of) => match read_flag(bytes)? {
            true => Value::Optional(Some(Box::new(read(bytes, of)?))),
            false => Value::Optional(None),
        },
        Type::List { item, capacity } => {
            let length = read_length(bytes, *capacity)?;
            let items: Option<_> = (0..length).map(|_| read(bytes, item)).collect();
            Value::List(items?)
        }
        Type::Text { capacity } => {
            let length = read_length(bytes, *capacity)?;
            let text = take(bytes, length)?.to_vec();
            Value::Text(String::from_utf8(text).ok()?)
        }
        Type::Structure(structure) => {
            let fields = structure.fields.iter();
            let fields: Option<_> = fields.map(|field| read(bytes, &field.of)).collect();
            Value::Fields(fields?)
        }
    })
}

/// Decodes a whole payload.
pub(crate) fn read_payload(mut bytes: &[u8], structure: &'static Structure) -> Option<Value> {
    let value = read(&mut bytes, &Type::Structure(structure))?;
    bytes.is_empty().then_some(value)
}

fn take<'b>(bytes: &mut &'b [u8], length: usize) -> Option<&'b [u8]> {
    let (taken, rest) = bytes.split_at_checked(length)?;
    *bytes = rest;
    Some(taken)
}

fn read_byte(bytes: &mut &[u8]) -> Option<u8> {
    take(bytes, 1).map(|byte| byte[0])
}

fn read_flag(bytes: &mut &[u8]) -> Option<bool> {
    match read_byte(bytes)? {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}

/// Decodes a varint. It may be longer than necessary, but not longer than the greatest number of `bits`
/// bits, and has no bit beyond those.
fn read_varint(bytes: &mut &[u8], bits: u32) -> Option<u64> {
    let mut value = 0_u128;
    for index in 0..bits.div_ceil(7) {
        let byte = read_byte(bytes)?;
        value |= u128::from(byte & 0x7F) << (7 * index);
        if byte & 0x80 == 0 {
            return u64::try_from(value).ok().filter(|_| value >> bits == 0);
        }
    }
    None
}

/// Decodes the number of items of a list, or of bytes of a text: a varint of the size of the reader's
/// `usize`.
fn read_length(bytes: &mut &[u8], capacity: u8) -> Option<usize> {
    let length = read_varint(bytes, usize::BITS)?;
    (length <= u64::from(capacity)).then_some(length as usize)
}

/// Encodes a payload.
pub(crate) fn payload_bytes(payload: Option<&Value>, kind: &Kind) -> Vec<u8> {
    let mut bytes = Vec::new();
    match (payload, kind.payload) {
        (Some(value), Some(structure)) => write(value, &mut bytes, &Type::Structure(structure)),
        (None, None) => {}
        _ => panic!("payload and kind do not agree"),
    }
    bytes
}

/// Encodes everything that the CRC-32 covers.
pub(crate) fn content_bytes(header: &Header, kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![VERSION, kind];
    let fields = [
        u64::from(header.boot_id),
        u64::from(header.sequence),
        header.time_us,
        u64::from(header.dropped),
    ];
    let value = Value::Fields(fields.map(Value::Unsigned).to_vec());
    write(&value, &mut bytes, &Header::TYPE);
    bytes.extend(payload);
    bytes
}

/// Adds CRC-32, COBS and the zero.
pub(crate) fn framed(content: &[u8]) -> Vec<u8> {
    let mut body = content.to_vec();
    body.extend(crc32c(content).to_le_bytes());
    cobs(&body)
}

/// Returns the CRC-32/ISCSI, computed bit by bit.
pub(crate) fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0x82F6_3B78 * (crc & 1))
        })
    })
}

/// Returns COBS with the zero at its end: each block is its length and its bytes.
pub(crate) fn cobs(body: &[u8]) -> Vec<u8> {
    let mut coded = Vec::new();
    let mut block = Vec::new();
    for &byte in body {
        if byte != 0 {
            block.push(byte);
        }
        if byte == 0 || block.len() == 254 {
            coded.push(block.len() as u8 + 1);
            coded.append(&mut block);
        }
    }
    coded.push(block.len() as u8 + 1);
    coded.append(&mut block);
    coded.push(0);
    coded
}

/// Returns the value with the most bytes, none of them zero.
pub(crate) fn largest(of: &Type) -> Value {
    match of {
        Type::Bool => Value::Bool(true),
        Type::U8 | Type::Code(_) => Value::Unsigned(u64::from(u8::MAX)),
        Type::U16 => Value::Unsigned(u64::from(u16::MAX)),
        Type::U32 => Value::Unsigned(u64::from(u32::MAX)),
        Type::U64 => Value::Unsigned(u64::MAX),
        Type::F32 => Value::F32(1.1_f32.to_bits()),
        Type::F64 => Value::F64(1.1_f64.to_bits()),
        Type::Optional(of) => Value::Optional(Some(Box::new(largest(of)))),
        Type::List { item, capacity } => Value::List(vec![largest(item); usize::from(*capacity)]),
        Type::Text { capacity } => Value::Text("x".repeat(usize::from(*capacity))),
        Type::Structure(structure) => of_fields(structure, |field| largest(&field.of)),
    }
}

/// Returns the value with the fewest bytes, all of them zero.
pub(crate) fn smallest(of: &Type) -> Value {
    match of {
        Type::Bool => Value::Bool(false),
        Type::U8 | Type::Code(_) | Type::U16 | Type::U32 | Type::U64 => Value::Unsigned(0),
        Type::F32 => Value::F32(0),
        Type::F64 => Value::F64(0),
        Type::Optional(_) => Value::Optional(None),
        Type::List { .. } => Value::List(Vec::new()),
        Type::Text { .. } => Value::Text(String::new()),
        Type::Structure(structure) => of_fields(structure, |field| smallest(&field.of)),
    }
}

/// Returns a random value with finite floats.
pub(crate) fn random(of: &Type, random: &mut Random) -> Value {
    fn any(of: &Type, random: &mut Random) -> Value {
        // Numbers of every bit length are equally frequent.
        let bits = random.bits() >> random.below(64);
        match of {
            Type::Bool => Value::Bool(bits & 1 == 1),
            Type::U8 | Type::Code(_) => Value::Unsigned(bits & 0xFF),
            Type::U16 => Value::Unsigned(bits & 0xFFFF),
            Type::U32 => Value::Unsigned(bits & 0xFFFF_FFFF),
            Type::U64 => Value::Unsigned(bits),
            Type::F32 => Value::F32((bits as f32).to_bits()),
            Type::F64 => Value::F64((bits as f64).sqrt().to_bits()),
            Type::Optional(_) if random.once_in(3) => Value::Optional(None),
            Type::Optional(of) => Value::Optional(Some(Box::new(any(of, random)))),
            Type::List { item, capacity } => {
                let length = random.below(usize::from(*capacity) + 1);
                Value::List((0..length).map(|_| any(item, random)).collect())
            }
            Type::Text { capacity } => {
                Value::Text("m".repeat(random.below(usize::from(*capacity) + 1)))
            }
            Type::Structure(structure) => of_fields(structure, |field| any(&field.of, random)),
        }
    }
    any(of, random)
}

fn of_fields(structure: &Structure, mut value: impl FnMut(&Field) -> Value) -> Value {
    Value::Fields(structure.fields.iter().map(&mut value).collect())
}

/// Any value; floats have any bits, or are finite only.
pub(crate) fn any_value(of: &Type, finite: bool) -> BoxedStrategy<Value> {
    match *of {
        Type::Bool => any::<bool>().prop_map(Value::Bool).boxed(),
        Type::U8 | Type::Code(_) => unsigned(8),
        Type::U16 => unsigned(16),
        Type::U32 => unsigned(32),
        Type::U64 => unsigned(64),
        Type::F32 if finite => prop::num::f32::NORMAL
            .prop_map(|value| Value::F32(value.to_bits()))
            .boxed(),
        Type::F32 => any::<u32>().prop_map(Value::F32).boxed(),
        Type::F64 if finite => prop::num::f64::NORMAL
            .prop_map(|value| Value::F64(value.to_bits()))
            .boxed(),
        Type::F64 => any::<u64>().prop_map(Value::F64).boxed(),
        Type::Optional(of) => prop::option::of(any_value(of, finite))
            .prop_map(|value| Value::Optional(value.map(Box::new)))
            .boxed(),
        Type::List { item, capacity } => {
            prop::collection::vec(any_value(item, finite), 0..=usize::from(capacity))
                .prop_map(Value::List)
                .boxed()
        }
        Type::Text { capacity } => prop::collection::vec(any::<char>(), 0..=usize::from(capacity))
            .prop_map(move |letters| Value::Text(cut(letters, usize::from(capacity))))
            .boxed(),
        Type::Structure(structure) => structure
            .fields
            .iter()
            .map(|field| any_value(&field.of, finite))
            .collect::<Vec<_>>()
            .prop_map(Value::Fields)
            .boxed(),
    }
}

/// Any integer of `bits` bits; small ones and the largest are as frequent as others.
fn unsigned(bits: u32) -> BoxedStrategy<Value> {
    (any::<u64>(), 64 - bits..64)
        .prop_map(|(value, shift)| Value::Unsigned(value >> shift))
        .boxed()
}

fn cut(letters: Vec<char>, capacity: usize) -> String {
    let mut text = String::new();
    for letter in letters {
        if text.len() + letter.len_utf8() <= capacity {
            text.push(letter);
        }
    }
    text
}
