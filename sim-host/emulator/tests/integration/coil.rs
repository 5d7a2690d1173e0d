//! Coil drive of the image: on the circuit, through PWM, ADC and DMA.

use std::ops::RangeInclusive;

use crate::common::driven::{PERIOD, bend, steps, telemetry, wired};
use crate::common::{RecordedBoard, coil, image, streaming};
use palpate_emulator::{Options, Plant, PlantConditions, Time};
use palpate_sim::electrical::Circuit;
use palpate_wire::code::{FaultCode, Outcome, RefusalReason, State, Stream};
use palpate_wire::command::{ClearFault, DriveCoil};
use palpate_wire::record::CoilTest;
use palpate_wire::{Command, Frame, Message, Record};

/// Exception number of the control interrupt, PWM_IRQ_WRAP.
const CONTROL: u32 = 16 + 4;
/// Exception numbers of the converter's bus, which may preempt the control interrupt: IO_IRQ_BANK0
/// and I2C0_IRQ.
const EDGE: u32 = 16 + 13;
const I2C: u32 = 16 + 23;

fn drive(to_a: f32, over_s: f32) -> Command {
    Command::DriveCoil(DriveCoil {
        to_a,
        over_s,
        trace_interval_s: 0.0,
    })
}

fn coil_test(frames: &[Frame<Record>]) -> Option<&CoilTest> {
    frames.iter().find_map(|frame| match &frame.message {
        Record::CoilTest(found) => Some(found),
        _ => None,
    })
}

/// A bench that is armed, after the self-test.
fn armed() -> RecordedBoard {
    armed_on(streaming())
}

fn armed_on(mut bench: RecordedBoard) -> RecordedBoard {
    let before = bench.frames.len();
    for command in [Command::SetCoil(coil()), Command::Arm] {
        assert_eq!(bench.command(&command).outcome, Outcome::Accepted);
    }
    for _ in 0..300 {
        if coil_test(&bench.frames[before..]).is_some() {
            return bench;
        }
        bench.run(Time::from_ms(1));
    }
    panic!("the self-test does not end");
}

fn driving(to_a: f32) -> RecordedBoard {
    let mut bench = armed();
    assert_eq!(bench.command(&drive(to_a, 0.0)).outcome, Outcome::Accepted);
    bench.run(Time::from_ms(5));
    bench
}

/// True mean current over a time, while the PC sends commands now and then.
fn mean_a<P: Plant>(bench: &mut RecordedBoard<P>, time: Time) -> f64 {
    let before = bench.board.totals();
    bench.run(time);
    let after = bench.board.totals();
    (after.charge_a_s - before.charge_a_s) / (after.time_s - before.time_s)
}

fn fault(bench: &RecordedBoard) -> Option<FaultCode> {
    bench.faults().last().map(|fault| fault.code)
}

#[test]
fn the_self_test_finds_the_circuit() {
    let bench = armed();
    let found = coil_test(&bench.frames).unwrap();
    // 0.389 ohm of coil and 0.07 ohm of bridge always; 50 milliohm of supply while it drives.
    assert!((0.44..0.52).contains(&found.resistance_ohm), "{found:?}");
    assert!((found.inductance_h / 40e-6 - 1.0).abs() < 0.05, "{found:?}");
    assert!((found.limited_to_a.unwrap() - 2.0).abs() < 0.5, "{found:?}");
    assert_eq!(bench.board.current_a(), 0.0);
}

#[test]
fn the_current_is_what_was_commanded() {
    let mut bench = armed();
    for to_a in [0.5_f32, 2.0, 5.0, 8.0, 9.9, -3.0, 1.0] {
        bench.command(&drive(to_a, 1e-3));
        bench.run(Time::from_ms(5));
        let mean_a = mean_a(&mut bench, Time::from_ms(20));
        // Far within 2 % of 10 A: this converter is exact except for four wide codes.
        assert!((mean_a - f64::from(to_a)).abs() < 0.05, "{to_a}: {mean_a}");
    }
    bench.command(&Command::Abort);
    bench.run(Time::from_ms(1));
    assert_eq!(bench.board.current_a(), 0.0);
    assert!(bench.faults().is_empty());
}

