//! The native board alone.

use ldc161x_sim::{ChipFault, FaultEvent, Lost};
use palpate_sim::Time;
use palpate_sim::device::{Device, TimedRecord};
use palpate_sim::native::{FIRST_BOOT_ID, NativeBoard, Wiring, default_settings};
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_wire::code::{FaultCode, Location, RebootTarget, State};
use palpate_wire::command::{Coil, DriveCoil, Reboot, Settings};
use palpate_wire::record::{Fault, Sample};
use palpate_wire::{Command, Record};

const COIL: Coil = Coil {
    resistance_ohm: 0.389,
    copper_capacity_j_per_k: 0.8,
    pad_capacity_j_per_k: 60.0,
    copper_to_pad_k_per_w: 0.5,
    pad_to_ambient_k_per_w: 8.0,
    current_uncertainty: 0.02,
};

fn world() -> World {
    let stack = Stack::builtin("ultrasoft").unwrap();
    let plant = draw(&stack, &Disturbances::builtin().unwrap(), 1);
    World::new(&plant, Switches::all(), Setup::default()).unwrap()
}

fn scanning(channels: u8, rate_hz: f32) -> Settings {
    Settings {
        channels,
        rate_hz,
        ..default_settings()
    }
}

fn states(records: &[TimedRecord]) -> Vec<State> {
    let states = records.iter().filter_map(|(_, record)| match record {
        Record::State(change) => Some(change.state),
        _ => None,
    });
    states.collect()
}

#[test]
fn it_says_who_it_is_tests_itself_and_streams_what_the_chip_converted() {
    let hardware = Wiring::new(world());
    let mut board = NativeBoard::new(&hardware);
    board.run_until(Time::from_ms(500)).unwrap();
    let records = board.take_records();
    assert!(matches!(&records[0].1, Record::Hello(hello) if hello.simulated));
    assert_eq!(states(&records), [State::Baseline]);
    let words: Vec<u32> = records
        .iter()
        .filter_map(|(_, record)| match record {
            Record::Sample(sample) => Some(sample.channels[0].word),
            _ => None,
        })
        .collect();
    // Samples at 1 kHz from the end of the start-up at 38 ms on.
    assert!((458..=466).contains(&words.len()), "{}", words.len());
    let last = hardware.chip().borrow().last_read(0).unwrap().word;
    assert_eq!(*words.last().unwrap(), last);
}

/// The drive current that suits a pressed sensor is too weak for some sensors at rest.
#[test]
fn a_sensor_that_was_pressed_at_power_on_works_when_it_is_lifted() {
    let (stack, disturbances) = (
        Stack::builtin("ultrasoft").unwrap(),
        Disturbances::builtin().unwrap(),
    );
    let mut faulted = 0;
    for seed in 500_001..500_005 {
        let plant = draw(&stack, &disturbances, seed);
        let mut world = World::new(&plant, Switches::all(), Setup::default()).unwrap();
        world.move_press(world.press_for_depth_m(0.4e-3), 0.0);
        let hardware = Wiring::new(world);
        let mut board = NativeBoard::new(&hardware);
        board.run_until(Time::from_ms(1_000)).unwrap();
        board.with_world(|world| world.move_press(-0.2e-3, 5e-3));
        board.run_until(Time::from_ms(3_000)).unwrap();
        let records = board.take_records();
        let faults = records
            .iter()
            .filter(|(_, record)| matches!(record, Record::Fault(_)));
        faulted += usize::from(faults.count() > 0);
        assert!(
            states(&records).last() != Some(&State::Fault),
            "seed {seed}"
        );
        let last = records.iter().rev().find_map(|(_, record)| match record {
            Record::Sample(sample) => Some(sample.clone()),
            _ => None,
        });
        assert_eq!(
            last.unwrap().channels[0].word >> 28,
            0,
            "seed {seed}: flags"
        );
    }
    assert!(faulted > 0, "no drawn sensor is too faint at rest");
}

