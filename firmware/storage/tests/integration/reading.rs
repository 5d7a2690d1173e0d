//! Reading the stored set.

use palpate_storage::{Contents, Error};
use palpate_wire::Command;

use crate::support::flash::Flash;
use crate::support::raw::{self, item};
use crate::support::specimens::{defaults, settings};
use crate::support::{load, now, open};

fn stored(items: &[Vec<u8>]) -> Flash {
    let mut flash = Flash::<4>::new();
    raw::store(&mut flash, items, 2, items.len());
    flash
}

#[test]
fn a_setting_that_is_missing_has_its_default() {
    // Scan rate, and automatic measurement at every contact.
    let rate = item([1, 2, 0], 1, &1_250f32.to_le_bytes());
    let automatic = item([1, 11, 0], 1, &[1]);
    let mut flash = stored(&[rate, automatic]);
    let mut expected = defaults();
    expected.rate_hz = 1_250.0;
    expected.automatic = true;
    let mut store = open(&mut flash).unwrap();
    assert_eq!(load(&mut store), Ok(vec![Command::SetSettings(expected)]));
}

#[test]
fn a_stored_value_beyond_its_limits_is_refused_and_the_rest_is_read() {
    let rate = item([1, 2, 0], 1, &1e9f32.to_le_bytes());
    let attraction = item([8, 0, 0], 1, &[0; 8]);
    let mut flash = stored(&[rate, attraction]);
    let mut store = open(&mut flash).unwrap();
    let refused = now(store.next(&settings()));
    assert!(matches!(refused, Err(Error::Invalid(_))), "{refused:?}");
    let next = now(store.next(&settings())).unwrap();
    assert!(matches!(next, Some(Command::SetAttraction(_))));
    assert_eq!(now(store.next(&settings())), Ok(None));
}

#[test]
fn an_item_that_its_version_cannot_mean_is_refused_and_the_rest_is_read() {
    // A setting, a part, and a part under the key of another channel.
    let mut tank = vec![0, 1];
    tank.extend(1e-10f32.to_le_bytes());
    tank.extend(3e6f64.to_le_bytes());
    let mut flash = stored(&[
        item([1, 2, 0], 1, &[1, 2, 3]),
        item([2, 2, 0], 1, &tank),
        item([7, 0, 0], 1, &[0; 5]),
        item([8, 0, 0], 1, &[0; 8]),
    ]);
    let mut store = open(&mut flash).unwrap();
    for number in [1, 2, 7] {
        let refused = now(store.next(&defaults()));
        assert_eq!(refused, Err(Error::Unreadable { number }));
    }
    let next = now(store.next(&defaults())).unwrap();
    assert!(matches!(next, Some(Command::SetAttraction(_))));
}

#[test]
fn items_that_are_sound_and_not_those_of_the_seal_are_damage() {
    let attraction = || item([8, 0, 0], 1, &[0; 8]);
    let coil = || item([7, 0, 0], 1, &[0; 24]);
    let mut of_another_save = attraction();
    of_another_save[4] = 2;
    for (items, count, is_whole) in [
        (vec![coil(), attraction()], 2, true),
        (vec![attraction()], 2, false),
        (vec![coil(), attraction()], 1, false),
        (vec![], 1, false),
        (vec![attraction(), attraction()], 2, false),
        (vec![attraction(), coil()], 2, false),
        (vec![coil(), of_another_save.clone()], 2, false),
        (vec![of_another_save], 1, false),
    ] {
        let mut flash = Flash::<4>::new();
        raw::store(&mut flash, &items, 2, count);
        let contents = open(&mut flash).unwrap().contents();
        let is_found = matches!(contents, Contents::Whole(_));
        assert_eq!(is_found, is_whole, "{items:?}");
        assert_eq!(contents == Contents::Damaged, !is_whole);
    }
}

/// Items of another program, shorter than the head of this crate's items.
#[test]
fn an_item_that_is_shorter_than_any_is_passed_by() {
    let mut flash = Flash::<4>::new();
    let items: Vec<_> = (0..8).map(|length| vec![0xFE; length]).collect();
    raw::push(&mut flash, 0, &items);
    assert_eq!(open(&mut flash).unwrap().contents(), Contents::Empty);
}