/// Wake-up times from the data sheets, up to the limit of the firmware.
#[test]
fn a_bridge_that_wakes_slowly_is_driven_without_overshoot_and_without_a_fault() {
    for wake_s in [0.8e-3, 1e-3, 2e-3] {
        let bridge = palpate_emulator::BridgeCircuit {
            wake_s,
            ..palpate_emulator::BridgeCircuit::default()
        };
        let mut bench = wired(PlantConditions::default(), bridge, 1);
        bench.arm();
        for (to_a, over_s) in [(1.0, 1e-3), (1.0, 0.0), (8.0, 5e-3)] {
            bench.board.circuit_mut().forget_peak();
            assert_eq!(
                bench.command(&drive(to_a, over_s)).outcome,
                Outcome::Accepted
            );
            bench.run(Time::from_ms(15));
            let mean_a = mean_a(&mut bench, Time::from_ms(5));
            let (peak_a, _) = bench.board.circuit().peak();
            assert!(
                bench.faults().is_empty(),
                "{wake_s} s: {:?}",
                bench.faults()
            );
            assert!(
                (mean_a - f64::from(to_a)).abs() < 0.1,
                "{wake_s} s: {mean_a} A"
            );
            // At most 1 A of ripple and of the overshoot of a step.
            assert!(peak_a < f64::from(to_a) + 1.0, "{wake_s} s: {peak_a} A");
            bench.command(&Command::Abort);
            bench.run(Time::from_ms(5));
        }
    }
}

#[test]
fn a_single_wild_sample_of_the_converter_ends_nothing() {
    let mut bench = driving(5.0);
    for wild_v in [0.0, 3.3, 3.3] {
        bench.board.drive_mut().wild_v = Some(wild_v);
        let mean_a = mean_a(&mut bench, Time::from_ms(5));
        assert_eq!(bench.board.drive_mut().wild_v, None, "it was converted");
        assert!((mean_a - 5.0).abs() < 0.1, "{mean_a}");
        assert_eq!(fault(&bench), None);
        bench.command(&drive(5.0, 0.0));
    }
}

/// A refusal reports the field, its value and its limit; a fault of the current or of the supply
/// reports the measured value.
#[test]
fn what_is_refused_and_what_fails_says_its_numbers() {
    let mut bench = driving(5.0);
    let answer = bench.command(&drive(11.0, 0.0));
    assert_eq!(answer.outcome, Outcome::OutOfRange);
    assert_eq!(
        (answer.field, answer.value, answer.low, answer.high),
        (Some(0), Some(11.0), Some(-10.0), Some(10.0))
    );
    bench.board.drive_mut().amplifier_v = Some(1.65 + 0.125 * 12.9);
    bench.run(Time::from_ms(5));
    let faults = bench.faults();
    let failed = faults.last().expect("a fault");
    assert_eq!(failed.code, FaultCode::OverCurrent);
    let value_a = failed.value.expect("a current");
    assert!(
        (value_a - 12.9).abs() < 0.1 && failed.limit == Some(12.7),
        "{failed:?}"
    );
}

