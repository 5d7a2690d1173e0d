//! Bits of the area are inverted, sectors are lost, or hold garbage.

use palpate_storage::{Contents, Error};

use crate::support::damage::{PATIENCE, survives, turn, turn_area};
use crate::support::flash::{AREA, Flash};
use crate::support::specimens::small;
use crate::support::{assert_stored, load, now, open, save, saved};

/// Tests bits at a prime step, which reaches every bit of a byte and every position in an item.
#[test]
fn a_turned_bit_is_found_or_does_no_harm() {
    turn_area(509);
}

/// Tests every bit, including those of both copies of the seal.
#[test]
fn every_bit_of_a_small_set_is_found_or_does_no_harm() {
    let history = [small(6e3), small(5e3)];
    let mut flash = saved(&history);
    let used = (0..AREA).filter(|byte| flash.bytes[*byte] != u8::MAX);
    let bits: Vec<_> = used
        .flat_map(|byte| (0..8).map(move |bit| byte * 8 + bit))
        .collect();
    let tally = turn(&mut flash, &history[1], bits.into_iter());
    assert!(tally.damaged > 500, "{tally:?}");
}

/// The sectors of a save are lost together with its seal. The copy of the seal in the other slot shows
/// the damage until the next save has ended.
#[test]
fn a_set_that_is_lost_altogether_is_damaged_and_not_silently_the_one_before() {
    for (loss, new) in [(0x00, small(4e3)), (0xFF, small(4e3)), (0x5A, vec![])] {
        let mut flash = saved(&[small(6e3), small(5e3)]);
        flash.bytes[AREA / 2..].fill(loss);
        for _ in 0..2 {
            let mut store = open(&mut flash).unwrap();
            assert_eq!(store.contents(), Contents::Damaged);
            assert_eq!(load(&mut store), Err(Error::Damaged));
            now(store.begin()).unwrap();
            now(store.put(&small(4e3)[0])).unwrap();
        }
        let mut store = open(&mut flash).unwrap();
        assert_eq!(save(&mut store, &new), Ok(()));
        assert_stored(&mut store, &new);
    }
}

/// With any content of the flash, every call ends.
#[test]
fn a_spoilt_area_is_read_to_an_end_and_can_be_erased() {
    (0..300).for_each(survives);
}

#[test]
fn an_area_of_one_byte_repeated_is_read_to_an_end() {
    for byte in 0..=u8::MAX {
        let mut flash = Flash::<4>::holding(vec![byte; AREA]);
        flash.patience = PATIENCE;
        let mut store = open(&mut flash).unwrap();
        // The queue takes a byte as the mark of a used sector if half of its bits are 0.
        let is_marked = byte.count_zeros() >= 4;
        assert_eq!(store.contents() == Contents::Damaged, is_marked, "{byte}");
        assert_eq!(save(&mut store, &small(6e3)), Ok(()), "{byte}");
        assert_stored(&mut store, &small(6e3));
    }
}
