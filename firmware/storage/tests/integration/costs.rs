//! Costs of opening, reading and saving in flash operations, and wear.

use palpate_wire::Command;

use crate::support::flash::{Counts, Flash};
use crate::support::specimens::{fullest, typical};
use crate::support::{load, open, save, saved, wear};

/// Returns the time of all reads in seconds: 2 us for each word of four bytes that is read in whole or
/// in part.
fn reading_s(what: &str, counts: &Counts) -> f64 {
    let words = counts.bytes_read as f64 / 4.0 + counts.reads as f64;
    let reading_s = 2e-6 * words;
    println!("{what}: {counts:?}, {:.1} ms of reading", 1e3 * reading_s);
    reading_s
}

/// Checks the times in seconds of opening, of reading and of saving, and the number of erases.
fn cost(name: &str, commands: &[Command], limits_s: [f64; 3], erases: u64) {
    let mut flash: Flash = saved(&[commands.to_vec(), commands.to_vec(), commands.to_vec()]);
    flash.take_counts();
    open(&mut flash).unwrap();
    assert!(reading_s(&format!("{name}, open"), &flash.take_counts()) < limits_s[0]);
    let mut store = open(&mut flash).unwrap();
    load(&mut store).unwrap();
    assert!(reading_s(&format!("{name}, open and read"), &flash.take_counts()) < limits_s[1]);
    store = open(&mut flash).unwrap();
    save(&mut store, commands).unwrap();
    let saving = flash.take_counts();
    assert!(reading_s(&format!("{name}, open and save"), &saving) < limits_s[2]);
    assert_eq!(saving.erases, erases);
}

#[test]
fn an_opening_takes_milliseconds_and_a_save_one_erase_for_each_sector() {
    cost("typical", &typical(), [0.005, 0.02, 0.15], 1);
    cost("fullest", &fullest(), [0.02, 0.2, 0.8], 2);
}

#[test]
fn the_sectors_are_erased_equally_often() {
    for (set, saves, sectors) in [(typical(), 500, 1), (fullest(), 100, 2)] {
        let (least, greatest) = wear(saves, |_| set.clone());
        assert!(greatest - least <= 2, "{least} to {greatest}");
        // Each save erases the sectors of the save before the stored one.
        let expected = saves * sectors / 16;
        assert!(
            greatest.abs_diff(expected) <= 2,
            "{greatest}, not {expected}"
        );
    }
}