#[test]
fn conversions_get_the_mean_of_their_own_window() {
    let mut bench = armed();
    bench.command(&drive(8.0, 1e-3));
    bench.run(Time::from_ms(10));
    bench.command(&drive(1.0, 0.06));
    bench.frames.clear();
    // The true current, every 10 us.
    let mut truth = Vec::new();
    for _ in 0..5_000 {
        bench.board.run_for(Time::from_us(10)).unwrap();
        let totals = bench.board.totals();
        truth.push((bench.board.now(), totals.charge_a_s));
    }
    bench.listen();
    let charge_at = |time: Time| {
        let after = truth.partition_point(|(at, _)| *at < time);
        let (before, after) = (truth.get(after.checked_sub(1)?)?, truth.get(after)?);
        let part = (time - before.0).as_secs_f64() / (after.0 - before.0).as_secs_f64();
        Some(before.1 + part * (after.1 - before.1))
    };
    // A record's time is the middle of its conversion, by the device's clock; the start of that
    // clock after power on is fitted.
    let half = Time::from_us(496);
    let worst_a = |offset_us: u64| {
        let mut worst_a = (0.0_f64, 0);
        for (time_us, sample) in bench.samples() {
            let middle = Time::from_us(time_us + offset_us);
            let window = (charge_at(middle - half), charge_at(middle + half));
            let ((Some(begin), Some(end)), Some(reported_a)) = (window, sample.current_a) else {
                continue;
            };
            let true_a = (end - begin) / (half + half).as_secs_f64();
            worst_a = (
                worst_a.0.max((f64::from(reported_a) - true_a).abs()),
                worst_a.1 + 1,
            );
        }
        worst_a
    };
    let (worst_a, compared) = (0..8_000)
        .map(|step| worst_a(10 * step))
        .filter(|(_, compared)| *compared > 30)
        .min_by(|one, other| one.0.total_cmp(&other.0))
        .expect("conversions within the ramp");
    println!("{compared} windows, worst {:.1} mA", 1e3 * worst_a);
    // A coil of 40 uH and half an ohm at 12 V, at 5 A: 0.9 A of ripple, peak to peak.
    let at_5_a = bench.samples().find_map(|(_, sample)| {
        let near = (sample.current_a? - 5.0).abs() < 0.2;
        near.then_some(sample.ripple_a?)
    });
    let ripple_a = at_5_a.expect("a conversion on the way");
    assert!((ripple_a - 0.9 / 12_f32.sqrt()).abs() < 0.05, "{ripple_a}");
    // 0.2 % of 10 A are 20 mA; half a wide code is 26 mA.
    assert!(worst_a < 0.03, "{worst_a}");
}

#[test]
fn a_step_takes_what_the_circuit_allows_and_two_periods() {
    let step = steps(&mut armed(), 9.0, 16);
    println!("{step:?}");
    assert!(step.took <= step.possible + PERIOD + PERIOD, "{step:?}");
    assert!(step.overshoot <= 0.02, "{step:?}");
}

/// One corner of the campaign `coil-current`.
#[test]
fn a_weak_supply_and_much_inductance_need_no_retuning() {
    let conditions = PlantConditions {
        coil_ohm: 1.4 * 0.389,
        inductance_h: 200e-6,
        supply_v: 5.0,
        ..PlantConditions::default()
    };
    let mut bench = wired(conditions, palpate_emulator::BridgeCircuit::default(), 1);
    bench.arm();
    let step = steps(&mut bench, 6.0, 2);
    println!("{step:?}");
    assert!(step.took <= step.possible + PERIOD + PERIOD, "{step:?}");
    assert!(step.overshoot <= 0.02, "{step:?}");
    let bend = bend(&mut bench, 6.0, 0.03);
    println!("bend: {:.2} %", 100.0 * bend);
    assert!(bend <= 0.005, "{bend}");
}

#[test]
fn a_silent_host_ends_it_after_a_tenth_of_a_second() {
    let mut bench = driving(3.0);
    bench.command(&Command::GetSettings);
    let since = bench.board.now();
    let mut died = None;
    while died.is_none() && bench.board.now() - since < Time::from_ms(200) {
        bench.run(Time::from_us(500));
        died = (bench.board.current_a() == 0.0).then(|| bench.board.now() - since);
    }
    let took = died.expect("it ends");
    // Includes up to 2 ms for the answer to the last command.
    assert!(
        took > Time::from_ms(97) && took < Time::from_ms(103),
        "{took}"
    );
    bench.run(Time::from_ms(5));
    assert_eq!(fault(&bench), Some(FaultCode::HostSilent));
    assert_eq!(bench.command(&drive(1.0, 0.0)).outcome, Outcome::Faulted);
}

/// Runs for a time, and repeats a change of the circuit as often as the plant restores its values.
fn disturbed(bench: &mut RecordedBoard, time: Time, change: impl Fn(&mut Circuit)) {
    let end = bench.board.now() + time;
    while bench.board.now() < end {
        change(bench.board.circuit_mut());
        bench.board.run_for(Time::from_us(8)).unwrap();
    }
    bench.listen();
}

