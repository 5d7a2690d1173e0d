//! Every command in every state: it gets exactly one answer, the right one, and has the right effect.

use crate::support::calibration::{COIL, calibration, curve, settings, springs};
use crate::support::sensor::Sensor;
use crate::support::{BOOT, Rig, answers, frame};
use palpate_procedure::{Action, Event, Link};
use palpate_wire::code::{Outcome, State};
use palpate_wire::{Command, FrameError, Header, PayloadError};

/// Outcomes of arm, measure and sweep in each state while armed.
const OUTCOMES: [(State, Outcome, Outcome, Outcome); 11] = {
    use Outcome::{Accepted, Busy, Faulted, NoContact};
    [
        (State::SelfTest, Accepted, NoContact, Busy),
        (State::Baseline, Accepted, NoContact, Accepted),
        (State::Watching, Accepted, NoContact, Accepted),
        (State::Contact, Accepted, Accepted, Accepted),
        (State::Settling, Accepted, Busy, Busy),
        (State::Peak, Accepted, Busy, Busy),
        (State::Ramps, Accepted, Busy, Busy),
        (State::Estimating, Accepted, Busy, Busy),
        (State::Release, Accepted, Accepted, Accepted),
        (State::Manual, Accepted, Busy, Busy),
        (State::Fault, Faulted, Faulted, Faulted),
    ]
};

#[test]
fn arm_measure_and_sweep_are_answered_as_the_state_demands() {
    for (state, arm, measure, sweep) in OUTCOMES {
        let rig = Rig::standing_in(state, |_| {});
        for (command, expected) in [
            (Command::Arm, arm),
            (Command::Measure, measure),
            (Command::Sweep, sweep),
        ] {
            let outcome = rig.clone().outcome(command.clone());
            assert_eq!(outcome, expected, "{command:?} in {state}");
        }
        if state == State::Fault {
            continue;
        }
        // While the device is disarmed, neither a measurement nor a sweep starts.
        let mut rig = rig.clone();
        rig.accepted(Command::Disarm);
        let estimates = state == State::Estimating;
        let busy = |is| if is { Outcome::Busy } else { Outcome::NotArmed };
        assert_eq!(rig.outcome(Command::Measure), busy(estimates), "{state}");
        let tested = state == State::SelfTest;
        assert_eq!(
            rig.outcome(Command::Sweep),
            busy(estimates || tested),
            "{state}"
        );
        assert!(rig.line.is_off());
    }
}

#[test]
fn without_the_coils_data_it_is_not_armed() {
    let mut rig = Rig::started();
    for command in calibration(&Sensor::default()) {
        if !matches!(command, Command::SetCoil(_)) {
            rig.accepted(command);
        }
    }
    assert_eq!(rig.outcome(Command::Arm), Outcome::NotCalibrated);
    rig.accepted(Command::SetCoil(COIL));
    rig.accepted(Command::Arm);
}

#[test]
fn abort_disarm_and_sensing_only_end_a_measurement_in_any_state() {
    for (state, ..) in OUTCOMES {
        for command in [Command::Abort, Command::Disarm, Command::SensingOnly] {
            let mut rig = Rig::standing_in(state, |_| {});
            rig.records.clear();
            let disarms = command != Command::Abort;
            // These commands are accepted with any boot id.
            let actions = rig.command(command, Header::ANY_BOOT);
            assert_eq!(answers(&actions)[0].outcome, Outcome::Accepted);
            assert!(rig.line.is_off());
            let measures = matches!(state, State::Settling | State::Peak | State::Ramps);
            assert_eq!(rig.refusals().len(), usize::from(measures), "{state}");
            let drives = measures || state == State::Manual;
            let after = if drives { State::Release } else { state };
            // In `State::Estimating` the procedure continues to send the points of an estimate.
            assert_eq!(rig.state(), after);
            assert_eq!(rig.procedure.is_armed(), !disarms && state != State::Fault);
            if disarms {
                assert_eq!(actions[0], Action::SafeState, "{state}");
            }
        }
    }
}

#[test]
fn the_same_for_a_sweep() {
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    rig.accepted(Command::Sweep);
    rig.run(20);
    rig.accepted(Command::Abort);
    assert!(rig.line.is_off());
    assert_eq!((rig.state(), rig.refusals().len()), (State::Baseline, 1));
}

#[test]
fn nothing_is_set_while_armed_and_anything_while_not() {
    let sensor = Sensor::default();
    let mut setters = vec![Command::SetSettings(settings(|of| of.ramps = 3))];
    setters.extend(calibration(&sensor));
    for (state, ..) in OUTCOMES {
        let rig = Rig::standing_in(state, |_| {});
        for command in &setters {
            let mut rig = rig.clone();
            if rig.procedure.is_armed() {
                assert_eq!(rig.outcome(command.clone()), Outcome::Armed, "{state}");
                assert_eq!(rig.state(), state);
                rig.accepted(Command::Disarm);
            }
            rig.accepted(command.clone());
        }
    }
}

#[test]
fn settings_and_curve_begin_the_baseline_anew() {
    let anew = [
        Command::SetSettings(settings(|_| {})),
        Command::SetDeformationCurve(curve()),
    ];
    for command in anew {
        for (from, to) in [
            (State::Watching, State::Baseline),
            (State::Contact, State::Baseline),
            (State::Release, State::Baseline),
            (State::SelfTest, State::SelfTest),
            (State::Fault, State::Fault),
        ] {
            let mut rig = Rig::standing_in(from, |_| {});
            rig.accepted(Command::Disarm);
            rig.accepted(command.clone());
            assert_eq!(rig.state(), to);
        }
    }
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    rig.accepted(Command::Disarm);
    rig.accepted(Command::SetSprings(springs(&Sensor::default())));
    assert_eq!(rig.state(), State::Watching);
}

#[test]
fn a_command_for_another_boot_does_nothing() {
    let commands = [
        Command::Arm,
        Command::Measure,
        Command::Sweep,
        Command::GetSettings,
    ];
    for boot in [BOOT + 1, Header::ANY_BOOT] {
        for command in &commands {
            let mut rig = Rig::standing_in(State::Contact, |_| {});
            let actions = rig.command(command.clone(), boot);
            assert_eq!(answers(&actions)[0].outcome, Outcome::OtherBoot);
            assert_eq!(actions.len(), 1, "{actions:?}");
            assert_eq!(rig.state(), State::Contact);
        }
    }
}

#[test]
fn frames_that_cannot_be_understood() {
    let mut rig = Rig::started();
    rig.wait(1_000);
    let header = frame(Command::Arm, BOOT, 5).header;
    let cause = PayloadError::Malformed;
    for (error, outcome) in [
        (
            FrameError::UnknownKind { header, kind: 0xEE },
            Outcome::UnknownCommand,
        ),
        (
            FrameError::Payload {
                header,
                kind: 0x90,
                cause,
            },
            Outcome::Malformed,
        ),
    ] {
        let actions = rig.step(&Event::NotUnderstood(Link::Probe, error));
        assert_eq!(answers(&actions)[0].outcome, outcome);
    }
    // Errors without a readable header to answer. They are counted; another version gets a `hello`.
    let unanswered = [FrameError::Checksum, FrameError::Version { found: 9 }];
    let said = unanswered.map(|error| rig.step(&Event::NotUnderstood(Link::Probe, error)).len());
    assert_eq!(said, [0, 1], "who we are, to one of another version");
    let status = rig.status();
    assert_eq!((status.commands_damaged, status.commands_refused), (2, 2));
}
