//! `cargo campaign storage`: flips every bit of the area, fills sectors with garbage, cuts the
//! power in a save and in the next one, and counts the wear of many saves. Prints its result as
//! Markdown; fails if a claim does not hold.

#[path = "../../../firmware/storage/tests/integration/support/mod.rs"]
mod support;

use std::process::ExitCode;

use support::bits::area;
use support::cuts::{Deed, nested};
use support::flash::Remnant;
use support::garbage::survives;
use support::specimens::{small, typical};
use support::wear::{alternating, wear};

use palpate_cli::evidence::{BEGIN, END};

use crate::drawn::Seed;

/// Number of areas with garbage in some of their sectors.
const SPOILT: u64 = 100_000;
/// Number of consecutive saves.
const SAVES: u32 = 100_000;
/// Greatest allowed difference of the erase counts of any two sectors.
const UNEVEN: u32 = 2;

pub(crate) fn run(&Seed { seed }: &Seed) -> ExitCode {
    println!("{BEGIN}");
    println!("## Turned bits\n");
    let bits = area(1);
    println!(
        "Every bit of the area, after saves to either slot, one at a time: {} turned, {} changed nothing \
         of what is stored, {} were found, the storage said that it is damaged, and an older set could be \
         named. None changed a stored value without a word.\n",
        bits.same + bits.damaged,
        bits.same,
        bits.damaged,
    );
    println!("## Garbage\n");
    let first = 1_000_000 * seed;
    (first..first + SPOILT).for_each(survives);
    println!(
        "{SPOILT} areas with random, nearly erased, nearly full or misplaced contents in random sectors: \
         each was read to its end within a bounded number of operations and without a write, returned \
         what had been stored or nothing, and could be erased and used again.\n"
    );
    println!("## Cuts of power\n");
    let history = [small(6e3), typical()];
    let less = typical()[1..].to_vec();
    let (few, fewer) = (small(4e3), small(3e3));
    let cuts = nested(&history, Deed::Save(&few), Deed::Save(&less))
        + nested(&history, Deed::Save(&less), Deed::Save(&fewer))
        + nested(&history, Deed::Erase, Deed::Save(&typical()[1..]));
    println!(
        "At each operation of a save or an erasure, and after that at each operation of the save that \
         follows, with {} kinds of remnant each: {cuts} pairs of cuts. Each left what was stored before or \
         what was to be stored, and said which.\n",
        Remnant::EVERY.len()
    );
    println!("## Wear\n");
    println!("| saved | saves | least erases of a sector | most |\n|---|---|---|---|");
    let changing = |number| small(1e3 + number as f32 / 64.0);
    show("one setting", wear(SAVES, changing));
    show("a calibration", wear(SAVES, alternating(typical)));
    println!("{END}");
    ExitCode::SUCCESS
}

fn show(what: &str, (least, most): (u32, u32)) {
    println!("| {what} | {SAVES} | {least} | {most} |");
    assert!(most - least <= UNEVEN, "the sectors wear unevenly");
}
