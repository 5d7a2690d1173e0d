//! Reading the stored set.

use palpate_storage::{Contents, Error};
use palpate_wire::Command;

use crate::support::flash::Flash;
use crate::support::format::{self, Item};
use crate::support::specimens::{defaults, settings};
use crate::support::{load, now, open};

fn stored(items: &[Item]) -> Flash {
    let mut flash = Flash::<4>::new();
    format::store(&mut flash, items, 1);
    flash
}

#[test]
fn a_setting_that_is_missing_has_its_default() {
    // Scan rate, and automatic measurement at every contact.
    let rate = Item::new([1, 2, 0], 1, &1_250f32.to_le_bytes());
    let automatic = Item::new([1, 11, 0], 1, &[1]);
    let mut flash = stored(&[rate, automatic]);
    let mut expected = defaults();
    expected.rate_hz = 1_250.0;
    expected.automatic = true;
    let mut store = open(&mut flash).unwrap();
    assert_eq!(load(&mut store), Ok(vec![Command::SetSettings(expected)]));
}

#[test]
fn where_no_setting_is_stored_there_is_no_command_for_settings() {
    let mut flash = stored(&[Item::new([8, 0, 0], 1, &[0; 8])]);
    let mut store = open(&mut flash).unwrap();
    let commands = load(&mut store).unwrap();
    assert!(matches!(commands[..], [Command::SetAttraction(_)]));
}

#[test]
fn a_stored_value_beyond_its_limits_is_refused_and_the_rest_is_read() {
    let rate = Item::new([1, 2, 0], 1, &1e9f32.to_le_bytes());
    let attraction = Item::new([8, 0, 0], 1, &[0; 8]);
    let mut flash = stored(&[rate, attraction]);
    let mut store = open(&mut flash).unwrap();
    assert!(matches!(
        now(store.next(&settings())),
        Err(Error::Invalid(_))
    ));
    let next = now(store.next(&settings())).unwrap();
    assert!(matches!(next, Some(Command::SetAttraction(_))));
    assert_eq!(now(store.next(&settings())), Ok(None));
}

#[test]
fn an_item_that_its_version_cannot_mean_is_refused_and_the_rest_is_read() {
    // A setting, a part, and a part under the key of another channel.
    let mut tank = vec![0, 1];
    tank.extend(1e-10f32.to_le_bytes());
    tank.extend(3e6f64.to_le_bytes());
    let items = [
        Item::new([1, 2, 0], 1, &[1, 2, 3]),
        Item::new([2, 2, 0], 1, &tank),
        Item::new([7, 0, 0], 1, &[0; 5]),
        Item::new([8, 0, 0], 1, &[0; 8]),
    ];
    let mut flash = stored(&items);
    let mut store = open(&mut flash).unwrap();
    for number in [1, 2, 7] {
        let refused = now(store.next(&defaults()));
        assert_eq!(refused, Err(Error::Unreadable { number }));
    }
    let next = now(store.next(&defaults())).unwrap();
    assert!(matches!(next, Some(Command::SetAttraction(_))));
}

#[test]
fn items_that_are_sound_and_not_those_of_the_seal_are_damage() {
    let attraction = |byte| Item::new([8, 0, 0], 1, &[byte; 8]);
    let sealed = [attraction(0)];
    for (items, more, is_whole) in [
        (vec![attraction(0)], 0, true),
        (vec![attraction(0)], 1, false),
        (vec![attraction(1)], 0, false),
        (vec![], 0, false),
        (
            vec![attraction(0), Item::new([8, 1, 0], 1, &[0; 8])],
            0,
            false,
        ),
    ] {
        let mut flash = Flash::<4>::new();
        format::store_with_seal_of(&mut flash, &items, &sealed, more);
        let contents = open(&mut flash).unwrap().contents();
        assert_eq!(
            matches!(contents, Contents::Whole(_)),
            is_whole,
            "{items:?}"
        );
        assert_eq!(contents == Contents::Damaged { older: None }, !is_whole);
    }
}

/// An item of another program's map, shorter than the head of this crate's items.
#[test]
fn an_item_that_is_shorter_than_any_is_passed_by() {
    use sequential_storage::cache::Cache;
    use sequential_storage::map::{MapConfig, MapStorage};

    let mut flash = Flash::<4>::new();
    let config = const { MapConfig::new(0..0x8000) };
    let mut map = MapStorage::<u8, _, _>::new(&mut flash, config, Cache::new_uncached());
    for length in 0..7usize {
        let value = [0xFE; 7];
        let mut buffer = [0; 32];
        now(map.store_item(&mut buffer, &254, &&value[..length])).unwrap();
    }
    let store = open(&mut flash).unwrap();
    assert_eq!(store.contents(), Contents::Empty);
}
