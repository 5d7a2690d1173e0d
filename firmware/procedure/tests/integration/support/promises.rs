//! Promises of the procedure at every step, under any conditions.

use coil_hbridge::CurrentLine;
use palpate_procedure::{Action, Actions, Event};
use palpate_wire::code::{Outcome, State};
use palpate_wire::{Command, FrameError, Message, Record};

use super::{Rig, answers};

/// Checks the actions of a step, which were already carried out.
pub(crate) fn hold(rig: &mut Rig, event: &Event<'_>, actions: &Actions) {
    assert!(
        !actions.is_full(),
        "an action may have been lost: {actions:?}"
    );
    safe_state_first(actions);
    currents_are_allowed(rig, actions);
    coil_is_off_where_it_has_to_be(rig);
    answered_once(rig, event, actions);
    stopped_until_asked(rig, event, actions);
    for action in actions {
        if let Action::Record { record, .. } = action {
            record_is_sound(record);
        }
    }
}

/// A refusal or a fault comes with the bridge off first, and with no current after it.
fn safe_state_first(actions: &Actions) {
    let index = actions
        .iter()
        .position(|action| matches!(action, Action::SafeState));
    assert!(index.unwrap_or(0) == 0, "not first: {actions:?}");
    let stops = actions.iter().any(|action| match action {
        Action::Record { record, .. } => match record {
            Record::Refusal(_) => true,
            Record::Fault(fault) => fault.active,
            _ => false,
        },
        _ => false,
    });
    assert!(!stops || index == Some(0), "no safe state: {actions:?}");
    let drives = actions
        .iter()
        .any(|action| matches!(action, Action::Current(_)));
    assert!(!(drives && index.is_some()), "drives: {actions:?}");
}

fn currents_are_allowed(rig: &Rig, actions: &Actions) {
    for action in actions {
        let Action::Current(CurrentLine { to_a, .. }) = action else {
            continue;
        };
        let allowed_a = rig.settings().peak_current_a.min(rig.limits.current.0);
        assert!(rig.procedure.is_armed());
        if rig.state() == State::Manual {
            assert!(to_a.abs() <= allowed_a, "{to_a} A");
            continue;
        }
        assert!((0.0..=allowed_a).contains(to_a), "{to_a} A");
        assert!(matches!(rig.state(), State::Peak | State::Ramps));
    }
}

fn coil_is_off_where_it_has_to_be(rig: &Rig) {
    let drives = matches!(rig.state(), State::Peak | State::Ramps | State::Manual);
    assert!(
        rig.line.is_off() || drives,
        "{} {:?}",
        rig.state(),
        rig.line
    );
    assert!(rig.procedure.is_armed() || rig.line.is_off());
    assert!(rig.state() != State::Fault || !rig.procedure.is_armed());
}

/// Every command, and every frame with a readable header, has exactly one answer. A command that needs
/// the coil may wait for the end of its test; at most one waits, and none without a test.
fn answered_once(rig: &mut Rig, event: &Event<'_>, actions: &Actions) {
    let asked = match event {
        Event::Command(_, frame) => Some((frame.header.sequence, frame.message.kind())),
        Event::NotUnderstood(
            _,
            FrameError::UnknownKind { header, kind } | FrameError::Payload { header, kind, .. },
        ) => Some((header.sequence, *kind)),
        _ => None,
    };
    rig.open.extend(asked);
    for answer in answers(actions) {
        let given = (answer.command, answer.kind);
        let index = rig.open.iter().position(|open| *open == given);
        rig.open
            .remove(index.unwrap_or_else(|| panic!("not asked: {answer:?}")));
    }
    let waits = rig.open.len();
    assert!(waits <= 1, "{:?}", rig.open);
    assert!(waits == 0 || rig.test_ends_us.is_some(), "{:?}", rig.open);
}

/// After `abort`, `disarm` and `sensing_only` the coil is not driven or tested until a command requests
/// it or, with `automatic`, an object touches again.
fn stopped_until_asked(rig: &mut Rig, event: &Event<'_>, actions: &Actions) {
    let touches = actions.iter().any(|action| match action {
        Action::Record {
            record: Record::State(change),
            ..
        } => {
            change.state == State::Contact
                && matches!(change.previous, State::Watching | State::Baseline)
        }
        _ => false,
    });
    if touches && rig.settings().automatic {
        rig.stopped = false;
    }
    if let Event::Command(_, frame) = event {
        let accepted = answers(actions).iter().any(|answer| {
            answer.command == frame.header.sequence && answer.outcome == Outcome::Accepted
        });
        match frame.message {
            Command::Abort | Command::Disarm | Command::SensingOnly if accepted => {
                rig.stopped = true;
            }
            Command::Arm
            | Command::Measure
            | Command::Sweep
            | Command::TestCoil
            | Command::DriveCoil(_) => rig.stopped = false,
            _ => {}
        }
    }
    let drives = |action: &Action| matches!(action, Action::Current(_) | Action::TestCoil);
    assert!(!(rig.stopped && actions.iter().any(drives)), "{actions:?}");
}

/// Values that the procedure computes are within the protocol's limits. Samples, words, faults and
/// answers pass their inputs on.
fn record_is_sound(record: &Record) {
    let passed_on = matches!(
        record,
        Record::Sample(_) | Record::Raw(_) | Record::Fault(_) | Record::Acknowledgement(_)
    );
    if !passed_on {
        assert_eq!(record.validate(), Ok(()), "{record:?}");
    }
    if let Record::Estimate(estimate) = record {
        let upper = estimate.upper_n_per_m.unwrap_or(f32::INFINITY);
        assert!(estimate.lower_n_per_m <= upper, "{estimate:?}");
        if let Some(value) = estimate.stiffness_n_per_m {
            let interval = estimate.lower_n_per_m..=upper;
            assert!(interval.contains(&value), "{estimate:?}");
        }
    }
}
