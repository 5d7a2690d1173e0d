//! Two converters on one bus: a failure of one does not affect the other.

use ldc161x_sim::{ChipFault, FaultEvent, InterruptRelease, Lost, Overwrite, Settings};
use palpate_emulator::{EmulatedBoard, LineFault, Options, SecondSensors, Still, Time};
use palpate_wire::Record;
use palpate_wire::code::{Location, Outcome};
use palpate_wire::command::Command;
use palpate_wire::record::{Fault, Sample};

use crate::common::stamps::{Silicon, change};
use crate::common::{RecordedBoard, recording};

/// Sensors of the second converter, all different from the first one's.
const SECOND_HZ: [f64; 4] = [2.5e6, 2.6e6, 2.7e6, 2.8e6];
/// Scan rate of both converters, Hz.
const RATE_HZ: f32 = 500.0;
/// Duration of the second converter's failure.
const FAILS: Time = Time::from_ms(300);

fn streaming() -> RecordedBoard {
    streaming_with(0b0001, RATE_HZ)
}

/// Both converters stream with these channels and this rate.
fn streaming_with(channels: u8, rate_hz: f32) -> RecordedBoard {
    let options = Options {
        second_converter: Some(SecondSensors::new(SECOND_HZ)),
        ..recording()
    };
    let mut bench = RecordedBoard::with(Settings::default(), options);
    bench.stream();
    let settings = palpate_wire::command::Settings {
        channels,
        rate_hz,
        ..bench.settings()
    };
    let answer = bench.command(&Command::SetSettings(settings));
    assert_eq!(answer.outcome, Outcome::Accepted);
    bench.run(Time::from_ms(200));
    bench.frames.clear();
    bench
}

/// Both converters share one CLKIN: if its frequency changed during a conversion, the count would
/// mix two frequencies.
#[test]
fn the_clock_changes_only_while_both_converters_are_stopped() {
    let mut bench = streaming();
    for (channels, phase_us) in [(15, 300), (1, 4_300), (3, 6_300), (1, 8_300)] {
        bench.run(Time::from_ms(400) + Time::from_us(phase_us));
        let before = bench.board.frequencies_hz();
        let settings = palpate_wire::command::Settings {
            channels,
            rate_hz: 100.0,
            ..bench.settings()
        };
        bench.send(&Command::SetSettings(settings));
        let has_changed = |board: &EmulatedBoard<Still>| board.frequencies_hz() != before;
        let limit = Time::from_ms(300);
        bench.board.run_until(limit, has_changed).unwrap();
        assert!(has_changed(&bench.board), "{channels}: the clock stays");
        let first = bench.board.chip().is_converting();
        let second = bench.board.second_chip_mut().unwrap().is_converting();
        assert!(!first && !second, "{channels}: {first} {second}");
        bench.listen();
    }
    let faults = bench.faults();
    assert!(faults.is_empty(), "{faults:?}");
}

fn of(bench: &RecordedBoard, sensor: u8) -> Vec<(u64, Sample)> {
    let samples = bench
        .samples()
        .filter(|(_, sample)| sample.sensor == sensor);
    samples
        .map(|(at_us, sample)| (at_us, sample.clone()))
        .collect()
}

/// Asserts one sample every 2 ms, none lost, none off its grid.
fn assert_whole(samples: &[(u64, Sample)], seconds: f64, what: &str) {
    assert_whole_at(RATE_HZ, samples, seconds, what);
}

/// Asserts samples at this rate, none lost, none off the grid.
fn assert_whole_at(rate_hz: f32, samples: &[(u64, Sample)], seconds: f64, what: &str) {
    let expected = f64::from(rate_hz) * seconds;
    let count = samples.len() as f64;
    assert!(
        (count - expected).abs() <= 0.02 * expected,
        "{what}: {count} of {expected}"
    );
    let missed: u32 = samples.iter().map(|(_, sample)| sample.missed).sum();
    assert_eq!(missed, 0, "{what}");
    assert!(samples.iter().all(|(_, sample)| !sample.gap), "{what}");
    let steps = samples.windows(2).map(|pair| pair[1].0 - pair[0].0);
    let steps: Vec<u64> = steps.collect();
    let (least, most) = (steps.iter().min().unwrap(), steps.iter().max().unwrap());
    assert!(most - least <= 4, "{what}: {least} to {most} us");
}

#[test]
fn both_converters_stream_at_500_frames_a_second() {
    let mut bench = streaming();
    bench.run(Time::from_ms(1_000));
    for sensor in [0, 1] {
        assert_whole(&of(&bench, sensor), 1.0, &format!("converter {sensor}"));
    }
    let first_hz = of(&bench, 0)[0].1.channels[0].frequency_hz;
    let second_hz = of(&bench, 1)[0].1.channels[0].frequency_hz;
    assert!((second_hz - 2.5e6).abs() < 5e3, "{second_hz}");
    assert!((first_hz - 3.1e6).abs() < 5e3, "{first_hz}");
    assert_eq!(bench.faults(), []);
    assert_eq!(bench.status().conversions_lost, 0);
}

