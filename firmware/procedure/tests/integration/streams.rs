//! Records sent without a command: identification, conversions, status.

use crate::support::calibration::{calibration, curve, settings};
use crate::support::sensor::Sensor;
use crate::support::{Rig, board};
use palpate_procedure::{Action, Conversion, Duration, Event, Instant};
use palpate_wire::code::{Contact, Stream};
use palpate_wire::command::Settings;
use palpate_wire::record::{Crash, Raw, Sample, Status};
use palpate_wire::{Command, Record};

/// Returns a calibrated rig with these settings and no records yet.
fn with(change: impl FnOnce(&mut Settings)) -> Rig {
    let mut rig = Rig::calibrated(Sensor::default(), settings(change));
    rig.records.clear();
    rig
}

#[test]
fn the_first_words_are_who_speaks_and_what_the_last_run_died_of() {
    let crash = Crash {
        cause: palpate_wire::code::ResetCause::Panic,
        streak: 1,
        file: Default::default(),
        line: 12,
        program_counter: 0,
        link_register: 0,
        uptime_ms: 5_000,
    };
    let mut board = board();
    board.crash = Some(crash.clone());
    let mut rig = Rig::started_as(board);
    let actions = rig.wait(0);
    assert_eq!(actions.len(), 3, "{actions:?}");
    assert!(matches!(rig.records[0].1, Record::Hello(_)));
    assert_eq!(rig.records[1].1, Record::Crash(crash));
    let Action::ConfigureSensors { channels, rate } = actions[2] else {
        panic!("{actions:?}");
    };
    assert_eq!((channels, rate.0), (0b0001, 1_000.0));
    // Each of these records is sent exactly once.
    rig.run(100);
    let again = |(_, record): &&(_, Record)| matches!(record, Record::Hello(_) | Record::Crash(_));
    assert_eq!(rig.records.iter().filter(again).count(), 2);
}

#[test]
fn every_so_many_samples_one_is_sent_with_what_was_lost_before_it() {
    let mut rig = with(|of| of.decimation = 5);
    for number in 1..=20 {
        rig.convert_with(|scan| scan.lost = u32::from(number == 7) * 3);
    }
    let samples: Vec<Sample> = rig.all();
    let missed: Vec<_> = samples.iter().map(|of| (of.missed, of.gap)).collect();
    assert_eq!(missed, [(0, false), (3, true), (0, false), (0, false)]);
    // The record has the time of its conversion's middle.
    let (at, _) = rig.records[0];
    assert_eq!(at.as_ticks(), rig.now_us - 15_000 - 500);
}

#[test]
fn nothing_is_sent_with_the_stream_off() {
    let mut rig = with(|of| of.stream = Stream::Off);
    rig.run(500);
    assert!(rig.all::<Sample>().is_empty());
    assert!(rig.all::<Raw>().is_empty());
}

#[test]
fn raw_words_come_in_full_runs_that_end_where_something_is_lost() {
    let mut rig = with(|of| of.stream = Stream::Raw);
    let mut words = Vec::new();
    for number in 0..200 {
        rig.convert_with(|scan| {
            scan.lost = u32::from(number == 77) * 4;
            words.push(scan.conversions[0].reading.word.bits());
        });
    }
    let runs: Vec<Raw> = rig.all();
    let received: Vec<u32> = runs.iter().flat_map(|run| run.words.clone()).collect();
    assert_eq!(received, words[..received.len()]);
    let capacity = runs[0].words.capacity();
    assert!(received.len() + capacity >= words.len());
    let mut counted = 0;
    for run in &runs {
        let broken = counted == 77;
        assert_eq!(run.missed, u32::from(broken) * 4, "at {counted}");
        assert_eq!((run.period_us, run.channels), (1_000.0, 1));
        counted += run.words.len();
        assert!(run.words.len() == capacity || counted == 77, "{counted}");
    }
}

#[test]
fn a_drift_goes_on_while_readings_are_flagged() {
    // Drift of the untouched sensor as after a press.
    const DRIFT_M_PER_S: f64 = -1e-6;
    let mut rig = with(|_| {});
    let drift = |rig: &mut Rig, ms: u64, flagged: bool| {
        for _ in 0..ms {
            rig.sensor.offset_m += DRIFT_M_PER_S * 1e-3;
            rig.convert_with(|scan| scan.conversions[0].reading.after_gap = flagged);
        }
    };
    drift(&mut rig, 2_000, false);
    drift(&mut rig, 400, true);
    drift(&mut rig, 1, false);
    let sample: Sample = rig.last();
    let deformation_m = sample.channels[0].deformation_m.expect("a curve");
    // The baseline has followed for the whole time, so the 0.4 um of recovery do not appear as a
    // deformation.
    assert!(deformation_m.abs() < 5e-8, "{deformation_m:e}");
}

