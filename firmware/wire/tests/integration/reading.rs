//! Payloads similar to sent ones, and random ones, are read as by the reference.

use crate::support::random::Random;
use crate::support::reference::{
    Value, content_bytes, framed, payload_bytes, random, read_payload, smallest, write,
};
use crate::support::{bytes_of, header};
use palpate_wire::schema::{Kind, Structure, Type};
use palpate_wire::{Command, Decoder, Frame, Message, Record};

/// Returns the payload as read by this crate; `None` if it refuses.
fn read<M: Message>(kind: u8, payload: &[u8]) -> Option<M> {
    let bytes = framed(&content_bytes(&header(1), kind, payload));
    let mut decoder = Decoder::<M, 1024>::new();
    let mut frames: Vec<_> = decoder.frames(&bytes).collect();
    assert_eq!(frames.len(), 1);
    frames.remove(0).ok().map(|frame| frame.message)
}

/// Returns whether this crate and the reference accept the bytes as a payload. If one does, the other
/// must read the same: compared as frames, so that every NaN keeps its bits.
fn is_read<M: Message>(kind: &Kind, structure: &'static Structure, payload: &[u8]) -> bool {
    let header = header(1);
    let expected = read_payload(payload, structure).map(|value| {
        let payload = payload_bytes(Some(&value), kind);
        framed(&content_bytes(&header, kind.number, &payload))
    });
    let found = read::<M>(kind.number, payload).map(|message| bytes_of(&Frame { header, message }));
    assert_eq!(found, expected, "{} from {payload:02x?}", kind.name);
    found.is_some()
}

/// Returns a byte at which decoding decides, or any other.
fn any_byte(random: &mut Random) -> u8 {
    let decisive = [0, 1, 2, 0x7F, 0x80, 0x81, 0xFF];
    match decisive.get(random.below(14)) {
        Some(byte) => *byte,
        None => random.bits() as u8,
    }
}

/// Changes, removes or inserts a byte.
fn change(bytes: &mut Vec<u8>, random: &mut Random) {
    let index = random.below(bytes.len() + 1);
    let byte = any_byte(random);
    match random.below(3) {
        0 if index < bytes.len() => bytes[index] = byte,
        1 if index < bytes.len() => drop(bytes.remove(index)),
        _ => bytes.insert(index, byte),
    }
}

/// Compares payloads with up to three changes, and random bytes.
fn agree<M: Message>(seed: u64) {
    let source = &mut Random(seed);
    for kind in M::KINDS {
        let Some(structure) = kind.payload else {
            continue;
        };
        let mut were_read = 0;
        for case in 0..1_000 {
            let mut payload = Vec::new();
            if case % 4 > 0 {
                let value = random(&Type::Structure(structure), source);
                write(&value, &mut payload, &Type::Structure(structure));
                (0..source.below(4)).for_each(|_| change(&mut payload, source));
            } else {
                payload.extend((0..source.below(60)).map(|_| any_byte(source)));
            }
            were_read += usize::from(is_read::<M>(kind, structure, &payload));
        }
        // Accepted and refused payloads both occur often enough.
        assert!(
            (100..900).contains(&were_read),
            "{}: {were_read}",
            kind.name
        );
    }
}

#[test]
fn records_are_read_as_the_reference_reads_them() {
    agree::<Record>(1);
}

#[test]
fn commands_are_read_as_the_reference_reads_them() {
    agree::<Command>(2);
}

/// Returns the description of a kind.
fn of_kind(number: u8) -> (&'static Kind, &'static Structure) {
    let kind = Record::KINDS.iter().find(|kind| kind.number == number);
    let kind = kind.expect("there is such a kind");
    (kind, kind.payload.expect("it has a payload"))
}

const HELLO: u8 = 0x01;
const CRASH: u8 = 0x02;
const CURRENT_TRACE: u8 = 0x0D;

/// Returns the smallest payload of a kind, with the bytes of one field replaced.
fn with_field(structure: &Structure, name: &str, bytes: &[u8]) -> Vec<u8> {
    let mut payload = Vec::new();
    for field in structure.fields {
        if field.name == name {
            payload.extend(bytes);
        } else {
            write(&smallest(&field.of), &mut payload, &field.of);
        }
    }
    payload
}

/// Tests numbers with every length of a varint, the greatest of every type, and one more.
#[test]
fn integers_of_every_length() {
    let (kind, structure) = of_kind(HELLO);
    for (name, bits) in [("firmware_major", 16), ("commit", 32), ("unit", 64)] {
        for shift in 0..64 {
            for number in [1_u64 << shift, (1 << shift) - 1, u64::MAX >> shift] {
                let mut bytes = Vec::new();
                write(&Value::Unsigned(number), &mut bytes, &Type::U64);
                let payload = with_field(structure, name, &bytes);
                let fits = bits == 64 || number >> bits == 0;
                let is_read = is_read::<Record>(kind, structure, &payload);
                assert_eq!(is_read, fits, "{name} {number}");
            }
        }
    }
}

#[test]
fn a_list_or_text_beyond_its_capacity_is_refused() {
    let (kind, structure) = of_kind(CURRENT_TRACE);
    for (length, fits) in [(16, true), (17, false)] {
        let list = [&[length][..], &vec![0; usize::from(length) * 4]].concat();
        let payload = with_field(structure, "currents_a", &list);
        assert_eq!(is_read::<Record>(kind, structure, &payload), fits);
    }
    let (kind, structure) = of_kind(CRASH);
    for (length, fits) in [(48, true), (49, false)] {
        let text = [&[length][..], &vec![b'x'; usize::from(length)]].concat();
        let payload = with_field(structure, "file", &text);
        assert_eq!(is_read::<Record>(kind, structure, &payload), fits);
    }
    let no_text = with_field(structure, "file", &[1, 0xFF]);
    assert!(!is_read::<Record>(kind, structure, &no_text));
}

/// A length in more bytes than necessary is read, like any other integer.
#[test]
fn an_integer_may_be_longer_than_it_needs_to_be() {
    let (kind, structure) = of_kind(CRASH);
    let text = with_field(structure, "file", &[0x81, 0, b'x']);
    assert!(is_read::<Record>(kind, structure, &text));
    let line = with_field(structure, "line", &[0x81, 0x80, 0]);
    assert!(is_read::<Record>(kind, structure, &line));
    let too_long = with_field(structure, "line", &[0x81, 0x80, 0x80, 0x80, 0x80, 0]);
    assert!(!is_read::<Record>(kind, structure, &too_long));
}