#[test]
fn a_dead_short_lets_little_through() {
    let mut bench = driving(5.0);
    bench.board.circuit_mut().forget_peak();
    let before = bench.board.totals();
    disturbed(&mut bench, Time::from_ms(2), |circuit| {
        circuit.parameters.coil_ohm = 10e-3;
        circuit.parameters.inductance_h = 2e-6;
    });
    assert!(!bench.board.bridge().awake);
    let (peak_a, _) = bench.board.circuit().peak();
    let energy_j = bench.board.totals().supply_j - before.supply_j;
    println!("dead short: peak {peak_a:.1} A, {:.1} mJ", 1e3 * energy_j);
    assert!(peak_a < 25.0, "{peak_a} A");
    assert!(energy_j < 0.02, "{energy_j} J");
    bench.run(Time::from_ms(5));
    let code = fault(&bench).unwrap();
    assert!(
        matches!(code, FaultCode::OverCurrent | FaultCode::Bridge),
        "{code}"
    );
    // Cleared, armed and tested again, the coil is driven.
    bench.command(&Command::ClearFault(ClearFault { code }));
    bench.run(Time::from_ms(300));
    let mut bench = armed_on(bench);
    bench.command(&drive(2.0, 0.0));
    bench.run(Time::from_ms(5));
    let again_a = mean_a(&mut bench, Time::from_ms(5));
    assert!((again_a - 2.0).abs() < 0.05, "{again_a}");
}

#[test]
fn an_open_coil_is_found_by_the_test_and_while_it_is_driven() {
    let mut bench = driving(3.0);
    disturbed(&mut bench, Time::from_ms(4), |circuit| {
        circuit.parameters.coil_ohm = 1e4;
    });
    bench.run(Time::from_ms(5));
    assert_eq!(fault(&bench), Some(FaultCode::CurrentMissing));
    let mut bench = streaming();
    bench.command(&Command::SetCoil(coil()));
    bench.command(&Command::Arm);
    disturbed(&mut bench, Time::from_ms(100), |circuit| {
        circuit.parameters.coil_ohm = 1e4;
    });
    bench.run(Time::from_ms(5));
    assert_eq!(fault(&bench), Some(FaultCode::CoilOpen));
}

/// Time until the bridge is off, while the PC sends commands now and then, and the greatest
/// difference of the true current from its target meanwhile.
fn off_after(bench: &mut RecordedBoard, target_a: f64, limit: Time) -> (Time, f64) {
    let begin = bench.board.now();
    let mut off_a = 0.0_f64;
    while bench.board.bridge().awake {
        assert!(bench.board.now() - begin < limit, "it stays on");
        if (bench.board.now() - begin).as_ps() % 40_000_000_000 < 1_000_000_000 {
            bench.send(&Command::GetSettings);
        }
        bench.run(Time::from_us(500));
        if bench.board.bridge().awake {
            off_a = off_a.max((bench.board.current_a() - target_a).abs());
        }
    }
    let took = bench.board.now() - begin;
    bench.run(Time::from_ms(5));
    assert_eq!(bench.board.current_a(), 0.0);
    (took, off_a)
}

/// A loose wire: no current flows while the coil's temperature is unknown.
#[test]
fn a_thermometer_that_is_open_now_and_then_switches_off() {
    let snapshot = driving(5.0);
    for open_ms in [1, 5, 9] {
        let mut bench = snapshot.clone();
        let begin = bench.board.now();
        for _ in 0..40 {
            for thermistor_v in [Some(3.3), None] {
                bench.board.drive_mut().thermistor_v = thermistor_v;
                bench.send(&Command::Identify);
                bench.run(Time::from_ms(open_ms));
            }
            if !bench.board.bridge().awake {
                break;
            }
        }
        let took = bench.board.now() - begin;
        println!("open for {open_ms} ms of twice as many: off after {took}");
        assert!(!bench.board.bridge().awake, "{open_ms} ms");
        assert!(took <= Time::from_ms(120), "{took}");
        assert_eq!(fault(&bench), Some(FaultCode::Thermometer));
    }
}

