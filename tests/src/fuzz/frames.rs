//! The decoders of records and commands.
//!
//! A script is a list of pieces, each with a byte and a length before it: a piece is sent as it is,
//! or as the content of a frame with a valid CRC-32.

use palpate_wire::{
    Command, CommandDecoder, Counts, Decoder, Frame, FrameError, Header, Message, Record,
    RecordDecoder, VERSION, crc32, encode,
};

use super::reader::Reader;
use crate::hostile::frame::stuffed;

/// Checks the decoders' promises on a script.
pub(super) fn run(script: &[u8]) -> Result<(), String> {
    let stream = stream(script);
    judge(RecordDecoder::new, &stream, Record::MAX_FRAME)?;
    judge(CommandDecoder::new, &stream, Command::MAX_FRAME)
}

/// Bytes that a script sends.
fn stream(script: &[u8]) -> Vec<u8> {
    let mut reader = Reader(script);
    let mut stream = Vec::new();
    while !reader.0.is_empty() {
        let how = reader.byte();
        let piece = reader.bytes();
        match how % 4 {
            0 => stream.extend(piece),
            // A frame of the present version; the first byte of the piece is the kind.
            1 => stream.extend(checked(&[&[VERSION], piece].concat())),
            2 => stream.extend(checked(piece)),
            _ => stream.extend(stuffed(piece)),
        }
    }
    stream
}

fn checked(content: &[u8]) -> Vec<u8> {
    stuffed(&[content, &crc32(content).to_le_bytes()].concat())
}

fn judge<M: Message + core::fmt::Debug, const N: usize>(
    decoder: fn() -> Decoder<M, N>,
    stream: &[u8],
    greatest: usize,
) -> Result<(), String> {
    let mut at_once = decoder();
    let frames: Vec<_> = at_once.frames(stream).collect();
    let zeros = stream.iter().filter(|&&byte| byte == 0).count();
    if frames.len() > zeros {
        return Err(format!("{} frames of {zeros} zeros", frames.len()));
    }
    if sum(at_once.counts()) != frames.len() as u64 {
        return Err(format!(
            "{} frames, counted {:?}",
            frames.len(),
            at_once.counts()
        ));
    }
    for frame in frames.into_iter().flatten() {
        reads_what_it_writes(&frame, decoder, greatest)?;
    }
    is_back_in_step(at_once)
}

fn sum(counts: &Counts) -> u64 {
    [counts.frames, counts.damaged(), counts.not_understood()]
        .map(u64::from)
        .iter()
        .sum()
}

/// Checks that a decoded frame can be encoded, and decodes to an equal one. A number may have been
/// encoded in more bytes than necessary.
fn reads_what_it_writes<M: Message + core::fmt::Debug, const N: usize>(
    frame: &Frame<M>,
    decoder: fn() -> Decoder<M, N>,
    greatest: usize,
) -> Result<(), String> {
    let written = write(frame, greatest)?;
    let again = decoder().frames(&written).next();
    let Some(Ok(again)) = again else {
        return Err(format!(
            "{frame:?} is written as {written:02X?}, and read as {again:?}"
        ));
    };
    // Compared by bytes: NaN does not equal itself.
    if write(&again, greatest)? == written {
        Ok(())
    } else {
        Err(format!("{frame:?} is written and read as {again:?}"))
    }
}

fn write<M: Message + core::fmt::Debug>(
    frame: &Frame<M>,
    greatest: usize,
) -> Result<Vec<u8>, String> {
    let mut buffer = vec![0; greatest];
    let written = encode(&frame.header, &frame.message, &mut buffer);
    written
        .map(<[u8]>::to_vec)
        .map_err(|error| format!("{frame:?}: {error}"))
}

/// Checks that a valid frame after a zero byte is received.
fn is_back_in_step<M: Message, const N: usize>(mut decoder: Decoder<M, N>) -> Result<(), String> {
    // A kind that neither direction has: the header is decoded for any message.
    let header = Header {
        boot_id: 1,
        sequence: 2,
        time_us: 3,
        dropped: 4,
    };
    let kind = 0xFE;
    let probe = checked(&[VERSION, kind, 1, 2, 3, 4]);
    let bytes = [&[0], probe.as_slice()].concat();
    let last = decoder.frames(&bytes).last();
    match last {
        Some(Err(FrameError::UnknownKind {
            header: read,
            kind: of,
        })) if (read, of) == (header, kind) => Ok(()),
        _ => Err("a sound frame after a zero is not received".to_owned()),
    }
}
