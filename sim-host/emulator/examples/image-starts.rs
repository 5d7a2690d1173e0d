//! Campaign: starts of the converter and changes of settings, at many phases: whether every time
//! stamp is right or its sample marked, and no sample of two scans. Prints its result as Markdown;
//! fails if a sample that is not marked is wrong, or a change raises a fault.

#[path = "../tests/integration/common/mod.rs"]
mod common;

use std::process::ExitCode;

use common::RecordedBoard;
use common::stamps::{Judged, Silicon, change, judge};
use ldc161x_sim::{ChipFault, FaultEvent, InterruptRelease, Lost, Overwrite, Time};

/// Starts and changes of each case: 64 cases make 256 of each.
const REPEATS: usize = 4;
/// How long each runs after its first sample is due.
const LENGTH: Time = Time::from_ms(80);
/// Between the moments at which the converter is disturbed or the command comes: no part of any
/// period. Sixteen of them go through the periods of most rates in steps of a few hundred microseconds.
const PHASE: Time = Time::from_us(1_237);
const PHASES: u64 = 16;

/// What became of the starts or changes of a case.
#[derive(Default)]
struct StartRow {
    runs: u32,
    judged: Judged,
    faults: u32,
    /// From the command to the first sample.
    longest: Time,
}

impl StartRow {
    fn add(&mut self, judged: &Judged) {
        self.runs += 1;
        self.judged.add(judged);
    }
}

/// The time in which any of the rates makes some scans.
fn length(rate_hz: f32) -> Time {
    LENGTH + Time::from_secs_f64(5.0 / f64::from(rate_hz))
}

/// A change of settings; returns the bench in which they are in force.
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
    // A sample's own time: it was sent as soon as it was made.
    let origin_us = begin.as_secs_f64() * 1e6;
    if let (Some((time_us, _)), true) = (first, edges > 0) {
        let took_us = (time_us as f64 - origin_us).max(0.0);
        row.longest = row.longest.max(Time::from_secs_f64(took_us * 1e-6));
    }
    row.faults += (bench.faults().len() - faults.min(bench.faults().len())) as u32;
    row.add(&judge(&bench));
    bench
}

/// The converter loses everything, and is started again with the same settings.
fn restarted(snapshot: &RecordedBoard, rate_hz: f32, phase: u64, row: &mut StartRow) {
    let mut bench = snapshot.clone();
    bench.frames.drain(..bench.frames.len().saturating_sub(1));
    let at = bench.board.now() + PHASE.times(phase);
    let event = FaultEvent::at(at, ChipFault::BrownOut(Lost::Everything), Time::ZERO);
    let scheduled = bench.board.chip_mut().schedule(event);
    assert!(scheduled.is_ok(), "no slot for a fault");
    // Until its silence is seen, and it is brought up.
    bench.run(length(rate_hz) + Time::from_ms(120));
    row.add(&judge(&bench));
}

fn print(silicon: Silicon, channels: u8, rate_hz: f32, rows: [&StartRow; 2]) {
    let [changes, starts] = rows;
    let by = match silicon.release {
        InterruptRelease::StatusOnly => "STATUS",
        _ => "STATUS or data",
    };
    let overwritten = match silicon.overwrite {
        Overwrite::ByChannel => "one by one",
        _ => "together",
    };
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

fn main() -> ExitCode {
    println!("<!-- evidence:begin -->");
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
    println!(
        "{starts} starts after the converter had lost everything, {changes} changes of settings, \
         {} samples, {} of them marked: with a gap, or scans missed before them. Of the others, off: \
         a time is more than 2 µs beside the middle of its conversion; mixed: its words are of two \
         scans; skipped: a scan is missing before it; torn: the converter's supply failed \
         in the last byte of the frame, which no reader of the bus can see. {} off, {} mixed, {} skipped, \
         {} torn; time stamps from \
         {:+.2} to {:+.2} µs, {:.2} µs between two that follow one another. Judged by the simulated converter's own record of every conversion. Four \
         channels at 1 kHz are more than the bus can fetch with STATUS: every second scan is missed \
         there, and marked. Faults: raised after a change. Change to sample: from the command to the \
         first sample of the new settings.",
        all.samples,
        all.marked,
        all.off,
        all.mixed,
        all.skipped,
        all.torn,
        all.least_us,
        all.most_us,
        all.jitter_us,
    );
    println!("<!-- evidence:end -->");
    if all.holds() && faults == 0 {
        ExitCode::SUCCESS
    } else {
        eprintln!("a sample was wrong and not marked, or a change of settings raised a fault");
        ExitCode::FAILURE
    }
}