#[test]
fn a_thermometer_that_opens_or_shorts_switches_off_within_25_ms() {
    let snapshot = driving(5.0);
    for volts in [3.3, 0.0] {
        let mut bench = snapshot.clone();
        bench.board.drive_mut().thermistor_v = Some(volts);
        let (took, _) = off_after(&mut bench, 5.0, Time::from_ms(100));
        println!("thermometer at {volts} V: off after {took}");
        assert!(
            took >= Time::from_ms(19) && took <= Time::from_ms(25),
            "{took}"
        );
        assert_eq!(fault(&bench), Some(FaultCode::Thermometer));
        // Cleared while its cause lasts, the fault returns; without its cause, it does not.
        let clear = Command::ClearFault(ClearFault {
            code: FaultCode::Thermometer,
        });
        assert_eq!(bench.command(&clear).outcome, Outcome::Accepted);
        bench.run(Time::from_ms(200));
        assert!(bench.faults().last().is_some_and(|fault| fault.active));
        bench.board.drive_mut().thermistor_v = None;
        bench.run(Time::from_ms(50));
        assert_eq!(bench.command(&clear).outcome, Outcome::Accepted);
        bench.run(Time::from_ms(300));
        assert!(bench.faults().last().is_some_and(|fault| !fault.active));
        let temperature_c = bench.status().temperature_c.expect("a temperature");
        assert!((temperature_c - 25.0).abs() < 1.0, "{temperature_c}");
    }
}

#[test]
fn a_board_without_coil_needs_no_thermometer_and_one_with_a_coil_does() {
    let mut bench = streaming();
    bench.board.drive_mut().thermistor_v = Some(3.3);
    bench.run(Time::from_ms(500));
    assert_eq!(bench.faults(), []);
    assert_eq!(bench.status().temperature_c, None);
    bench.command(&Command::SetCoil(coil()));
    bench.run(Time::from_ms(250));
    assert_eq!(fault(&bench), Some(FaultCode::Thermometer));
    assert_eq!(bench.command(&Command::Arm).outcome, Outcome::Faulted);
}

#[test]
fn an_amplifier_that_freezes_at_its_target_is_found() {
    let snapshot = driving(5.0);
    for later_ms in [0, 45, 70, 80] {
        let mut bench = snapshot.clone();
        for _ in 0..later_ms / 5 {
            bench.send(&Command::GetSettings);
            bench.run(Time::from_ms(5));
        }
        bench.board.drive_mut().amplifier_v = Some(1.65 + 0.125 * 5.0);
        let (took, off_a) = off_after(&mut bench, 5.0, Time::from_ms(200));
        let code = fault(&bench);
        println!("frozen after {later_ms} ms: {took}, off by {off_a:.2} A, {code:?}");
        assert_eq!(code, Some(FaultCode::CurrentSense));
        assert!(took <= Time::from_ms(174), "{took}");
    }
}

/// From such a result on, each one would be read as another channel's: the thermistor's as the
/// current.
#[test]
fn a_result_that_dma_does_not_get_switches_off_within_two_periods_and_is_got_over() {
    let mut bench = driving(6.0);
    bench.board.read_adc_fifo();
    let begin = bench.board.now();
    bench
        .board
        .run_until(Time::from_ms(1), |board| !board.bridge().awake)
        .unwrap();
    let took = bench.board.now() - begin;
    assert!(took <= PERIOD + PERIOD, "{took}");
    bench.run(Time::from_ms(10));
    assert_eq!(fault(&bench), Some(FaultCode::CurrentSense));
    let clear = Command::ClearFault(ClearFault {
        code: FaultCode::CurrentSense,
    });
    assert_eq!(bench.command(&clear).outcome, Outcome::Accepted);
    // After another test, the current equals the command.
    let before = bench.frames.len();
    assert_eq!(bench.command(&Command::Arm).outcome, Outcome::Accepted);
    bench.run(Time::from_ms(150));
    assert!(coil_test(&bench.frames[before..]).is_some());
    assert_eq!(bench.command(&drive(5.0, 1e-3)).outcome, Outcome::Accepted);
    bench.run(Time::from_ms(5));
    let mean_a = mean_a(&mut bench, Time::from_ms(20));
    assert!((mean_a - 5.0).abs() < 0.05, "{mean_a}");
    let active = bench.faults().iter().filter(|fault| fault.active).count();
    assert_eq!(active, 1, "{:?}", bench.faults());
}

