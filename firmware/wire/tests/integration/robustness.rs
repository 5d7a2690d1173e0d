//! Any input: no panic, no frame that was never sent, and resynchronisation.

use crate::support::fixture::{commands, records};
use crate::support::payloads::any_parts;
use crate::support::{bytes_of, content, frame_of, framed, header, sound, stuffed};
use palpate_wire::record::Acknowledgement;
use palpate_wire::{
    Command, CommandDecoder, Counts, Decoder, Frame, FrameError, Message, PayloadError, Record,
    RecordDecoder, VERSION,
};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

/// Kind of a `state`.
const STATE: u8 = 0x05;

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
        let bytes = framed(&[&[VERSION, kind], &rest[..]].concat());
        is_read_or_refused(RecordDecoder::new(), &bytes);
        is_read_or_refused(CommandDecoder::new(), &bytes);
    }

    /// The stream is passed to the decoder in pieces of any size.
    #[test]
    fn the_division_of_the_stream_does_not_matter(cuts in vec(0..400_usize, 0..8)) {
        let stream: Vec<u8> = (0..6).map(header).map(sound).collect::<Vec<_>>().concat();
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
        let stream = [&garbage[..], &[0], &sound(header(1))].concat();
        let mut decoder = RecordDecoder::new();
        let last = decoder.frames(&stream).last().expect("at least one frame");
        prop_assert_eq!(last.map(|frame| frame.header.sequence), Ok(1));
        prop_assert_eq!(decoder.counts().frames, 1);
    }
}

/// Checks that a frame with a valid CRC-32 is read, or refused for its content. A frame that is read may
/// be longer than its shortest encoding, never shorter.
fn is_read_or_refused<M: Message, const N: usize>(mut decoder: Decoder<M, N>, bytes: &[u8]) {
    let mut results = decoder.frames(bytes);
    match results.next().expect("the zero ends a frame") {
        Ok(frame) => assert!(bytes_of(&frame).len() <= bytes.len()),
        Err(FrameError::Stuffing | FrameError::Checksum | FrameError::TooShort) => {
            panic!("the frame was whole");
        }
        Err(_) => {}
    }
}

/// Damage to a frame in transit.
#[derive(Clone, Debug)]
enum Damage {
    Flip(Vec<(Index, u8)>),
    /// Bytes are removed, replaced or inserted.
    Replace(Index, usize, Vec<u8>),
    Swap(Index, Index),
    /// The frame is cut off, and the rest of another frame follows.
    Continue(Index, Index),
    /// The zero at the end is missing.
    Join,
}

fn any_damage() -> impl Strategy<Value = Damage> {
    let index = any::<Index>;
    prop_oneof![
        2 => vec((index(), 0..8_u8), 1..=8).prop_map(Damage::Flip),
        4 => (index(), prop_oneof![0..=8_usize, 0..=255_usize], vec(any::<u8>(), 0..=8))
            .prop_map(|(from, length, by)| Damage::Replace(from, length, by)),
        1 => (index(), index()).prop_map(|(one, other)| Damage::Swap(one, other)),
        1 => (index(), index()).prop_map(|(at, from)| Damage::Continue(at, from)),
        1 => Just(Damage::Join),
    ]
}

impl Damage {
    fn apply(&self, frame: &mut Vec<u8>, other: &[u8]) {
        let length = frame.len();
        match self {
            Self::Flip(bits) => bits
                .iter()
                .for_each(|(at, bit)| frame[at.index(length)] ^= 1 << bit),
            Self::Replace(from, count, by) => {
                let from = from.index(length);
                frame.splice(from..length.min(from + count), by.iter().copied());
            }
            Self::Swap(one, other) => frame.swap(one.index(length), other.index(length)),
            Self::Continue(at, from) => {
                frame.truncate(at.index(length));
                frame.extend(&other[from.index(other.len())..]);
            }
            Self::Join => {
                frame.pop();
                frame.extend(other);
            }
        }
    }
}

