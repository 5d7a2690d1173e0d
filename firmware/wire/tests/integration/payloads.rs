//! Reading of payloads: one that is shorter or longer than its type, or has a byte that a field does not
//! allow, is refused.

use crate::support::payloads::{Parts, any_parts, fields, list, smallest};
use crate::support::{frame_of, header};
use palpate_wire::schema::Structure;
use palpate_wire::{Command, FrameError, Message, PayloadError, Record};
use proptest::prelude::*;

fn error_of<M: Message>(kind: u8, payload: &[u8]) -> Option<PayloadError> {
    let bytes = frame_of(&header(1), kind, payload);
    let mut decoder = palpate_wire::Decoder::<M, 1024>::new();
    match decoder.frames(&bytes).next() {
        Some(Ok(_)) => None,
        Some(Err(FrameError::Payload { cause, .. })) => Some(cause),
        other => panic!("{:?}", other.map(|result| result.err())),
    }
}

/// Checks a payload cut off at any position, and one with excess bytes.
fn has_its_length<M: Message>((_, kind, mut payload): Parts) {
    for length in 0..payload.len() {
        let error = error_of::<M>(kind.number, &payload[..length]);
        assert_eq!(error, Some(PayloadError::Malformed), "{}", kind.name);
    }
    assert_eq!(error_of::<M>(kind.number, &payload), None);
    payload.extend([0, 1]);
    let excess = PayloadError::Excess { bytes: 2 };
    assert_eq!(error_of::<M>(kind.number, &payload), Some(excess));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]

    #[test]
    fn no_message_is_shorter_or_longer(
        record in any_parts::<Record>(false),
        command in any_parts::<Command>(false),
    ) {
        has_its_length::<Record>(record);
        has_its_length::<Command>(command);
    }
}

/// Returns whether the smallest record of a kind is read with these bytes in place of a field.
fn is_read(kind: &str, field: &str, bytes: &[u8]) -> bool {
    let kind = Record::KINDS.iter().find(|known| known.name == kind);
    let kind = kind.expect("there is such a kind");
    let structure: &Structure = kind.payload.expect("it has a payload");
    let payload = fields(structure, |of| match of.name == field {
        true => bytes.to_vec(),
        false => smallest(&of.of),
    });
    let error = error_of::<Record>(kind.number, &payload);
    assert!(matches!(error, None | Some(PayloadError::Malformed)));
    error.is_none()
}

#[test]
fn a_flag_is_0_or_1() {
    for (kind, field) in [("hello", "dirty"), ("sample", "gap")] {
        let read = [0, 1, 2, 0x80, 0xFF].map(|flag| is_read(kind, field, &[flag]));
        assert_eq!(read, [true, true, false, false, false], "{field}");
    }
    // Flag before an optional value: 0 for `None`, 1 if the value follows.
    let read = [0, 1, 2, 0xFF].map(|flag| {
        let value = if flag == 0 { &[][..] } else { &[0; 4] };
        is_read("refusal", "limit", &[&[flag], value].concat())
    });
    assert_eq!(read, [true, true, false, false]);
}

/// Tests the greatest number of every type, and one more.
#[test]
fn an_integer_has_no_bit_beyond_its_type() {
    let greatest = |last| [&[0xFF; 9][..], &[last]].concat();
    for (field, bytes, last) in [("firmware_major", 2, 3), ("commit", 4, 15), ("unit", 9, 1)] {
        let number = |last| greatest(last).split_off(9 - bytes);
        assert!(is_read("hello", field, &number(last)), "{field}");
        assert!(!is_read("hello", field, &number(last + 1)), "{field}");
        assert!(!is_read("hello", field, &number(0x80)), "{field}");
    }
}

/// A number in more bytes than necessary is read.
#[test]
fn an_integer_may_be_longer_than_it_needs_to_be() {
    assert!(is_read("crash", "file", &[0x81, 0, b'x']));
    assert!(is_read("crash", "line", &[0x81, 0x80, 0]));
    assert!(!is_read(
        "crash",
        "line",
        &[0x81, 0x80, 0x80, 0x80, 0x80, 0]
    ));
}

#[test]
fn a_list_or_text_beyond_its_capacity_is_refused() {
    let currents = |length| list(&vec![vec![0; 4]; length]);
    assert!(is_read("current_trace", "currents_a", &currents(16)));
    assert!(!is_read("current_trace", "currents_a", &currents(17)));
    let text = |length| list(&vec![vec![b'x']; length]);
    assert!(is_read("crash", "file", &text(48)));
    assert!(!is_read("crash", "file", &text(49)));
    assert!(!is_read("crash", "file", &[1, 0xFF]), "no UTF-8");
    // A length above the list's capacity, and lengths above the number of remaining bytes.
    assert!(!is_read("raw", "words", &[33, 0]));
    assert!(!is_read("raw", "words", &[0xFF, 0x7F]));
}
