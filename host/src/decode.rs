//! `palpate decode`: frames of the device, as JSON.

use std::io::{self, Read, Write};

use clap::Args;
use palpate_wire::{FrameError, Record, RecordDecoder};
use serde::Serialize;

use crate::failure::Failure;

/// Turn the device's frames on standard input into JSON on standard output, one object a line
#[derive(Args)]
#[command(after_help = "\
Every line has boot_id, sequence, time_us, dropped and record; a frame that cannot be understood
gives a line with error instead. docs/protocol.md names every field with unit and range.

Example, with what a debug probe wrote of RTT channel 1:
  palpate decode < records.bin")]
pub(crate) struct Arguments {}

#[derive(Serialize)]
struct Line<'r> {
    boot_id: u32,
    sequence: u32,
    time_us: u64,
    dropped: u32,
    record: &'r Record,
}

#[derive(Serialize)]
struct Damaged {
    error: String,
}

pub(crate) fn run(_: &Arguments) -> Result<(), Failure> {
    decode(io::stdin().lock(), io::stdout().lock())
}

fn decode(mut from: impl Read, mut to: impl Write) -> Result<(), Failure> {
    let mut decoder = RecordDecoder::new();
    let mut buffer = [0; 4096];
    loop {
        let length = from.read(&mut buffer)?;
        let bytes = buffer.get(..length).unwrap_or_default();
        if bytes.is_empty() {
            return Ok(to.flush()?);
        }
        for frame in bytes.iter().filter_map(|&byte| decoder.push(byte)) {
            writeln!(to, "{}", line(frame)?)?;
        }
    }
}

fn line(frame: Result<palpate_wire::Frame<Record>, FrameError>) -> Result<String, Failure> {
    Ok(match frame {
        Ok(frame) => serde_json::to_string(&Line {
            boot_id: frame.header.boot_id,
            sequence: frame.header.sequence,
            time_us: frame.header.time_us,
            dropped: frame.header.dropped,
            record: &frame.message,
        })?,
        Err(error) => serde_json::to_string(&Damaged {
            error: error.to_string(),
        })?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fixture_becomes_one_object_a_frame() {
        let records = include_bytes!("../../firmware/wire/fixture/v2-records.bin");
        let mut text = Vec::new();
        decode(&records[..], &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.lines().count() > 40);
        for line in text.lines() {
            let value: serde_json::Value = serde_json::from_str(line).unwrap();
            assert!(value.get("record").is_some(), "{line}");
        }
    }

    #[test]
    fn a_damaged_frame_becomes_an_error_and_the_next_is_read() {
        let records = include_bytes!("../../firmware/wire/fixture/v2-records.bin");
        let mut bytes = records.to_vec();
        bytes[5] ^= 0x10;
        let mut text = Vec::new();
        decode(&bytes[..], &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.lines().next().unwrap().starts_with("{\"error\":"));
        assert!(text.lines().nth(1).unwrap().contains("\"record\":"));
    }
}
