//! Erasing the storage.

use palpate_storage::Contents;

use crate::support::flash::Flash;
use crate::support::specimens::{small, typical};
use crate::support::{assert_stored, now, open, save, saved, whole};

#[test]
fn after_an_erasure_nothing_is_stored_and_saves_count_from_1() {
    let mut flash = saved(&[small(6e3), typical(), small(5e3)]);
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    assert_stored(&mut store, &[]);
    drop(store);
    let mut store = open(&mut flash).unwrap();
    assert_stored(&mut store, &[]);
    assert!(!store.is_interrupted());
    assert_eq!(save(&mut store, &typical()), Ok(true));
    assert_eq!(whole(&store).generation, 1);
    assert_eq!(save(&mut store, &small(5e3)), Ok(true));
    assert_eq!(whole(&store).generation, 2);
}

#[test]
fn an_erasure_leaves_nothing_of_what_was_stored() {
    let mut flash = saved(&[small(6e3), typical()]);
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    drop(store);
    // Two copies of the seal of an empty set, and the mark of their sector.
    let used = flash.bytes.iter().filter(|byte| **byte != u8::MAX).count();
    assert!(used < 80, "{used}");
}

#[test]
fn an_erasure_of_nothing_writes_nothing() {
    let mut flash = Flash::<4>::new();
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    assert_eq!(store.contents(), Contents::Empty);
    drop(store);
    assert_eq!((flash.counts.writes, flash.counts.erases), (0, 0));

    let mut flash = saved(&[small(6e3)]);
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    drop(store);
    flash.take_counts();
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    drop(store);
    assert_eq!((flash.counts.writes, flash.counts.erases), (0, 0));
}

#[test]
fn an_erasure_ends_a_save() {
    let mut flash = saved(&[small(6e3)]);
    let mut store = open(&mut flash).unwrap();
    store.begin().unwrap();
    now(store.put(&typical()[0])).unwrap();
    now(store.erase()).unwrap();
    assert_stored(&mut store, &[]);
    assert!(now(store.commit()).is_err());
}
