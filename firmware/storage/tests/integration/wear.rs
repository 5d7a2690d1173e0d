//! All sectors wear alike.

use crate::support::flash::Flash;
use crate::support::specimens::{fullest, small, typical};
use crate::support::{assert_stored, open, save};

/// Erases of the sectors after some saves that differ in turn: the least and the greatest.
fn wear(saves: u32, of: impl Fn(u32) -> Vec<palpate_wire::Command>) -> (u32, u32) {
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

fn alternating(
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

#[track_caller]
fn assert_even((least, greatest): (u32, u32), saves: u32, sectors: u32) {
    assert!(greatest - least <= 2, "{least} to {greatest}");
    // Each save erases the sectors of the one before the last.
    let expected = saves * sectors / 16;
    assert!(
        greatest.abs_diff(expected) <= 2,
        "{greatest}, not {expected}"
    );
}

#[test]
fn the_sectors_are_erased_equally_often() {
    assert_even(wear(500, alternating(typical)), 500, 1);
    assert_even(wear(100, alternating(fullest)), 100, 2);
}

#[test]
#[ignore = "takes minutes"]
fn the_sectors_are_erased_equally_often_in_100000_saves() {
    let small = |number| small(1e3 + number as f32 / 64.0);
    assert_even(wear(100_000, small), 100_000, 1);
    assert_even(wear(100_000, alternating(typical)), 100_000, 1);
}
