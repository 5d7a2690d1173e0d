//! `cargo campaign image-starts`: starts of the converter and changes of settings, at many phases.
//! Checks that every time stamp is right or its sample marked, and that no sample mixes two scans.
//! Prints its result as Markdown; fails if an unmarked sample is wrong, or a change raises a fault.

use std::process::ExitCode;

use crate::evidence::conclude;

use super::common::RecordedBoard;
use super::common::stamps::{Judged, Shared, Silicon, change, judge, judge_both};
use ldc161x_sim::{ChipFault, FaultEvent, InterruptRelease, Lost, Overwrite, Time};
use palpate_wire::{Frame, Record};

/// Number of starts and changes of each case: 64 cases make 256 of each.
const REPEATS: usize = 4;
/// Duration of each run after its first sample is due.
const LENGTH: Time = Time::from_ms(80);
/// Interval between the times at which the converter is disturbed or the command arrives; it
/// divides no period. Sixteen intervals step through the periods of most rates by a few hundred
/// microseconds each.
const PHASE: Time = Time::from_us(1_237);
const PHASES: u64 = 16;

/// Results of the starts or changes of a case.
#[derive(Default)]
struct StartRow {
    runs: u32,
    judged: Judged,
    faults: u32,
    /// Longest time from the command to the first sample.
    longest: Time,
}

impl StartRow {
    fn add(&mut self, judged: &Judged) {
        self.runs += 1;
        self.judged.add(judged);
    }
}

/// Time for several scans at any of the rates.
fn length(rate_hz: f32) -> Time {
    LENGTH + Time::from_secs_f64(5.0 / f64::from(rate_hz))
}

/// Changes the settings; returns the bench in which they are in force.
fn changed(
    snapshot: &RecordedBoard,
    channels: u8,
    rate_hz: f32,
    phase: u64,
    row: &mut StartRow,
) -> RecordedBoard {
    let mut bench = snapshot.clone();
    bench.run(PHASE.times(phase));
    let faults = bench.faults().len();
    let begin = bench.board.now();
    change(&mut bench, channels, rate_hz, Time::ZERO);
    let count = channels.count_ones() as usize;
    let edges = bench.board.chip().interrupts();
    bench.run(length(rate_hz));
    let first = bench.samples().find(|(_, it)| it.channels.len() == count);
    // The time in the sample serves, since a sample is sent as soon as it is made.
    let origin_us = begin.as_secs_f64() * 1e6;
    if let (Some((time_us, _)), true) = (first, edges > 0) {
        let took_us = (time_us as f64 - origin_us).max(0.0);
        row.longest = row.longest.max(Time::from_secs_f64(took_us * 1e-6));
    }
    row.faults += (bench.faults().len() - faults.min(bench.faults().len())) as u32;
    row.add(&judge(&bench));
    bench
}

/// The converter loses all its registers, and restarts with the same settings.
fn restarted(snapshot: &RecordedBoard, rate_hz: f32, phase: u64, row: &mut StartRow) {
    let mut bench = snapshot.clone();
    bench.frames.drain(..bench.frames.len().saturating_sub(1));
    let at = bench.board.now() + PHASE.times(phase);
    let event = FaultEvent::at(at, ChipFault::BrownOut(Lost::Everything), Time::ZERO);
    let scheduled = bench.board.chip_mut().schedule(event);
    assert!(scheduled.is_ok(), "no slot for a fault");
    // Runs until the converter's silence is detected and the converter has restarted.
    bench.run(length(rate_hz) + Time::from_ms(120));
    row.add(&judge(&bench));
}

/// Release of INTB and overwriting of DATA, in words.
const fn silicon_words(silicon: Silicon) -> [&'static str; 2] {
    let by = match silicon.release {
        InterruptRelease::StatusOnly => "STATUS",
        _ => "STATUS or data",
    };
    let overwritten = match silicon.overwrite {
        Overwrite::ByChannel => "one by one",
        _ => "together",
    };
    [by, overwritten]
}

fn print(silicon: Silicon, channels: u8, rate_hz: f32, rows: [&StartRow; 2]) {
    let [changes, starts] = rows;
    let [by, overwritten] = silicon_words(silicon);
    let mut both = changes.judged;
    both.add(&starts.judged);
    println!(
        "| {} | {rate_hz} Hz | {by} | {overwritten} | {} | {} | {} | {} | {} | {} | {} | {} | {:+.2} to {:+.2} µs | {} | {:.0} ms |",
        channels.count_ones(),
        starts.runs,
        changes.runs,
        both.samples,
        both.marked,
        both.off,
        both.mixed,
        both.skipped,
        both.torn,
        both.least_us,
        both.most_us,
        changes.faults,
        changes.longest.as_secs_f64() * 1e3,
    );
}

/// Rates of two converters with 1 to 4 channels; the last is the highest that the bus can fetch
/// from both.
const RATES_OF_TWO_HZ: [[f32; 4]; 4] = [
    [100.0, 250.0, 500.0, 1_000.0],
    [100.0, 250.0, 500.0, 810.0],
    [100.0, 250.0, 430.0, 580.0],
    [100.0, 200.0, 250.0, 430.0],
];

/// Drops frames sent before the answer to the last command: samples of the old settings.
fn forget_before_the_answer(bench: &mut RecordedBoard) {
    let is_answer = |frame: &Frame<Record>| matches!(frame.message, Record::Acknowledgement(_));
    if let Some(answer) = bench.frames.iter().rposition(is_answer) {
        bench.frames.drain(..answer);
    }
}

