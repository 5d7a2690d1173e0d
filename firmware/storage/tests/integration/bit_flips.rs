//! One bit of the area is inverted: the stored set is unchanged, or is reported as damaged.

use palpate_storage::{Contents, Error, Store};
use palpate_wire::Command;

use crate::support::bits::{area, turn};
use crate::support::flash::{AREA, Flash};
use crate::support::specimens::small;
use crate::support::{assert_stored, load, now, open, save, saved};

/// Tests bits at a prime step, which reaches every bit of a byte and every position in an item.
#[test]
fn a_turned_bit_is_found_or_does_no_harm() {
    area(509);
}

#[test]
fn every_bit_of_a_small_set_is_found_or_does_no_harm() {
    let history = [small(6e3), small(5e3)];
    let mut flash = saved(&history);
    let used: Vec<_> = (0..AREA)
        .filter(|byte| flash.bytes[*byte] != u8::MAX)
        .collect();
    let last = *used.last().unwrap();
    let bits = (0..AREA / 2).chain(AREA / 2..last + 64).flat_map(|byte| {
        let near = used.binary_search(&byte).is_ok() || byte.is_multiple_of(61);
        (0..8).filter(move |_| near).map(move |bit| byte * 8 + bit)
    });
    let tally = turn(&mut flash, &history[1], bits);
    assert!(tally.damaged > 500, "{tally:?}");
}

/// Clears all bits of two of the three copies of the stored set's seal, and leaves each copy in turn.
#[test]
fn a_seal_outlives_the_loss_of_two_of_its_three_copies() {
    let history = [small(6e3), small(5e3)];
    let flash = saved(&history);
    let copies = seals(&flash);
    // Two copies of the first save's seal, one copy of the second save's seal beside them, and two
    // copies of the latter after its own items.
    assert_eq!(copies.len(), 5);
    for kept in copies[2..].iter().copied() {
        let mut flash = flash.clone();
        for lost in copies[2..].iter().filter(|copy| **copy != kept) {
            flash.bytes[*lost..*lost + 22].fill(0);
        }
        let mut store = open(&mut flash).unwrap();
        assert_stored(&mut store, &history[1]);
    }
}

/// Returns the positions of the seals: keys 255 with a place up to 2, and version 1.
fn seals(flash: &Flash) -> Vec<usize> {
    let is_seal = |at: &usize| {
        matches!(flash.bytes[*at..*at + 4], [255, 0..=2, 0, 1]) && at.is_multiple_of(4)
    };
    (0..AREA - 4).filter(is_seal).collect()
}

/// The sectors of a save are lost together with its seals: the other slot holds a copy of the seal.
#[test]
fn a_set_that_is_lost_altogether_is_damaged_and_not_silently_the_one_before() {
    let history = [small(6e3), small(5e3)];
    for loss in [0x00, 0xFF, 0x5A] {
        let mut flash = saved(&history);
        flash.bytes[AREA / 2..].fill(loss);
        let mut store = open(&mut flash).unwrap();
        assert!(matches!(
            store.contents(),
            Contents::Damaged { older: Some(_) }
        ));
        assert_eq!(load(&mut store), Err(Error::Damaged));
    }
}

#[test]
fn the_set_before_a_damaged_one_is_read_only_when_it_is_asked_for() {
    let history = [small(6e3), small(5e3)];
    let mut flash = saved(&history);
    flash.bytes[AREA / 2..].fill(0);
    let mut store = open(&mut flash).unwrap();
    assert!(store.rewind_to_older());
    assert_eq!(read_on(&mut store), history[0]);
    store.rewind();
    assert_eq!(load(&mut store), Err(Error::Damaged));
}

fn read_on(store: &mut Store<&mut Flash>) -> Vec<Command> {
    let defaults = crate::support::specimens::defaults();
    let mut commands = Vec::new();
    while let Some(command) = now(store.next(&defaults)).unwrap() {
        commands.push(command);
    }
    commands
}

#[test]
fn a_save_over_a_damaged_set_leaves_the_one_before_until_it_has_ended() {
    let history = [small(6e3), small(5e3)];
    let mut flash = saved(&history);
    flash.bytes[AREA / 2..].fill(0);
    let mut store = open(&mut flash).unwrap();
    store.begin().unwrap();
    now(store.put(&small(4e3)[0])).unwrap();
    drop(store);
    let mut store = open(&mut flash).unwrap();
    assert!(matches!(
        store.contents(),
        Contents::Damaged { older: Some(_) }
    ));
    assert_eq!(save(&mut store, &small(4e3)), Ok(true));
    assert_stored(&mut store, &small(4e3));
}

#[test]
fn a_damaged_set_can_be_replaced_by_nothing() {
    for erase in [false, true] {
        let mut flash = saved(&[small(6e3), small(5e3)]);
        flash.bytes[AREA / 2..].fill(0);
        let mut store = open(&mut flash).unwrap();
        if erase {
            now(store.erase()).unwrap();
        } else {
            assert_eq!(save(&mut store, &[]), Ok(true));
        }
        assert_stored(&mut store, &[]);
    }
}
