//! Costs of opening, reading and saving in flash operations.

use palpate_wire::Command;

use crate::support::flash::{Counts, Flash};
use crate::support::specimens::{fullest, typical};
use crate::support::{load, open, save, saved};

/// Returns the time of all reads in seconds: 2 us for each word of four bytes that is read in whole or
/// in part.
fn reading_s(counts: &Counts) -> f64 {
    let words = counts.bytes_read as f64 / 4.0 + counts.reads as f64;
    2e-6 * words
}

fn show(what: &str, counts: Counts) -> Counts {
    println!(
        "{what}: {counts:?}, {:.1} ms of reading",
        1e3 * reading_s(&counts)
    );
    counts
}

/// Returns the costs of opening, of reading, and of saving with a change in the last command.
fn costs(name: &str, commands: &[Command]) -> [Counts; 3] {
    let shorter = commands[..commands.len() - 1].to_vec();
    let mut flash: Flash = saved(&[commands.to_vec(), shorter, commands.to_vec()]);
    flash.take_counts();
    drop(open(&mut flash));
    let opening = show(&format!("{name}, open"), flash.take_counts());
    let mut store = open(&mut flash).unwrap();
    load(&mut store).unwrap();
    drop(store);
    let reading = show(&format!("{name}, open and read"), flash.take_counts());
    let mut store = open(&mut flash).unwrap();
    save(&mut store, &commands[..commands.len() - 1]).unwrap();
    drop(store);
    let saving = show(&format!("{name}, open and save"), flash.take_counts());
    [opening, reading, saving]
}

#[test]
fn an_opening_takes_milliseconds_and_a_save_one_erase_for_each_sector() {
    let [opening, reading, saving] = costs("typical", &typical());
    assert!(reading_s(&opening) < 0.005 && reading_s(&reading) < 0.02);
    assert!(saving.erases == 1 && reading_s(&saving) < 0.15);
    let [opening, reading, saving] = costs("fullest", &fullest());
    assert!(reading_s(&opening) < 0.02 && reading_s(&reading) < 0.2);
    assert!(saving.erases == 2 && reading_s(&saving) < 0.8);
}
