//! The flashed image reads the simulated converter: every word, on time, without a loss.

use crate::common::{RecordedBoard, image, recording};
use ldc161x_sim::{InterruptRelease, Settings, Switches};
use palpate_emulator::{EmulatedBoard, Still, Time};
use palpate_wire::Record;
use palpate_wire::code::{Chip, Outcome, ResetCause, Stream};
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
fn a_thousand_samples_a_second_arrive_without_a_loss() {
    let mut bench = drifting();
    bench.stream();
    bench.run(Time::from_ms(2_000));
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
fn sample_times_are_the_middles_of_their_conversions() {
    let mut bench = drifting();
    bench.stream();
    bench.run(Time::from_ms(300));
    let fetched = bench.board.wire_log().unwrap().fetched.clone();
    // The board's timer starts with its tick, some time after power on; this offset is the same for
    // all samples.
    let errors: Vec<f64> = bench
        .samples()
        .filter_map(|(time_us, sample)| {
            let word = sample.channels[0].word;
            let truth = fetched.iter().find(|it| it.word == word)?;
            let middle_s = (truth.start.as_secs_f64() + truth.end.as_secs_f64()) / 2.0;
            Some(time_us as f64 - middle_s * 1e6)
        })
        .collect();
    assert!(errors.len() > 290, "{}", errors.len());
    let lowest = errors.iter().copied().fold(f64::MAX, f64::min);
    let highest = errors.iter().copied().fold(f64::MIN, f64::max);
    assert!(
        highest - lowest < 2.0,
        "sample times move by {} us",
        highest - lowest
    );
}

#[test]
fn an_edge_is_answered_by_a_start_within_ten_microseconds() {
    let mut bench = RecordedBoard::new();
    bench.stream();
    bench.run(Time::from_ms(100));
    let before = bench.board.wire_log().unwrap().edge_to_start.len();
    bench.run(Time::from_ms(1_000));
    let latencies = &bench.board.wire_log().unwrap().edge_to_start[before..];
    assert!(latencies.len() > 900);
    let worst = latencies.iter().max().unwrap();
    assert!(*worst <= Time::from_us(10), "{worst}");
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

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn fast_streams_lose_nothing_whatever_releases_the_interrupt() {
    for (release, rate_hz) in [
        // 98 % of the rate that the bus can fetch, with 10 us between two frames.
        (InterruptRelease::StatusOrData, 3_960.0),
        (InterruptRelease::StatusOnly, 2_685.0),
    ] {
        let chip = Settings {
            switches: Switches {
                interrupt_release: release,
                ..Switches::default()
            },
            ..Settings::default()
        };
        let mut bench = RecordedBoard::with(chip, recording());
        bench.stream();
        let settings = palpate_wire::command::Settings {
            rate_hz,
            stream: Stream::Raw,
            ..bench.settings()
        };
        let answer = bench.command(&Command::SetSettings(settings));
        assert_eq!(answer.outcome, Outcome::Accepted);
        bench.run(Time::from_ms(100));
        let before = bench.status();
        let overwritten = bench.board.chip().overwritten(0);
        bench.run(Time::from_ms(500));
        let after = bench.status();
        assert_eq!(
            after.conversions_lost, before.conversions_lost,
            "{release:?}"
        );
        assert_eq!(
            bench.board.chip().overwritten(0),
            overwritten,
            "{release:?}"
        );
        let frames = f64::from(after.conversions - before.conversions);
        assert!(frames > 0.495 * f64::from(rate_hz), "{release:?}: {frames}");
    }
}
