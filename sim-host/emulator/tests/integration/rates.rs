//! The image at the rates that it accepts: it keeps them, and accepts no more than the bus can
//! carry.

use crate::common::{FREQUENCIES_HZ, RecordedBoard, image, recording};
use ldc161x_sim::{InterruptRelease, Settings, Switches};
use palpate_emulator::{EmulatedBoard, Options, Still, Time};
use palpate_wire::Record;
use palpate_wire::code::{Outcome, Stream};
use palpate_wire::command::{self, Command};
use palpate_wire::record::Acknowledgement;

const RELEASES: [InterruptRelease; 2] =
    [InterruptRelease::StatusOnly, InterruptRelease::StatusOrData];

/// A bench with a running stream, whose simulated chip releases INTB as `release` says.
fn streaming(release: InterruptRelease) -> RecordedBoard {
    let chip = Settings {
        switches: Switches {
            interrupt_release: release,
            ..Switches::default()
        },
        ..Settings::default()
    };
    let plant = Still::new(FREQUENCIES_HZ);
    let mut bench = RecordedBoard::of(EmulatedBoard::new(image(), plant, chip, recording()));
    bench.stream();
    bench
}

fn set(bench: &mut RecordedBoard, channels: u8, rate_hz: f32, stream: Stream) -> Acknowledgement {
    let settings = command::Settings {
        channels,
        rate_hz,
        stream,
        ..bench.settings()
    };
    bench.command(&Command::SetSettings(settings))
}

/// Limits that a refusal reports, Hz; asserts that rates outside of them are refused.
fn limits_hz(bench: &mut RecordedBoard, channels: u8) -> [f32; 2] {
    let answer = set(bench, channels, 1.0, Stream::Raw);
    assert_eq!(answer.outcome, Outcome::OutOfRange);
    assert_eq!((answer.field, answer.value), (Some(1), Some(1.0)));
    let limits_hz = [answer.low.unwrap(), answer.high.unwrap()];
    let [low_hz, high_hz] = limits_hz;
    for beyond_hz in [low_hz - 1.0, high_hz + 1.0, 5_000.0] {
        let answer = set(bench, channels, beyond_hz, Stream::Raw);
        assert_eq!(answer.outcome, Outcome::OutOfRange, "{beyond_hz} Hz");
        assert_eq!((answer.low, answer.high), (Some(low_hz), Some(high_hz)));
    }
    limits_hz
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn the_rates_that_are_accepted_are_kept_without_a_loss_and_others_are_refused() {
    for release in RELEASES {
        let snapshot = streaming(release);
        for channels in [0b0001, 0b1111] {
            let limits_hz = limits_hz(&mut snapshot.clone(), channels);
            for rate_hz in limits_hz {
                let what = format!("{release:?} {channels:#b} {rate_hz} Hz");
                let mut bench = snapshot.clone();
                let answer = set(&mut bench, channels, rate_hz, Stream::Raw);
                assert_eq!(answer.outcome, Outcome::Accepted, "{what}");
                bench.run(Time::from_ms(400));
                let (before, from) = (bench.status(), bench.board.now());
                let overwritten = bench.board.chip().overwritten(0);
                bench.frames.clear();
                let runs_s = if rate_hz < 100.0 { 2.5 } else { 0.6 };
                bench.run(Time::from_secs_f64(runs_s));
                let (after, to) = (bench.status(), bench.board.now());
                assert_eq!(after.conversions_lost, before.conversions_lost, "{what}");
                assert_eq!(bench.board.chip().overwritten(0), overwritten, "{what}");
                let scans = f64::from(after.conversions - before.conversions);
                let kept_hz = scans / (to - from).as_secs_f64();
                let one_hz = 1.0 / (to - from).as_secs_f64();
                assert!(
                    (kept_hz - f64::from(rate_hz)).abs() < 0.01 * kept_hz + one_hz,
                    "{what}: {kept_hz}"
                );
                assert_eq!(bench.faults(), [], "{what}");
                assert_periods_are_true(&bench, &what);
            }
        }
    }
}

/// Asserts that the period of a run of words is the interval in the converter's own record.
fn assert_periods_are_true(bench: &RecordedBoard, what: &str) {
    let fetched = &bench.board.wire_log().unwrap().fetched;
    let first: Vec<_> = fetched.iter().filter(|it| it.channel == 0).collect();
    let [.., before, last] = first[..] else {
        panic!("{what}: no words");
    };
    let true_us = (last.end - before.end).as_secs_f64() * 1e6;
    let runs: Vec<_> = bench
        .frames
        .iter()
        .filter_map(|frame| match &frame.message {
            Record::Raw(raw) => Some(raw.period_us),
            _ => None,
        })
        .collect();
    assert!(!runs.is_empty(), "{what}");
    for period_us in runs {
        assert!(
            (f64::from(period_us) - true_us).abs() < 1.0,
            "{what}: {period_us} for {true_us}"
        );
    }
}

/// Slow edges slow down the bus clock: 400 kHz by the block's registers become 280 and 195 kHz with
/// the two rise times here. A frame of four channels then takes 1.3 and 1.9 ms.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_slow_bus_loses_nothing_where_a_frame_fits_into_a_scan() {
    for (rise_ns, rate_hz) in [(1_220, 250.0), (2_780, 100.0)] {
        let options = Options {
            scl_rise: Time::from_ns(rise_ns),
            ..recording()
        };
        let mut bench = RecordedBoard::with(Settings::default(), options);
        bench.stream();
        let answer = set(&mut bench, 0b1111, rate_hz, Stream::Samples);
        assert_eq!(answer.outcome, Outcome::Accepted);
        bench.run(Time::from_ms(300));
        bench.frames.clear();
        bench.run(Time::from_ms(2_000));
        let what = format!("rise {rise_ns} ns, {rate_hz} Hz");
        let missed: u32 = bench.samples().map(|(_, sample)| sample.missed).sum();
        let count = bench.samples().count() as f32;
        println!("{what}: {count} samples, {missed} missed");
        assert!((count - 2.0 * rate_hz).abs() < 5.0, "{what}: {count}");
        assert_eq!(missed, 0, "{what}");
        assert_eq!(bench.faults(), [], "{what}");
        assert_eq!(bench.status().bus_errors, 0, "{what}");
    }
}