/// The conversion in progress when the command arrives used another clock: as a baseline of the new
/// settings it would be wrong by a sixth.
#[test]
fn no_sample_of_the_old_settings_follows_the_answer() {
    let mut channels_after = Vec::new();
    for phase_us in [300, 2_300, 5_300, 9_300] {
        let hardware = Wiring::new(world());
        let mut board = NativeBoard::new(&hardware);
        let settings = |channels| scanning(channels, 100.0);
        board.send(Command::SetSettings(settings(0b0001))).unwrap();
        board
            .run_until(Time::from_ms(300) + Time::from_us(phase_us))
            .unwrap();
        board.take_records();
        board.send(Command::SetSettings(settings(0b1111))).unwrap();
        board.run_until(Time::from_ms(700)).unwrap();
        let records = board.take_records().into_iter();
        let is_answer = |record: &Record| matches!(record, Record::Acknowledgement(_));
        let after = records.skip_while(|(_, record)| !is_answer(record));
        channels_after.extend(after.filter_map(|(_, record)| match record {
            Record::Sample(sample) => Some(sample.channels.len()),
            _ => None,
        }));
    }
    assert!(channels_after.len() > 40, "{}", channels_after.len());
    assert!(
        channels_after.iter().all(|channels| *channels == 4),
        "{channels_after:?}"
    );
}

/// Both converters share one CLKIN: if its frequency changed during a conversion, the count would
/// mix two frequencies.
#[test]
fn the_clock_changes_only_while_both_converters_are_stopped() {
    let wiring = Wiring::with_second_converter(world());
    let mut board = NativeBoard::new(&wiring);
    let settings = |channels| scanning(channels, 100.0);
    let clock = || wiring.chips()[0].borrow().settings().external_clock;
    let runs = |converter: usize| wiring.chips()[converter].borrow().is_converting();
    let mut changes = 0;
    for (channels, phase_us) in [(15, 300), (1, 4_300), (3, 6_300), (1, 8_300), (7, 1_300)] {
        let end = board.now() + Time::from_ms(400) + Time::from_us(phase_us);
        board.run_until(end).unwrap();
        assert!(runs(0) && runs(1));
        let before = clock();
        board
            .send(Command::SetSettings(settings(channels)))
            .unwrap();
        let limit = board.now() + Time::from_ms(300);
        while clock() == before {
            assert!(board.now() < limit, "{channels}: the clock stays");
            board.advance(board.now() + Time::from_us(20)).unwrap();
        }
        assert!(!runs(0) && !runs(1), "{channels}: {} {}", runs(0), runs(1));
        changes += 1;
    }
    assert_eq!(changes, 5);
}

/// The second channel is not connected. The converter's watchdog ends a conversion after 5.2 ms: at
/// every rate the sensor is reported, once, and the converter does not restart.
#[test]
fn a_sensor_that_does_not_oscillate_is_reported_as_that_at_every_rate() {
    for rate_hz in [32.0, 180.0, 200.0, 300.0, 500.0, 1_000.0] {
        let hardware = Wiring::new(world());
        let mut board = NativeBoard::new(&hardware);
        let settings = scanning(0b0010, rate_hz);
        board.send(Command::SetSettings(settings)).unwrap();
        board.run_until(Time::from_ms(1_500)).unwrap();
        let mut faults = Vec::new();
        let mut recoveries = None;
        for (_, record) in board.take_records() {
            match record {
                Record::Fault(fault) => faults.push((fault.code, fault.active)),
                Record::Status(status) => recoveries = Some(status.recoveries),
                _ => {}
            }
        }
        assert_eq!(
            faults,
            [(FaultCode::SensorNotOscillating, true)],
            "{rate_hz} Hz"
        );
        assert_eq!(recoveries, Some(0), "{rate_hz} Hz");
    }
}

/// Samples of each converter, with their times.
fn samples(records: &[TimedRecord], sensor: u8) -> Vec<(u64, Sample)> {
    let samples = records.iter().filter_map(|(at, record)| match record {
        Record::Sample(sample) if sample.sensor == sensor => Some((at.as_ticks(), sample.clone())),
        _ => None,
    });
    samples.collect()
}

