//! The power fails in any write or erase: afterwards the old or the new set is stored.

use palpate_storage::Contents;

use crate::support::cuts::{Configuration, Operation, cut_short, nested, one_of};
use crate::support::flash::Remnant;
use crate::support::specimens::{small, typical};
use crate::support::{assert_stored, open, save, saved};

/// A power cut during `deed` leaves the old or the new set, and a following save succeeds.
fn all_or_nothing(history: &[Configuration], deed: Operation<'_>) {
    let before = saved(history);
    let old = history.last().map_or(&[][..], Vec::as_slice);
    let next = small(1e3);
    let mut counts = [0; 2];
    cut_short(&before, deed, |_, _, mut flash| {
        let found = one_of(&mut flash, &[old, deed.outcome()]);
        counts[usize::from(found == deed.outcome())] += 1;
        let mut store = open(&mut flash).unwrap();
        assert_eq!(save(&mut store, &next), Ok(()));
        assert_stored(&mut store, &next);
    });
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}

#[test]
fn a_save_is_whole_or_did_not_happen() {
    all_or_nothing(&[typical(), small(6e3)], Operation::Save(&typical()));
    all_or_nothing(&[small(6e3), typical()], Operation::Save(&small(5e3)));
}

#[test]
fn the_first_save_is_whole_or_did_not_happen() {
    all_or_nothing(&[], Operation::Save(&typical()));
}

#[test]
fn an_erasure_is_whole_or_did_not_happen() {
    all_or_nothing(&[small(6e3), typical()], Operation::Erase);
    all_or_nothing(&[small(6e3)], Operation::Erase);
}

#[test]
fn a_second_cut_in_the_save_after_the_first_leaves_old_or_new() {
    let history = [small(6e3), small(5e3)];
    nested(
        &history,
        Operation::Save(&small(4e3)),
        Operation::Save(&small(3e3)),
    );
}

#[test]
fn a_second_cut_in_another_deed_leaves_old_or_new() {
    let history = [small(6e3), small(5e3)];
    nested(&history, Operation::Erase, Operation::Save(&small(3e3)));
    nested(&history, Operation::Save(&small(4e3)), Operation::Erase);
}

/// Repeated saves fail, each in another operation: the stored set survives all of them.
#[test]
fn what_is_stored_outlives_any_number_of_saves_that_are_cut_off() {
    let mut flash = saved(&[small(6e3), typical()]);
    let mut new = typical();
    new.pop();
    for attempt in 0..300u64 {
        let remnant = Remnant::EVERY[attempt as usize % Remnant::EVERY.len()];
        flash.cut_after(attempt % 40, remnant);
        assert!(Operation::Save(&new).on(&mut flash).is_err());
        assert!(flash.power_on());
        one_of(&mut flash, &[&typical()]);
    }
    let store = open(&mut flash).unwrap();
    assert!(matches!(store.contents(), Contents::Whole(_)));
}
