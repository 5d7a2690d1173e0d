//! What sequential-storage does not promise, and this crate adds. Where one of these tests fails, a part of
//! this crate may have become needless.

use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use crate::support::flash::{Flash, Remnant, SECTOR};
use crate::support::{now, raw};

/// The queue omits a damaged item without an error, so this crate keeps the item count, in two copies.
#[test]
fn an_item_with_a_turned_bit_is_left_out_without_an_error() {
    let mut flash = Flash::<4>::new();
    let items = [vec![1; 20], vec![2; 20], vec![3; 20]];
    raw::push(&mut flash, 0, &items);
    // A bit in the middle of the second item, after the mark of the sector and the headers.
    flash.bytes[4 + 28 + 8 + 10] ^= 1;
    assert_eq!(raw::items(&mut flash, 0), [vec![1; 20], vec![3; 20]]);
}

type Map<'a> = MapStorage<u8, &'a mut Flash, Cache<Uncached, Uncached, Uncached, u8>>;

fn map(flash: &mut Flash) -> Map<'_> {
    let config = const { MapConfig::new(0..3 * SECTOR as u32) };
    MapStorage::new(flash, config, Cache::new_uncached())
}

fn put(flash: &mut Flash, key: u8, value: u32) -> bool {
    let value = [value; 16];
    now(map(flash).store_item(&mut [0; 128], &key, &value)).is_ok()
}

/// A map that has filled its sectors moves the values that it keeps and erases their old sector. So this
/// crate never overwrites the stored set, and erases the slot of a save itself.
#[test]
fn a_map_loses_a_value_that_is_not_written_when_the_power_fails_in_an_erasure() {
    let mut flash = Flash::<4>::new();
    assert!(put(&mut flash, 0, 0));
    let before = loop {
        let before = flash.clone();
        assert!(put(&mut flash, 1, 1));
        if flash.counts.erases > 0 {
            break before;
        }
    };
    let lost = Remnant::EVERY.into_iter().filter(|remnant| {
        (0..10).any(|after| {
            let mut flash = before.clone();
            flash.cut_after(after, *remnant);
            let is_cut = !put(&mut flash, 1, 1);
            flash.power_on();
            put(&mut flash, 1, 1);
            is_cut && now(map(&mut flash).fetch_item::<[u32; 16]>(&mut [0; 128], &0)) == Ok(None)
        })
    });
    let lost: Vec<_> = lost.collect();
    assert_eq!(lost, [Remnant::Bits, Remnant::Programmed]);
}
