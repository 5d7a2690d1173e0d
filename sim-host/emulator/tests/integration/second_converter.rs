//! Two converters on one bus: what one fails of costs the other nothing.

use ldc161x_sim::{ChipFault, FaultEvent, Lost, Settings};
use palpate_emulator::{LineFault, Options, Time};
use palpate_wire::code::{Location, Outcome};
use palpate_wire::command::Command;
use palpate_wire::record::Sample;

use crate::common::{RecordedBoard, recording};

/// The second converter's sensors: none is the first one's.
const SECOND_HZ: [f64; 4] = [2.5e6, 2.6e6, 2.7e6, 2.8e6];
/// Scans a second of both.
const RATE_HZ: f32 = 500.0;
/// How long the second one fails.
const FAILS: Time = Time::from_ms(300);

/// Both converters stream.
fn streaming() -> RecordedBoard {
    let options = Options {
        second_converter: Some(SECOND_HZ),
        ..recording()
    };
    let mut bench = RecordedBoard::with(Settings::default(), options);
    bench.stream();
    let settings = palpate_wire::command::Settings {
        rate_hz: RATE_HZ,
        ..bench.settings()
    };
    let answer = bench.command(&Command::SetSettings(settings));
    assert_eq!(answer.outcome, Outcome::Accepted);
    bench.run(Time::from_ms(200));
    bench.frames.clear();
    bench
}

fn of(bench: &RecordedBoard, sensor: u8) -> Vec<(u64, Sample)> {
    let samples = bench
        .samples()
        .filter(|(_, sample)| sample.sensor == sensor);
    samples
        .map(|(at_us, sample)| (at_us, sample.clone()))
        .collect()
}

/// One sample every 2 ms, none lost, none beside its grid.
fn assert_whole(samples: &[(u64, Sample)], seconds: f64, what: &str) {
    let expected = f64::from(RATE_HZ) * seconds;
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

#[test]
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
        let fault = FaultEvent::at(bench.board.now(), way, FAILS);
        let second = bench.board.second_chip_mut().unwrap();
        second.schedule(fault).unwrap();
        bench.run(Time::from_ms(1_000));
        assert_whole(&of(&bench, 0), 1.0, &what);
        // The second reported that, and came back.
        let begun = bench.faults().into_iter().filter(|fault| fault.active);
        let locations: Vec<Location> = begun.map(|fault| fault.location).collect();
        assert!(
            locations
                .iter()
                .all(|location| *location == Location::SecondSensor),
            "{what}: {locations:?}"
        );
        let last_us = of(&bench, 1).last().map_or(0, |(at_us, _)| *at_us);
        let first_us = of(&bench, 0).last().map_or(0, |(at_us, _)| *at_us);
        assert!(
            first_us.abs_diff(last_us) < 10_000,
            "{what}: {last_us} {first_us}"
        );
    }
}

/// The block is in its reset or has no pins then: an access to it ends the run.
#[test]
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
        // Both go on.
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
