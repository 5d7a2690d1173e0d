//! Inverts the bits of the area one after the other.

use palpate_storage::{Contents, Error};
use palpate_wire::Command;

use super::flash::{AREA, Flash};
use super::specimens::{fullest, typical};
use super::{assert_stored, load, open, saved};

/// Effects of inverted bits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// Number of bits that did not change the stored set.
    pub(crate) same: u32,
    /// Number of bits after whose inversion the stored set was reported as damaged.
    pub(crate) damaged: u32,
}

/// Inverts bits one at a time.
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
        match store.contents() {
            Contents::Damaged { older } => {
                tally.damaged += 1;
                assert!(older.is_some(), "bit {bit}");
                assert_eq!(load(&mut store), Err(Error::Damaged));
            }
            _ => {
                tally.same += 1;
                assert_stored(&mut store, stored);
            }
        }
        drop(store);
        flash.bytes[bit / 8] ^= mask;
    }
    tally
}

/// Inverts every `step`th bit of the area, after saves to both slots.
pub(crate) fn area(step: usize) -> Tally {
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
