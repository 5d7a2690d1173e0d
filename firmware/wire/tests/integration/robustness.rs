//! Any input: no panic, no frame that was never sent, and resynchronisation.

use crate::support::reference::{cobs, content_bytes, framed};
use crate::support::{bytes_of, corruption, fixture, header, specimens};
use palpate_wire::record::Acknowledgement;
use palpate_wire::{
    Command, CommandDecoder, Counts, FrameError, Message, PayloadError, Record, RecordDecoder,
    VERSION,
};
use proptest::collection::vec;
use proptest::prelude::*;

/// Returns a typical frame.
fn sound(sequence: u32) -> Vec<u8> {
    let message = specimens::records().swap_remove(7);
    bytes_of(&palpate_wire::Frame {
        header: header(sequence),
        message,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    /// The random bytes contain many zeros, so that frames end often.
    #[test]
    fn random_bytes_are_no_frame(
        bytes in vec(prop_oneof![3 => any::<u8>(), 1 => Just(0)], 0..2_000),
    ) {
        let mut records = RecordDecoder::new();
        let mut commands = CommandDecoder::new();
        prop_assert!(records.frames(&bytes).all(|frame| frame.is_err()));
        prop_assert!(commands.frames(&bytes).all(|frame| frame.is_err()));
    }

    /// The random bytes are sent with a valid CRC-32 and version, so that they pass all checks before
    /// header and payload.
    #[test]
    fn random_payloads_are_read_or_refused(
        kind in any::<u8>(),
        rest in vec(prop_oneof![any::<u8>(), Just(0x80), Just(0xFF), Just(1)], 0..250),
    ) {
        let mut content = vec![VERSION, kind];
        content.extend(rest);
        let bytes = framed(&content);
        let mut records = RecordDecoder::new();
        let mut commands = CommandDecoder::new();
        let results = [
            records.frames(&bytes).map(|result| result.map(|frame| bytes_of(&frame))).next(),
            commands.frames(&bytes).map(|result| result.map(|frame| bytes_of(&frame))).next(),
        ];
        for result in results {
            match result.expect("the zero ends a frame") {
                // The input may have been longer than its shortest encoding, never shorter.
                Ok(encoded) => prop_assert!(encoded.len() <= bytes.len()),
                Err(FrameError::Stuffing | FrameError::Checksum | FrameError::TooShort) => {
                    prop_assert!(false, "the frame was whole");
                }
                Err(_) => {}
            }
        }
    }

    /// The stream is passed to the decoder in pieces of any size.
    #[test]
    fn the_division_of_the_stream_does_not_matter(cuts in vec(0..400_usize, 0..8)) {
        let stream: Vec<u8> = (0..6).flat_map(sound).collect();
        let mut decoder = RecordDecoder::new();
        let mut rest = &stream[..];
        let mut frames = 0;
        for cut in cuts {
            let (piece, others) = rest.split_at(cut.min(rest.len()));
            frames += decoder.frames(piece).filter(Result::is_ok).count();
            rest = others;
        }
        frames += decoder.frames(rest).filter(Result::is_ok).count();
        prop_assert_eq!(frames, 6);
    }

    /// After any garbage and one zero, the next frame is received.
    #[test]
    fn one_zero_is_enough_to_be_back_in_step(garbage in vec(any::<u8>(), 0..700)) {
        let mut stream = garbage;
        stream.push(0);
        stream.extend(sound(1));
        let mut decoder = RecordDecoder::new();
        let last = decoder.frames(&stream).last().expect("at least one frame");
        prop_assert_eq!(last.map(|frame| frame.header.sequence), Ok(1));
        prop_assert_eq!(decoder.counts().frames, 1);
    }
}

/// A part of `cargo run --release --example corruption`.
#[test]
fn no_damaged_frame_is_taken_for_a_sound_one() {
    let outcome = corruption::run(30_000, 7);
    assert_eq!(
        (outcome.undetected, outcome.out_of_step),
        (0, 0),
        "{outcome}"
    );
    assert!(outcome.refused >= 30_000 / 2, "{outcome}");
    assert!(
        outcome.kinds.iter().all(|&count| count > 1_000),
        "{outcome}"
    );
}

/// Inverts every single bit of every typical frame.
#[test]
fn every_single_flipped_bit_is_found() {
    for frame in fixture::records().iter().take(Record::KINDS.len()) {
        let bytes = bytes_of(frame);
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            damaged.push(0);
            let mut decoder = RecordDecoder::new();
            assert!(
                decoder.frames(&damaged).all(|result| result.is_err()),
                "bit {bit}"
            );
        }
    }
}

fn only_error(bytes: &[u8]) -> (FrameError, Counts) {
    let mut decoder = RecordDecoder::new();
    let mut results: Vec<_> = decoder.frames(bytes).collect();
    assert_eq!(results.len(), 1);
    (results.remove(0).unwrap_err(), *decoder.counts())
}

#[test]
fn every_error_is_named_and_counted_by_itself() {
    let whole = sound(5);
    let content = content_bytes(&header(5), 0x05, &[1, 1, 1, 1, 0]);
    let with = |change: fn(&mut Vec<u8>)| {
        let mut content = content.clone();
        change(&mut content);
        framed(&content)
    };
    let header = header(5);
    let kind = 0x05;
    let payload = |cause| FrameError::Payload {
        header,
        kind,
        cause,
    };

    let none = Counts::default();
    let cut = [&whole[..9], &[0]].concat();
    assert_eq!(
        only_error(&cut),
        (
            FrameError::Stuffing,
            Counts {
                stuffing: 1,
                ..none
            }
        )
    );
    let long = [&[0x11; 300][..], &[0]].concat();
    assert_eq!(
        only_error(&long),
        (
            FrameError::TooLong,
            Counts {
                too_long: 1,
                ..none
            }
        )
    );
    // A frame that is longer than the maximum, and otherwise valid.
    let long = with(|content| content.extend([7; 300]));
    assert_eq!(
        only_error(&long),
        (
            FrameError::TooLong,
            Counts {
                too_long: 1,
                ..none
            }
        )
    );
    let short = [2, 1, 0];
    assert_eq!(
        only_error(&short),
        (
            FrameError::TooShort,
            Counts {
                too_short: 1,
                ..none
            }
        )
    );
    for content in [&[][..], &[VERSION]] {
        let short = framed(content);
        assert_eq!(
            only_error(&short),
            (
                FrameError::TooShort,
                Counts {
                    too_short: 1,
                    ..none
                }
            )
        );
    }
    let mut wrong = whole.clone();
    wrong[3] ^= 0x40;
    assert_eq!(
        only_error(&wrong),
        (
            FrameError::Checksum,
            Counts {
                checksum: 1,
                ..none
            }
        )
    );
    let other = with(|content| content[0] = VERSION + 1);
    let found = VERSION + 1;
    assert_eq!(
        only_error(&other),
        (FrameError::Version { found }, Counts { version: 1, ..none })
    );
    let headless = framed(&[VERSION, kind, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F, 0, 0, 0]);
    assert_eq!(
        only_error(&headless),
        (FrameError::Header, Counts { header: 1, ..none })
    );
    let unknown = with(|content| content[1] = 0x7F);
    let kind = 0x7F;
    assert_eq!(
        only_error(&unknown),
        (
            FrameError::UnknownKind { header, kind },
            Counts {
                unknown_kind: 1,
                ..none
            }
        )
    );
    let unfinished = with(|content| content.truncate(content.len() - 1));
    assert_eq!(
        only_error(&unfinished),
        (
            payload(PayloadError::Malformed),
            Counts { payload: 1, ..none }
        )
    );
    let no_bool = with(|content| {
        let at = content.len() - 2;
        content[at] = 2;
    });
    assert_eq!(
        only_error(&no_bool),
        (
            payload(PayloadError::Malformed),
            Counts { payload: 1, ..none }
        )
    );
    let excess = with(|content| content.extend([0, 0]));
    assert_eq!(
        only_error(&excess),
        (
            payload(PayloadError::Excess { bytes: 2 }),
            Counts { payload: 1, ..none }
        )
    );
}

#[test]
fn counts_tell_damage_from_what_is_not_understood() {
    let counts = Counts {
        frames: 1,
        stuffing: 2,
        too_long: 4,
        too_short: 8,
        checksum: 16,
        version: 32,
        header: 64,
        unknown_kind: 128,
        payload: 256,
    };
    assert_eq!(counts.damaged(), 2 + 4 + 8 + 16);
    assert_eq!(counts.not_understood(), 32 + 64 + 128 + 256);
}

#[test]
fn errors_say_what_is_the_matter() {
    let (error, _) = only_error(&framed(&[VERSION + 1, 5]));
    assert_eq!(
        error.to_string(),
        format!(
            "frame is of protocol version {}, this program speaks version {VERSION}",
            VERSION + 1
        )
    );
    assert_eq!(error.header(), None);
    let (error, _) = only_error(&framed(&content_bytes(
        &header(5),
        0x05,
        &[1, 1, 1, 1, 0, 9],
    )));
    assert_eq!(
        error.to_string(),
        "payload of frame 5, kind 0x05, has 1 bytes too many"
    );
    assert_eq!(error.header(), Some(&header(5)));
}

/// Tests the longest varint, and one that is too long.
#[test]
fn hostile_varints_are_refused() {
    for length in 1..=20 {
        let mut content = vec![VERSION, 0x05];
        content.extend(vec![0xFF; length]);
        content.extend([0x7F, 0, 0, 0, 0, 0]);
        let (error, _) = only_error(&framed(&content));
        assert!(
            matches!(error, FrameError::Header | FrameError::Payload { .. }),
            "{error}"
        );
    }
    // The list claims more items than its capacity, and more than there are.
    for claimed in [[33, 0], [0xFF, 0x7F]] {
        let mut payload = vec![0, 0, 1, 0, 0, 0x80, 0x3F];
        payload.extend(claimed);
        let (error, _) = only_error(&framed(&content_bytes(&header(1), 0x04, &payload)));
        assert!(matches!(error, FrameError::Payload { .. }), "{error}");
    }
}

/// The decoder refuses a frame that is a byte too long and accepts the longest one.
#[test]
fn the_longest_frame_is_taken_and_a_longer_one_is_not() {
    let longest = fixture::commands()
        .iter()
        .map(bytes_of)
        .max_by_key(Vec::len)
        .unwrap();
    assert!(Command::MAX_FRAME - longest.len() <= 1);
    let mut decoder = CommandDecoder::new();
    let whole = |decoder: &mut CommandDecoder| -> Vec<bool> {
        let frames = decoder.frames(&longest);
        frames.map(|frame| frame.is_ok()).collect()
    };
    assert_eq!(whole(&mut decoder), [true]);
    let mut body = vec![0x33; Command::MAX_FRAME - 1];
    body[..2].copy_from_slice(&[VERSION, 0x90]);
    let results: Vec<_> = decoder.frames(&cobs(&body)).collect();
    assert_eq!(results, [Err(FrameError::TooLong)]);
    assert_eq!(whole(&mut decoder), [true]);
}

#[test]
fn a_record_is_no_command_and_a_command_no_record() {
    let mut commands = CommandDecoder::new();
    for frame in fixture::records().iter().take(Record::KINDS.len()) {
        let bytes = bytes_of(frame);
        // A record that is longer than any command does not even fit into the command decoder.
        assert!(commands.frames(&bytes).all(|result| result.is_err()));
    }
    let mut records = RecordDecoder::new();
    for frame in fixture::commands() {
        let result = records.frames(&bytes_of(&frame)).next().unwrap();
        assert_eq!(
            result,
            Err(FrameError::UnknownKind {
                header: frame.header,
                kind: frame.message.kind()
            })
        );
    }
}

#[test]
fn what_is_not_understood_can_be_answered() {
    let header = header(9);
    let answer = |error| {
        Acknowledgement::not_understood(&error)
            .map(|answer| (answer.command, answer.kind, answer.outcome.name()))
    };
    let kind = 0xEE;
    let error = FrameError::UnknownKind { header, kind };
    assert_eq!(answer(error), Some((9, 0xEE, "unknown_command")));
    let cause = PayloadError::Malformed;
    let error = FrameError::Payload {
        header,
        kind,
        cause,
    };
    assert_eq!(answer(error), Some((9, 0xEE, "malformed")));
    assert_eq!(answer(FrameError::Checksum), None);
}
