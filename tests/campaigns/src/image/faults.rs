//! `cargo campaign image-faults`: faults of bus and converter, and crashes during a ramp, each from
//! a snapshot of the running image. Prints its result as Markdown; fails if a claim does not hold.

use std::fmt::Write;
use std::process::ExitCode;

use crate::evidence::conclude;

use super::common::{Crash, RecordedBoard, TASKS, ramping, streaming};
use ldc161x_sim::{ChipFault, FaultEvent, Lost, Time};
use palpate_emulator::{Image, LineFault, firmware};

/// Longest time from the end of a cause to the next good sample.
const RECOVERY: Time = Time::from_ms(50);
/// Longest times until the bridge is off, after a panic or a fault, and after a hang.
const OFF_AT_ONCE: Time = Time::from_ms(1);
const OFF_AFTER_HANG: Time = Time::from_ms(60);
/// Number of points of a ramp, 3 ms apart.
const POINTS: u64 = 20;

/// Worst result of a group of cases.
struct FaultRow {
    what: String,
    cases: u32,
    worst: Time,
    limit: Time,
    broken: u32,
}

impl FaultRow {
    fn new(what: &str, limit: Time) -> Self {
        Self {
            what: what.to_owned(),
            cases: 0,
            worst: Time::ZERO,
            limit,
            broken: 0,
        }
    }

    /// Adds a case with its time; `None` for a case that did not end.
    fn add(&mut self, took: Option<Time>) {
        self.cases += 1;
        match took {
            Some(took) => {
                self.worst = self.worst.max(took);
                self.broken += u32::from(took > self.limit);
            }
            None => self.broken += 1,
        }
    }
}

/// Time from now to the next sample without a gap; `None` if there is no such sample, if the
/// watchdog reset the board, or if a word with an error flag was sent as a sample.
fn recovery(bench: &mut RecordedBoard) -> Option<Time> {
    let begin = bench.board.now();
    bench.frames.clear();
    while bench.board.now() < begin + Time::from_ms(200) {
        bench.run(Time::from_ms(1));
        if bench.samples().any(|(_, it)| it.missed == 0 && !it.gap) {
            let took = bench.board.now() - begin;
            bench.run(Time::from_ms(20));
            let sound = bench.board.resets().watchdog == 0
                && bench.words().iter().all(|word| word >> 28 == 0);
            return sound.then_some(took);
        }
    }
    None
}

fn wires(snapshot: &RecordedBoard, rows: &mut Vec<FaultRow>) {
    let mut row = FaultRow::new(
        "SDA held low from each bit of a frame on, until 1 to 9 clock pulses have passed",
        RECOVERY,
    );
    for bit in 0..95 {
        let mut bench = snapshot.clone();
        bench.board.disturb(LineFault::SdaLow {
            bit,
            lasting: None,
            clocks: Some(1 + bit % 9),
        });
        bench.run(Time::from_ms(5));
        let freed = !bench.board.is_disturbed();
        row.add(recovery(&mut bench).filter(|_| freed));
    }
    rows.push(row);
    for held_us in [1_000, 4_900, 5_100, 30_000] {
        let mut row = FaultRow::new(
            &format!(
                "SCL held for {} ms, from every fifth bit",
                held_us as f64 / 1e3
            ),
            RECOVERY,
        );
        for bit in (0..95).step_by(5) {
            let mut bench = snapshot.clone();
            let lasting = Some(Time::from_us(held_us));
            bench.board.disturb(LineFault::SclHeld { bit, lasting });
            bench.run(Time::from_us(held_us + 1_000));
            row.add(recovery(&mut bench));
        }
        rows.push(row);
    }
    let mut row = FaultRow::new("SCL held for ever, reported, then released", RECOVERY);
    for bit in (0..95).step_by(10) {
        let mut bench = snapshot.clone();
        let lasting = None;
        bench.board.disturb(LineFault::SclHeld { bit, lasting });
        bench.run(Time::from_ms(150));
        let reported = bench.faults().iter().any(|fault| fault.active);
        bench.board.release();
        row.add(recovery(&mut bench).filter(|_| reported));
    }
    rows.push(row);
}

