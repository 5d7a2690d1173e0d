//! After a start of the converter, and during disturbances, each sample has its right time and
//! belongs to one scan, or is marked. Short form; the campaign `image-starts` covers every rate and
//! many phases.

use crate::common::stamps::{Judged, Silicon, change, judge};
use crate::common::{FREQUENCIES_HZ, RecordedBoard, image, recording};
use ldc161x_sim::{ChipFault, FaultEvent, InterruptRelease, Overwrite, Sensors, Settings};
use palpate_emulator::{EmulatedBoard, Plant, Still, Time};
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Outcome, State};
use palpate_wire::command::Command;

/// Registers of channel 0; those of the other channels follow (data sheet table 7).
const RCOUNT0: u8 = 0x08;
const SETTLECOUNT0: u8 = 0x10;

/// A converter that releases INTB when DATA is read.
const BY_DATA: Silicon = Silicon {
    release: InterruptRelease::StatusOrData,
    overwrite: Overwrite::ByChannel,
};

#[test]
fn samples_after_a_change_of_channels_are_right_or_marked() {
    samples_are_right_or_marked(Silicon::all().take(1));
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn samples_after_a_change_of_channels_are_right_or_marked_whatever_the_silicon() {
    samples_are_right_or_marked(Silicon::all().skip(1));
}

fn samples_are_right_or_marked(silicons: impl Iterator<Item = Silicon>) {
    for silicon in silicons {
        let mut snapshot = silicon.bench();
        snapshot.stream();
        for channels in [0b0001, 0b0011, 0b0111, 0b1111] {
            let fastest_hz = silicon.fastest_hz(channels);
            for rate_hz in [500.0, fastest_hz.min(1_000.0), fastest_hz] {
                let mut bench = snapshot.clone();
                change(&mut bench, channels, rate_hz, Time::from_ms(150));
                let judged = judge(&bench);
                let what = format!("{silicon:?}, {channels:#06b}, {rate_hz} Hz: {judged:?}");
                println!("{what}");
                assert!(judged.samples > 20, "{what}");
                assert!(judged.holds(), "{what}");
            }
        }
    }
}

#[test]
fn no_sample_of_the_old_settings_follows_the_answer() {
    let mut snapshot = BY_DATA.bench();
    snapshot.stream();
    change(&mut snapshot, 0b0001, 100.0, Time::from_ms(150));
    let mut channels_after = Vec::new();
    for phase in 0..4 {
        let mut bench = snapshot.clone();
        bench.run(Time::from_us(2_300).times(phase));
        let settings = palpate_wire::command::Settings {
            channels: 0b1111,
            ..bench.settings()
        };
        let before = bench.frames.len();
        let answer = bench.command(&Command::SetSettings(settings));
        assert_eq!(answer.outcome, Outcome::Accepted);
        bench.run(Time::from_ms(200));
        let is_answer = |record: &Record| matches!(record, Record::Acknowledgement(_));
        let messages = bench.frames[before..].iter().map(|frame| &frame.message);
        let after = messages.skip_while(|record| !is_answer(record));
        channels_after.extend(after.filter_map(|record| match record {
            Record::Sample(sample) => Some(sample.channels.len()),
            _ => None,
        }));
    }
    assert!(channels_after.len() > 20, "{}", channels_after.len());
    assert!(
        channels_after.iter().all(|channels| *channels == 4),
        "{channels_after:?}"
    );
}

#[test]
fn a_change_of_channels_is_no_fault() {
    for silicon in Silicon::all().filter(|it| it.overwrite == Overwrite::ByChannel) {
        let mut snapshot = silicon.bench();
        snapshot.stream();
        for (channels, rate_hz) in [
            (0b0011, 1_000.0),
            (0b0111, 1_000.0),
            (0b1111, 900.0),
            (0b1111, 100.0),
        ] {
            let mut bench = snapshot.clone();
            let begin = bench.board.now();
            change(&mut bench, channels, rate_hz, Time::ZERO);
            let came = bench.wait_for(Time::from_ms(300), |record| match record {
                Record::Sample(sample) => (sample.channels.len() > 1).then_some(()),
                _ => None,
            });
            let took = bench.board.now() - begin;
            println!("{silicon:?}, {channels:#06b}, {rate_hz} Hz: {took}");
            assert!(came.is_some());
            bench.run(Time::from_ms(100));
            assert!(bench.faults().is_empty(), "{:?}", bench.faults());
            let restarted = bench.frames.iter().any(
                |frame| matches!(&frame.message, Record::State(it) if it.state == State::SelfTest),
            );
            assert!(!restarted, "{channels:#06b} {rate_hz}");
        }
    }
}

/// Sensors that stop oscillating for a while.
#[derive(Clone)]
struct Stopping {
    sensors: Still,
    from_s: f64,
    to_s: f64,
}

impl Sensors for Stopping {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        if (self.from_s..self.to_s).contains(&time_s) {
            0.0
        } else {
            self.sensors.frequency_hz(channel, time_s)
        }
    }
}

