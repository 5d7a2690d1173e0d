//! Every message survives encoding and decoding, compared with a second implementation.

use crate::support::fixture::decode_one;
use crate::support::reference::{Value, any_value, content_bytes, framed, payload_bytes};
use crate::support::{bytes_of, kind_of, specimens};
use palpate_wire::schema::{Kind, Type};
use palpate_wire::{Command, Frame, Header, Message, Record};
use proptest::prelude::*;
use proptest::sample::select;

/// Returns a kind of message, and a payload for it.
fn any_message<M: Message + 'static>(
    finite: bool,
) -> impl Strategy<Value = (&'static Kind, Option<Value>)> {
    select(M::KINDS).prop_flat_map(move |kind: Kind| {
        let kind = M::KINDS.iter().find(|known| **known == kind).unwrap();
        let payload = match kind.payload {
            Some(structure) => any_value(&Type::Structure(structure), finite)
                .prop_map(Some)
                .boxed(),
            None => Just(None).boxed(),
        };
        payload.prop_map(move |payload| (kind, payload))
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

/// Encodes with the reference, then decodes and encodes with the crate.
fn survives<M: Message>(header: &Header, kind: &Kind, payload: Option<&Value>) {
    let content = content_bytes(header, kind.number, &payload_bytes(payload, kind));
    let reference = framed(&content);
    let frame: Frame<M> = decode_one(&reference);
    assert_eq!(frame.header, *header);
    assert_eq!(*kind_of(&frame.message), *kind);
    assert_eq!(frame.message.name(), kind.name);
    assert_eq!(bytes_of(&frame), reference);
}

/// As `survives`, through JSON as well.
fn survives_json<M>(header: &Header, kind: &Kind, payload: Option<&Value>)
where
    M: Message + serde::Serialize + serde::de::DeserializeOwned,
{
    let content = content_bytes(header, kind.number, &payload_bytes(payload, kind));
    let frame: Frame<M> = decode_one(&framed(&content));
    let text = serde_json::to_string(&frame).unwrap();
    let read: Frame<M> = serde_json::from_str(&text).unwrap();
    assert_eq!(bytes_of(&read), bytes_of(&frame), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn every_record(header in any_header(), (kind, payload) in any_message::<Record>(false)) {
        survives::<Record>(&header, kind, payload.as_ref());
    }

    #[test]
    fn every_command(header in any_header(), (kind, payload) in any_message::<Command>(false)) {
        survives::<Command>(&header, kind, payload.as_ref());
    }

    #[test]
    fn every_record_as_json(
        header in any_header(),
        (kind, payload) in any_message::<Record>(true),
    ) {
        survives_json::<Record>(&header, kind, payload.as_ref());
    }

    #[test]
    fn every_command_as_json(
        header in any_header(),
        (kind, payload) in any_message::<Command>(true),
    ) {
        survives_json::<Command>(&header, kind, payload.as_ref());
    }
}

#[test]
fn there_is_a_specimen_of_every_kind_and_it_is_valid() {
    fn check<M: Message>(specimens: &[M]) {
        let mut kinds: Vec<_> = specimens.iter().map(Message::kind).collect();
        let mut all: Vec<_> = M::KINDS.iter().map(|kind| kind.number).collect();
        kinds.sort_unstable();
        all.sort_unstable();
        assert_eq!(kinds, all);
        for specimen in specimens {
            assert_eq!(specimen.validate(), Ok(()), "{}", specimen.name());
        }
    }
    check(&specimens::records());
    check(&specimens::commands());
}

#[test]
fn json_names_what_it_does_not_know() {
    let error = |text: &str| {
        serde_json::from_str::<Command>(text)
            .unwrap_err()
            .to_string()
    };
    let message = error(r#"{"clear_fault":{"code":"coil_too_cold"}}"#);
    assert!(
        message.contains("coil_too_cold") && message.contains("coil_too_hot"),
        "{message}"
    );
    let message = error(r#"{"clear_fault":{"code":256}}"#);
    assert!(message.contains("256"), "{message}");
    let message = error(r#"{"clear_fault":{"code":1,"colour":2}}"#);
    assert!(message.contains("colour"), "{message}");
    let message = error(r#"{"clear_fault":{}}"#);
    assert!(message.contains("missing field `code`"), "{message}");
}
