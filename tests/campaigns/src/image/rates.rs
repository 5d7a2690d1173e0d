//! `cargo campaign image-rates`: rate of the stream, delay after an edge, losses, and whether the
//! losses are counted. Prints its result as Markdown; fails if a loss is not counted or an edge
//! waits.

use std::fmt::Write;
use std::ops::{Range, RangeInclusive};
use std::process::ExitCode;

use crate::evidence::conclude;

use super::common::{RecordedBoard, recording};
use ldc161x_sim::{InterruptRelease, Settings, Switches, Time};
use palpate_wire::code::{Outcome, Stream};
use palpate_wire::command::Command;
use palpate_wire::record::Status;

/// Longest allowed delay from an edge of INTB to START while the bus is free.
const LATENCY: Time = Time::from_us(10);
/// Duration of each case.
const LENGTH: Time = Time::from_ms(60_000);

struct RateCase {
    channels: u8,
    rate_hz: f32,
    stream: Stream,
    release: InterruptRelease,
    /// Bit times of a frame on the bus.
    bit_times: u32,
}

impl RateCase {
    /// Frame rate at 400 kHz with 10 us between two frames, Hz.
    fn limit_hz(&self) -> f64 {
        1.0 / (f64::from(self.bit_times) * 2.5e-6 + 10e-6)
    }
}

struct RateResult {
    rate_hz: f64,
    /// Least and greatest number of lost conversions: a range, since the firmware reports a status
    /// at another time than the campaign reads the converter's own count.
    lost: RangeInclusive<u32>,
    reported: u32,
    median: Time,
    worst: Time,
    load: f64,
}

/// A status, and the converter's count of overwritten conversions before and after it.
fn status(bench: &mut RecordedBoard) -> (Status, Range<u64>) {
    let before = bench.board.chip().overwritten(0);
    let status = bench.status();
    (status, before..bench.board.chip().overwritten(0))
}

fn measure(case: &RateCase) -> RateResult {
    let chip = Settings {
        switches: Switches {
            interrupt_release: case.release,
            ..Switches::default()
        },
        ..Settings::default()
    };
    let mut bench = RecordedBoard::with(chip, recording());
    bench.stream();
    let settings = palpate_wire::command::Settings {
        channels: case.channels,
        rate_hz: case.rate_hz,
        stream: case.stream,
        ..bench.settings()
    };
    let answer = bench.command(&Command::SetSettings(settings));
    assert_eq!(answer.outcome, Outcome::Accepted);
    bench.run(Time::from_ms(200));
    let (before, from) = status(&mut bench);
    let edges = bench
        .board
        .wire_log()
        .map_or(0, |log| log.edge_to_start.len());
    let asleep = bench.board.time_asleep();
    let begin = bench.board.now();
    let mut left = LENGTH;
    while left > Time::ZERO {
        let slice = left.min(Time::from_ms(500));
        bench.run(slice);
        bench.frames.drain(..bench.frames.len().saturating_sub(1));
        left = left - slice;
    }
    let passed = (bench.board.now() - begin).as_secs_f64();
    let load = 1.0 - (bench.board.time_asleep() - asleep).as_secs_f64() / passed;
    let (after, to) = status(&mut bench);
    let mut latencies = bench
        .board
        .wire_log()
        .map(|log| log.edge_to_start[edges..].to_vec())
        .unwrap_or_default();
    latencies.sort_unstable();
    RateResult {
        rate_hz: f64::from(after.conversions - before.conversions) / passed,
        lost: (to.start - from.end) as u32..=(to.end - from.start) as u32,
        reported: after.conversions_lost - before.conversions_lost,
        median: latencies
            .get(latencies.len() / 2)
            .copied()
            .unwrap_or_default(),
        worst: latencies.last().copied().unwrap_or_default(),
        load,
    }
}

/// Requested cases. A register takes 47 bit times, and a STOP follows the last one; where only
/// STATUS releases INTB, it is one more register of every frame.
fn cases() -> Vec<RateCase> {
    let mut cases = Vec::new();
    for (release, registers) in [
        (InterruptRelease::StatusOrData, 0),
        (InterruptRelease::StatusOnly, 1),
    ] {
        for (channels, share, stream) in [
            (0b0001, None, Stream::Samples),
            (0b0001, Some(0.98), Stream::Raw),
            (0b1111, Some(0.98), Stream::Raw),
        ] {
            let mut case = RateCase {
                channels,
                rate_hz: 1_000.0,
                stream,
                release,
                bit_times: 47 * (2 * channels.count_ones() + registers) + 1,
            };
            if let Some(share) = share {
                case.rate_hz = (case.limit_hz() * share).ceil() as f32;
            }
            cases.push(case);
        }
    }
    cases
}

fn text(count: &RangeInclusive<u32>) -> String {
    if count.start() == count.end() {
        count.start().to_string()
    } else {
        format!("{} to {}", count.start(), count.end())
    }
}

pub(crate) fn run() -> ExitCode {
    let mut rows = String::new();
    let (mut share, mut worst, mut reported) = (0.0_f64, Time::ZERO, 0);
    let mut holds = true;
    for case in cases() {
        let found = measure(&case);
        let by = match case.release {
            InterruptRelease::StatusOnly => "STATUS",
            _ => "STATUS or data",
        };
        let _ = writeln!(
            rows,
            "| {} | {} Hz | {} | {by} | {:.1} | {:.1} % | {} | {} | {} | {} | {:.0} % |",
            case.channels.count_ones(),
            case.rate_hz,
            if case.stream == Stream::Raw {
                "raw"
            } else {
                "samples"
            },
            found.rate_hz,
            found.rate_hz / case.limit_hz() * 100.0,
            text(&found.lost),
            found.reported,
            us(found.median),
            us(found.worst),
            found.load * 100.0,
        );
        share = share.max(found.rate_hz / case.limit_hz() * 100.0);
        worst = worst.max(found.worst);
        reported += found.reported;
        holds &= found.worst <= LATENCY && found.lost.contains(&found.reported);
        holds &= *found.lost.start() == 0;
    }
    let text = format!(
        "At up to {share:.1} % of the bus's limit, {reported} conversions are reported lost; the edge of INTB waits {} at worst.\n\n\
         | channels | asked | stream | INTB released by | scans per second | of the bus's limit \
         | lost | reported | edge to START, median | worst | load |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n{rows}\n\
         {} simulated seconds each. The bus's limit: a frame takes its bits at 400 kHz and 10 µs. \
         Lost: conversions that the converter overwrote unread, by its own record; two figures where they changed \
         while the device reported its count. Reported: those that the firmware says were lost. Settings that need \
         more than 98 % of the bus are refused.",
        us(worst),
        LENGTH.as_secs_f64()
    );
    if !holds {
        eprintln!(
            "a loss was not reported, a conversion was lost without need, or an edge waited too long"
        );
    }
    conclude(&text, holds)
}

fn us(time: Time) -> String {
    format!("{:.2} µs", time.as_secs_f64() * 1e6)
}
