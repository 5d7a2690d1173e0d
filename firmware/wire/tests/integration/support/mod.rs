//! Common functions of several tests and of the example `generate`.

#![allow(dead_code, reason = "no test uses all of it")]

pub(crate) mod document;
pub(crate) mod fixture;
pub(crate) mod payloads;

use palpate_wire::code::{Mode, State};
use palpate_wire::record::StateChange;
use palpate_wire::schema::Kind;
use palpate_wire::{Decoder, Frame, Header, Message, Record, VERSION, crc32, encode};

/// Returns the kind of a message.
pub(crate) fn kind_of<M: Message>(message: &M) -> &'static Kind {
    M::KINDS
        .iter()
        .find(|kind| kind.number == message.kind())
        .expect("every message has a kind")
}

/// Returns a frame as bytes.
pub(crate) fn bytes_of<M: Message>(frame: &Frame<M>) -> Vec<u8> {
    // The previous content of the buffer must not matter.
    let mut buffer = vec![0x55; M::MAX_FRAME];
    encode(&frame.header, &frame.message, &mut buffer)
        .expect("the buffer holds any frame")
        .to_vec()
}

/// Decodes exactly one frame.
pub(crate) fn decode_one<M: Message>(bytes: &[u8]) -> Frame<M> {
    let mut decoder = Decoder::<M, 256>::new();
    let mut frames: Vec<_> = decoder.frames(bytes).collect();
    assert_eq!(frames.len(), 1, "one frame in {bytes:02x?}");
    frames.remove(0).expect("the frame is sound")
}

/// Returns a typical header.
pub(crate) fn header(sequence: u32) -> Header {
    Header {
        boot_id: fixture::BOOT_ID,
        sequence,
        time_us: 1_000_000 + u64::from(sequence) * 1_000,
        dropped: 0,
    }
}

/// Returns a typical record with this header, as bytes.
pub(crate) fn sound(header: Header) -> Vec<u8> {
    let message = Record::State(StateChange {
        state: State::Ramps,
        previous: State::Peak,
        mode: Mode::Stiffness,
        armed: true,
        measurement: 1,
    });
    bytes_of(&Frame { header, message })
}

/// Returns a frame as bytes; the payload need not fit the kind.
pub(crate) fn frame_of(header: &Header, kind: u8, payload: &[u8]) -> Vec<u8> {
    framed(&content(header, kind, payload))
}

/// Returns the bytes that the CRC-32 covers.
pub(crate) fn content(header: &Header, kind: u8, payload: &[u8]) -> Vec<u8> {
    [&payloads::encoded(&(VERSION, kind, header)), payload].concat()
}

/// Adds CRC-32, COBS and the zero.
pub(crate) fn framed(content: &[u8]) -> Vec<u8> {
    stuffed(&[content, &crc32(content).to_le_bytes()].concat())
}

/// Adds COBS and the zero, by a library that the encoder does not use.
pub(crate) fn stuffed(body: &[u8]) -> Vec<u8> {
    let mut coded = vec![0; cobs::max_encoding_length(body.len())];
    let length = cobs::encode(body, &mut coded);
    coded.truncate(length);
    coded.push(0);
    coded
}

/// Returns a frame without COBS.
pub(crate) fn unstuffed(frame: &[u8]) -> Vec<u8> {
    let mut body = frame.to_vec();
    let length = cobs::decode_in_place(&mut body).expect("the frame is sound");
    body.truncate(length);
    body
}
