//! Damage of the area: inverted bits, and garbage in some sectors.

use palpate_storage::{Contents, Error};
use palpate_wire::Command;

use super::flash::{AREA, Flash, Remnant, SECTOR, SECTORS};
use super::specimens::{fullest, small, typical};
use super::{assert_stored, load, now, open, save, saved};

/// Maximum number of flash operations that a call may take: every word of the area is read twice as the
/// header of an item, in each of a few passes.
pub(crate) const PATIENCE: u64 = 16 * (AREA / 4) as u64;

/// Effects of inverted bits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// Number of bits that did not change the stored set.
    pub(crate) same: u32,
    /// Number of bits after whose inversion the stored set was reported as damaged.
    pub(crate) damaged: u32,
}

/// Inverts bits one at a time: the stored set is unchanged, or is reported as damaged.
pub(crate) fn turn(
    flash: &mut Flash,
    stored: &[Command],
    bits: impl Iterator<Item = usize>,
) -> Tally {
    let mut tally = Tally::default();
    for bit in bits {
        let mask = 1 << (bit % 8);
        flash.bytes[bit / 8] ^= mask;
        let mut store = open(&mut *flash).unwrap();
        if store.contents() == Contents::Damaged {
            tally.damaged += 1;
            assert_eq!(load(&mut store), Err(Error::Damaged));
        } else {
            tally.same += 1;
            assert_stored(&mut store, stored);
        }
        flash.bytes[bit / 8] ^= mask;
    }
    tally
}

/// Inverts every `step`th bit of the area, after saves to both slots.
pub(crate) fn turn_area(step: usize) -> Tally {
    let mut sum = Tally::default();
    for history in [[fullest(), typical()], [typical(), fullest()]] {
        let mut flash = saved(&history);
        let tally = turn(&mut flash, &history[1], (0..AREA * 8).step_by(step));
        // Only bits of the stored items can damage the set: neither those of the seals nor those of the
        // rest of the area.
        let items: usize = flash.bytes.iter().filter(|byte| **byte != u8::MAX).count();
        assert!(
            tally.damaged > 0 && tally.damaged < (8 * items / step) as u32,
            "{tally:?}"
        );
        sum.same += tally.same;
        sum.damaged += tally.damaged;
    }
    sum
}

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
        // Adds the sector marks that the queue looks for, so that it reads the data between them.
        if flash.random().is_multiple_of(2) {
            flash.bytes[from..from + 4].fill(0);
            let is_closed = flash.random().is_multiple_of(2);
            flash.bytes[to - 4..to].fill(if is_closed { 0 } else { u8::MAX });
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
    // Opening changes nothing: the queue does not repair by itself.
    let counts = flash.take_counts();
    assert_eq!((counts.writes, counts.erases), (0, 0), "seed {seed}");
    // After any garbage the area can be erased and used again.
    flash.patience = PATIENCE;
    let mut store = open(&mut flash).unwrap();
    now(store.erase()).unwrap();
    assert_stored(&mut store, &[]);
    assert_eq!(save(&mut store, &typical()), Ok(()), "seed {seed}");
    assert_stored(&mut store, &typical());
}