/// Faults with their times; asserts that there are some, all of the second converter.
fn of_second(bench: &RecordedBoard, what: &str) -> Vec<(u64, Fault)> {
    let faults = bench
        .frames
        .iter()
        .filter_map(|frame| match &frame.message {
            Record::Fault(fault) => Some((frame.header.time_us, fault.clone())),
            _ => None,
        });
    let faults: Vec<(u64, Fault)> = faults.collect();
    assert!(
        !faults.is_empty(),
        "{what}: it failed, and no fault said so"
    );
    let is_of_second = |(_, fault): &(u64, Fault)| fault.location == Location::SecondSensor;
    assert!(faults.iter().all(is_of_second), "{what}: {faults:?}");
    faults
}

/// With any set of channels, both start without a fault, and share the bus without a loss: a frame
/// of four channels takes 1.1 ms of bus time, in which the other converter overwrites each channel.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn both_converters_stream_with_every_number_of_channels() {
    for (channels, rate_hz) in [
        (0b0001, 1_000.0),
        (0b0011, 800.0),
        (0b0111, 250.0),
        (0b0111, 580.0),
        (0b1111, 100.0),
        (0b1111, 250.0),
        (0b1111, 430.0),
    ] {
        let what = format!("{channels:#06b} {rate_hz} Hz");
        let mut bench = streaming_with(channels, rate_hz);
        bench.run(Time::from_ms(100));
        bench.frames.clear();
        bench.run(Time::from_ms(500));
        for sensor in [0, 1] {
            let samples = of(&bench, sensor);
            assert_whole_at(
                rate_hz,
                &samples,
                0.5,
                &format!("{what}, converter {sensor}"),
            );
        }
        assert_eq!(bench.faults(), [], "{what}");
        let status = bench.status();
        assert_eq!(status.bus_errors, 0, "{what}");
        assert_eq!(status.recoveries, 0, "{what}");
    }
}

/// A rate that the bus cannot fetch from both is refused, and the previous settings continue.
#[test]
fn more_than_the_bus_can_fetch_from_both_is_refused() {
    let mut bench = streaming();
    bench.run(Time::from_ms(5));
    for (channels, rate_hz) in [(0b0011, 850.0), (0b0111, 600.0), (0b1111, 460.0)] {
        let settings = palpate_wire::command::Settings {
            channels,
            rate_hz,
            ..bench.settings()
        };
        let answer = bench.command(&Command::SetSettings(settings));
        assert_eq!(
            answer.outcome,
            Outcome::OutOfRange,
            "{channels:#06b} {rate_hz}"
        );
    }
    // During the search for the highest rate, samples were queued.
    bench.run(Time::from_ms(50));
    bench.frames.clear();
    bench.run(Time::from_ms(200));
    assert_whole(&of(&bench, 1), 0.2, "converter 1");
}

