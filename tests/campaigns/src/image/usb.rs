//! `cargo campaign image-usb`: the image at a USB host, with a second PC at the probe and the coil
//! in its train. Prints its result as Markdown; fails if a claim does not hold. Its seed is the
//! argument after `--seed`.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::process::ExitCode;

use crate::evidence::conclude;

use super::common::Crash;
use super::common::usb::control::disturb_control;
use super::common::usb::descriptors::reviewed;
use super::common::usb::links::{flood, silent_link};
use super::common::usb::restarts::{ask_for_restart, reboot, replug};
use super::common::usb::streams::{LATEST_PACKET, stopped_reader, stream_in_trains};
use super::common::usb::{INTERRUPT, UsbBench, missing, plugged};
use crate::drawn::Seed;
use palpate_emulator::Time;
use palpate_procedure::Link;

/// Longest allowed delay from an edge of INTB to START while the bus is free.
const LATENCY: Time = Time::from_us(10);
/// Longest interval between two levels of the coil's PWM: from one and a half periods on, a level
/// was late.
const LEVELS_APART: Time = Time::from_us(24);
/// Greatest processor load in the train, with both links in use.
const LOAD: f32 = 0.55;
/// Longest times until the bridge is off, after a fault, and after a hang or a restart request.
const OFF_AT_ONCE: Time = Time::from_ms(1);
const OFF_AFTER_HANG: Time = Time::from_ms(60);
/// Allowed time from a PC's last command to the end of its current, including the overhead of the
/// test: a command and its answer take 2 ms.
const SILENCE: std::ops::Range<Time> = Time::from_ms(95)..Time::from_ms(103);

const STREAM: Time = Time::from_ms(60_000);
const CONTROL_TRANSFERS: u32 = 100_000;
const STOPPED: Time = Time::from_ms(5_000);
const ROUNDS: u32 = 100;
const RUBBISH: usize = 1_000_000;
/// Number of points of the train, 25 ms apart.
const POINTS: u64 = 20;

fn us(time: Time) -> String {
    format!("{:.2} µs", time.as_secs_f64() * 1e6)
}

fn ms(time: Time) -> String {
    format!("{:.1} ms", time.as_secs_f64() * 1e3)
}

fn of_the_device(out: &mut String) -> bool {
    let bench = plugged();
    let description = bench.probe.board.usb().description();
    let unit = u64::from_be_bytes(bench.probe.board.flash().unique_id());
    let is_reviewed = description == Some(&reviewed(unit));
    let serial = description.and_then(|it| it.string(3));
    let _ = writeln!(
        out,
        "Descriptors: {}the reviewed ones, byte by byte. Serial number {}, that of the flash {unit:016X}.\n",
        if is_reviewed { "" } else { "not " },
        serial.as_deref().unwrap_or("none"),
    );
    is_reviewed
}

