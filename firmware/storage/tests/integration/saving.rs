//! What a save accepts, refuses and leaves unchanged.

use palpate_storage::{Contents, Error, Store};
use palpate_wire::{Command, Message};

use crate::support::flash::{AREA, Flash, SECTOR};
use crate::support::specimens::{
    crosstalk, deformation_curve, fullest, identity, small, springs, stiffening, stiffening_curve,
    tank, typical,
};
use crate::support::{assert_stored, load, now, open, save, saved, whole};

#[test]
fn what_is_saved_is_read_back_after_a_start() {
    for commands in [typical(), fullest(), small(6e3)] {
        let mut flash = saved(std::slice::from_ref(&commands));
        let mut store = open(&mut flash).unwrap();
        assert_stored(&mut store, &commands);
        let set = whole(&store);
        assert_eq!((set.generation, set.unknown_items), (1, 0));
        assert!(!store.is_interrupted());
    }
}

#[test]
fn each_setting_and_each_chunk_is_one_item() {
    let mut flash = saved(&[typical()]);
    // The one settings command of the typical set is stored as 23 items.
    let items = typical().len() - 1 + 23;
    let store = open(&mut flash).unwrap();
    assert_eq!(usize::from(whole(&store).items), items);
}

#[test]
fn a_save_of_what_is_stored_touches_nothing() {
    let mut flash = saved(&[typical()]);
    flash.take_counts();
    let mut store = open(&mut flash).unwrap();
    assert_eq!(save(&mut store, &typical()), Ok(false));
    assert_eq!(whole(&store).generation, 1);
    drop(store);
    let counts = flash.take_counts();
    assert_eq!((counts.writes, counts.erases), (0, 0));
}

#[test]
fn a_save_of_nothing_where_nothing_is_stored_touches_nothing() {
    let mut flash = Flash::<4>::new();
    let mut store = open(&mut flash).unwrap();
    assert_eq!(store.contents(), Contents::Empty);
    assert_eq!(save(&mut store, &[]), Ok(false));
    drop(store);
    let counts = flash.take_counts();
    assert_eq!((counts.writes, counts.erases), (0, 0));
}

#[test]
fn a_difference_anywhere_is_saved() {
    for changed in 0..typical().len() {
        let mut flash = saved(&[typical()]);
        let mut store = open(&mut flash).unwrap();
        let mut commands = typical();
        commands.remove(changed);
        assert_eq!(save(&mut store, &commands), Ok(true));
        assert_stored(&mut store, &commands);
        assert_eq!(save(&mut store, &typical()), Ok(true));
        assert_stored(&mut store, &typical());
        assert_eq!(whole(&store).generation, 3);
    }
}

#[test]
fn a_law_takes_the_place_of_a_curve_and_the_other_way_round() {
    let mut flash = Flash::<4>::new();
    let mut store = open(&mut flash).unwrap();
    for commands in [vec![stiffening()], stiffening_curve(20), vec![stiffening()]] {
        assert_eq!(save(&mut store, &commands), Ok(true));
        assert_stored(&mut store, &commands);
    }
}

#[test]
fn what_comes_out_of_order_or_twice_ends_the_save() {
    let orders = [
        [springs(6e3), tank(0, 0)],
        [tank(1, 0), tank(0, 3)],
        [tank(0, 0), tank(0, 0)],
        [identity(1), crosstalk(0, 0)],
        [
            deformation_curve(0, 0, 16).remove(1),
            deformation_curve(0, 0, 16).remove(0),
        ],
    ];
    for [one, other] in orders {
        let mut flash = saved(&[small(6e3)]);
        let mut store = open(&mut flash).unwrap();
        store.begin().unwrap();
        assert_eq!(now(store.put(&one)), Ok(()));
        let kind = other.kind();
        assert_eq!(now(store.put(&other)), Err(Error::OutOfOrder { kind }));
        assert_eq!(now(store.put(&other)), Err(Error::NotBegun));
        assert_eq!(now(store.commit()), Err(Error::NotBegun));
        assert_stored(&mut store, &small(6e3));
    }
}

#[test]
fn what_sets_nothing_or_is_beyond_its_limits_is_refused() {
    let mut flash = saved(&[small(6e3)]);
    let mut store = open(&mut flash).unwrap();
    store.begin().unwrap();
    let refused = now(store.put(&Command::Arm));
    assert_eq!(refused, Err(Error::NotASetter { kind: 0x82 }));
    store.begin().unwrap();
    let negative = springs(-1.0);
    let invalid = negative.validate().unwrap_err();
    assert_eq!(now(store.put(&negative)), Err(Error::Invalid(invalid)));
    assert_stored(&mut store, &small(6e3));
}

