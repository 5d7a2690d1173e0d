//! An area with garbage in some sectors.

use palpate_storage::Contents;

use super::flash::{AREA, Flash, Remnant, SECTOR, SECTORS};
use super::specimens::{small, typical};
use super::{assert_stored, load, now, open, save, saved};

/// Maximum number of flash operations that a call may take: every word of the area is read twice as the
/// header of an item, in each of a few passes.
pub(crate) const PATIENCE: u64 = 16 * (AREA / 4) as u64;

/// Fills some sectors with one kind of garbage.
fn spoil(flash: &mut Flash, seed: u64) {
    flash.cut_after(seed, Remnant::All);
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
                // Most bits are erased here, and most are written in the next case.
                1 => random | flash.random() as u8 | flash.random() as u8,
                2 => random & flash.random() as u8 & flash.random() as u8,
                3 => 0,
                // The content of another sector.
                4 => flash.bytes[other + byte - from],
                // Changed bits in one byte of 200 on average.
                _ if flash.random().is_multiple_of(200) => old ^ random,
                _ => old,
            };
        }
        // Adds the sector marks that the map looks for, so that it reads the data between them.
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

/// Opens an area with garbage in it, erases it and saves again.
pub(crate) fn survives(seed: u64) {
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
    // Opening changes nothing: the map does not repair by itself.
    let counts = flash.take_counts();
    assert_eq!((counts.writes, counts.erases), (0, 0), "seed {seed}");
    // After any garbage the area can be erased and used again.
    flash.patience = PATIENCE;
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    assert_stored(&mut store, &[]);
    assert_eq!(save(&mut store, &typical()), Ok(true), "seed {seed}");
    assert_stored(&mut store, &typical());
}
