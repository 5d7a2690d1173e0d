//! Queue of commands that need the coil: one waits for the end of the coil's test, and each is answered
//! once. Everything that stops the coil stops the test and drops the waiting command.

use crate::support::{BOOT, Rig, answers, drive_coil, frame};
use palpate_procedure::{Action, Event, Link};
use palpate_wire::code::{FaultCode, Location, Outcome, State};
use palpate_wire::record::{Acknowledgement, CoilTest};
use palpate_wire::{Command, Header};

const TEST_US: u64 = 60_000;

fn drive(to_a: f32) -> Command {
    drive_coil(to_a, 0.0)
}

/// Returns a rig in a state, during the coil's test that arming starts.
fn testing(state: State) -> Rig {
    let mut rig = Rig::standing_in(state, |_| {});
    rig.accepted(Command::Disarm);
    rig.test_us = TEST_US;
    rig.accepted(Command::Arm);
    rig.run(5);
    rig.records.clear();
    rig
}

/// Sends a command without waiting for its answer.
fn send(rig: &mut Rig, command: Command) -> u32 {
    rig.command(command, BOOT);
    rig.sequence
}

/// Returns all answers so far, by sequence number.
fn given(rig: &Rig) -> Vec<(u32, Outcome)> {
    let answers = rig.all::<Acknowledgement>().into_iter();
    answers
        .map(|answer| (answer.command, answer.outcome))
        .collect()
}

fn tests_reported(rig: &Rig) -> usize {
    rig.all::<CoilTest>().len()
}

#[test]
fn one_waits_for_the_test_and_the_next_is_answered_with_busy() {
    let commands = [
        Command::Measure,
        Command::Sweep,
        Command::TestCoil,
        drive(1.0),
    ];
    for first in &commands {
        for second in &commands {
            let mut rig = testing(State::Contact);
            let one = send(&mut rig, first.clone());
            assert_eq!(given(&rig), [], "{first:?} waits");
            let two = send(&mut rig, second.clone());
            assert_eq!(given(&rig), [(two, Outcome::Busy)]);
            // Other commands are answered at once meanwhile.
            let other = send(&mut rig, Command::GetSettings);
            assert_eq!(given(&rig)[1], (other, Outcome::Accepted));
            rig.run(60);
            assert_eq!(given(&rig)[2..], [(one, Outcome::Accepted)], "{first:?}");
            let begun = match first {
                Command::Measure => State::Settling,
                Command::Sweep => State::Peak,
                Command::DriveCoil(_) => State::Manual,
                _ => State::Contact,
            };
            assert_eq!(rig.state(), begun);
        }
    }
}

/// A PC arms and requests a train as soon as the device has identified itself.
#[test]
fn a_train_that_is_asked_for_during_both_self_tests_begins_after_them() {
    let mut rig = testing(State::SelfTest);
    assert_eq!(rig.state(), State::SelfTest);
    let one = send(&mut rig, Command::Sweep);
    rig.run(60);
    assert_eq!(given(&rig), [(one, Outcome::Accepted)]);
    assert_eq!(rig.state(), State::Peak);
}

#[test]
fn what_may_not_be_done_is_refused_without_waiting() {
    let mut rig = testing(State::Watching);
    assert_eq!(rig.outcome(Command::Measure), Outcome::NoContact);
    assert_eq!(rig.outcome(drive(19.0)), Outcome::OutOfRange);
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    rig.accepted(Command::Disarm);
    assert_eq!(rig.outcome(Command::TestCoil), Outcome::NotArmed);
    assert_eq!(rig.test_ends_us, None);
}

/// Everything that stops the coil, in each state: the test ends, the waiting command is dropped with an
/// answer, and the coil is not driven afterwards.
#[test]
fn what_stops_the_coil_empties_the_queue_in_every_state() {
    for state in [
        State::SelfTest,
        State::Baseline,
        State::Watching,
        State::Contact,
        State::Release,
    ] {
        for stop in [Command::Abort, Command::Disarm, Command::SensingOnly] {
            let mut rig = testing(state);
            let waits = send(&mut rig, drive(3.0));
            let actions = rig.command(stop.clone(), Header::ANY_BOOT);
            assert_eq!(actions[0], Action::SafeState, "{stop:?} in {state}");
            assert_eq!(
                given(&rig),
                [(waits, Outcome::Aborted), (rig.sequence, Outcome::Accepted)],
                "{stop:?} in {state}"
            );
            for _ in 0..500 {
                rig.convert();
                assert!(rig.line.is_off());
            }
            assert_eq!(
                tests_reported(&rig),
                0,
                "a test that was stopped finds nothing"
            );
        }
    }
}

#[test]
fn after_an_abort_the_coil_is_tested_before_it_is_driven() {
    let mut rig = testing(State::Watching);
    rig.accepted(Command::Abort);
    let one = send(&mut rig, drive(2.0));
    rig.run(30);
    assert!(rig.line.is_off());
    rig.run(40);
    assert_eq!(given(&rig).last(), Some(&(one, Outcome::Accepted)));
    assert_eq!(tests_reported(&rig), 1);
    assert!(!rig.line.is_off());
}

#[test]
fn a_fault_empties_the_queue() {
    let mut rig = testing(State::Watching);
    let one = send(&mut rig, drive(2.0));
    rig.fail(FaultCode::CoilOpen, Location::Coil);
    assert_eq!(given(&rig), [(one, Outcome::Faulted)]);
    rig.run(200);
    assert!(rig.line.is_off());
}

#[test]
fn a_test_that_does_not_end_is_a_fault() {
    let mut rig = testing(State::Watching);
    rig.test_ends_us = Some(u64::MAX);
    let one = send(&mut rig, drive(2.0));
    rig.run(440);
    assert_eq!(rig.state(), State::Watching);
    rig.run(10);
    let fault = rig.faults().pop().expect("a fault");
    assert_eq!(
        (fault.code, fault.location),
        (FaultCode::Overrun, Location::Coil)
    );
    assert_eq!(given(&rig), [(one, Outcome::Faulted)]);
}

#[test]
fn a_test_is_reported_once_however_much_is_driven_after_it() {
    let mut rig = testing(State::Watching);
    rig.run(60);
    for _ in 0..3 {
        rig.accepted(drive(1.0));
        rig.run(20);
        rig.accepted(Command::Abort);
        rig.lift();
    }
    assert_eq!(tests_reported(&rig), 1);
}

/// With `automatic` a touch may come during the coil's test.
#[test]
fn an_automatic_measurement_waits_for_the_test_too() {
    let mut rig = Rig::standing_in(State::Watching, |of| {
        (of.automatic, of.settling_s) = (true, 0.3);
    });
    rig.accepted(Command::Abort);
    rig.test_us = 400_000;
    rig.accepted(Command::TestCoil);
    rig.sensor.press(3e-4);
    rig.run(390);
    assert_eq!(rig.state(), State::Settling);
    rig.until(State::Peak, 500);
    rig.until(State::Estimating, 5_000);
}

#[test]
fn two_commands_of_one_number_have_two_answers() {
    let mut rig = testing(State::Watching);
    let twice = frame(drive(1.0), BOOT, 700);
    rig.step(&Event::Command(Link::Probe, &twice));
    let second = rig.step(&Event::Command(Link::Probe, &twice));
    assert_eq!(answers(&second)[0].outcome, Outcome::Busy);
    rig.run(60);
    assert_eq!(
        given(&rig),
        [(700, Outcome::Busy), (700, Outcome::Accepted)]
    );
}