/// Changes settings of two converters, and lets the second one lose its registers and restart while the first
/// one continues. Returns the totals, and whether no sample was lost or wrong and no fault was false.
fn of_two() -> (String, bool) {
    println!(
        "| channels | rate | INTB released by | DATA overwritten | changes | samples | marked \
         | lost | wrong | faults | starts of the second | lost by the first |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    let mut all = Shared::default();
    let (mut cases, mut false_faults, mut lost_by_first) = (0, 0, 0);
    let mut phases = (1..=PHASES).cycle();
    for silicon in Silicon::all() {
        let mut snapshot = silicon.bench_of_two();
        snapshot.stream();
        for (channels, rates_hz) in [0b0001, 0b0011, 0b0111, 0b1111]
            .into_iter()
            .zip(RATES_OF_TWO_HZ)
        {
            for rate_hz in rates_hz {
                let mut both = Shared::default();
                let (mut faults, mut lost) = (0, 0);
                for phase in phases.by_ref().take(REPEATS) {
                    let mut bench = snapshot.clone();
                    bench.run(PHASE.times(phase));
                    change(&mut bench, channels, rate_hz, Time::ZERO);
                    forget_before_the_answer(&mut bench);
                    bench.run(length(rate_hz) + Time::from_ms(100));
                    both.add(&judge_both(&bench, rate_hz));
                    faults += bench.faults().len();
                    let begin = bench.frames.len().saturating_sub(1);
                    bench.frames.drain(..begin);
                    let at = bench.board.now() + PHASE.times(phase);
                    let event =
                        FaultEvent::at(at, ChipFault::BrownOut(Lost::Everything), Time::ZERO);
                    let second = bench.board.second_chip_mut();
                    assert!(second.is_some_and(|chip| chip.schedule(event).is_ok()));
                    bench.run(length(rate_hz) + Time::from_ms(120));
                    let of_first = bench.samples().filter(|(_, it)| it.sensor == 0);
                    lost += of_first
                        .map(|(_, it)| it.missed + u32::from(it.gap))
                        .sum::<u32>();
                }
                let [release, overwritten] = silicon_words(silicon);
                println!(
                    "| {} | {rate_hz} Hz | {release} | {overwritten} | {REPEATS} | {} | {} | {} | {} | {faults} | {REPEATS} | {lost} |",
                    channels.count_ones(),
                    both.samples,
                    both.marked,
                    both.lost,
                    both.wrong,
                );
                all.add(&both);
                cases += REPEATS;
                false_faults += faults;
                lost_by_first += lost;
            }
        }
    }
    let text = format!(
        "Two converters on one bus take turns, one channel per transaction, at rates up to the highest that the board accepts. \
         {cases} times the settings of both are changed, then the second loses all registers and is restarted. Of {} samples {} are \
         marked. {} scans were lost between two samples of a converter; {} unmarked samples have another sensor's frequency or a time \
         off the scan period; {false_faults} faults. While the second restarted, {lost_by_first} scans of the first were lost or marked \
         as following a gap.",
        all.samples, all.marked, all.lost, all.wrong,
    );
    let is_sound = [
        all.lost as usize,
        all.wrong as usize,
        false_faults,
        lost_by_first as usize,
    ] == [0; 4];
    (text, is_sound)
}

pub(crate) fn run() -> ExitCode {
    println!(
        "| channels | rate | INTB released by | DATA overwritten | starts | changes | samples \
         | marked | off | mixed | skipped | torn | time stamps, unmarked | faults | change to sample |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let mut all = Judged::default();
    let (mut starts, mut changes, mut faults) = (0, 0, 0);
    let mut phases = (1..=PHASES).cycle();
    for silicon in Silicon::all() {
        let mut snapshot = silicon.bench();
        snapshot.stream();
        for channels in [0b0001, 0b0011, 0b0111, 0b1111] {
            let fastest_hz = silicon.fastest_hz(channels);
            for rate_hz in [100.0, 500.0, fastest_hz.min(1_000.0), fastest_hz] {
                let (mut change, mut start) = (StartRow::default(), StartRow::default());
                for phase in phases.by_ref().take(REPEATS) {
                    let bench = changed(&snapshot, channels, rate_hz, phase, &mut change);
                    restarted(&bench, rate_hz, phase, &mut start);
                }
                print(silicon, channels, rate_hz, [&change, &start]);
                all.add(&change.judged);
                all.add(&start.judged);
                starts += start.runs;
                changes += change.runs;
                faults += change.faults;
            }
        }
    }
    println!();
    let (two, two_are_sound) = of_two();
    let text = format!(
        "{starts} starts after the converter had lost all registers and {changes} changes of settings, {} samples. Wrong and not marked: \
         {} with a wrong time, {} that mix two scans, {} after a missing scan that is not reported, {} torn, by a supply \
         that failed during the frame's last byte, which no reader can see. Time stamps are off by {:+.2} to {:+.2} µs.\n\n\
         Compared with the simulated converter's own record of every conversion. {} samples are marked as following a gap or missed \
         scans. For the others: a time is wrong if it is more than 2 µs from the middle of its conversion; a sample is torn if the \
         converter's supply failed during the last byte of the frame, which no reader of the bus can see. The errors of two \
         consecutive time stamps differ by {:.2} µs at most. {faults} faults were raised after a change. With STATUS in each frame the \
         bus cannot fetch four channels at 1 kHz: every second scan is missed, and the samples are marked.\n\n{two}",
        all.samples,
        all.off,
        all.mixed,
        all.skipped,
        all.torn,
        all.least_us,
        all.most_us,
        all.marked,
        all.jitter_us,
    );
    let holds = all.holds() && faults == 0 && two_are_sound;
    if !holds {
        eprintln!("a sample was wrong and not marked, or a change of settings raised a fault");
    }
    conclude(&text, holds)
}