#[test]
fn a_bridge_without_a_limit_is_not_driven() {
    let options = Options {
        drive: palpate_emulator::BridgeCircuit {
            limit_a: f64::INFINITY,
            ..Options::default().drive
        },
        ..crate::common::recording()
    };
    let mut bench = RecordedBoard::with(ldc161x_sim::Settings::default(), options);
    bench.stream();
    bench.command(&Command::SetCoil(coil()));
    bench.command(&Command::Arm);
    bench.run(Time::from_ms(150));
    assert_eq!(fault(&bench), Some(FaultCode::NoHardwareLimit));
    assert_eq!(bench.board.current_a(), 0.0);
    assert_eq!(bench.command(&Command::Arm).outcome, Outcome::Faulted);
}

#[test]
fn the_control_interrupt_keeps_its_time() {
    let _ = image();
    let mut bench = driving(5.0);
    bench.command(&drive(1.0, 0.1));
    let (mut begun, mut longest, mut total) = (Vec::new(), Time::ZERO, Time::ZERO);
    for _ in 0..2_000 {
        let is_in = |board: &palpate_emulator::EmulatedBoard<_>| board.exception() == CONTROL;
        bench.board.run_until(Time::from_us(50), is_in).unwrap();
        let begin = bench.board.now();
        begun.push(begin);
        // Preemption counts: the levels must be written before the period ends.
        bench
            .board
            .run_until(Time::from_us(50), |board| {
                !matches!(board.exception(), CONTROL | EDGE | I2C)
            })
            .unwrap();
        let took = bench.board.now() - begin;
        (longest, total) = (longest.max(took), total + took);
    }
    // Starts of the interrupt relative to a grid of 16 us; the earliest one is not delayed.
    let first = begun[0].as_ps();
    let late = |at: &Time| (at.as_ps() - first + 8_000_000) % 16_000_000;
    let phases: Vec<u64> = begun.iter().map(late).collect();
    let (least, most) = (phases.iter().min().unwrap(), phases.iter().max().unwrap());
    let jitter_us = (most - least) as f64 * 1e-6;
    let periods = (begun[begun.len() - 1].as_ps() - first) as f64 / 16e6;
    let longest_us = longest.as_secs_f64() * 1e6;
    let mean_us = total.as_secs_f64() * 1e6 / begun.len() as f64;
    println!(
        "control interrupt: mean {mean_us:.2} us, longest {longest_us:.2} us, jitter {jitter_us:.2} us"
    );
    assert!((periods - 1_999.0).abs() < 0.5, "{periods}: one was missed");
    // No period is lost as long as the interrupt ends before its next call.
    assert!(jitter_us + longest_us < 14.0, "{jitter_us} {longest_us}");
}

/// A level that misses its wrap takes effect a period late. Two seconds of the campaign
/// `coil-current`, 120 000 periods.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn nothing_is_missed_under_full_telemetry() {
    for stream in [Stream::Samples, Stream::Raw] {
        let mut bench = streaming();
        let found = telemetry(&mut bench, Time::from_ms(1_000), stream);
        println!("{found:?}");
        assert!(found.levels.written > 55_000);
        assert_eq!((found.levels.late, found.lost), (0, 0));
        assert!(found.levels.longest_gap < Time::from_us(24), "{found:?}");
        assert!(found.samples > 990);
        assert!(found.worst <= Time::from_us(10), "{}", found.worst);
    }
}

/// Answers since a frame, each with its command's kind.
fn answers(bench: &RecordedBoard, from: usize) -> Vec<(u8, Outcome)> {
    let of = |frame: &Frame<Record>| match &frame.message {
        Record::Acknowledgement(answer) => Some((answer.kind, answer.outcome)),
        _ => None,
    };
    bench.frames[from..].iter().filter_map(of).collect()
}

fn tests_reported(bench: &RecordedBoard, from: usize) -> usize {
    let is_test = |frame: &&Frame<Record>| matches!(frame.message, Record::CoilTest(_));
    bench.frames[from..].iter().filter(is_test).count()
}

/// A bench within the test that arming starts.
fn testing() -> RecordedBoard {
    let mut bench = streaming();
    for command in [Command::SetCoil(coil()), Command::Arm] {
        assert_eq!(bench.command(&command).outcome, Outcome::Accepted);
    }
    bench.run(Time::from_ms(5));
    bench
}

