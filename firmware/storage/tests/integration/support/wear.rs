//! Erase counts of the sectors.

use super::flash::Flash;
use super::{assert_stored, open, save};

/// Returns the smallest and the largest erase count of the sectors after saves that differ in turn.
pub(crate) fn wear(saves: u32, of: impl Fn(u32) -> Vec<palpate_wire::Command>) -> (u32, u32) {
    let mut flash = Flash::<4>::new();
    let mut store = open(&mut flash).unwrap();
    for number in 0..saves {
        assert_eq!(save(&mut store, &of(number)), Ok(true));
    }
    assert_stored(&mut store, &of(saves - 1));
    drop(store);
    let wear = flash.wear.iter();
    (*wear.clone().min().unwrap(), *wear.max().unwrap())
}

/// A set, and the set without its last item, in turn.
pub(crate) fn alternating(
    set: fn() -> Vec<palpate_wire::Command>,
) -> impl Fn(u32) -> Vec<palpate_wire::Command> {
    move |number| {
        let mut commands = set();
        if number % 2 == 1 {
            commands.pop();
        }
        commands
    }
}
