//! The flashed image reads the simulated converter: every word, on time, without a loss.

use crate::common::{RecordedBoard, image, recording};
use ldc161x_sim::Settings;
use palpate_emulator::{EmulatedBoard, Still, Time};
use palpate_wire::Record;
use palpate_wire::code::{Chip, Outcome, ResetCause};
use palpate_wire::command::Command;

/// Asserts that every word fetched since the start of the stream was sent, in order.
fn assert_every_word_arrives(bench: &RecordedBoard, fewest: usize) {
    let log = bench.board.wire_log().unwrap();
    let fetched: Vec<u32> = log.fetched.iter().map(|it| it.word).collect();
    let sent = bench.words();
    assert!(sent.len() >= fewest, "{} words came", sent.len());
    let begin = fetched.iter().position(|word| word == &sent[0]).unwrap();
    assert_eq!(fetched[begin..begin + sent.len()], sent);
    let on_their_way = fetched.len() - begin - sent.len();
    assert!(on_their_way < 5, "{on_their_way} words never came");
}

#[test]
fn it_says_who_it_is_and_brings_the_converter_up() {
    let mut bench = RecordedBoard::new();
    bench.stream();
    let Some(Record::Hello(hello)) = bench.frames.first().map(|frame| &frame.message) else {
        panic!("the first record is no hello");
    };
    assert_eq!(hello.board, palpate_wire::code::Board::Pico);
    assert_eq!(hello.chip, Chip::Ldc161x);
    assert_eq!(hello.reset_cause, ResetCause::PowerOn);
    assert_eq!(hello.schema_hash, palpate_wire::SCHEMA_HASH);
    assert_eq!(bench.board.frequencies_hz(), (200e6, Some(200e6 / 6.0)));
    assert_eq!(bench.board.chip().misuse(), ldc161x_sim::Misuse::default());
}

#[test]
fn a_thousand_samples_a_second_arrive_without_a_loss_and_edges_are_answered_at_once() {
    let mut bench = drifting();
    bench.stream();
    let started = bench.board.wire_log().unwrap().edge_to_start.len();
    bench.run(Time::from_ms(2_000));
    let latencies = &bench.board.wire_log().unwrap().edge_to_start[started..];
    let worst = latencies.iter().max().unwrap();
    assert!(*worst <= Time::from_us(10), "{worst}");
    assert_every_word_arrives(&bench, 1_990);
    let overwritten = bench.board.chip().overwritten(0);
    let status = bench.status();
    assert_eq!(status.conversions_lost, 0);
    assert_eq!(bench.board.chip().overwritten(0), overwritten);
    assert!(bench.samples().all(|(_, sample)| sample.missed == 0));
    assert_eq!(bench.samples().filter(|(_, sample)| sample.gap).count(), 1);
    let dropped = bench.frames.last().unwrap().header.dropped;
    assert_eq!(dropped, 0);
    assert_eq!(bench.board.resets().watchdog, 0);
}

/// A bench whose sensors drift so fast that no two words within a second are equal.
fn drifting() -> RecordedBoard {
    let mut plant = Still::new(crate::common::FREQUENCIES_HZ);
    plant.drift_hz_per_s = 300e3;
    RecordedBoard::of(EmulatedBoard::new(
        image(),
        plant,
        Settings::default(),
        recording(),
    ))
}

#[test]
fn four_channels_arrive_in_their_order() {
    let mut bench = RecordedBoard::new();
    bench.stream();
    let settings = palpate_wire::command::Settings {
        channels: 0b1111,
        rate_hz: 500.0,
        ..bench.settings()
    };
    let answer = bench.command(&Command::SetSettings(settings));
    assert_eq!(answer.outcome, Outcome::Accepted);
    bench.run(Time::from_ms(100));
    bench.frames.clear();
    bench.run(Time::from_ms(500));
    assert_eq!(bench.board.frequencies_hz().1, Some(40e6));
    let scans: Vec<_> = bench.samples().collect();
    assert!(scans.len() >= 240, "{}", scans.len());
    for (_, scan) in scans {
        let channels: Vec<u8> = scan.channels.iter().map(|it| it.channel).collect();
        assert_eq!(channels, [0, 1, 2, 3]);
        for (conversion, hz) in scan.channels.iter().zip(crate::common::FREQUENCIES_HZ) {
            let error = (conversion.frequency_hz - hz).abs() / hz;
            assert!(error < 1e-3, "channel {}: {error}", conversion.channel);
        }
        assert!(
            scan.channels
                .windows(2)
                .all(|two| two[0].offset_us < two[1].offset_us)
        );
        assert_eq!(scan.missed, 0);
    }
}