fn converter(snapshot: &RecordedBoard, rows: &mut Vec<FaultRow>) {
    let mut row = FaultRow::new("NACK of each byte of a frame", RECOVERY);
    for after_bytes in 0..12 {
        let mut bench = snapshot.clone();
        let next = bench.board.chip().traffic().transactions;
        let event = FaultEvent::in_transactions(next, 1, ChipFault::Nack { after_bytes });
        let scheduled = bench.board.chip_mut().schedule(event).is_ok();
        bench.run(Time::from_ms(2));
        row.add(recovery(&mut bench).filter(|_| scheduled));
    }
    rows.push(row);
    let mut row = FaultRow::new(
        "the converter loses everything, at 50 points of a period",
        RECOVERY,
    );
    for point in 0..50 {
        let mut bench = snapshot.clone();
        let at = bench.board.now() + Time::from_us(20 * point);
        let event = FaultEvent::at(at, ChipFault::BrownOut(Lost::Everything), Time::ZERO);
        let scheduled = bench.board.chip_mut().schedule(event).is_ok();
        bench.run(Time::from_ms(2));
        row.add(recovery(&mut bench).filter(|_| scheduled));
    }
    rows.push(row);
    let mut row = FaultRow::new("INTB stuck for 60 ms, low and high", RECOVERY);
    for low in [false, true] {
        let mut bench = snapshot.clone();
        let lasting = Time::from_ms(60);
        let event = FaultEvent::at(bench.board.now(), ChipFault::IntbStuck { low }, lasting);
        let scheduled = bench.board.chip_mut().schedule(event).is_ok();
        bench.run(lasting);
        row.add(recovery(&mut bench).filter(|_| scheduled));
    }
    rows.push(row);
    // A recovery pauses for 20 ms between two attempts; the first start of the converter also searches
    // for its drive current.
    let mut row = FaultRow::new(
        "no converter or another chip at power on, the right one later",
        Time::from_ms(100),
    );
    let foreign = ChipFault::WrongIdentity {
        manufacturer: 0x5449,
        device: 0x3054,
    };
    for fault in [ChipFault::Absent, foreign] {
        let mut bench = RecordedBoard::new();
        let event = FaultEvent::from(Time::ZERO, fault);
        let scheduled = bench.board.chip_mut().schedule(event).is_ok();
        bench.run(Time::from_ms(300));
        let reported = bench.faults().iter().any(|fault| fault.active);
        bench.board.chip_mut().clear_faults();
        row.add(recovery(&mut bench).filter(|_| scheduled && reported));
    }
    rows.push(row);
}

fn crashes(image: &Image, rows: &mut Vec<FaultRow>) {
    for (crash, what, limit) in [
        (Crash::HardFault, "HardFault", OFF_AT_ONCE),
        (Crash::Loop, "endless loop", OFF_AFTER_HANG),
    ] {
        let mut row = FaultRow::new(
            &format!("{what} in each exception, at {POINTS} points of the ramps"),
            limit,
        );
        let mut bench = ramping(super::common::image());
        for _ in 0..POINTS {
            bench.run(Time::from_ms(3));
            for exception in super::common::EXCEPTIONS {
                let mut bench = bench.clone();
                row.add(crash.in_exception(&mut bench, exception));
            }
        }
        rows.push(row);
    }
    let mut row = FaultRow::new(
        &format!("panic in each task, at {POINTS} points of the ramps"),
        OFF_AT_ONCE,
    );
    let mut bench = ramping(image);
    for _ in 0..POINTS {
        bench.run(Time::from_ms(3));
        for task in 0..TASKS {
            let mut bench = bench.clone();
            row.add(super::common::panic_in(&mut bench, task));
        }
    }
    rows.push(row);
}

pub(crate) fn run() -> ExitCode {
    let planted = match firmware::build_with_defect("panic").map(|path| Image::load(&path)) {
        Ok(Ok(image)) => image,
        Ok(Err(error)) => return failed(&error.to_string()),
        Err(error) => return failed(&error.to_string()),
    };
    let mut rows = Vec::new();
    let snapshot = streaming();
    wires(&snapshot, &mut rows);
    converter(&snapshot, &mut rows);
    let wires_and_converter = rows.len();
    crashes(&planted, &mut rows);
    let worst = |rows: &[FaultRow]| {
        let worst = rows.iter().map(|row| row.worst).max();
        worst.unwrap_or_default().as_secs_f64() * 1e3
    };
    let (causes, crashes) = rows.split_at(wires_and_converter);
    let broken: u32 = rows.iter().map(|row| row.broken).sum();
    let cases: u32 = rows.iter().map(|row| row.cases).sum();
    let mut text = format!(
        "{broken} of {cases} cases are beyond their limits; the next good sample comes within {:.0} ms, and the bridge is off within {:.0} \
         ms.\n\n| cause | cases | worst | limit | beyond the limit |\n|---|---|---|---|---|\n",
        worst(causes),
        worst(crashes),
    );
    for row in &rows {
        let ms = |time: Time| format!("{:.3} ms", time.as_secs_f64() * 1e3);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} |",
            row.what,
            row.cases,
            ms(row.worst),
            ms(row.limit),
            row.broken
        );
    }
    text += "\nFaults: time from the end of the cause to the first sample that does not follow a gap, in steps of 1 ms; a watchdog reset or a \
         word with an error flag counts as beyond the limit. Crashes (last three rows): time until the bridge is off. It then stays off \
         for 100 ms, in which the image restarts.";
    conclude(&text, broken == 0)
}

fn failed(why: &str) -> ExitCode {
    eprintln!("{why}");
    ExitCode::FAILURE
}