#[test]
fn every_channel_has_its_own_conversion_and_baseline() {
    let mut rig = Rig::started();
    rig.accepted(Command::SetSettings(settings(|of| of.channels = 0b0011)));
    let mut second = curve();
    second.channel = 1;
    rig.accepted(Command::SetDeformationCurve(curve()));
    rig.accepted(Command::SetDeformationCurve(second));
    // The second channel is pressed by half as much as the first, and offset.
    let mut other = Sensor {
        offset_m: 1e-6,
        ..Sensor::default()
    };
    for step in 0..1_000 {
        if step == 900 {
            rig.sensor.press(3e-4);
            other.press(1.5e-4);
        }
        let time_s = rig.now_us as f64 * 1e-6;
        rig.convert_with(|scan| {
            let mut reading = other.reading(0.0, time_s);
            reading.channel = ldc161x::Channel::One;
            let offset = Duration::from_ticks(400);
            let second = Conversion { reading, offset };
            scan.conversions.push(second).expect("room for four");
        });
    }
    let sample: Sample = rig.last();
    let channels: Vec<_> = sample.channels.iter().collect();
    assert_eq!((channels[0].channel, channels[0].offset_us), (0, 0));
    assert_eq!((channels[1].channel, channels[1].offset_us), (1, 400));
    for (conversion, expected_m) in channels.iter().zip([3e-4, 1.5e-4]) {
        let found_m = conversion.deformation_m.expect("a curve");
        assert!((found_m / expected_m - 1.0).abs() < 1e-3, "{found_m}");
    }
    assert_eq!(sample.contact, Contact::Held);
}

#[test]
fn flagged_conversions_are_reported_and_counted_and_teach_nothing() {
    let mut rig = with(|_| {});
    rig.run(1_000);
    rig.records.clear();
    let before = rig.status();
    for _ in 0..10 {
        // This reading is flagged; if it were accepted, it would be far from the baseline.
        rig.sensor.press(3e-4);
        rig.sensor.flags = 0x1000;
        rig.convert();
        rig.sensor.depth_m = 0.0;
        rig.sensor.flags = 0;
        rig.convert_with(|scan| scan.lost = 2);
    }
    let after = rig.status();
    let samples: Vec<Sample> = rig.all();
    let flagged = samples
        .iter()
        .filter(|of| of.channels[0].deformation_m.is_none());
    assert_eq!(flagged.count(), 10);
    assert!(samples.iter().all(|of| of.contact != Contact::Began));
    assert_eq!(after.conversions - before.conversions, 20);
    assert_eq!(after.conversions_flagged - before.conversions_flagged, 10);
    assert_eq!(after.conversions_lost - before.conversions_lost, 20);
    assert_eq!(after.second_conversions, 0);
}

#[test]
fn a_second_converter_is_reported_and_counted_beside_the_first() {
    let mut board = board();
    board.channels = [0b0001, 0b0001];
    let mut rig = Rig::started_as(board);
    for command in calibration(&Sensor::default()) {
        rig.accepted(command);
    }
    // Runs for longer than the start-up of a converter may take.
    for _ in 0..200 {
        rig.convert();
        let mut scan = rig.scan();
        scan.sensor = 1;
        rig.step(&Event::Scan(&scan));
    }
    let samples: Vec<Sample> = rig.all();
    let of = |sensor| samples.iter().filter(|of| of.sensor == sensor).count();
    assert_eq!((of(0), of(1)), (200, 200));
    let counted = rig.status();
    assert_eq!(
        (counted.conversions, counted.second_conversions),
        (200, 200)
    );
    // Conversions of the second converter alone do not prevent the fault of a silent first converter.
    for _ in 0..51 {
        rig.now_us += 1_000;
        let mut scan = rig.scan();
        scan.sensor = 1;
        rig.step(&Event::Scan(&scan));
    }
    assert_eq!(rig.faults().len(), 1);
}

#[test]
fn status_comes_every_period_and_counts_measurements() {
    let mut rig = Rig::touched(|_| {});
    rig.measure();
    rig.accepted(Command::Abort);
    rig.until(palpate_wire::code::State::Release, 100);
    rig.accepted(Command::Measure);
    rig.accepted(Command::Abort);
    let counted = rig.status();
    assert_eq!((counted.measurements, counted.refusals), (1, 1));
    assert_eq!(counted.temperature_c, Some(25.0));
    rig.records.clear();
    rig.run(5_000);
    assert_eq!(rig.all::<Status>().len(), 5);
}

/// The period is that of the converter, not that of the requested rate: 999.25 us at 1 kHz.
#[test]
fn raw_words_have_the_period_of_their_conversions() {
    let mut rig = with(|of| of.stream = Stream::Raw);
    for number in 0..200 {
        rig.convert_with(|scan| {
            let middle_us = 1e6 + 999.25 * f64::from(number);
            scan.middle = Instant::from_ticks(middle_us as u64);
        });
    }
    let runs = rig.all::<Raw>().into_iter();
    let periods_us: Vec<_> = runs.map(|raw| raw.period_us).collect();
    assert!(periods_us.len() > 4, "{periods_us:?}");
    assert!(
        periods_us.iter().all(|us| (us - 999.25).abs() < 0.05),
        "{periods_us:?}"
    );
}