fn streams(out: &mut String) -> bool {
    let _ = writeln!(
        out,
        "| channels | asked | time | trains | time in them | scans | lost | samples by USB | records \
         missing by USB | records missing by RTT | levels written | levels late | longest time between two levels | edge to \
         START, worst | load in the train | greatest load | latest packet in a frame |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    let mut holds = true;
    for (channels, rate_hz) in [(0b0001_u8, 1_000.0), (0b1111, 500.0)] {
        let mut bench = plugged();
        let found = stream_in_trains(&mut bench, channels, rate_hz, STREAM);
        let _ = writeln!(
            out,
            "| {} | {rate_hz} Hz | {:.0} s | {} | {:.1} s | {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.1} % | {:.1} % | {} |",
            channels.count_ones(),
            STREAM.as_secs_f64(),
            found.trains,
            found.driven.as_secs_f64(),
            found.scans,
            found.scans_lost,
            found.samples,
            found.missing.0,
            found.missing_by_rtt,
            found.levels.written,
            found.levels.late,
            us(found.levels.longest_gap),
            us(found.edge_to_start),
            100.0 * found.load_in_train,
            100.0 * found.load,
            us(bench.probe.board.usb_latest_bulk()),
        );
        let is_whole = found.scans_lost == 0
            && found.samples_after_gap == 0
            && found.missing == (0, 0)
            && found.missing_by_rtt == 0
            && found.damaged == 0
            && found.restarts == 0;
        let is_in_time = found.levels.late == 0
            && found.levels.longest_gap < LEVELS_APART
            && found.edge_to_start <= LATENCY
            && bench.probe.board.usb_latest_bulk() < LATEST_PACKET;
        holds &= is_whole && is_in_time && found.trains > 1 && found.load_in_train <= LOAD;
    }
    let _ = writeln!(
        out,
        "\nTrains follow one another as soon as the coil's budget of heat allows. Load: greatest mean \
         over a tenth of a second that a `status` reported. The greatest overall includes the evaluation at the \
         end of a coil test. A bulk packet that is made available more than 800 us after the start of a \
         frame may hang the controller (RP2040-E15).\n"
    );
    holds
}

/// Appends a line of the loss account; returns whether the account is exact.
fn account(out: &mut String, what: &str, bench: &UsbBench, cut: u32) -> bool {
    let tally = bench.port.tally();
    let (missing, dropped) = missing(&tally);
    let (samples, strange) = bench.strange_samples();
    let _ = writeln!(
        out,
        "| {what} | {} | {missing} | {dropped} | {} | {samples} | {strange} |",
        tally.received(),
        bench.port.damaged,
    );
    missing == dropped && bench.port.damaged <= cut && strange == 0 && samples > 0
}

fn interruptions(out: &mut String) -> bool {
    let _ = writeln!(
        out,
        "| what | records | missing | dropped, as the device says | cut frames | samples compared | \
         samples that differ from those by RTT |\n|---|---|---|---|---|---|---|"
    );
    let mut holds = true;
    let mut bench = plugged();
    stopped_reader(&mut bench, STOPPED);
    holds &= account(out, "the reader stops for 5 s", &bench, 0);
    let mut bench = plugged();
    bench.suspend_and_resume(STOPPED);
    holds &= account(out, "the bus is suspended for 5 s", &bench, 0);
    let mut bench = plugged();
    bench.port.begin_account();
    for round in 0..ROUNDS {
        bench.set_open(false);
        bench.run(Time::from_us(3_000 + 137 * u64::from(round)));
        bench.set_open(true);
        bench.run(Time::from_us(20_000 + 91 * u64::from(round)));
    }
    bench.run(Time::from_ms(50));
    holds &= account(out, "DTR off and on, 100 times", &bench, ROUNDS);
    let mut bench = plugged();
    bench.port.begin_account();
    let mut slowest = Time::ZERO;
    for round in 0..ROUNDS {
        let away = Time::from_us(2_000 + 1_731 * u64::from(round));
        slowest = slowest.max(replug(&mut bench, away));
        bench.run(Time::from_us(31 * u64::from(round)));
    }
    bench.run(Time::from_ms(50));
    holds &= account(
        out,
        "unplugged and plugged again, 100 times",
        &bench,
        ROUNDS,
    );
    holds &= bench.probe.board.resets().watchdog == 0;
    let _ = writeln!(
        out,
        "\nThe device's account of losses is exact where `missing` equals `dropped`. A port that is opened \
         anew may begin with the rest of a frame, once. After replugging, the port was open within {}, including \
         the 100 ms allowed for contact bounce.\n",
        ms(slowest)
    );
    holds
}

fn control(out: &mut String, seed: u64) -> bool {
    let mut bench = plugged();
    let found = disturb_control(&mut bench, CONTROL_TRANSFERS, seed);
    let _ = writeln!(
        out,
        "Control transfers of any kind: {} completed, {} stalled, {} cut by a bus reset, {} replaced by the next setup packet, {} ended by a \
         host that sent less than announced, {} answered with leftovers of an abandoned transfer, {} hung.",
        found.done,
        found.stalled,
        found.cancelled,
        found.overtaken,
        found.cut_short,
        found.spoiled,
        found.hung.len(),
    );
    for (transfer, outcome) in found.hung.iter().take(5) {
        eprintln!("hung: {:02x?}: {outcome}", transfer.setup);
    }
    let restarts = bench.probe.board.resets().watchdog;
    let _ = writeln!(
        out,
        "A host that abandons a transfer and sends the next setup packet may receive a packet of the \
         abandoned one, until the processor has handled the setup packet (docs/firmware.md, errata). Apart \
         from these, {} device descriptors requested in between were wrong or refused. The longest transfer took {}. \
         Levels of the coil's PWM: {} written, {} late, {} from one to the next at most; edge to START \
         {} at worst. The board started anew {restarts} times. It was enumerated {} times, and streamed \
         after each.\n",
        found.wrong,
        ms(found.longest),
        found.levels.written,
        found.levels.late,
        us(found.levels.longest_gap),
        us(found.edge_to_start),
        found.enumerations,
    );
    found.hung.is_empty()
        && found.wrong == 0
        && restarts == 0
        && found.levels.late == 0
        && found.levels.longest_gap < LEVELS_APART
        && found.edge_to_start <= LATENCY
}

fn rubbish(out: &mut String, seed: u64) -> bool {
    let mut bench = plugged();
    let found = flood(&mut bench, RUBBISH, seed);
    let _ = writeln!(
        out,
        "{} random bytes in {:.1} s, as fast as the device takes them: {} of {} commands between were \
         answered, {} after their last byte at most; {} of {} scans lost, {} records missing, {} new \
         starts.\n",
        found.bytes,
        found.took.as_secs_f64(),
        found.answered,
        found.commands,
        ms(found.slowest_answer),
        found.scans_lost,
        found.scans,
        found.missing.0,
        found.restarts,
    );
    found.answered == found.commands
        && found.scans_lost == 0
        && found.missing == (0, 0)
        && found.restarts == 0
}

fn silence(out: &mut String) -> bool {
    let mut holds = true;
    for (by, name, other) in [(Link::Usb, "USB", "RTT"), (Link::Probe, "RTT", "USB")] {
        let took = silent_link(&mut plugged(), by).unwrap_or(Time::MAX);
        let _ = writeln!(
            out,
            "- A current commanded over {name} ended {} after the command, while {other} went on.",
            ms(took)
        );
        holds &= SILENCE.contains(&took);
    }
    out.push('\n');
    holds
}

fn restarts(out: &mut String) -> bool {
    let mut bench = plugged();
    let (mut slowest, mut runs) = (Time::ZERO, BTreeSet::new());
    for _ in 0..ROUNDS {
        let (took, boot_ids) = reboot(&mut bench);
        slowest = slowest.max(took);
        runs.extend(boot_ids);
    }
    let mut holds = runs.len() as u32 == ROUNDS + 1;
    let _ = writeln!(
        out,
        "- {ROUNDS} new starts by `reboot` over USB: {} boot ids, the port open again by itself within \
         {}.",
        runs.len(),
        ms(slowest)
    );
    let mut snapshot = plugged();
    snapshot.begin_train();
    for (request, name) in [(1, "the boot loader"), (2, "the firmware")] {
        let (mut worst, mut right) = (Time::ZERO, true);
        for point in 0..POINTS {
            let mut bench = snapshot.clone();
            bench.run(Time::from_ms(25 * point));
            let found = ask_for_restart(&mut bench, request, 0);
            worst = worst.max(found.off.unwrap_or(Time::MAX));
            right &= found.off_first && found.in_boot_loader == (request == 1);
        }
        let _ = writeln!(
            out,
            "- What picotool requests to start {name}, at {POINTS} points of the train: bridge off \
             within {}, before the reset.",
            ms(worst)
        );
        holds &= right && worst <= OFF_AFTER_HANG;
    }
    for (crash, name, limit) in [
        (Crash::HardFault, "HardFault", OFF_AT_ONCE),
        (Crash::Loop, "An endless loop", OFF_AFTER_HANG),
    ] {
        let mut worst = Time::ZERO;
        for point in 0..POINTS {
            let mut bench = snapshot.clone();
            bench.run(Time::from_ms(25 * point));
            let took = crash.in_exception(&mut bench.probe, INTERRUPT);
            worst = worst.max(took.unwrap_or(Time::MAX));
            holds &= bench.probe.board.resets().watchdog == 1;
        }
        let _ = writeln!(
            out,
            "- {name} in the interrupt of USB, at {POINTS} points of the train: bridge off within {:.3} ms.",
            worst.as_secs_f64() * 1e3
        );
        holds &= worst <= limit;
    }
    out.push('\n');
    holds
}

pub(crate) fn run(&Seed { seed }: &Seed) -> ExitCode {
    let mut text = String::new();
    let out = &mut text;
    let holds = [
        of_the_device(out),
        streams(out),
        interruptions(out),
        rubbish(out, seed),
        silence(out),
        restarts(out),
        control(out, seed),
    ];
    if holds == [true; 7] {
        let figure = format!(
            "Two streams of {} s in trains, interruptions of the reader, {RUBBISH} random bytes, {ROUNDS} new starts and {CONTROL_TRANSFERS} control \
             transfers: every missing record is counted, no level of the coil's PWM is late, and nothing hangs.",
            STREAM.as_secs_f64()
        );
        conclude(&format!("{figure}\n\n{text}"), true)
    } else {
        eprintln!(
            "{text}\na claim does not hold: device, streams, interruptions, rubbish, silence, new starts, \
             control transfers: {holds:?}"
        );
        ExitCode::FAILURE
    }
}