/// A converter that continues to convert while INTB is stuck, at several rates.
#[test]
fn an_interrupt_line_that_is_stuck_is_named_with_its_level() {
    for rate_hz in [100.0, 500.0, 1_000.0] {
        for low in [false, true] {
            let wiring = Wiring::new(world());
            let mut board = NativeBoard::new(&wiring);
            let settings = scanning(1, rate_hz);
            board.send(Command::SetSettings(settings)).unwrap();
            board.run_until(Time::from_ms(500)).unwrap();
            board.take_records();
            let fault = ChipFault::IntbStuck { low };
            let fault = FaultEvent::at(board.now(), fault, Time::from_ms(300));
            wiring.chip().borrow_mut().schedule(fault).unwrap();
            board.run_until(Time::from_ms(1_500)).unwrap();
            let faults: Vec<_> = board
                .take_records()
                .into_iter()
                .filter_map(|(_, record)| match record {
                    Record::Fault(fault) => Some((fault.code, fault.active, fault.value)),
                    _ => None,
                })
                .collect();
            let level = Some(if low { 0.0 } else { 1.0 });
            let code = FaultCode::InterruptStuck;
            assert_eq!(
                faults,
                [(code, true, level), (code, false, level)],
                "{rate_hz} Hz, low: {low}"
            );
        }
    }
}

