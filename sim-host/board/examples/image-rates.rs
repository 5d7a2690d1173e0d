//! Campaign: how fast the image streams, how soon it answers an edge, what it loses and whether it
//! counts that. Prints its result as Markdown; fails if a loss is not counted or an edge waits.

#[path = "../tests/common/mod.rs"]
mod common;

use std::process::ExitCode;

use common::{Bench, recording};
use ldc161x_sim::{InterruptRelease, Settings, Switches, Time};
use palpate_wire::code::Stream;
use palpate_wire::command::Command;

/// The longest that an edge that meets a free bus may wait.
const LATENCY: Time = Time::from_us(10);
const LENGTH: Time = Time::from_ms(10_000);

struct Case {
    channels: u8,
    rate_hz: f32,
    stream: Stream,
    release: InterruptRelease,
    length: Time,
}

struct Found {
    rate_hz: f64,
    lost: u32,
    told: u32,
    median: Time,
    worst: Time,
    load: f64,
}

fn run(case: &Case) -> Found {
    let chip = Settings {
        switches: Switches {
            interrupt_release: case.release,
            ..Switches::default()
        },
        ..Settings::default()
    };
    let mut bench = Bench::with(chip, recording());
    bench.stream();
    let settings = palpate_wire::command::Settings {
        channels: case.channels,
        rate_hz: case.rate_hz,
        stream: case.stream,
        ..bench.settings()
    };
    bench.command(&Command::SetSettings(settings));
    bench.run(Time::from_ms(200));
    let before = bench.status();
    let overwritten = bench.board.chip().overwritten(0);
    let edges = bench
        .board
        .wire_log()
        .map_or(0, |log| log.edge_to_start.len());
    let asleep = bench.board.time_asleep();
    let begin = bench.board.now();
    let mut left = case.length;
    while left > Time::ZERO {
        let slice = left.min(Time::from_ms(500));
        bench.run(slice);
        bench.frames.drain(..bench.frames.len().saturating_sub(1));
        left = left - slice;
    }
    let passed = (bench.board.now() - begin).as_secs_f64();
    let load = 1.0 - (bench.board.time_asleep() - asleep).as_secs_f64() / passed;
    let lost = bench.board.chip().overwritten(0) - overwritten;
    let after = bench.status();
    let mut latencies = bench
        .board
        .wire_log()
        .map(|log| log.edge_to_start[edges..].to_vec())
        .unwrap_or_default();
    latencies.sort_unstable();
    Found {
        rate_hz: f64::from(after.conversions - before.conversions) / passed,
        lost: lost as u32,
        told: after.conversions_lost - before.conversions_lost,
        median: latencies
            .get(latencies.len() / 2)
            .copied()
            .unwrap_or_default(),
        worst: latencies.last().copied().unwrap_or_default(),
        load,
    }
}

fn main() -> ExitCode {
    let both = [InterruptRelease::StatusOrData, InterruptRelease::StatusOnly];
    let mut cases = Vec::new();
    for release in both {
        for (channels, rate_hz, stream, length) in [
            (0b0001, 1_000.0, Stream::Samples, LENGTH),
            (0b0001, 2_000.0, Stream::Raw, LENGTH),
            (0b1111, 500.0, Stream::Samples, LENGTH),
            (0b0001, 4_000.0, Stream::Raw, Time::from_ms(2_000)),
        ] {
            cases.push(Case {
                channels,
                rate_hz,
                stream,
                release,
                length,
            });
        }
    }
    println!("<!-- evidence:begin -->");
    println!(
        "| channels | asked | stream | INTB released by | seconds | scans per second | lost | told \
         | edge to START, median | worst | load |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut holds = true;
    for case in &cases {
        let found = run(case);
        let us = |time: Time| format!("{:.2} µs", time.as_secs_f64() * 1e6);
        let by = match case.release {
            InterruptRelease::StatusOnly => "STATUS",
            _ => "STATUS or data",
        };
        println!(
            "| {} | {} Hz | {} | {by} | {:.0} | {:.1} | {} | {} | {} | {} | {:.0} % |",
            case.channels.count_ones(),
            case.rate_hz,
            if case.stream == Stream::Raw {
                "raw"
            } else {
                "samples"
            },
            case.length.as_secs_f64(),
            found.rate_hz,
            found.lost,
            found.told,
            us(found.median),
            us(found.worst),
            found.load * 100.0,
        );
        let overloaded = case.rate_hz > 3_000.0;
        holds &= overloaded || (found.lost == 0 && found.told == 0 && found.worst <= LATENCY);
    }
    println!();
    println!(
        "Lost: conversions that the converter overwrote unread. Told: those that the firmware says \
         were lost, in the converter or before its procedure. The rows of 4000 Hz ask for more than \
         the processor can do with every scan."
    );
    println!("<!-- evidence:end -->");
    if holds {
        ExitCode::SUCCESS
    } else {
        eprintln!("a conversion was lost, or an edge waited too long");
        ExitCode::FAILURE
    }
}
