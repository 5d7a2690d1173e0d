//! The power fails in any write or erase: afterwards all is as it was, or all is new.

use palpate_storage::{Contents, Error};
use palpate_wire::Command;

use crate::support::flash::{Failure, Flash, Remnant};
use crate::support::specimens::{small, typical};
use crate::support::{assert_stored, load, now, open, save, saved};

type Configuration = Vec<Command>;

/// What is done while the power fails.
#[derive(Clone, Copy)]
enum Deed<'a> {
    Save(&'a [Command]),
    Erase,
}

impl Deed<'_> {
    fn on(self, flash: &mut Flash) -> Result<(), Error<Failure>> {
        let mut store = open(flash)?;
        match self {
            Self::Save(commands) => save(&mut store, commands).map(drop),
            Self::Erase => now(store.erase()),
        }
    }

    /// What is stored when it has been done.
    const fn outcome(&self) -> &[Command] {
        match self {
            Self::Save(commands) => commands,
            Self::Erase => &[],
        }
    }
}

/// What is stored after the start that follows: one of several, and the storage says which.
#[track_caller]
fn one_of<'a>(flash: &mut Flash, candidates: &[&'a [Command]]) -> &'a [Command] {
    let mut store = open(flash).unwrap();
    let stored = load(&mut store).unwrap();
    let found = candidates.iter().find(|candidate| **candidate == stored);
    let found = found.unwrap_or_else(|| panic!("neither old nor new: {:?}", store.contents()));
    assert_stored(&mut store, found);
    found
}

/// Every flash that a power cut in a deed can leave.
fn cut_short(before: &Flash, deed: Deed<'_>, mut with: impl FnMut(u64, Remnant, Flash)) {
    for remnant in Remnant::EVERY {
        for after in 0.. {
            let mut flash = before.clone();
            flash.cut_after(after, remnant);
            let done = deed.on(&mut flash);
            if !flash.power_on() {
                assert_eq!(done, Ok(()));
                assert!(after > 4, "the deed writes something");
                break;
            }
            assert_eq!(done, Err(Error::Flash(Failure::PowerCut)));
            with(after, remnant, flash);
        }
    }
}

/// A power cut in a deed leaves old or new, and what is done then succeeds.
fn all_or_nothing(history: &[Configuration], deed: Deed<'_>) {
    let before = saved(history);
    let old = history.last().map_or(&[][..], Vec::as_slice);
    let next = small(1e3);
    let mut counts = [0; 2];
    cut_short(&before, deed, |_, _, mut flash| {
        let found = one_of(&mut flash, &[old, deed.outcome()]);
        counts[usize::from(found == deed.outcome())] += 1;
        let mut store = open(&mut flash).unwrap();
        assert_eq!(save(&mut store, &next), Ok(true));
        assert_stored(&mut store, &next);
    });
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}

#[test]
fn a_save_is_whole_or_did_not_happen() {
    all_or_nothing(&[typical(), small(6e3)], Deed::Save(&typical()));
    all_or_nothing(&[small(6e3), typical()], Deed::Save(&small(5e3)));
}

#[test]
fn the_first_save_is_whole_or_did_not_happen() {
    all_or_nothing(&[], Deed::Save(&typical()));
}

#[test]
fn an_erasure_is_whole_or_did_not_happen() {
    all_or_nothing(&[small(6e3), typical()], Deed::Erase);
    all_or_nothing(&[small(6e3)], Deed::Erase);
}

/// The power fails in a save, and again in what follows it.
fn nested(history: &[Configuration], first: Deed<'_>, second: Deed<'_>) {
    let before = saved(history);
    let old = history.last().map_or(&[][..], Vec::as_slice);
    let mut cuts = 0;
    cut_short(&before, first, |_, _, mut flash| {
        let between = one_of(&mut flash, &[old, first.outcome()]);
        if between == second.outcome() {
            return;
        }
        cut_short(&flash, second, |_, _, mut flash| {
            one_of(&mut flash, &[between, second.outcome()]);
            cuts += 1;
        });
    });
    assert!(cuts > 1_000, "{cuts}");
}

#[test]
fn a_second_cut_in_the_save_after_the_first_leaves_old_or_new() {
    let history = [small(6e3), small(5e3)];
    nested(&history, Deed::Save(&small(4e3)), Deed::Save(&small(3e3)));
}

#[test]
fn a_second_cut_in_another_deed_leaves_old_or_new() {
    let history = [small(6e3), small(5e3)];
    nested(&history, Deed::Erase, Deed::Save(&small(3e3)));
    nested(&history, Deed::Save(&small(4e3)), Deed::Erase);
}

/// With a set of the usual size.
#[test]
#[ignore = "takes minutes"]
fn a_second_cut_after_a_cut_in_a_typical_save_leaves_old_or_new() {
    let history = [small(6e3), typical()];
    nested(
        &history,
        Deed::Save(&small(4e3)),
        Deed::Save(&typical()[1..]),
    );
    nested(
        &history,
        Deed::Save(&typical()[1..]),
        Deed::Save(&small(3e3)),
    );
}

/// One save after another fails, always in another operation: what was stored outlives them all.
#[test]
fn what_is_stored_outlives_any_number_of_saves_that_are_cut_off() {
    let mut flash = saved(&[small(6e3), typical()]);
    let mut new = typical();
    new.pop();
    for attempt in 0..300u64 {
        let remnant = Remnant::EVERY[attempt as usize % Remnant::EVERY.len()];
        flash.cut_after(attempt % 40, remnant);
        assert!(Deed::Save(&new).on(&mut flash).is_err());
        assert!(flash.power_on());
        one_of(&mut flash, &[&typical()]);
    }
    let store = open(&mut flash).unwrap();
    assert!(matches!(store.contents(), Contents::Whole(_)));
}