/// Both converters at 500 scans a second; the second one fails for 300 ms in each of these ways.
#[test]
fn a_second_converter_that_fails_costs_the_first_nothing() {
    let ways = [
        ChipFault::Absent,
        ChipFault::Nack { after_bytes: 3 },
        ChipFault::IntbStuck { low: true },
        ChipFault::IntbStuck { low: false },
        ChipFault::BrownOut(Lost::Everything),
        ChipFault::ClockLoss,
    ];
    for way in ways {
        let wiring = Wiring::with_second_converter(world());
        let mut board = NativeBoard::new(&wiring);
        let settings = scanning(1, 500.0);
        board.send(Command::SetSettings(settings)).unwrap();
        board.run_until(Time::from_ms(500)).unwrap();
        let before = board.take_records();
        for sensor in [0, 1] {
            let count = samples(&before, sensor).len();
            assert!(count > 190, "{way:?}: sensor {sensor}: {count}");
        }
        let fault = FaultEvent::at(board.now(), way, Time::from_ms(300));
        wiring.chips()[1].borrow_mut().schedule(fault).unwrap();
        board.run_until(Time::from_ms(1_500)).unwrap();
        let after = board.take_records();
        let first = samples(&after, 0);
        let missed: u32 = first.iter().map(|(_, sample)| sample.missed).sum();
        assert_eq!(missed, 0, "{way:?}");
        assert!(
            (499..=506).contains(&first.len()),
            "{way:?}: {}",
            first.len()
        );
        assert!(first.iter().all(|(_, sample)| !sample.gap), "{way:?}");
        let mut steps = first.windows(2).map(|pair| pair[1].0 - pair[0].0);
        assert!(steps.all(|step| (1_980..=2_002).contains(&step)), "{way:?}");
        // The second converter recovers, and its failure was reported.
        let second = samples(&after, 1);
        let last_us = second.last().expect("it comes back").0;
        assert!(last_us > 1_450_000, "{way:?}: {last_us}");
        let faults: Vec<(u64, &Fault)> = after
            .iter()
            .filter_map(|(at, record)| match record {
                Record::Fault(fault) => Some((at.as_ticks(), fault)),
                _ => None,
            })
            .collect();
        assert!(
            !faults.is_empty(),
            "{way:?}: it was silent, and no fault said so"
        );
        assert!(
            faults
                .iter()
                .all(|(_, fault)| fault.location == Location::SecondSensor),
            "{way:?}: {faults:?}"
        );
        // The failed transfers are counted, and so are the more numerous attempts to recover.
        if matches!(way, ChipFault::Absent | ChipFault::Nack { .. }) {
            let counts = after.iter().rev().find_map(|(_, record)| match record {
                Record::Status(status) => Some((status.bus_errors, status.recoveries)),
                _ => None,
            });
            let (errors, recoveries) = counts.expect("a status");
            assert!(errors > 0 && recoveries > errors, "{way:?}: {counts:?}");
        }
        // The fault lasts until its cause ends, at 800 ms; a dip of the supply is over at once.
        if !matches!(way, ChipFault::BrownOut(_)) {
            let ended_us: Vec<u64> = faults
                .iter()
                .filter(|(_, fault)| !fault.active)
                .map(|(at_us, _)| *at_us)
                .collect();
            assert_eq!(2 * ended_us.len(), faults.len(), "{way:?}: {faults:?}");
            assert!(
                ended_us.iter().all(|at_us| *at_us >= 800_000),
                "{way:?}: {faults:?}"
            );
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_records() {
    let run = || {
        let hardware = Wiring::new(world());
        let mut board = NativeBoard::new(&hardware);
        board.run_until(Time::from_ms(300)).unwrap();
        board.take_records()
    };
    let (here, there) = (run(), std::thread::spawn(run).join().unwrap());
    assert_eq!(here, there);
}

/// The current's zero must be measured without current, but a current still flows for a moment
/// after the bridge has gone off.
#[test]
fn a_coil_that_is_tested_anew_under_current_has_the_same_zero() {
    let hardware = Wiring::new(world());
    let mut board = NativeBoard::new(&hardware);
    board.run_until(Time::from_ms(300)).unwrap();
    board.send(Command::SetCoil(COIL)).unwrap();
    board.send(Command::Arm).unwrap();
    let mut zeros_v = Vec::new();
    for index in 0..12 {
        board.run_until(board.now() + Time::from_ms(100)).unwrap();
        let records = board.take_records();
        let tested = records.iter().find_map(|(_, record)| match record {
            Record::CoilTest(test) => Some(test.zero_v),
            _ => None,
        });
        zeros_v.push(tested.unwrap());
        let drive = DriveCoil {
            to_a: 10.0,
            over_s: 0.0,
            trace_interval_s: 0.0,
        };
        board.send(Command::DriveCoil(drive)).unwrap();
        board
            .run_until(board.now() + Time::from_us(5_000 + 83 * index))
            .unwrap();
        board.send(Command::Disarm).unwrap();
        board.send(Command::Arm).unwrap();
    }
    // Half a count of the converter, to which the zero is rounded.
    for zero_v in &zeros_v {
        assert!((zero_v - zeros_v[0]).abs() < 0.41e-3, "{zeros_v:?}");
    }
}

/// The flash outlives a restart, and the board.
#[test]
fn what_is_stored_is_in_force_after_a_restart_and_on_the_next_board() {
    let stored = Settings {
        ramps: 7,
        ..default_settings()
    };
    let ramps_in_force = |board: &mut NativeBoard<'_>| {
        board.take_records();
        board.send(Command::GetSettings).unwrap();
        board.run_until(board.now() + Time::from_ms(10)).unwrap();
        let records = board.take_records();
        let mut settings = records.iter().filter_map(|(_, record)| match record {
            Record::Settings(settings) => Some(settings.ramps),
            _ => None,
        });
        settings.next().unwrap()
    };
    let hardware = Wiring::new(world());
    let mut board = NativeBoard::new(&hardware);
    board.send(Command::SetSettings(stored.clone())).unwrap();
    board.send(Command::Store).unwrap();
    board.run_until(board.now() + Time::from_ms(100)).unwrap();
    let target = RebootTarget::Firmware;
    board.send(Command::Reboot(Reboot { target })).unwrap();
    board.run_until(board.now() + Time::from_ms(600)).unwrap();
    assert_eq!(board.boot_id(), FIRST_BOOT_ID + 1);
    assert_eq!(ramps_in_force(&mut board), stored.ramps);
    drop(board);
    assert_eq!(
        ramps_in_force(&mut NativeBoard::new(&hardware)),
        stored.ramps
    );
}
