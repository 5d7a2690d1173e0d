//! `cargo campaign image-storage`: settings and calibration in the flash of the running image, with
//! power cuts at every flash operation, flipped bits, and all other activity. Prints its result as
//! Markdown; fails if a claim does not hold.

use std::collections::BTreeMap;
use std::process::ExitCode;

use crate::evidence::conclude;

use super::common::RecordedBoard;
use super::common::during_save::DuringSave;
use super::common::stored::{
    Amount, BitFlip, ThirdSave, Which, configuration, erases, flip, spread, streaming_with,
};
use palpate_emulator::{FlashTimes, Time};
use palpate_wire::code::StorageState;
use palpate_wire::{Command, configuration_crc};

/// Number of seeds; the seed selects the effect of a power cut in an operation.
const SEEDS: u64 = 2;
/// Number of second power cuts in the next save, for each first one.
const NESTED: u64 = 3;
/// Number of stored bits to flip, one at a time.
const FLIPS: usize = 200;
/// Number of saves with the longest flash times, each at another phase of the converter.
const SAVES: u64 = 12;

/// Counts of each outcome, and of forbidden ones.
#[derive(Default)]
struct Tally {
    rows: Vec<[String; 5]>,
    cases: u32,
    broken: u32,
}

impl Tally {
    fn add(&mut self, what: &str, cases: u32, before: u32, after: u32, broken: u32) {
        self.cases += cases;
        let numbers = [cases, before, after, broken].map(|number| number.to_string());
        let [cases, before, after, neither] = numbers;
        self.rows
            .push([what.to_owned(), cases, before, after, neither]);
        self.broken += broken;
    }
}

/// Cuts the power at every operation of a save, and again in the next save.
fn cuts(
    amount: Amount,
    seed: u64,
    once: &mut BTreeMap<Which, u32>,
    again: &mut BTreeMap<Which, u32>,
) {
    let save = ThirdSave::prepared(amount, FlashTimes::Typical, seed);
    for operation in 0..save.operations.len() as u64 {
        let (which, recovered, found) = save.cut(operation);
        if which == Which::Neither {
            eprintln!("{amount:?}, seed {seed}, operation {operation}: {found:?}");
        }
        *once.entry(which).or_default() += 1;
        if amount == Amount::Full {
            continue;
        }
        for second in spread(NESTED, save.operations.len() as u64) {
            let Some((which, found)) = save.cut_again(&recovered, which, second) else {
                continue;
            };
            if which == Which::Neither {
                eprintln!("seed {seed}, operation {operation}, then {second}: {found:?}");
            }
            *again.entry(which).or_default() += 1;
        }
    }
}

fn add(tally: &mut Tally, what: &str, counts: &BTreeMap<Which, u32>) {
    let of = |which| counts.get(&which).copied().unwrap_or(0);
    let cases = counts.values().sum();
    tally.add(
        what,
        cases,
        of(Which::Old),
        of(Which::New),
        of(Which::Neither),
    );
}

/// Cuts the power at every operation of a complete erase: either all data remain, or none.
fn erasures(tally: &mut Tally) {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    let commands = configuration(1, Amount::Usual);
    bench.save(&configuration(2, Amount::Usual));
    bench.save(&commands);
    let operations = bench.operations_of(&Command::Erase).len() as u64;
    let (mut before, mut after, mut broken) = (0, 0, 0);
    for operation in 0..operations {
        let mut bench = bench.clone();
        match bench.cut_at(operation, &Command::Erase) {
            Some(found) if found.is(&commands) => before += 1,
            Some(found)
                if found.is_default()
                    && found.storage.state == StorageState::Empty
                    && found.faults.is_empty() =>
            {
                after += 1;
            }
            found => {
                eprintln!("erase, operation {operation}: {found:?}");
                broken += 1;
            }
        }
    }
    let cases = before + after + broken;
    tally.add("`erase`, at each operation", cases, before, after, broken);
}

/// Cuts the power, or sends `load`, after each command of a new calibration, before it is saved.
fn abandoned(tally: &mut Tally) {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    let old = configuration(1, Amount::Full);
    bench.save(&old);
    let (mut cut, mut loaded) = ([0; 2], [0; 2]);
    for command in configuration(2, Amount::Full) {
        bench.accepted(&command);
        let holds = bench.clone().cycle_power().is(&old);
        cut[usize::from(holds)] += 1;
        let found = bench.clone().with_storage(&Command::Load);
        let crc = configuration_crc(&old);
        let holds = found.succeeded && [found.stored_crc, found.in_force_crc] == [crc; 2];
        loaded[usize::from(holds)] += 1;
    }
    let all = cut[0] + cut[1];
    tally.add(
        "after each command of another calibration",
        all,
        cut[1],
        0,
        cut[0],
    );
    tally.add(
        "`load` after each of these instead",
        all,
        loaded[1],
        0,
        loaded[0],
    );
}

/// Flips bits at equal distances over all stored data.
fn flips() -> BTreeMap<BitFlip, u32> {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    let commands = configuration(2, Amount::Usual);
    bench.save(&configuration(1, Amount::Usual));
    bench.save(&commands);
    let written = bench.written();
    let mut counts = BTreeMap::new();
    for index in 0..FLIPS {
        let address = written[index * (written.len() - 1) / (FLIPS - 1)];
        let of = flip(&bench, &commands, address, (index * 5 % 8) as u8);
        *counts.entry(of).or_default() += 1;
    }
    counts
}

