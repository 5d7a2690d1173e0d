//! Sets stored by other firmware versions, and the part of them that a save keeps.

use std::fs;
use std::path::PathBuf;

use palpate_storage::{Contents, Error};
use palpate_wire::Command;

use crate::support::flash::{AREA, Flash, SECTOR};
use crate::support::raw::{self, item};
use crate::support::specimens::{coil, defaults, small, springs, stiffening_curve, tank, typical};
use crate::support::{assert_stored, load, now, open, save, saved, whole};

/// Sectors of a fixture, each preceded by its number; missing ones are erased.
fn fixture(version: u32) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("fixture/v{version}.bin"))
}

/// Content of the fixtures: a set, and the one saved before it.
fn history() -> [Vec<Command>; 2] {
    let mut newest = typical();
    newest.retain(|command| !matches!(command, Command::SetStiffening(_)));
    let behind = newest
        .iter()
        .position(|command| matches!(command, Command::SetCoil(_)));
    newest.splice(behind.unwrap()..behind.unwrap(), stiffening_curve(20));
    [typical(), newest]
}

/// Fails when the format changes. Sets of every version must remain readable: give the changed item a new
/// version, and leave the fixtures unchanged.
#[test]
fn what_each_version_stored_is_read() {
    for version in [1, 2] {
        let mut bytes = vec![u8::MAX; AREA];
        for entry in fs::read(fixture(version)).unwrap().chunks(1 + SECTOR) {
            let from = usize::from(entry[0]) * SECTOR;
            bytes[from..from + SECTOR].copy_from_slice(&entry[1..]);
        }
        let mut flash = Flash::<4>::holding(bytes);
        let mut store = open(&mut flash).unwrap();
        assert_stored(&mut store, &history()[1]);
        assert_eq!(whole(&store).generation, 2);
        save(&mut store, &small(6e3)).unwrap();
        assert_stored(&mut store, &small(6e3));
    }
}

#[test]
#[ignore = "writes the fixture; a new version of the format needs another file"]
fn write_the_fixture() {
    let flash = saved(&history());
    let sectors = flash.bytes.chunks(SECTOR).enumerate();
    let in_use = sectors.filter(|(_, sector)| sector.iter().any(|byte| *byte != u8::MAX));
    let fixed: Vec<u8> = in_use
        .flat_map(|(number, sector)| [&[number as u8], sector].concat())
        .collect();
    fs::write(fixture(2), fixed).unwrap();
}

/// Items of a save as this version writes them, without its seals.
fn written(commands: Vec<Command>) -> Vec<Vec<u8>> {
    let mut flash = saved(&[commands]);
    let mut items = raw::items(&mut flash, 0);
    items.retain(|item| item[0] != 255);
    items
}

fn known() -> Vec<Command> {
    vec![typical().remove(0), tank(0, 0), coil()]
}

/// A set of the next version: the items of this version, with a setting, a part and a chunk that this
/// version does not know, and a part of a higher version.
fn of_next_version(seal_version: u8) -> Flash {
    let mut items = written(known());
    items.extend(unknown());
    items.sort();
    let mut flash = Flash::<4>::new();
    raw::store(&mut flash, &items, seal_version, items.len());
    flash
}

fn unknown() -> [Vec<u8>; 6] {
    [
        item([1, 24, 0], 1, &[7; 4]),
        item([3, 0x01, 0], 1, &[5; 9]),
        item([5, 0, 0], 2, &[1; 40]),
        item([12, 3, 1], 1, &[2; 247]),
        item([12, 3, 9], 1, &[3; 1]),
        item([245, 0, 0], 9, &[]),
    ]
}

/// Returns the unknown items in a slot, as of the first save.
fn kept(flash: &mut Flash, slot: u32) -> Vec<Vec<u8>> {
    let mut items = raw::items(flash, slot);
    items.iter_mut().for_each(|item| item[4] = 1);
    items.retain(|item| unknown().contains(item));
    items
}

#[test]
fn what_the_next_version_stored_is_read_as_far_as_it_is_known_and_kept_for_it() {
    let mut flash = of_next_version(2);
    let mut store = open(&mut flash).unwrap();
    let set = whole(&store);
    assert_eq!(usize::from(set.unknown_items), unknown().len());
    assert_eq!(set.items - set.unknown_items, 22 + 3);
    assert_eq!(load(&mut store).unwrap(), known());
    let saves = [vec![tank(0, 1)], vec![coil()], vec![tank(1, 3)], vec![]];
    for (commands, slot) in saves.into_iter().zip([1, 0].into_iter().cycle()) {
        let mut store = open(&mut flash).unwrap();
        save(&mut store, &commands).unwrap();
        assert_eq!(load(&mut store).unwrap(), commands);
        assert_eq!(usize::from(whole(&store).unknown_items), unknown().len());
        assert_eq!(kept(&mut flash, slot), unknown());
    }
}

/// A newly set part replaces every version of it: the later calibration counts.
#[test]
fn a_part_that_is_set_takes_the_place_of_its_unknown_version() {
    let mut flash = of_next_version(2);
    let mut store = open(&mut flash).unwrap();
    save(&mut store, &[springs(3e3)]).unwrap();
    assert_stored(&mut store, &[springs(3e3)]);
    let kept = kept(&mut flash, 1);
    assert_eq!(kept.len(), unknown().len() - 1);
    assert!(kept.iter().all(|item| item[0] != 5));
}

#[test]
fn a_curve_that_is_set_takes_the_place_of_every_chunk_and_law_of_an_unknown_version() {
    let of_6 = |index, version| item([6, 0, index], version, &[1; 20]);
    for unknown in [vec![of_6(0, 2)], vec![of_6(1, 2), of_6(9, 2), of_6(25, 2)]] {
        let mut flash = Flash::<4>::new();
        raw::store(&mut flash, &unknown, 2, unknown.len());
        let mut store = open(&mut flash).unwrap();
        save(&mut store, &stiffening_curve(12)).unwrap();
        assert_stored(&mut store, &stiffening_curve(12));
        assert_eq!(whole(&store).unknown_items, 0);
    }
}

#[test]
fn an_older_set_that_lacks_a_setting_and_a_part_is_read() {
    let mut items = written(typical());
    items.retain(|item| !matches!(item[..], [1, 17, ..] | [10, ..]));
    let mut flash = Flash::<4>::new();
    raw::store(&mut flash, &items, 2, items.len());
    let mut store = open(&mut flash).unwrap();
    let mut expected = typical();
    expected.retain(|command| !matches!(command, Command::SetCurrentCorrection(_)));
    let Command::SetSettings(settings) = &mut expected[0] else {
        panic!("the settings come first");
    };
    settings.ramp_s = defaults().ramp_s;
    assert_eq!(load(&mut store).unwrap(), expected);
}

#[test]
fn a_set_in_a_later_format_is_left_alone_until_it_is_erased() {
    let mut flash = of_next_version(3);
    let mut store = open(&mut flash).unwrap();
    assert_eq!(store.contents(), Contents::Newer);
    assert_eq!(load(&mut store), Err(Error::Newer));
    assert_eq!(save(&mut store, &small(6e3)), Err(Error::Newer));
    now(store.erase()).unwrap();
    save(&mut store, &small(6e3)).unwrap();
    assert_stored(&mut store, &small(6e3));
}
