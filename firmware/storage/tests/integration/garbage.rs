//! With any content of the flash, every call ends.

use palpate_storage::Contents;

use crate::support::flash::{AREA, Flash};
use crate::support::garbage::{PATIENCE, survives};
use crate::support::specimens::small;
use crate::support::{assert_stored, open, save};

#[test]
fn a_spoilt_area_is_read_to_an_end_and_can_be_erased() {
    for seed in 0..300 {
        survives(seed);
    }
}

/// Garbage in which the map's search for space would take 420,000 reads.
#[test]
fn a_search_for_room_in_garbage_ends() {
    survives(1_044_078);
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

/// Returns whether the map accepts a byte as the mark of a used sector: half of its bits are 0.
const fn is_marked(byte: u8) -> bool {
    byte.count_zeros() >= 4
}
