//! The native board alone.

use ldc161x_sim::{ChipFault, FaultEvent, Lost};
use palpate_sim::Time;
use palpate_sim::device::{Device, TimedRecord};
use palpate_sim::native::{NativeBoard, Wiring, default_settings};
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_wire::code::{FaultCode, Location, Outcome, State};
use palpate_wire::command::{Coil, CurrentCorrection, DriveCoil};
use palpate_wire::record::{CurrentTrace, Fault, Sample};
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

#[test]
fn several_channels_come_scan_by_scan() {
    let hardware = Wiring::new(world());
    let mut board = NativeBoard::new(&hardware);
    let settings = palpate_wire::command::Settings {
        channels: 0b1111,
        rate_hz: 100.0,
        ..default_settings()
    };
    board.send(Command::SetSettings(settings)).unwrap();
    // The converter's start takes five scans of 10 ms each.
    board.run_until(Time::from_ms(350)).unwrap();
    let records = board.take_records();
    let scans: Vec<_> = records
        .iter()
        .filter_map(|(at, record)| match record {
            Record::Sample(sample) if sample.channels.len() == 4 => Some((at.as_ticks(), sample)),
            _ => None,
        })
        .collect();
    assert!(scans.len() > 20);
    for (_, scan) in &scans {
        assert!(
            scan.channels
                .is_sorted_by_key(|conversion| conversion.offset_us)
        );
        // Channels 1 to 3 are not connected: the board reports them without a count.
        assert_eq!(scan.channels[3].word & 0x0FFF_FFFF, 0);
    }
    let steps = scans.windows(2).map(|pair| pair[1].0 - pair[0].0);
    let steps: Vec<u64> = steps.collect();
    assert!(
        steps.iter().all(|step| (9_000..=10_100).contains(step)),
        "{steps:?}"
    );
}