fn any_frame<M: Message>() -> impl Strategy<Value = Vec<u8>> {
    any_parts::<M>(false)
        .prop_map(|(header, kind, payload)| frame_of(&header, kind.number, &payload))
}

/// Four frames, the first of which is damaged.
fn any_frames<M: Message>() -> impl Strategy<Value = [Vec<u8>; 4]> {
    std::array::from_fn(|_| any_frame::<M>())
}

/// Damage to the zero at the end of a frame may destroy the next frame, but not the last one.
fn is_not_deceived<M: Message, const N: usize>(
    mut decoder: Decoder<M, N>,
    sent: &[Vec<u8>; 4],
    damage: &Damage,
) {
    let [first, second, next, last] = sent;
    let mut damaged = first.clone();
    damage.apply(&mut damaged, second);
    let stream = [&damaged, next, last].map(Vec::as_slice).concat();
    let frames = decoder.frames(&stream).flatten();
    let received: Vec<_> = frames.map(|frame| bytes_of(&frame)).collect();
    assert!(received.iter().all(|frame| sent.contains(frame)));
    assert_eq!(received.last(), Some(last));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 15_000, ..ProptestConfig::default() })]

    #[test]
    fn no_damaged_frame_is_taken_for_a_sound_one(
        records in any_frames::<Record>(),
        commands in any_frames::<Command>(),
        damage in any_damage(),
    ) {
        is_not_deceived(RecordDecoder::new(), &records, &damage);
        is_not_deceived(CommandDecoder::new(), &commands, &damage);
    }
}

/// Inverts every single bit of every typical frame, also of its CRC-32.
#[test]
fn every_single_flipped_bit_is_found() {
    for frame in records().iter().take(Record::KINDS.len()) {
        let bytes = bytes_of(frame);
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            damaged.push(0);
            let mut decoder = RecordDecoder::new();
            let mut results = decoder.frames(&damaged);
            assert!(results.all(|result| result.is_err()), "bit {bit}");
        }
    }
}

fn only_error(bytes: &[u8]) -> (FrameError, Counts) {
    let mut decoder = RecordDecoder::new();
    let mut results: Vec<_> = decoder.frames(bytes).collect();
    assert_eq!(results.len(), 1);
    (results.remove(0).unwrap_err(), *decoder.counts())
}

/// Counter of an error.
type Counter = fn(&mut Counts) -> &mut u32;