impl Plant for Stopping {
    fn advance_to(&mut self, _: Time) {}

    fn set_current(&mut self, _: f64, _: f64) {}
}

#[test]
fn a_conversion_that_the_watchdog_aborts_is_marked_and_not_called_lost() {
    // The chip's watchdog expires 5.2 ms after the last result: it aborts a longer conversion,
    // which restarts until the sensor oscillates.
    for lasting_s in [0.002, 0.012, 0.022] {
        let plant = Stopping {
            sensors: Still {
                drift_hz_per_s: 1e6,
                ..Still::new(FREQUENCIES_HZ)
            },
            from_s: f64::MAX,
            to_s: f64::MAX,
        };
        let board = EmulatedBoard::new(image(), plant, Settings::default(), recording());
        let mut bench = RecordedBoard::of(board);
        bench.stream();
        change(&mut bench, 0b0001, 100.0, Time::from_ms(150));
        let before = bench.status();
        let overwritten = bench.board.chip().overwritten(0);
        let begun_s = bench
            .board
            .chip()
            .last_conversion(0)
            .unwrap()
            .end
            .as_secs_f64();
        let plant = bench.board.plant_mut();
        plant.from_s = begun_s + 0.0142;
        plant.to_s = plant.from_s + lasting_s;
        bench.run(Time::from_ms(150));
        let after = bench.status();
        let judged = judge(&bench);
        assert_eq!(
            bench.board.chip().overwritten(0),
            overwritten,
            "{lasting_s}"
        );
        assert_eq!(
            after.conversions_lost, before.conversions_lost,
            "{lasting_s}"
        );
        assert!(judged.holds(), "{lasting_s}: {judged:?}");
        let gaps = bench.samples().filter(|(_, it)| it.gap).count();
        // Samples are marked after the gap of the start, after that of the first whole conversion,
        // and after each edge of the watchdog; a conversion that ended without oscillation is
        // flagged.
        let aborted = (lasting_s / 0.0052) as usize + 1;
        assert!((2..=3 + aborted).contains(&gaps), "{lasting_s}: {gaps}");
    }
}

/// Flips bits of a converter register while it streams.
fn upset(
    silicon: Silicon,
    channels: u8,
    rate_hz: f32,
    address: u8,
    bits: u16,
) -> (RecordedBoard, Judged) {
    let mut bench = silicon.bench();
    bench.stream();
    change(&mut bench, channels, rate_hz, Time::from_ms(150));
    assert!(bench.faults().is_empty());
    let at = bench.board.now() + Time::from_us(1_230);
    let fault = ChipFault::RegisterUpset { address, bits };
    let event = FaultEvent::at(at, fault, Time::ZERO);
    bench.board.chip_mut().schedule(event).unwrap();
    bench.run(Time::from_ms(120));
    let judged = judge(&bench);
    (bench, judged)
}

#[test]
fn a_conversion_time_that_changes_is_marked_at_once_and_its_register_reported() {
    let by_status = Silicon {
        release: InterruptRelease::StatusOnly,
        ..BY_DATA
    };
    for (silicon, channels, rate_hz, address, bits) in [
        (BY_DATA, 0b0001, 1_000.0, RCOUNT0, 1 << 9),
        (BY_DATA, 0b0001, 1_000.0, RCOUNT0, 1 << 3),
        (BY_DATA, 0b1111, 1_000.0, RCOUNT0 + 2, 1 << 6),
        (BY_DATA, 0b1111, 1_000.0, SETTLECOUNT0 + 1, 1 << 4),
        (by_status, 0b1111, 900.0, RCOUNT0 + 3, 1 << 5),
        (by_status, 0b0001, 1_000.0, RCOUNT0, 1 << 10),
    ] {
        let (bench, judged) = upset(silicon, channels, rate_hz, address, bits);
        let what = format!("{silicon:?} {channels:#06b} {address:#04x} {bits:#06x}: {judged:?}");
        assert!(judged.holds(), "{what}");
        let faults = bench.faults();
        let reported = faults.first().unwrap_or_else(|| panic!("no fault: {what}"));
        assert_eq!(reported.code, FaultCode::SensorReset, "{what}");
        assert_eq!(reported.value, Some(f32::from(address)), "{what}");
        // After its restart, the converter's register is right again.
        let last = bench.samples().last().unwrap().1;
        assert!(!last.gap && last.missed == 0, "{what}");
        assert!(faults.iter().any(|fault| !fault.active), "{what}");
    }
}
