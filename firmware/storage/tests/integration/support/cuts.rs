//! The power fails in any write or erase.

use palpate_storage::Error;
use palpate_wire::Command;

use super::flash::{Failure, Flash, Remnant};
use super::{assert_stored, load, now, open, save, saved};

pub(crate) type Configuration = Vec<Command>;

/// Operation during which the power fails.
#[derive(Clone, Copy)]
pub(crate) enum Operation<'a> {
    Save(&'a [Command]),
    Erase,
}

impl Operation<'_> {
    pub(crate) fn on(self, flash: &mut Flash) -> Result<(), Error<Failure>> {
        let mut store = open(flash)?;
        match self {
            Self::Save(commands) => save(&mut store, commands),
            Self::Erase => now(store.erase()),
        }
    }

    /// Returns the stored set after the operation.
    pub(crate) const fn outcome(&self) -> &[Command] {
        match self {
            Self::Save(commands) => commands,
            Self::Erase => &[],
        }
    }
}

/// Returns the set stored after the following start: one of several candidates, as the storage reports.
#[track_caller]
pub(crate) fn one_of<'a>(flash: &mut Flash, candidates: &[&'a [Command]]) -> &'a [Command] {
    let mut store = open(flash).unwrap();
    let stored = load(&mut store).unwrap();
    let found = candidates.iter().find(|candidate| **candidate == stored);
    let found = found.unwrap_or_else(|| panic!("neither old nor new: {:?}", store.contents()));
    assert_stored(&mut store, found);
    found
}

/// Passes on every flash content that a power cut in an operation can leave.
pub(crate) fn cut_short(
    before: &Flash,
    deed: Operation<'_>,
    mut with: impl FnMut(u64, Remnant, Flash),
) {
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

/// The power fails in a save, and again in the following operation.
pub(crate) fn nested(
    history: &[Configuration],
    first: Operation<'_>,
    second: Operation<'_>,
) -> u32 {
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
    cuts
}
