//! `cargo campaign storage`: flips every bit of the area, fills sectors with garbage, cuts the
//! power in a save and in the next one, and counts the wear of many saves. Prints its result as
//! Markdown; fails if a claim does not hold.

#[path = "../../../firmware/storage/tests/integration/support/mod.rs"]
mod support;

use std::process::ExitCode;

use support::cuts::{Operation, nested};
use support::damage::{survives, turn_area};
use support::specimens::{small, typical};
use support::wear;

use crate::drawn::Seed;
use crate::evidence::conclude;

/// Number of areas with garbage in some of their sectors.
const SPOILT: u64 = 100_000;
/// Number of consecutive saves.
const SAVES: u32 = 100_000;
/// Greatest allowed difference of the erase counts of any two sectors.
const UNEVEN: u32 = 2;

pub(crate) fn run(&Seed { seed }: &Seed) -> ExitCode {
    let bits = turn_area(1);
    let first = 1_000_000 * seed;
    (first..first + SPOILT).for_each(survives);
    let history = [small(6e3), typical()];
    let less = typical()[1..].to_vec();
    let (few, fewer) = (small(4e3), small(3e3));
    let cuts = nested(&history, Operation::Save(&few), Operation::Save(&less))
        + nested(&history, Operation::Save(&less), Operation::Save(&fewer))
        + nested(&history, Operation::Erase, Operation::Save(&typical()[1..]));
    let changing = |number| small(1e3 + number as f32 / 64.0);
    let worn = [wear(SAVES, changing), wear(SAVES, |_| typical())];
    let [of_setting, of_calibration] = worn.map(|(least, most)| {
        assert!(most - least <= UNEVEN, "the sectors wear unevenly");
        format!("{least} to {most}")
    });
    let text = format!(
        "Of {} turned bits {} changed nothing of what is stored and {} were found; none changed a stored value unnoticed. {SPOILT} areas \
         with garbage were read to their end, gave what had been stored or nothing, and could be used again; {cuts} pairs of \
         power cuts left what was stored before or what was to be stored. {SAVES} saves of one setting erase each sector {of_setting} \
         times, of a calibration {of_calibration} times.",
        bits.same + bits.damaged,
        bits.same,
        bits.damaged,
    );
    conclude(&text, true)
}
