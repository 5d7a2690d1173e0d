//! Current commanded directly by a PC: it ends when the PC is silent, and with every cause that ends any
//! current.

use crate::support::{BOOT, Rig, board, clear, drive_coil};
use palpate_procedure::{Action, Event, Instant, Procedure};
use palpate_wire::code::{FaultCode, Location, Outcome, State};
use palpate_wire::command::DriveCoil;
use palpate_wire::record::CurrentTrace;
use palpate_wire::{Command, Record};

fn drive(to_a: f32) -> Command {
    drive_coil(to_a, 0.01)
}

fn manual() -> Rig {
    Rig::standing_in(State::Manual, |_| {})
}

#[test]
fn the_host_falls_silent() {
    let mut rig = manual();
    // Commands of any kind, 99 ms apart, keep the current alive.
    for command in [Command::GetSettings, drive(2.0), Command::Identify] {
        rig.run(98);
        assert_eq!(rig.state(), State::Manual);
        rig.outcome(command);
    }
    rig.run(100);
    assert_eq!(rig.state(), State::Manual, "not before 100 ms");
    assert!(!rig.line.is_off());
    rig.run(2);
    let fault = rig.faults().pop().expect("a fault");
    assert_eq!(
        (fault.code, fault.location),
        (FaultCode::HostSilent, Location::Link)
    );
    assert!((fault.value.expect("a time") - 0.1).abs() < 0.0025);
    assert!(rig.line.is_off() && !rig.procedure.is_armed());
    // The fault is latched: another command does not restart the current.
    assert_eq!(rig.outcome(drive(1.0)), Outcome::Faulted);
    rig.accepted(clear(FaultCode::HostSilent));
}

#[test]
fn it_takes_both_polarities_within_the_limits() {
    let mut rig = manual();
    rig.accepted(drive(-2.0));
    rig.run(20);
    assert!((rig.line.at(rig.now_us) + 2.0).abs() < 1e-6);
    let peak_a = rig.settings().peak_current_a;
    for to_a in [1.001 * peak_a, -1.001 * peak_a] {
        let answer = rig.send(drive(to_a));
        assert_eq!(answer.outcome, Outcome::OutOfRange);
        let numbers = (answer.field, answer.value, answer.low, answer.high);
        assert_eq!(numbers, (Some(0), Some(to_a), Some(-peak_a), Some(peak_a)));
    }
    assert_eq!(rig.outcome(drive(f32::NAN)), Outcome::NotFinite);
}

#[test]
fn it_is_on_for_too_long() {
    let mut rig = manual();
    // The board's limit of 20 s ends the current; the coil of the tests could take 1 A indefinitely.
    for _ in 0..420 {
        rig.run(50);
        if rig.state() != State::Manual {
            break;
        }
        rig.accepted(drive(0.5));
    }
    let fault = rig.faults().pop().expect("a fault");
    assert_eq!((fault.code, fault.limit), (FaultCode::OnTime, Some(20.0)));
    assert!((fault.value.expect("a time") - 20.0).abs() < 0.01);
}

#[test]
fn it_is_refused_where_nothing_else_may_be_driven() {
    let mut rig = Rig::standing_in(State::Contact, |_| {});
    rig.accepted(Command::Disarm);
    assert_eq!(rig.outcome(drive(1.0)), Outcome::NotArmed);
    assert_eq!(rig.outcome(Command::TestCoil), Outcome::NotArmed);
    let mut ramps = Rig::standing_in(State::Ramps, |_| {});
    assert_eq!(ramps.outcome(drive(1.0)), Outcome::Busy);
}

#[test]
fn the_coils_test_is_asked_for_and_reported() {
    let mut rig = Rig::standing_in(State::Contact, |_| {});
    rig.test_us = 60_000;
    let actions = rig.command(Command::TestCoil, BOOT);
    assert!(actions.contains(&Action::TestCoil));
    let found = crate::support::coil_test();
    rig.records.clear();
    rig.step(&Event::CoilTested(found.clone()));
    assert_eq!(
        rig.records.pop().map(|of| of.1),
        Some(Record::CoilTest(found.clone()))
    );
    // A further result without a test in progress is not reported.
    rig.step(&Event::CoilTested(found));
    assert_eq!(rig.records, []);
}

#[test]
fn a_current_is_recorded_before_it_is_driven_and_reported() {
    let mut rig = Rig::standing_in(State::Contact, |_| {});
    let mut line = DriveCoil {
        to_a: 2.0,
        over_s: 0.0,
        trace_interval_s: 1.6e-5,
    };
    let actions = rig.command(Command::DriveCoil(line.clone()), BOOT);
    let index = |of: fn(&Action) -> bool| actions.iter().position(of);
    let traced =
        index(|action| matches!(action, Action::TraceCurrent { interval } if interval.0 == 1.6e-5));
    let driven = index(|action| matches!(action, Action::Current(_)));
    assert!(traced.is_some() && traced < driven, "{traced:?} {driven:?}");
    line.trace_interval_s = 0.0;
    let tracing = |action: &Action| matches!(action, Action::TraceCurrent { .. });
    let actions = rig.command(Command::DriveCoil(line), BOOT);
    assert!(!actions.iter().any(tracing));
    let trace = CurrentTrace {
        total: 2,
        first: 0,
        interval_s: 1.6e-5,
        currents_a: [0.0, 1.9].into_iter().collect(),
    };
    rig.records.clear();
    let at = Instant::from_ticks(123_456);
    rig.step(&Event::CurrentTraced {
        at,
        trace: trace.clone(),
    });
    assert_eq!(rig.records.pop(), Some((at, Record::CurrentTrace(trace))));
}

#[test]
fn five_crashes_in_a_row_lock_the_outputs_and_it_still_talks() {
    for (crashes, locked) in [(4, false), (5, true), (200, true)] {
        let mut rig = Rig::started();
        let mut board = board();
        board.crashes = crashes;
        rig.procedure = Procedure::new(board);
        rig.records.clear();
        rig.step(&Event::Tick);
        let faults = rig.faults();
        assert_eq!(
            faults.iter().any(|of| of.code == FaultCode::CrashStreak),
            locked
        );
        assert!(
            rig.records
                .iter()
                .any(|of| matches!(of.1, Record::Hello(_)))
        );
        if locked {
            let cleared = rig.outcome(clear(FaultCode::CrashStreak));
            assert_eq!(cleared, Outcome::FaultPersists);
            assert_eq!(rig.outcome(Command::Arm), Outcome::Faulted);
            assert_eq!(rig.outcome(Command::GetSettings), Outcome::Accepted);
        }
    }
}
