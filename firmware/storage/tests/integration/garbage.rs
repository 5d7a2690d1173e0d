//! Whatever the flash contains, every call comes to an end.

use palpate_storage::Contents;

use crate::support::flash::{AREA, Flash, SECTOR, SECTORS};
use crate::support::specimens::{small, typical};
use crate::support::{assert_stored, load, now, open, save, saved};

/// Flash operations of the longest call: every word of the area is read twice as the header of an
/// item, in each of a few passes.
const PATIENCE: u64 = 16 * (AREA / 4) as u64;

/// Fills some sectors with one kind of garbage.
fn spoil(flash: &mut Flash, seed: u64) {
    flash.cut_after(seed, crate::support::flash::Remnant::All);
    flash.power_on();
    let sectors = flash.random() | 1 << (seed % SECTORS as u64);
    for sector in (0..SECTORS).filter(|sector| sectors >> sector & 1 == 1) {
        let kind = flash.random() % 6;
        let (from, to) = (sector * SECTOR, (sector + 1) * SECTOR);
        let other = flash.random() as usize % SECTORS * SECTOR;
        for byte in from..to {
            let random = flash.random() as u8;
            let old = flash.bytes[byte];
            flash.bytes[byte] = match kind {
                0 => random,
                // Mostly erased, mostly written.
                1 => random | flash.random() as u8 | flash.random() as u8,
                2 => random & flash.random() as u8 & flash.random() as u8,
                3 => 0,
                // A sector that belongs elsewhere.
                4 => flash.bytes[other + byte - from],
                // Bits turned here and there.
                _ if flash.random().is_multiple_of(200) => old ^ random,
                _ => old,
            };
        }
        // The marks that the map looks for, so that it reads what is between them.
        if flash.random().is_multiple_of(2) {
            flash.bytes[from..from + 4].fill(0);
            let end = if flash.random().is_multiple_of(2) {
                0
            } else {
                u8::MAX
            };
            flash.bytes[to - 4..to].fill(end);
        }
    }
}

fn survives(seed: u64) {
    let history = [typical(), small(5e3)];
    let mut flash = saved(&history);
    spoil(&mut flash, seed);
    flash.patience = PATIENCE;
    flash.take_counts();
    let mut store = open(&mut flash).unwrap();
    let stored = load(&mut store);
    if let Contents::Whole(_) = store.contents() {
        let stored = stored.unwrap();
        assert!(history.contains(&stored), "seed {seed}: {stored:?}");
    }
    drop(store);
    // To look at it changes nothing: the map repairs nothing of its own accord.
    let counts = flash.take_counts();
    assert_eq!((counts.writes, counts.erases), (0, 0), "seed {seed}");
    // It can always be used again.
    flash.patience = PATIENCE;
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    assert_stored(&mut store, &[]);
    assert_eq!(save(&mut store, &typical()), Ok(true), "seed {seed}");
    assert_stored(&mut store, &typical());
}

#[test]
fn a_spoilt_area_is_read_to_an_end_and_can_be_erased() {
    for seed in 0..300 {
        survives(seed);
    }
}

#[test]
#[ignore = "takes minutes"]
fn any_spoilt_area_is_read_to_an_end_and_can_be_erased() {
    for seed in 300..100_300 {
        survives(seed);
    }
}

#[test]
fn an_area_of_one_byte_repeated_is_read_to_an_end() {
    for byte in 0..=u8::MAX {
        let mut flash = Flash::<4>::holding(vec![byte; AREA]);
        flash.patience = PATIENCE;
        let mut store = open(&mut flash).unwrap();
        let is_blank = byte == u8::MAX;
        assert_eq!(
            store.contents() == Contents::Empty,
            is_blank || !is_marked(byte)
        );
        assert_eq!(save(&mut store, &small(6e3)), Ok(true), "{byte}");
        assert_stored(&mut store, &small(6e3));
    }
}

/// Whether the map takes a byte for the mark of a sector in use: half of its bits are 0.
const fn is_marked(byte: u8) -> bool {
    byte.count_zeros() >= 4
}