#[test]
fn nothing_is_read_during_a_save_and_an_abandoned_one_leaves_what_was_stored() {
    let mut flash = saved(&[small(6e3)]);
    let mut store = open(&mut flash).unwrap();
    store.begin().unwrap();
    assert_eq!(load(&mut store), Err(Error::Saving));
    now(store.put(&tank(0, 0))).unwrap();
    store.abandon();
    assert_stored(&mut store, &small(6e3));
    drop(store);
    let mut store = open(&mut flash).unwrap();
    assert_stored(&mut store, &small(6e3));
    assert!(store.is_interrupted());
    assert_eq!(save(&mut store, &small(5e3)), Ok(true));
    assert!(!store.is_interrupted());
    // The interrupted save does not count.
    assert_eq!(whole(&store).generation, 2);
}

/// Words of one byte, as in a flash with a page buffer, and of 8 and 32 bytes.
#[test]
fn flashes_of_other_words_hold_the_same() {
    fn holds<const WORD: usize>(commands: &[Command]) {
        let mut flash = Flash::<WORD>::new();
        for _ in 0..2 {
            let mut store = open(&mut flash).unwrap();
            save(&mut store, commands).unwrap();
            assert_stored(&mut store, commands);
        }
    }
    holds::<1>(&fullest());
    holds::<8>(&fullest());
    holds::<32>(&typical());
}

#[test]
fn more_than_a_slot_holds_is_refused_and_what_was_stored_stays() {
    let mut flash = Flash::<4>::new();
    // Two slots of two sectors each, one of which can hold items.
    let range = 0..4 * SECTOR as u32;
    let mut store = now(Store::open(&mut flash, range.clone())).unwrap();
    assert_eq!(save(&mut store, &typical()), Ok(true));
    assert_eq!(save(&mut store, &fullest()), Err(Error::Full));
    assert_stored(&mut store, &typical());
    drop(store);
    // The only erased sector is that with the seal's third copy; the map has erased none to make space.
    assert_eq!(flash.counts.erases, 1);
    let mut store = now(Store::open(&mut flash, range)).unwrap();
    assert_stored(&mut store, &typical());
    assert_eq!(save(&mut store, &small(5e3)), Ok(true));
    assert_stored(&mut store, &small(5e3));
}

#[test]
fn a_range_that_is_no_two_slots_is_refused() {
    let sector = SECTOR as u32;
    let reversed = std::ops::Range {
        start: 2 * sector,
        end: sector,
    };
    for range in [
        0..0,
        reversed,
        0..2 * sector,
        0..5 * sector,
        100..100 + 4 * sector,
        0..AREA as u32 + 2 * sector,
        0..u32::MAX,
    ] {
        let opened = now(Store::open(Flash::<4>::new(), range.clone()));
        assert_eq!(opened.err(), Some(Error::Range), "{range:?}");
    }
}

#[test]
fn nothing_beside_the_range_is_touched() {
    let mut flash = Flash::<4>::holding(vec![0x5A; AREA]);
    let inside = 2 * SECTOR..10 * SECTOR;
    flash.bytes[inside.clone()].fill(u8::MAX);
    let range = inside.start as u32..inside.end as u32;
    for commands in [typical(), fullest(), small(6e3), typical()] {
        let mut store = now(Store::open(&mut flash, range.clone())).unwrap();
        save(&mut store, &commands).unwrap();
        assert_stored(&mut store, &commands);
    }
    let mut store = now(Store::open(&mut flash, range)).unwrap();
    now(store.erase()).unwrap();
    drop(store);
    flash.bytes.drain(inside);
    assert!(flash.bytes.iter().all(|byte| *byte == 0x5A));
}

#[test]
fn a_worn_out_sector_is_found_and_what_was_stored_stays() {
    let mut flash = saved(&[small(6e3)]);
    // The worn bytes are in the slot of the next save.
    flash.worn = AREA / 2 + 40..AREA;
    let mut store = open(&mut flash).unwrap();
    assert_eq!(save(&mut store, &small(5e3)), Err(Error::NotKept));
    assert_stored(&mut store, &small(6e3));
    drop(store);
    flash.worn = 0..0;
    let mut store = open(&mut flash).unwrap();
    assert_stored(&mut store, &small(6e3));
    assert_eq!(save(&mut store, &small(5e3)), Ok(true));
    assert_stored(&mut store, &small(5e3));
}

#[test]
fn errors_say_what_to_do() {
    let invalid = springs(-1.0).validate().unwrap_err();
    let errors: [(Error<()>, &str); 6] = [
        (Error::Flash(()), "the flash failed"),
        (Error::Damaged, "save it, or erase"),
        (Error::Newer, "update the firmware"),
        (Error::OutOfOrder { kind: 0x91 }, "kind 0x91 comes too late"),
        (Error::Invalid(invalid), "allowed are"),
        (Error::Unreadable { number: 5 }, "kind 5 cannot be read"),
    ];
    for (error, words) in errors {
        assert!(error.to_string().contains(words), "{error}");
    }
}
