//! Every message survives encoding and decoding, as bytes that the schema makes and as JSON.

use crate::support::fixture::{commands, records};
use crate::support::payloads::{Parts, any_parts};
use crate::support::{bytes_of, decode_one, frame_of, kind_of};
use palpate_wire::{Command, Frame, Message, Record};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Decodes a frame made from the schema, and encodes it.
fn survives<M: Message>((header, kind, payload): Parts) -> Frame<M> {
    let bytes = frame_of(&header, kind.number, &payload);
    let frame: Frame<M> = decode_one(&bytes);
    assert_eq!(frame.header, header);
    assert_eq!(*kind_of(&frame.message), *kind);
    assert_eq!(frame.message.name(), kind.name);
    assert_eq!(bytes_of(&frame), bytes);
    frame
}

fn survives_json<M: Message + Serialize + DeserializeOwned>(parts: Parts) {
    let frame = survives::<M>(parts);
    let text = serde_json::to_string(&frame).unwrap();
    let read: Frame<M> = serde_json::from_str(&text).unwrap();
    assert_eq!(bytes_of(&read), bytes_of(&frame), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn every_message(
        record in any_parts::<Record>(false),
        command in any_parts::<Command>(false),
    ) {
        survives::<Record>(record);
        survives::<Command>(command);
    }

    #[test]
    fn every_message_as_json(
        record in any_parts::<Record>(true),
        command in any_parts::<Command>(true),
    ) {
        survives_json::<Record>(record);
        survives_json::<Command>(command);
    }
}

#[test]
fn the_fixture_has_a_typical_message_of_every_kind_and_it_is_valid() {
    fn check<M: Message>(frames: &[Frame<M>]) {
        let typical = &frames[..M::KINDS.len()];
        let mut kinds: Vec<_> = typical.iter().map(|frame| frame.message.kind()).collect();
        let mut all: Vec<_> = M::KINDS.iter().map(|kind| kind.number).collect();
        kinds.sort_unstable();
        all.sort_unstable();
        assert_eq!(kinds, all);
        assert_eq!(frames.len(), 3 * all.len());
        for frame in typical {
            let message = &frame.message;
            assert_eq!(message.validate(), Ok(()), "{}", message.name());
        }
    }
    check(&records());
    check(&commands());
}

#[test]
fn json_names_what_it_does_not_know() {
    for (text, named) in [
        (r#"{"code":"coil_too_cold"}"#, "coil_too_cold"),
        (r#"{"code":"coil_too_cold"}"#, "coil_too_hot"),
        (r#"{"code":256}"#, "256"),
        (r#"{"code":1,"colour":2}"#, "colour"),
        (r#"{}"#, "missing field `code`"),
    ] {
        let command = format!(r#"{{"clear_fault":{text}}}"#);
        let error = serde_json::from_str::<Command>(&command).unwrap_err();
        assert!(error.to_string().contains(named), "{error}");
    }
}
