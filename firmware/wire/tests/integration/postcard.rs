//! The payloads are what serde and postcard make of the same structures.

use crate::support::reference::{content_bytes, framed};
use crate::support::{bytes_of, header, specimens};
use palpate_wire::code::{Place, Stream};
use palpate_wire::record::{Crash, CurrentTrace, Fault, Hello, Raw, Sample, Status};
use palpate_wire::{Decoder, Message, Record, command};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// What postcard writes.
fn written<T: Serialize>(payload: &T) -> Vec<u8> {
    let mut buffer = [0; Record::MAX_PAYLOAD];
    let written = postcard::to_slice(payload, &mut buffer);
    written.expect("as long as any payload").to_vec()
}

/// What this crate reads; nothing if it refuses.
fn read(kind: u8, payload: &[u8]) -> Option<Record> {
    let bytes = framed(&content_bytes(&header(1), kind, payload));
    let mut decoder = Decoder::<Record, 512>::new();
    let mut frames: Vec<_> = decoder.frames(&bytes).collect();
    assert_eq!(frames.len(), 1);
    frames.remove(0).ok().map(|frame| frame.message)
}

/// The payload of a message as this crate writes it.
fn payload_of(message: Record) -> Vec<u8> {
    let (kind, header) = (message.kind(), header(1));
    let bytes = bytes_of(&palpate_wire::Frame { header, message });
    // Undone with the other implementation: whatever payload gives this frame is the one.
    let before = content_bytes(&header, kind, &[]).len();
    let mut decoder = cobs_decoded(&bytes);
    decoder.truncate(decoder.len() - 4);
    decoder.split_off(before)
}

fn cobs_decoded(frame: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    let mut rest = &frame[..frame.len() - 1];
    while let Some((&length, others)) = rest.split_first() {
        let (block, others) = others.split_at(usize::from(length) - 1);
        content.extend(block);
        if !others.is_empty() && length != 255 {
            content.push(0);
        }
        rest = others;
    }
    content
}

/// Bytes that postcard takes for a payload, and as it would write them, are taken for the same
/// one; what is taken is what postcard takes.
fn agree<T: Serialize + DeserializeOwned>(
    bytes: &[u8],
    record: fn(T) -> Record,
) -> Result<(), TestCaseError> {
    // Compared as bytes, so that every NaN stays the one it is.
    let canonical = |payload: T| (written(&payload), record(payload));
    let theirs = postcard::take_from_bytes::<T>(bytes).ok();
    let theirs = theirs.filter(|(_, rest)| rest.is_empty());
    let theirs = theirs.map(|(payload, _)| canonical(payload));
    let kind = kind_of_any::<T>(record);
    let ours = read(kind, bytes).map(payload_of);
    match (theirs, ours) {
        (Some((theirs, _)), Some(ours)) => prop_assert_eq!(theirs, ours),
        (None, Some(ours)) => prop_assert!(false, "{bytes:02x?} read as {ours:02x?}"),
        (Some((theirs, _)), None) => prop_assert_ne!(&theirs, bytes, "refused"),
        (None, None) => {}
    }
    Ok(())
}

/// The kind of a record, found with any bytes that postcard takes for its payload.
fn kind_of_any<T: DeserializeOwned>(record: fn(T) -> Record) -> u8 {
    let zeros = [0; Record::MAX_PAYLOAD];
    let (payload, _) = postcard::take_from_bytes::<T>(&zeros).expect("zeros are a payload");
    record(payload).kind()
}

/// Payloads near those that are, and any others.
fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let near = prop::sample::select(specimens::records()).prop_map(payload_of);
    let changes = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4);
    let near = (near, changes).prop_map(|(mut bytes, changes)| {
        for (place, byte) in changes {
            if !bytes.is_empty() {
                let place = place.index(bytes.len());
                bytes[place] = byte;
            }
        }
        bytes
    });
    prop_oneof![near, prop::collection::vec(any::<u8>(), 0..60)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn what_is_read_is_what_postcard_reads(bytes in bytes()) {
        agree::<Hello>(&bytes, Record::Hello)?;
        agree::<Crash>(&bytes, Record::Crash)?;
        agree::<Sample>(&bytes, Record::Sample)?;
        agree::<Raw>(&bytes, Record::Raw)?;
        agree::<Fault>(&bytes, Record::Fault)?;
        agree::<Status>(&bytes, Record::Status)?;
        agree::<CurrentTrace>(&bytes, Record::CurrentTrace)?;
        agree::<command::Settings>(&bytes, Record::Settings)?;
        agree::<command::Tank>(&bytes, Record::Tank)?;
        agree::<command::DeformationCurve>(&bytes, Record::DeformationCurve)?;
    }
}

#[test]
fn what_is_written_is_what_postcard_writes() {
    for record in specimens::records() {
        let theirs = match &record {
            Record::Hello(of) => written(of),
            Record::Crash(of) => written(of),
            Record::Sample(of) => written(of),
            Record::Raw(of) => written(of),
            Record::State(of) => written(of),
            Record::Estimate(of) => written(of),
            Record::LoadPoint(of) => written(of),
            Record::Refusal(of) => written(of),
            Record::Fault(of) => written(of),
            Record::Status(of) => written(of),
            Record::Acknowledgement(of) => written(of),
            Record::CoilTest(of) => written(of),
            Record::CurrentTrace(of) => written(of),
            Record::Settings(of) => written(of),
            Record::Tank(of) => written(of),
            Record::DeformationCurve(of) => written(of),
            Record::Crosstalk(of) => written(of),
            Record::Springs(of) => written(of),
            Record::Stiffening(of) => written(of),
            Record::StiffeningCurve(of) => written(of),
            Record::Coil(of) => written(of),
            Record::Attraction(of) => written(of),
            Record::TemperatureEffect(of) => written(of),
            Record::CurrentCorrection(of) => written(of),
        };
        assert_eq!(payload_of(record.clone()), theirs, "{record:?}");
    }
}

/// Numbers that take every length of a varint.
#[test]
fn integers_of_every_length() {
    for shift in 0..64 {
        for number in [1_u64 << shift, (1 << shift) - 1, u64::MAX >> shift] {
            let hello = Hello {
                unit: number,
                commit: number as u32,
                firmware_major: number as u16,
                ..postcard::from_bytes(&[0; 64]).expect("zeros are a payload")
            };
            let theirs = written(&hello);
            assert_eq!(payload_of(Record::Hello(hello.clone())), theirs);
            assert_eq!(read(1, &theirs), Some(Record::Hello(hello)));
        }
    }
    let codes = (Place::Coil, Stream::Raw);
    assert_eq!(written(&codes), [codes.0.number(), codes.1.number()]);
}

#[test]
fn a_list_or_text_beyond_its_capacity_is_refused() {
    let trace = |length: usize| {
        let currents_a = vec![1.0_f32; length];
        written(&(128_u8, 0_u8, 1e-3_f32, currents_a.as_slice()))
    };
    assert!(read(0x0D, &trace(16)).is_some());
    assert_eq!(read(0x0D, &trace(17)), None);
    let crash = |length: usize| {
        let file = "x".repeat(length);
        written(&(1_u8, 1_u8, file.as_str(), 1_u32, 1_u32, 1_u32, 1_u32))
    };
    assert!(read(0x02, &crash(48)).is_some());
    assert_eq!(read(0x02, &crash(49)), None);
}