#[test]
fn every_error_is_named_and_counted_by_itself() {
    let (header, kind) = (header(5), STATE);
    let state = content(&header, kind, &[1, 1, 1, 1, 0]);
    let with = |change: fn(&mut Vec<u8>)| {
        let mut content = state.clone();
        change(&mut content);
        framed(&content)
    };
    let payload = |cause| FrameError::Payload {
        header,
        kind,
        cause,
    };
    let whole = sound(header);
    let mut wrong = whole.clone();
    wrong[3] ^= 0x40;
    let no_header = framed(&[VERSION, kind, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F, 0, 0, 0]);
    let short: Counter = |counts| &mut counts.too_short;
    let long: Counter = |counts| &mut counts.too_long;
    let malformed: Counter = |counts| &mut counts.payload;
    let cases: [(Vec<u8>, FrameError, Counter); 13] = [
        (
            [&whole[..9], &[0]].concat(),
            FrameError::Stuffing,
            |counts| &mut counts.stuffing,
        ),
        ([&[0x11; 300][..], &[0]].concat(), FrameError::TooLong, long),
        // A frame that is longer than the maximum, and otherwise valid.
        (
            with(|content| content.extend([7; 300])),
            FrameError::TooLong,
            long,
        ),
        (vec![2, 1, 0], FrameError::TooShort, short),
        (framed(&[]), FrameError::TooShort, short),
        (framed(&[VERSION]), FrameError::TooShort, short),
        (wrong, FrameError::Checksum, |counts| &mut counts.checksum),
        (
            with(|content| content[0] = VERSION + 1),
            FrameError::Version { found: VERSION + 1 },
            |counts| &mut counts.version,
        ),
        (no_header, FrameError::Header, |counts| &mut counts.header),
        (
            with(|content| content[1] = 0x7F),
            FrameError::UnknownKind { header, kind: 0x7F },
            |counts| &mut counts.unknown_kind,
        ),
        (
            with(|content| content.truncate(content.len() - 1)),
            payload(PayloadError::Malformed),
            malformed,
        ),
        (
            with(|content| {
                let armed = content.len() - 2;
                content[armed] = 2;
            }),
            payload(PayloadError::Malformed),
            malformed,
        ),
        (
            with(|content| content.extend([0, 0])),
            payload(PayloadError::Excess { bytes: 2 }),
            malformed,
        ),
    ];
    for (bytes, error, counter) in cases {
        let mut counts = Counts::default();
        *counter(&mut counts) = 1;
        assert_eq!(only_error(&bytes), (error, counts));
    }
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
    let (error, _) = only_error(&framed(&[VERSION + 1, STATE]));
    assert_eq!(
        error.to_string(),
        format!(
            "frame is of protocol version {}, this program speaks version {VERSION}",
            VERSION + 1
        )
    );
    assert_eq!(error.header(), None);
    let excess = frame_of(&header(5), STATE, &[1, 1, 1, 1, 0, 9]);
    let (error, _) = only_error(&excess);
    assert_eq!(
        error.to_string(),
        "payload of frame 5, kind 0x05, has 1 bytes too many"
    );
    assert_eq!(error.header(), Some(&header(5)));
}

/// The decoder refuses a frame that is a byte too long and accepts the longest one.
#[test]
fn the_longest_frame_is_taken_and_a_longer_one_is_not() {
    fn check<M: Message, const N: usize>(mut decoder: Decoder<M, N>, frames: &[Frame<M>]) {
        let longest = frames.iter().map(bytes_of).max_by_key(Vec::len).unwrap();
        assert!(M::MAX_FRAME - longest.len() <= 1);
        let whole = |decoder: &mut Decoder<M, N>| -> Vec<bool> {
            let frames = decoder.frames(&longest);
            frames.map(|frame| frame.is_ok()).collect()
        };
        assert_eq!(whole(&mut decoder), [true]);
        let too_long = stuffed(&vec![0x33; M::MAX_FRAME - 1]);
        let mut results = decoder.frames(&too_long);
        let only = results.next().and_then(Result::err);
        assert_eq!(only, Some(FrameError::TooLong));
        assert!(results.next().is_none());
        drop(results);
        assert_eq!(whole(&mut decoder), [true]);
    }
    check(RecordDecoder::new(), &records());
    check(CommandDecoder::new(), &commands());
}

#[test]
fn a_record_is_no_command_and_a_command_no_record() {
    let mut decoder = CommandDecoder::new();
    for frame in records().iter().take(Record::KINDS.len()) {
        let bytes = bytes_of(frame);
        // A record that is longer than any command does not even fit into the command decoder.
        assert!(decoder.frames(&bytes).all(|result| result.is_err()));
    }
    let mut decoder = RecordDecoder::new();
    for frame in commands() {
        let (header, kind) = (frame.header, frame.message.kind());
        let result = decoder.frames(&bytes_of(&frame)).next().unwrap();
        assert_eq!(result, Err(FrameError::UnknownKind { header, kind }));
    }
}

#[test]
fn what_is_not_understood_can_be_answered() {
    let (header, kind) = (header(9), 0xEE);
    let answer = |error| {
        Acknowledgement::not_understood(&error)
            .map(|answer| (answer.command, answer.kind, answer.outcome.name()))
    };
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