/// If INTB is pulled low or released for a microsecond, there is no extra record.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_disturbance_of_intb_is_no_sample() {
    for (low, lasting_ns) in [(true, 500), (true, 1_500), (false, 1_000)] {
        let mut bench = RecordedBoard::new();
        bench.stream();
        bench.run(Time::from_ms(100));
        bench.frames.clear();
        for step in 0..200 {
            // The disturbances come at all times within a period of 1 ms.
            let at = bench.board.now() + Time::from_us(1_000 + 5 * (step % 40));
            let fault = ChipFault::IntbStuck { low };
            let event = FaultEvent::at(at, fault, Time::from_ns(lasting_ns));
            bench.board.chip_mut().schedule(event).unwrap();
            bench.run(Time::from_us(2_000 + 7 * (step % 11)));
        }
        let samples = of(&bench, 0);
        let what = format!("{low} {lasting_ns} ns: {} samples", samples.len());
        let (first_us, last_us) = (samples[0].0, samples[samples.len() - 1].0);
        let scans = (last_us - first_us) as f64 * 1e-6 * 999.21;
        let missed: u32 = samples.iter().map(|(_, sample)| sample.missed).sum();
        let what = format!("{what}, {missed} missed, {scans} scans");
        println!("{what}");
        let found = samples.len() as f64 - 1.0 + f64::from(missed);
        assert!((found - scans).abs() < 1.5, "{what}");
        // A conversion that ends in the disturbance is lost, and marked.
        assert!(f64::from(missed) < 0.01 * scans, "{what}");
        assert!(samples.len() > 350, "{what}");
        assert_eq!(bench.faults(), [], "{what}");
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_second_converter_that_fails_costs_the_first_nothing() {
    let mut running = streaming();
    running.run(Time::from_ms(20));
    for way in [
        ChipFault::Absent,
        ChipFault::Nack { after_bytes: 3 },
        ChipFault::IntbStuck { low: true },
        ChipFault::IntbStuck { low: false },
        ChipFault::BrownOut(Lost::Everything),
        ChipFault::ClockLoss,
    ] {
        let what = format!("{way:?}");
        let mut bench = running.clone();
        bench.frames.clear();
        let begun_us = bench.board.timer_us();
        let fault = FaultEvent::at(bench.board.now(), way, FAILS);
        let second = bench.board.second_chip_mut().unwrap();
        second.schedule(fault).unwrap();
        bench.run(Time::from_ms(1_000));
        assert_whole(&of(&bench, 0), 1.0, &what);
        // The second converter reported the fault until its cause ended, and recovered.
        let faults = of_second(&bench, &what);
        if !matches!(way, ChipFault::BrownOut(_)) {
            let ended: Vec<u64> = faults
                .iter()
                .filter(|(_, fault)| !fault.active)
                .map(|(at_us, _)| at_us - begun_us)
                .collect();
            assert_eq!(2 * ended.len(), faults.len(), "{what}: {faults:?}");
            assert!(
                ended.iter().all(|after_us| *after_us >= 300_000),
                "{what}: {faults:?}"
            );
        }
        let last_us = of(&bench, 1).last().map_or(0, |(at_us, _)| *at_us);
        let first_us = of(&bench, 0).last().map_or(0, |(at_us, _)| *at_us);
        assert!(
            first_us.abs_diff(last_us) < 10_000,
            "{what}: {last_us} {first_us}"
        );
    }
}

/// While the second converter restarts, its transactions follow one another without a pause: an
/// edge of the first converter may coincide with any part of them, and its time must still be
/// right. The edges here coincide with the start of a transaction, which would delay them if a task
/// started it with interrupts off.
#[test]
fn the_first_loses_nothing_while_the_second_starts_anew() {
    let silicon = Silicon {
        release: InterruptRelease::StatusOrData,
        overwrite: Overwrite::ByChannel,
    };
    let mut running = silicon.bench_of_two();
    running.stream();
    for (rate_hz, after_us) in [(200.0, 7_422), (200.0, 8_659), (250.0, 12_370)] {
        let mut bench = running.clone();
        bench.run(Time::from_us(after_us));
        change(&mut bench, 0b1111, rate_hz, Time::ZERO);
        bench.run(Time::from_ms(180) + Time::from_secs_f64(5.0 / f64::from(rate_hz)));
        bench.frames.clear();
        let lost = ChipFault::BrownOut(Lost::Everything);
        let at = bench.board.now() + Time::from_us(after_us);
        let second = bench.board.second_chip_mut().unwrap();
        second
            .schedule(FaultEvent::at(at, lost, Time::ZERO))
            .unwrap();
        bench.run(Time::from_ms(200));
        let what = format!("{rate_hz} Hz, {after_us} us");
        let marked = |(_, sample): &(u64, Sample)| sample.gap || sample.missed > 0;
        let (first, second) = (of(&bench, 0), of(&bench, 1));
        assert!(first.len() > 35, "{what}: {}", first.len());
        assert_eq!(first.iter().position(marked), None, "{what}");
        assert!(second.iter().any(marked), "{what}: it went on");
    }
}

/// While the bus is freed, the I2C block is in reset or has no pins: an access to the block would
/// stop the run.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn an_edge_while_the_bus_is_freed_waits_until_it_is() {
    const PHASES: u64 = 8;
    let running = streaming();
    let mut met = 0;
    for phase in 0..PHASES {
        let mut bench = running.clone();
        bench.run(Time::from_us(2_000 / PHASES * phase));
        bench.board.disturb(LineFault::SdaLow {
            bit: 12,
            lasting: Some(Time::from_ms(4)),
            clocks: None,
        });
        bench
            .board
            .run_until(Time::from_ms(20), |board| board.bus_is_taken())
            .unwrap();
        let fault = FaultEvent::at(
            bench.board.now(),
            ChipFault::IntbStuck { low: true },
            Time::from_us(20),
        );
        let second = bench.board.second_chip_mut().unwrap();
        let was_high = !second.intb_is_low();
        second.schedule(fault).unwrap();
        bench
            .board
            .run_until(Time::from_ms(20), |board| !board.bus_is_taken())
            .unwrap();
        met += u32::from(was_high);
        // Both converters continue.
        bench.run(Time::from_ms(100));
        bench.frames.clear();
        bench.run(Time::from_ms(100));
        for sensor in [0, 1] {
            let count = of(&bench, sensor).len();
            assert!(count >= 45, "phase {phase}: {count} of sensor {sensor}");
        }
    }
    assert!(met > 0, "no edge met a recovery");
}