#[test]
fn one_command_waits_for_the_test_and_each_has_one_answer() {
    let mut bench = testing();
    let from = bench.frames.len();
    bench.send(&drive(2.0, 0.0));
    bench.send(&drive(4.0, 0.0));
    bench.run(Time::from_ms(10));
    let kind = drive(1.0, 0.0).kind();
    assert_eq!(answers(&bench, from), [(kind, Outcome::Busy)]);
    bench.run(Time::from_ms(80));
    assert_eq!(
        answers(&bench, from)[1..],
        [(kind, Outcome::Accepted)],
        "{:?}",
        bench.faults()
    );
    let flows_a = mean_a(&mut bench, Time::from_ms(10));
    assert!((flows_a - 2.0).abs() < 0.05, "{flows_a}");
}

#[test]
fn an_abort_during_the_test_stops_it_and_drops_what_waits() {
    for stop in [Command::Abort, Command::Disarm, Command::SensingOnly] {
        let mut bench = testing();
        let from = bench.frames.len();
        bench.send(&drive(3.0, 0.0));
        bench.run(Time::from_ms(5));
        assert_eq!(bench.command(&stop).outcome, Outcome::Accepted);
        let kind = drive(1.0, 0.0).kind();
        assert_eq!(
            answers(&bench, from),
            [(kind, Outcome::Aborted), (stop.kind(), Outcome::Accepted)]
        );
        for _ in 0..300 {
            bench.run(Time::from_ms(1));
            assert!(!bench.board.bridge().awake);
        }
        assert_eq!(bench.board.current_a(), 0.0);
        assert_eq!(tests_reported(&bench, from), 0);
        assert!(bench.faults().is_empty(), "{:?}", bench.faults());
    }
    // The drive is still armed, and the coil is tested again before it is driven.
    let mut bench = testing();
    bench.command(&Command::Abort);
    let from = bench.frames.len();
    assert_eq!(bench.command(&drive(2.0, 0.0)).outcome, Outcome::Accepted);
    assert_eq!(tests_reported(&bench, from), 1);
    // The bridge wakes up.
    bench.run(Time::from_ms(3));
    let flows_a = mean_a(&mut bench, Time::from_ms(20));
    assert!((flows_a - 2.0).abs() < 0.2, "{flows_a}");
}

#[test]
fn a_test_is_reported_once_however_much_is_driven_after_it() {
    let mut bench = armed();
    for to_a in [1.0, 2.0, 3.0] {
        bench.command(&drive(to_a, 0.0));
        bench.run(Time::from_ms(5));
        bench.command(&Command::Abort);
        bench.run(Time::from_ms(20));
    }
    assert_eq!(tests_reported(&bench, 0), 1);
    bench.command(&Command::TestCoil);
    bench.run(Time::from_ms(100));
    assert_eq!(tests_reported(&bench, 0), 2);
}

/// A change of the circuit.
type CircuitChange = fn(&mut Circuit);

/// A supply that fails at once, and one that drops only under load.
#[test]
fn a_supply_that_collapses_is_reported_as_that() {
    let snapshot = driving(5.0);
    let collapses: [(&str, CircuitChange); 3] = [
        ("0 V", |circuit| circuit.parameters.supply_v = 0.0),
        ("3 V", |circuit| circuit.parameters.supply_v = 3.0),
        ("3 ohm", |circuit| circuit.parameters.supply_ohm = 3.0),
    ];
    for (what, change) in collapses {
        let mut bench = snapshot.clone();
        bench.board.circuit_mut().forget_peak();
        disturbed(&mut bench, Time::from_ms(12), change);
        bench.run(Time::from_ms(5));
        let fault = bench.faults().pop();
        println!("{what}: {fault:?}");
        let fault = fault.unwrap_or_else(|| panic!("{what}: no fault"));
        assert_eq!(fault.code, FaultCode::SupplyLow, "{what}: {fault:?}");
        assert!(fault.value < fault.limit, "{what}: {fault:?}");
        assert!(!bench.board.bridge().awake, "{what}");
    }
}

