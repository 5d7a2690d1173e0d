//! Random events in any order: `crate::support::promises` checks every step. No panic, no current beyond
//! the limits or while disarmed, bridge off with every refusal and fault, one answer per command.

use std::collections::BTreeSet;

use crate::support::moves::{Move, carry_out, moves};
use crate::support::{Rig, board};
use palpate_wire::code::State;
use palpate_wire::{Command, Record};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

/// Returns a rig whose board allows less than the protocol, armed and watching.
fn start() -> Rig {
    let mut board = board();
    board.limits.current.0 = 10.0;
    let mut rig = Rig::started_as(board);
    carry_out(&mut rig, &Move::Restore);
    rig.until(State::Watching, 3_000);
    rig.sensor.press(3e-4);
    rig
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 400,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn promises_hold_in_any_sequence(sequence in prop::collection::vec(moves(), 1..400)) {
        let mut rig = start();
        for of in &sequence {
            carry_out(&mut rig, of);
        }
        // Abort and disarm end every state.
        rig.accepted(Command::Abort);
        prop_assert!(rig.line.is_off());
        rig.accepted(Command::Disarm);
        prop_assert!(rig.line.is_off() && !rig.procedure.is_armed());
    }

    #[test]
    fn they_hold_from_the_first_event_on(sequence in prop::collection::vec(moves(), 1..40)) {
        let mut rig = Rig::started();
        for of in &sequence {
            carry_out(&mut rig, of);
        }
    }
}

#[test]
fn twenty_thousand_moves_from_fixed_seeds_reach_everything() {
    let mut states = BTreeSet::new();
    let mut reasons = BTreeSet::new();
    let mut faults = BTreeSet::new();
    let (mut estimates, mut armed) = (0, 0);
    for seed in 0..50 {
        let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
        let mut runner = TestRunner::new_with_rng(ProptestConfig::default(), rng);
        let mut rig = start();
        for _ in 0..400 {
            let of = moves().new_tree(&mut runner).expect("a move").current();
            carry_out(&mut rig, &of);
            states.insert(rig.state().number());
            armed += usize::from(rig.procedure.is_armed());
            for (_, record) in rig.records.drain(..) {
                match record {
                    Record::Estimate(_) => estimates += 1,
                    Record::Refusal(refusal) => drop(reasons.insert(refusal.reason.number())),
                    Record::Fault(fault) => drop(faults.insert(fault.code.number())),
                    _ => {}
                }
            }
        }
    }
    // The random moves have reached every state.
    assert_eq!(states.len(), State::ALL.len());
    assert!(estimates > 100 && armed > 5_000, "{estimates} {armed}");
    assert!(reasons.len() > 12, "{reasons:?}");
    assert!(faults.len() > 25, "{faults:?}");
}
