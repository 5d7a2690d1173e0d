//! `palpate decode`: the device's frames as JSON.

use std::io::{self, Read, Write};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::jsonl::{self, Note};
use palpate_wire::RecordDecoder;

/// Turn the device's frames on standard input into JSON on standard output, one object a line
#[derive(Args)]
#[command(after_help = "\
A line has header (boot_id, sequence, time_us, dropped) and message, the record under its name; a \
frame that cannot be understood gives a line with error instead. docs/protocol.md names every field \
with unit and range.

Exit code 1 if there is no valid frame at all.

Example, with what a debug probe wrote of RTT channel 1:
  palpate decode < records.bin")]
pub(crate) struct Arguments {}

pub(crate) fn run(_: &Arguments) -> Result<(), Failure> {
    let seen = decode(io::stdin().lock(), io::stdout().lock())?;
    if seen.frames > 0 {
        return Ok(());
    }
    Err(Failure::Refused(format!(
        "no frame found in {} bytes ({} damaged pieces between zeros). The input has \
         to be what a board sends on its channel of records (RTT channel 1), as bytes: docs/protocol.md.",
        seen.bytes, seen.damaged
    )))
}

/// Statistics of the input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    bytes: u64,
    /// Valid frames.
    frames: u64,
    /// Pieces that are not valid frames.
    damaged: u64,
}

fn decode(mut from: impl Read, mut to: impl Write) -> Result<Seen, Failure> {
    let mut decoder = RecordDecoder::new();
    let mut buffer = [0; 4096];
    let mut seen = Seen::default();
    loop {
        let length = from.read(&mut buffer)?;
        let bytes = buffer.get(..length).unwrap_or_default();
        if bytes.is_empty() {
            to.flush()?;
            return Ok(seen);
        }
        seen.bytes += bytes.len() as u64;
        for frame in bytes.iter().filter_map(|&byte| decoder.push(byte)) {
            let line = match frame {
                Ok(frame) => {
                    seen.frames += 1;
                    jsonl::frame(&frame)?
                }
                Err(error) => {
                    seen.damaged += 1;
                    let error = error.to_string();
                    jsonl::note(&Note::Damaged { error })?
                }
            };
            writeln!(to, "{line}")?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fixture_becomes_one_object_a_frame() {
        let records = include_bytes!("../../../../firmware/wire/fixture/v2-records.bin");
        let mut text = Vec::new();
        decode(&records[..], &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.lines().count() > 40);
        for line in text.lines() {
            let value: serde_json::Value = serde_json::from_str(line).unwrap();
            assert!(value.get("message").is_some(), "{line}");
        }
    }

    #[test]
    fn a_damaged_frame_becomes_an_error_and_the_next_is_read() {
        let records = include_bytes!("../../../../firmware/wire/fixture/v2-records.bin");
        let mut bytes = records.to_vec();
        bytes[5] ^= 0x10;
        let mut text = Vec::new();
        decode(&bytes[..], &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.lines().next().unwrap().starts_with("{\"error\":"));
        assert!(text.lines().nth(1).unwrap().contains("\"message\":"));
    }
}
