//! A second definition of the area's format, to write the sets of other firmware versions.

use palpate_wire::crc32;
use sequential_storage::cache::Cache;
use sequential_storage::map::{MapConfig, MapStorage};

use super::flash::{AREA, Flash};
use super::now;

/// An item of any version.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Item {
    pub(crate) key: [u8; 3],
    pub(crate) version: u8,
    pub(crate) payload: Vec<u8>,
}

impl Item {
    pub(crate) fn new(key: [u8; 3], version: u8, payload: &[u8]) -> Self {
        Self {
            key,
            version,
            payload: payload.to_vec(),
        }
    }

    /// Returns the item as a map value, without its key.
    fn value(&self, generation: u32) -> Vec<u8> {
        let mut value = vec![self.version];
        value.extend(generation.to_le_bytes());
        value.extend(&self.payload);
        value
    }
}

/// Returns the CRC-32 over items: each continues the previous one over key, version and payload.
fn digest(items: &[Item]) -> u32 {
    items.iter().fold(0u32, |before, item| {
        let mut bytes = before.to_le_bytes().to_vec();
        bytes.extend(item.key);
        bytes.push(item.version);
        bytes.extend(&item.payload);
        crc32(&bytes)
    })
}

/// Returns the payload of a seal.
fn sum(items: &[Item], configuration_crc: u32) -> Vec<u8> {
    let mut payload = (items.len() as u16).to_le_bytes().to_vec();
    payload.extend(digest(items).to_le_bytes());
    payload.extend(configuration_crc.to_le_bytes());
    payload.extend(0u32.to_le_bytes());
    payload
}

/// Writes items into the first slot, as the first save, with seals of this version.
pub(crate) fn store(flash: &mut Flash, items: &[Item], seal_version: u8) {
    store_sealed(flash, items, seal_version, &sum(items, 0));
}

/// As [`store`], with the seals of other items, and `more` added to their number.
pub(crate) fn store_with_seal_of(flash: &mut Flash, items: &[Item], others: &[Item], more: u8) {
    let mut payload = sum(others, 0);
    payload[0] += more;
    store_sealed(flash, items, 1, &payload);
}

fn store_sealed(flash: &mut Flash, items: &[Item], seal_version: u8, sum: &[u8]) {
    let slot = const { MapConfig::new(0..AREA as u32 / 2) };
    let mut map = MapStorage::<[u8; 3], _, _>::new(flash, slot, Cache::new_uncached());
    let seals = [0, 1].map(|copy| Item::new([255, copy, 0], seal_version, sum));
    for item in items.iter().chain(&seals) {
        let mut buffer = [0; 256];
        let value = item.value(1);
        now(map.store_item(&mut buffer, &item.key, &value.as_slice())).unwrap();
    }
}

/// Returns all items of a slot in stored order, without seals, with their generation.
pub(crate) fn items(flash: &mut Flash, slot: u32) -> Vec<(u32, Item)> {
    let half = AREA as u32 / 2;
    let config = MapConfig::new(slot * half..(slot + 1) * half);
    let mut map = MapStorage::<[u8; 3], _, _>::new(flash, config, Cache::new_uncached());
    let mut buffer = [0; 256];
    let mut found = now(map.fetch_all_items(&mut buffer)).unwrap();
    let mut items = Vec::new();
    while let Some((key, value)) = now(found.next::<&[u8]>(&mut buffer)).unwrap() {
        let (generation, payload) = value[1..].split_first_chunk::<4>().unwrap();
        if key[0] != 255 {
            let item = Item::new(key, value[0], payload);
            items.push((u32::from_le_bytes(*generation), item));
        }
    }
    items
}
