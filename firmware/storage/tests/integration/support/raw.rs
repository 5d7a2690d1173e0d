//! Items as they lie in a slot, to write and read the sets of other firmware versions.

use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::queue::{QueueConfig, QueueStorage};

use super::flash::{AREA, Flash};
use super::now;

type Queue<'a> = QueueStorage<&'a mut Flash, Cache<Uncached, Uncached, Uncached>>;

fn queue(flash: &mut Flash, slot: u32) -> Queue<'_> {
    let half = AREA as u32 / 2;
    let config = QueueConfig::new(slot * half..(slot + 1) * half);
    QueueStorage::new(flash, config, Cache::new_uncached())
}

pub(crate) fn push(flash: &mut Flash, slot: u32, items: &[Vec<u8>]) {
    for item in items {
        now(queue(flash, slot).push(item, false)).unwrap();
    }
}

/// Returns all items of a slot in stored order.
pub(crate) fn items(flash: &mut Flash, slot: u32) -> Vec<Vec<u8>> {
    let mut queue = queue(flash, slot);
    let mut found = now(queue.iter()).unwrap();
    let mut items = Vec::new();
    while let Some(item) = now(found.next(&mut [0; 256])).unwrap() {
        items.push(item.to_vec());
    }
    items
}

/// Returns an item of the first save.
pub(crate) fn item(key: [u8; 3], version: u8, payload: &[u8]) -> Vec<u8> {
    [&key[..], &[version, 1, 0, 0, 0], payload].concat()
}

/// Writes items into the first slot, as the first save, with a seal that claims a number of items.
pub(crate) fn store(flash: &mut Flash, items: &[Vec<u8>], seal_version: u8, count: usize) {
    push(flash, 0, items);
    let mut seal = [0; 10];
    seal[0] = count as u8;
    push(flash, 0, &[item([255, 0, 0], seal_version, &seal)]);
}
