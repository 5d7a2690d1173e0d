//! What the procedure promises at every step, whatever happens to it.

use palpate_procedure::{Action, Actions, Event};
use palpate_wire::code::State;
use palpate_wire::{FrameError, Message, Record};

use super::{Rig, answers};

/// Holds the actions of a step, carried out already, against the promises.
pub(crate) fn hold(rig: &Rig, event: &Event<'_>, actions: &Actions) {
    assert!(
        !actions.is_full(),
        "an action may have been lost: {actions:?}"
    );
    safe_state_first(actions);
    currents_are_allowed(rig, actions);
    coil_is_off_where_it_has_to_be(rig);
    answered_once(event, actions);
    for action in actions {
        if let Action::Record { record, .. } = action {
            record_is_sound(record);
        }
    }
}

/// A refusal and a fault come with the bridge off, before all else, and with no current after it.
fn safe_state_first(actions: &Actions) {
    let place = actions
        .iter()
        .position(|action| matches!(action, Action::SafeState));
    assert!(place.unwrap_or(0) == 0, "not first: {actions:?}");
    let stops = actions.iter().any(|action| match action {
        Action::Record { record, .. } => match record {
            Record::Refusal(_) => true,
            Record::Fault(fault) => fault.active,
            _ => false,
        },
        _ => false,
    });
    assert!(!stops || place == Some(0), "no safe state: {actions:?}");
    let drives = actions
        .iter()
        .any(|action| matches!(action, Action::Current { .. }));
    assert!(!(drives && place.is_some()), "drives: {actions:?}");
}

fn currents_are_allowed(rig: &Rig, actions: &Actions) {
    for action in actions {
        let Action::Current { to, .. } = action else {
            continue;
        };
        let allowed_a = rig.settings().peak_current_a.min(rig.limits.current.0);
        assert!(rig.procedure.is_armed());
        if rig.state() == State::Directed {
            assert!(to.0.abs() <= allowed_a, "{to:?}");
            continue;
        }
        assert!((0.0..=allowed_a).contains(&to.0), "{to:?}");
        assert!(matches!(rig.state(), State::Peak | State::Ramps));
    }
}

fn coil_is_off_where_it_has_to_be(rig: &Rig) {
    let drives = matches!(rig.state(), State::Peak | State::Ramps | State::Directed);
    assert!(
        rig.line.is_off() || drives,
        "{} {:?}",
        rig.state(),
        rig.line
    );
    assert!(rig.procedure.is_armed() || rig.line.is_off());
    assert!(rig.state() != State::Fault || !rig.procedure.is_armed());
}

/// Every command, and every frame whose header could be read, has one answer, its own.
fn answered_once(event: &Event<'_>, actions: &Actions) {
    let expected = match event {
        Event::Command(frame) => Some((frame.header.sequence, frame.message.kind())),
        Event::NotUnderstood(
            FrameError::UnknownKind { header, kind } | FrameError::Payload { header, kind, .. },
        ) => Some((header.sequence, *kind)),
        _ => None,
    };
    let answers = answers(actions);
    let given: Vec<_> = answers.iter().map(|of| (of.command, of.kind)).collect();
    assert_eq!(given, Vec::from_iter(expected));
}

/// What the procedure itself reckons lies within the protocol's limits. Samples, words, faults and
/// answers pass on what they were given.
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