/// The conversion in progress when the command arrives used another clock: as a baseline of the new
/// settings it would be wrong by a sixth.
#[test]
fn no_sample_of_the_old_settings_follows_the_answer() {
    let mut channels_after = Vec::new();
    for phase_us in [300, 2_300, 5_300, 9_300] {
        let hardware = Wiring::new(world());
        let mut board = NativeBoard::new(&hardware);
        let settings = |channels| palpate_wire::command::Settings {
            channels,
            rate_hz: 100.0,
            ..default_settings()
        };
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
    let settings = |channels| palpate_wire::command::Settings {
        channels,
        rate_hz: 100.0,
        ..default_settings()
    };
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
        let settings = palpate_wire::command::Settings {
            channels: 0b0010,
            rate_hz,
            ..default_settings()
        };
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
            let settings = palpate_wire::command::Settings {
                rate_hz,
                ..default_settings()
            };
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
        let settings = palpate_wire::command::Settings {
            rate_hz: 500.0,
            ..default_settings()
        };
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
        let even = first.windows(2).all(|pair| {
            let [(before, _), (after, _)] = pair else {
                return false;
            };
            (1_980..=2_002).contains(&(after - before))
        });
        assert!(even, "{way:?}");
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

/// A drive has only its measurement: its non-linearity, 51 mA at most, bends the true current.
#[test]
fn a_line_of_the_current_is_straight_as_it_is_measured() {
    let stack = Stack::builtin("ultrasoft").unwrap();
    let plant = draw(&stack, &Disturbances::builtin().unwrap(), 1);
    let switches = Switches::none()
        .with("adc_nonlinearity", true)
        .with("current_gain", true);
    let world = World::new(&plant, switches, Setup::default()).unwrap();
    let hardware = Wiring::new(world);
    let mut board = NativeBoard::new(&hardware);
    board.send(Command::SetCoil(COIL)).unwrap();
    board.run_until(Time::from_ms(100)).unwrap();
    board.send(Command::Arm).unwrap();
    let line = |to_a, over_s| {
        Command::DriveCoil(DriveCoil {
            to_a,
            over_s,
            trace_interval_s: 0.0,
        })
    };
    board.send(line(10.0, 0.0)).unwrap();
    board.run_until(board.now() + Time::from_ms(10)).unwrap();
    board.send(line(0.0, 0.06)).unwrap();
    board.take_records();
    let begin = board.now();
    board.run_until(begin + Time::from_ms(58)).unwrap();
    let currents: Vec<[f64; 2]> = board
        .take_records()
        .iter()
        .filter_map(|(at, record)| match record {
            Record::Sample(sample) => Some([
                at.as_ticks() as f64 * 1e-6,
                sample.current_a.unwrap().into(),
            ]),
            _ => None,
        })
        .filter(|[at_s, _]| *at_s > begin.as_secs_f64() + 1e-3)
        .collect();
    assert!(currents.len() > 50);
    let ([t0, a0], [t1, a1]) = (currents[0], currents[currents.len() - 1]);
    assert!((a0 - a1) > 9.0, "{a0} {a1}");
    for [at_s, current_a] in currents {
        let straight_a = a0 + (a1 - a0) * (at_s - t0) / (t1 - t0);
        let off_a = current_a - straight_a;
        // The limit is a tenth of the non-linearity; the control law itself contributes 3 mA.
        assert!(off_a.abs() < 5e-3, "{current_a} A: {off_a}");
    }
}

/// Drives an armed board to 8 A within 20 ms, with its own current recorded every quarter of a
/// millisecond.
fn with_recorded_current(board: &mut NativeBoard<'_>) -> u64 {
    board.run_until(board.now() + Time::from_ms(300)).unwrap();
    board.send(Command::SetCoil(COIL)).unwrap();
    board.send(Command::Arm).unwrap();
    board.run_until(board.now() + Time::from_ms(100)).unwrap();
    board.take_records();
    let begun = board.now();
    let drive = DriveCoil {
        to_a: 8.0,
        over_s: 20e-3,
        trace_interval_s: 250e-6,
    };
    board.send(Command::DriveCoil(drive)).unwrap();
    board.run_until(begun + Time::from_ms(90)).unwrap();
    (begun.as_secs_f64() * 1e6) as u64
}

#[test]
fn a_recorded_current_is_the_one_that_flowed() {
    let hardware = Wiring::new(world());
    let mut board = NativeBoard::new(&hardware);
    let begun_us = with_recorded_current(&mut board);
    let parts: Vec<(u64, CurrentTrace)> = board
        .take_records()
        .into_iter()
        .filter_map(|(at, record)| match record {
            Record::CurrentTrace(part) => Some((at.as_ticks(), part)),
            _ => None,
        })
        .collect();
    let firsts: Vec<u8> = parts.iter().map(|(_, part)| part.first).collect();
    assert_eq!(firsts, [0, 16, 32, 48, 64, 80, 96, 112]);
    let mut off_a = Vec::new();
    for (at_us, part) in &parts {
        assert_eq!(part.total, 128);
        // Whole periods of 16 us.
        assert!((part.interval_s - 256e-6).abs() < 1e-9);
        for (index, current_a) in part.currents_a.iter().enumerate() {
            let after_s = (at_us - begun_us) as f64 * 1e-6 + 256e-6 * index as f64;
            // The bridge wakes up first.
            let setpoint_a = (8.0 * (after_s - 2e-3) / 20e-3).clamp(0.0, 8.0);
            off_a.push(f64::from(*current_a) - setpoint_a);
        }
    }
    assert!(off_a.iter().all(|off_a| off_a.abs() < 0.3), "{off_a:?}");
    // The rise takes 78 intervals, after the first 8; one interval more or less would be 0.1 A.
    let mean_a = off_a[8..86].iter().sum::<f64>() / 78.0;
    assert!(mean_a.abs() < 0.05, "{mean_a}");
}

/// The measurement reads low by 3 % of its reading: after the correction, the regulated current is
/// 3 % lower at the same setpoint.
#[test]
fn a_correction_moves_the_true_current() {
    let current_a = |correction: Option<CurrentCorrection>| {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let plant = draw(&stack, &Disturbances::builtin().unwrap(), 1);
        let world = World::new(&plant, Switches::none(), Setup::default()).unwrap();
        let hardware = Wiring::new(world);
        let mut board = NativeBoard::new(&hardware);
        if let Some(correction) = correction {
            board
                .send(Command::SetCurrentCorrection(correction))
                .unwrap();
        }
        with_recorded_current(&mut board);
        board.with_world(|world| world.truth().current_a)
    };
    let changes_a = [-0.3, 0.0, 0.3].into_iter().collect();
    let corrected_a = current_a(Some(CurrentCorrection {
        greatest_a: 10.0,
        changes_a,
    }));
    let plain_a = current_a(None);
    assert!((plain_a - 8.0).abs() < 0.05, "{plain_a}");
    assert!((corrected_a * 1.03 - plain_a).abs() < 0.02, "{corrected_a}");
}

/// Answers received so far, each with its command's number.
fn answers(board: &mut NativeBoard<'_>) -> Vec<(u32, Outcome)> {
    let records = board.take_records();
    let answers = records.iter().filter_map(|(_, record)| match record {
        Record::Acknowledgement(answer) => Some((answer.command, answer.outcome)),
        _ => None,
    });
    answers.collect()
}

/// The queue belongs to the procedure: the native board behaves as the image does
/// (`one_command_waits_for_the_test_and_each_has_one_answer` in
/// `sim-host/emulator/tests/integration/coil.rs`).
#[test]
fn one_command_waits_for_the_coils_test_and_an_abort_drops_it() {
    let hardware = Wiring::new(world());
    let drive = |to_a| {
        Command::DriveCoil(DriveCoil {
            to_a,
            over_s: 0.0,
            trace_interval_s: 0.0,
        })
    };
    let testing = || {
        let mut board = NativeBoard::new(&hardware);
        board.run_until(board.now() + Time::from_ms(300)).unwrap();
        board.send(Command::SetCoil(COIL)).unwrap();
        board.send(Command::Arm).unwrap();
        board.take_records();
        board
    };
    let run = |board: &mut NativeBoard<'_>, ms| {
        let end = board.now() + Time::from_ms(ms);
        board.run_until(end).unwrap();
    };
    let mut board = testing();
    let one = board.post(drive(2.0));
    let two = board.post(drive(4.0));
    assert_eq!(answers(&mut board), [(two, Outcome::Busy)]);
    run(&mut board, 70);
    assert_eq!(answers(&mut board), [(one, Outcome::Accepted)]);
    let flows_a = board.with_world(|world| world.truth().current_a);
    assert!((flows_a - 2.0).abs() < 0.1, "{flows_a}");
    board.send(Command::Abort).unwrap();
    drop(board);

    let mut board = testing();
    let one = board.post(drive(2.0));
    let abort = board.post(Command::Abort);
    assert_eq!(
        answers(&mut board),
        [(one, Outcome::Aborted), (abort, Outcome::Accepted)]
    );
    run(&mut board, 300);
    assert_eq!(answers(&mut board), []);
    let flows_a = board.with_world(|world| world.truth().current_a);
    assert_eq!(flows_a, 0.0);
}

/// Temperature that the board reports after a second, degrees Celsius, and the true one.
fn temperatures(nonlinearity_lsb: f64) -> [f64; 2] {
    let stack = Stack::builtin("ultrasoft").unwrap();
    let mut plant = draw(&stack, &Disturbances::builtin().unwrap(), 1);
    plant.current.nonlinearity_lsb = nonlinearity_lsb;
    plant.current.nonlinearity_phase = 1.5;
    let world = World::new(&plant, Switches::all(), Setup::default()).unwrap();
    let hardware = Wiring::new(world);
    let mut board = NativeBoard::new(&hardware);
    board.run_until(Time::from_ms(1_200)).unwrap();
    let records = board.take_records();
    let reported_c = records.iter().rev().find_map(|(_, record)| match record {
        Record::Status(status) => status.temperature_c,
        _ => None,
    });
    let true_c = hardware.world().borrow().truth().pad_c;
    [reported_c.unwrap().into(), true_c]
}

#[test]
fn the_thermometer_is_read_through_the_converter_of_the_current() {
    let error_k = |nonlinearity_lsb| {
        let [reported_c, true_c] = temperatures(nonlinearity_lsb);
        (reported_c - true_c).abs()
    };
    let (exact_k, bowed_k) = (error_k(0.0), error_k(100.0));
    assert!(exact_k < 0.15, "{exact_k}");
    // A hundred counts in mid-range, where a count is 0.022 K.
    assert!((1.5..3.0).contains(&bowed_k), "{bowed_k}");
}

/// The current's zero is measured without current; where the bridge went off just before, a current
/// still flows for a moment.
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