/// Saves both amounts with the flash's longest times.
fn saves() -> Vec<(Amount, DuringSave, u32)> {
    let mut all = Vec::new();
    for amount in [Amount::Usual, Amount::Full] {
        let mut save = ThirdSave::prepared(amount, FlashTimes::Longest, 1);
        save.bench.plug();
        for phase in 0..SAVES {
            let mut bench: RecordedBoard = save.bench.clone();
            bench.run(Time::from_us(5_000 + 137 * phase));
            let during = bench.store_beside_everything();
            if !during.holds() {
                eprintln!("{amount:?}, phase {phase}: {during:?}");
            }
            all.push((amount, during, bench.status().stack_bytes));
        }
    }
    all
}

fn print_saves(saves: &[(Amount, DuringSave, u32)]) -> u32 {
    println!(
        "| configuration | saves | took | erases, programs | samples by probe, USB | marked or missing | edge to START | unfed | requests answered | slowest |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for amount in [Amount::Usual, Amount::Full] {
        let of: Vec<&DuringSave> = saves
            .iter()
            .filter(|(of, ..)| *of == amount)
            .map(|(_, during, _)| during)
            .collect();
        let worst = |value: fn(&DuringSave) -> Time| {
            let worst = of.iter().map(|it| value(it)).max().unwrap_or_default();
            worst.as_secs_f64()
        };
        let sum = |value: fn(&DuringSave) -> usize| of.iter().map(|it| value(it)).sum::<usize>();
        let lost = |of: &DuringSave| {
            of.probe.marked
                + of.usb.marked
                + (of.probe.missing_frames + of.usb.missing_frames) as usize
        };
        println!(
            "| {amount:?} | {} | {:.2} s | {}, {} | {}, {} | {} | {:.1} us | {:.1} ms | {} of {} | {:.0} ms |",
            of.len(),
            worst(|it| it.took),
            of[0].erases,
            of[0].programs,
            sum(|it| it.probe.samples),
            sum(|it| it.usb.samples),
            sum(lost),
            worst(|it| it.edge_to_start) * 1e6,
            worst(|it| it.unfed) * 1e3,
            sum(|it| it.answered),
            sum(|it| it.answered + it.refused),
            worst(|it| it.slowest) * 1e3,
        );
    }
    saves.iter().filter(|(_, it, _)| !it.holds()).count() as u32
}

pub(crate) fn run() -> ExitCode {
    let saves = saves();
    let mut tally = Tally::default();
    for amount in [Amount::Usual, Amount::Full] {
        let (mut once, mut again) = (BTreeMap::new(), BTreeMap::new());
        let seeds = if amount == Amount::Usual { SEEDS } else { 1 };
        for seed in 1..=seeds {
            cuts(amount, seed, &mut once, &mut again);
        }
        let prepared = ThirdSave::prepared(amount, FlashTimes::Typical, 1);
        let what = format!(
            "`store`, {amount:?}: at each of {} operations, {} of them erases, {seeds} times",
            prepared.operations.len(),
            erases(&prepared.operations),
        );
        add(&mut tally, &what, &once);
        if !again.is_empty() {
            add(
                &mut tally,
                &format!("and again in the next `store`, at {NESTED} of its operations"),
                &again,
            );
        }
    }
    erasures(&mut tally);
    abandoned(&mut tally);
    let flips = flips();
    let silent = flips.get(&BitFlip::Silent).copied().unwrap_or(0);
    println!("## Cuts of power\n");
    println!(
        "| the power fails | cases | the old one in force | the new one, or none after `erase` | anything else |"
    );
    println!("|---|---|---|---|---|");
    for row in &tally.rows {
        println!("| {} |", row.join(" | "));
    }
    println!(
        "\nAfter each cut the board starts again. In force counts what `storage`, `hello` and `settings` say: \
         one whole configuration by its CRC, identity and settings, stored, and no fault. A start writes nothing, so what repairs is the \
         next `store` or `erase`; the second cuts are in those.\n"
    );
    println!("## Bits\n");
    let count = |of| flips.get(&of).copied().unwrap_or(0);
    println!(
        "{FLIPS} single bits of what is stored, over both slots, each with a power cycle: {} without effect or corrected, {} found \
         (`storage_damaged`, defaults in force), {silent} silently different.\n",
        count(BitFlip::Corrected),
        count(BitFlip::Found),
    );
    println!("## Beside a save with the longest erases and programs\n");
    let held_up = print_saves(&saves);
    let deepest = saves.iter().map(|(.., bytes)| *bytes).max().unwrap_or(0);
    println!(
        "\nUsual: one channel, a curve of six knots. Full: four channels, curves of 32 knots. 1 kHz over probe and USB; a request for the device descriptor every 7 ms. \
         In the midst of an erase `arm`, `drive_coil`, `measure`, `set_coil`, `store`, `load`, `erase` and `reboot` are refused. \
         Bridge and control interrupt rest all the while; no reset. Greatest depth of the stack: {deepest} bytes. Saves in which something was held up: {held_up}."
    );
    if tally.broken + silent + held_up > 0 {
        eprintln!(
            "{} power cuts or loads leave neither the old nor the new; {silent} flipped bits change a value \
             unnoticed; {held_up} saves hold anything up",
            tally.broken
        );
        return ExitCode::FAILURE;
    }
    let text = format!(
        "After each of {} power cuts or loads, either the old or the new configuration is active, whole; none of {FLIPS} \
         flipped bits changes a value unnoticed; none of {} saves delays anything.",
        tally.cases,
        saves.len(),
    );
    conclude(&text, true)
}