/// A train takes 34 J of a capacity of 56 J, with a cooling of 3.5 W. The test `energy` of
/// `palpate-procedure` covers the same without the image.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_second_train_soon_after_the_first_is_refused_with_the_time_to_wait() {
    let conditions = PlantConditions {
        coil_ohm: 0.48,
        ..PlantConditions::default()
    };
    let mut bench = wired(conditions, palpate_emulator::BridgeCircuit::default(), 1);
    bench.arm();
    let sweep = |bench: &mut RecordedBoard<_>| {
        let from = bench.frames.len();
        assert_eq!(bench.command(&Command::Sweep).outcome, Outcome::Accepted);
        let end = bench.board.now() + Time::from_ms(3_000);
        while bench.board.now() < end {
            bench.run(Time::from_ms(10));
            let found = bench.frames[from..]
                .iter()
                .find_map(|frame| match &frame.message {
                    Record::Refusal(refusal) => Some(Some(refusal.clone())),
                    Record::State(change) if change.previous == State::Ramps => Some(None),
                    Record::Fault(fault) => panic!("{fault:?}"),
                    _ => None,
                });
            if let Some(refused) = found {
                return refused;
            }
        }
        panic!("the train does not end");
    };
    assert_eq!(sweep(&mut bench), None);
    bench.run(Time::from_ms(2_000));
    let refusal = sweep(&mut bench).expect("it does not fit");
    println!("{refusal:?}");
    assert_eq!(refusal.reason, RefusalReason::TooMuchEnergy);
    let wait_s = refusal.wait_s.expect("a time to wait");
    assert!((1.0..15.0).contains(&wait_s), "{wait_s}");
    bench.run(Time::from_secs_f64(wait_s.into()));
    assert_eq!(sweep(&mut bench), None);
    assert!(bench.faults().is_empty());
}

/// A complete train on a plant as drawn by the demonstration, with its own supply, coil and
/// measurement errors.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_drawn_sensor_drives_its_train() {
    drawn_sensors_drive_their_trains(1..=1);
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn other_drawn_sensors_drive_their_trains() {
    drawn_sensors_drive_their_trains(2..=3);
}

fn drawn_sensors_drive_their_trains(seeds: RangeInclusive<u64>) {
    use palpate_emulator::Instrument;
    use palpate_sim::device::Device;
    use palpate_sim::parameters::draw;
    use palpate_sim::stack::{Disturbances, Stack};
    use palpate_sim::switches::Switches;
    use palpate_sim::world::{Setup, World};

    let stack = Stack::builtin("ultrasoft").unwrap();
    let disturbances = Disturbances::builtin().unwrap();
    for seed in seeds {
        let plant = draw(&stack, &disturbances, seed);
        let world = World::new(&plant, Switches::all(), Setup::default()).unwrap();
        let mut instrument = Instrument::new(image(), world, Options::default());
        instrument.start().unwrap();
        instrument.send(Command::SetCoil(coil())).unwrap();
        instrument.send(Command::Arm).unwrap();
        instrument.send(Command::Sweep).unwrap();
        let end = instrument.now() + Time::from_ms(5_000);
        let is_over = |record: &Record| match record {
            Record::State(change) => change.previous == State::Ramps,
            Record::Fault(_) | Record::Refusal(_) => true,
            _ => false,
        };
        let is_driven = instrument.run_to(end, is_over).unwrap();
        let mut records = instrument.frames().iter().map(|frame| &frame.message);
        let refusal = records.find(|of| matches!(of, Record::Refusal(_))).cloned();
        assert!(is_driven, "seed {seed}: {refusal:?}");
        let mut greatest_a = 0.0_f32;
        for (_, record) in instrument.take_records() {
            match record {
                Record::Sample(sample) => {
                    greatest_a = greatest_a.max(sample.current_a.unwrap_or(0.0));
                }
                Record::CoilTest(found) => println!("{seed}: {found:?}"),
                Record::Fault(_) | Record::Refusal(_) => panic!("seed {seed}: {record:?}"),
                Record::Status(status) => println!("{seed}: load {:?}", status.processor_load),
                _ => {}
            }
        }
        assert!(greatest_a > 4.0, "seed {seed}: {greatest_a}");
    }
}
