//! What a save and an erasure accept, refuse and leave unchanged.

use palpate_storage::{Contents, Error, Store};
use palpate_wire::{Command, Message};

use crate::support::flash::{AREA, Flash, SECTOR};
use crate::support::specimens::{
    crosstalk, deformation_curve, fullest, identity, small, springs, tank, typical,
};
use crate::support::{assert_stored, load, now, open, save, saved, whole};

#[test]
fn what_is_saved_is_read_back_after_a_start() {
    for commands in [typical(), fullest(), small(6e3)] {
        let mut flash = saved(std::slice::from_ref(&commands));
        let mut store = open(&mut flash).unwrap();
        assert_stored(&mut store, &commands);
        let set = whole(&store);
        // The one settings command is stored as 23 items.
        let of_settings = 22 * usize::from(matches!(commands[0], Command::SetSettings(_)));
        assert_eq!(usize::from(set.items), commands.len() + of_settings);
        assert_eq!((set.generation, set.unknown_items), (1, 0));
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
        now(store.begin()).unwrap();
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
    now(store.begin()).unwrap();
    let refused = now(store.put(&Command::Arm));
    assert_eq!(refused, Err(Error::NotASetter { kind: 0x82 }));
    now(store.begin()).unwrap();
    let negative = springs(-1.0);
    let invalid = negative.validate().unwrap_err();
    assert_eq!(now(store.put(&negative)), Err(Error::Invalid(invalid)));
    assert_stored(&mut store, &small(6e3));
}

#[test]
fn nothing_is_read_during_a_save_and_an_abandoned_one_leaves_what_was_stored() {
    let mut flash = saved(&[small(6e3)]);
    let mut store = open(&mut flash).unwrap();
    now(store.begin()).unwrap();
    assert_eq!(load(&mut store), Err(Error::Saving));
    now(store.put(&tank(0, 0))).unwrap();
    store.abandon();
    assert_stored(&mut store, &small(6e3));
    let mut store = open(&mut flash).unwrap();
    assert_stored(&mut store, &small(6e3));
    save(&mut store, &small(5e3)).unwrap();
    // The interrupted save does not count.
    assert_eq!(whole(&store).generation, 2);
}

/// Words of one byte, as in a flash with a page buffer, and of 8 and 32 bytes.
#[test]
fn flashes_of_other_words_hold_the_same() {
    fn holds<const WORD: usize>() {
        let mut flash = Flash::<WORD>::new();
        for _ in 0..2 {
            let mut store = open(&mut flash).unwrap();
            save(&mut store, &fullest()).unwrap();
            assert_stored(&mut store, &fullest());
        }
    }
    holds::<1>();
    holds::<8>();
    holds::<32>();
}

#[test]
fn more_than_a_slot_holds_is_refused_and_what_was_stored_stays() {
    let mut flash = Flash::<4>::new();
    // Two slots of one sector each.
    let range = 0..2 * SECTOR as u32;
    let mut store = now(Store::open(&mut flash, range.clone())).unwrap();
    save(&mut store, &typical()).unwrap();
    assert_eq!(save(&mut store, &fullest()), Err(Error::Full));
    assert_stored(&mut store, &typical());
    // Only the sector with the copy of the seal was erased, and none to make space.
    assert_eq!(flash.counts.erases, 1);
    let mut store = now(Store::open(&mut flash, range)).unwrap();
    assert_stored(&mut store, &typical());
    save(&mut store, &small(5e3)).unwrap();
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
        0..sector,
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
    flash.worn = 0..0;
    let mut store = open(&mut flash).unwrap();
    save(&mut store, &small(5e3)).unwrap();
    assert_stored(&mut store, &small(5e3));
}

#[test]
fn after_an_erasure_nothing_is_stored_and_saves_count_from_1() {
    let mut flash = saved(&[small(6e3), typical(), small(5e3)]);
    let mut store = open(&mut flash).unwrap();
    now(store.begin()).unwrap();
    now(store.erase()).unwrap();
    assert_eq!(now(store.commit()), Err(Error::NotBegun));
    // The seal of an empty set and the mark of its sector remain; another erasure does not change them.
    let used = flash.bytes.iter().filter(|byte| **byte != u8::MAX).count();
    assert!(used < 80, "{used}");
    flash.take_counts();
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    assert_stored(&mut store, &[]);
    assert_eq!((flash.counts.writes, flash.counts.erases), (0, 0));
    for generation in 1..3 {
        let mut store = open(&mut flash).unwrap();
        save(&mut store, &typical()).unwrap();
        assert_eq!(whole(&store).generation, generation);
    }
}

#[test]
fn an_erasure_of_nothing_writes_nothing() {
    let mut flash = Flash::<4>::new();
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    assert_eq!(store.contents(), Contents::Empty);
    assert_eq!((flash.counts.writes, flash.counts.erases), (0, 0));
}
