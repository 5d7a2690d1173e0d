//! Common functions of several tests and examples.

#![allow(dead_code, reason = "no test uses all of it")]

pub(crate) mod corruption;
pub(crate) mod document;
pub(crate) mod fixture;
pub(crate) mod random;
pub(crate) mod reference;
pub(crate) mod specimens;

use palpate_wire::schema::Kind;
use palpate_wire::{Frame, Header, Message, encode};

/// Returns the kind of a message.
pub(crate) fn kind_of<M: Message>(message: &M) -> &'static Kind {
    M::KINDS
        .iter()
        .find(|kind| kind.number == message.kind())
        .expect("every message has a kind")
}

/// Returns a frame as bytes.
pub(crate) fn bytes_of<M: Message>(frame: &Frame<M>) -> Vec<u8> {
    let mut buffer = vec![0; M::MAX_FRAME];
    encode(&frame.header, &frame.message, &mut buffer)
        .expect("the buffer holds any frame")
        .to_vec()
}

/// Returns a typical header.
pub(crate) fn header(sequence: u32) -> Header {
    Header {
        boot_id: 0x1234_5678,
        sequence,
        time_us: 1_000_000 + u64::from(sequence) * 1_000,
        dropped: 0,
    }
}
