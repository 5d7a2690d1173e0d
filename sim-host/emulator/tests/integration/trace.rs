//! The value change dump, read back by the library of a waveform viewer: its lines must show the
//! chip's true signals.

use std::collections::BTreeMap;
use std::io::Cursor;

use crate::common::{RecordedBoard, image, ramping_on, recording};
use ldc161x_sim::Settings;
use palpate_emulator::{EmulatedBoard, LineFault, Options, Still, Time};
use wellen::{SignalValueRef, simple};

/// Changes of a signal by nanoseconds: levels and bytes as numbers, unknown values as `None`.
type Changes = Vec<(u64, Option<f64>)>;

fn read(dump: Vec<u8>) -> BTreeMap<String, Changes> {
    let mut waveform = simple::read_from_reader(Cursor::new(dump)).expect("it is well-formed");
    let hierarchy = waveform.hierarchy();
    let scopes = hierarchy.scopes().map(|scope| &hierarchy[scope]);
    let names: Vec<_> = scopes
        .flat_map(|scope| scope.vars(hierarchy))
        .map(|it| &hierarchy[it])
        .map(|it| (it.full_name(hierarchy), it.signal_ref()))
        .collect();
    let times = waveform.time_table().to_vec();
    let mut signals = BTreeMap::new();
    for (name, signal) in names {
        waveform.load_signals(&[signal]);
        let changes = waveform.get_signal(signal).expect("it is loaded");
        let value = |value: SignalValueRef<'_>| match value {
            SignalValueRef::Real(value) => Some(value),
            other => {
                let bits = other.to_bit_string()?;
                u32::from_str_radix(&bits, 2).ok().map(f64::from)
            }
        };
        let changes = changes.iter_changes();
        let changes = changes.map(|(at, of)| (times[at as usize], value(of)));
        signals.insert(name, changes.collect());
    }
    signals
}

/// A bus symbol, decoded from the levels of both lines alone.
#[derive(Clone, Debug, PartialEq)]
enum PassedSymbol {
    Start,
    Byte(u8, bool),
    Stop,
}

fn decode(signals: &BTreeMap<String, Changes>) -> Vec<(u64, PassedSymbol)> {
    let lines = [("board.scl", true), ("board.sda", false)];
    let mut edges: Vec<(u64, bool, bool)> = lines
        .iter()
        .flat_map(|(name, is_scl)| {
            let changes = signals[*name].iter();
            changes.filter_map(|(at, level)| Some((*at, *is_scl, (*level)? > 0.5)))
        })
        .collect();
    edges.sort_by_key(|(at, ..)| *at);
    let (mut scl, mut sda, mut bits) = (true, true, None::<Vec<bool>>);
    let mut passed = Vec::new();
    for (at, is_scl, high) in edges {
        if !is_scl {
            if scl && sda != high {
                passed.push((
                    at,
                    if high {
                        PassedSymbol::Stop
                    } else {
                        PassedSymbol::Start
                    },
                ));
                bits = (!high).then(Vec::new);
            }
            sda = high;
            continue;
        }
        if high
            && !scl
            && let Some(bits) = &mut bits
        {
            bits.push(sda);
            if let [byte @ .., acknowledge] = bits.as_slice()
                && byte.len() == 8
            {
                let byte = byte.iter().fold(0, |byte, bit| byte << 1 | u8::from(*bit));
                passed.push((at, PassedSymbol::Byte(byte, !acknowledge)));
                bits.clear();
            }
        }
        scl = high;
    }
    passed
}

fn traced() -> EmulatedBoard<Still> {
    let options = Options {
        trace: true,
        ..recording()
    };
    let mut plant = Still::new(crate::common::FREQUENCIES_HZ);
    plant.drift_hz_per_s = 300e3;
    EmulatedBoard::new(image(), plant, Settings::default(), options)
}

fn dump(bench: &mut RecordedBoard) -> BTreeMap<String, Changes> {
    let mut dump = Vec::new();
    let trace = bench.board.take_trace().expect("a trace was requested");
    trace.write(&mut dump).unwrap();
    read(dump)
}

#[test]
fn the_lines_say_what_the_chip_reported() {
    let mut bench = RecordedBoard::of(traced());
    bench.stream();
    bench.run(Time::from_ms(50));
    let log = bench.board.wire_log().unwrap().clone();
    let signals = dump(&mut bench);
    let passed = decode(&signals);
    // Frames of one channel: DATA0_MSB and DATA0_LSB, in one transaction.
    let bytes: Vec<PassedSymbol> = passed.iter().map(|(_, it)| it.clone()).collect();
    let mut words: Vec<u32> = bytes
        .windows(14)
        .filter_map(|frame| {
            use PassedSymbol::{Byte, Start};
            match frame {
                [
                    Start,
                    Byte(0x54, true),
                    Byte(0x00, true),
                    Start,
                    Byte(0x55, true),
                    Byte(a, true),
                    Byte(b, false),
                    Start,
                    Byte(0x54, true),
                    Byte(0x01, true),
                    Start,
                    Byte(0x55, true),
                    Byte(c, true),
                    Byte(d, false),
                ] => Some(u32::from_be_bytes([*a, *b, *c, *d])),
                _ => None,
            }
        })
        .collect();
    // A result that is fetched twice counts once, as in the log.
    words.dedup();
    let fetched: Vec<u32> = log.fetched.iter().map(|it| it.word).collect();
    assert!(words.len() > 50, "{} of {}", words.len(), fetched.len());
    let begin = fetched.iter().position(|word| *word == words[0]).unwrap();
    assert_eq!(
        fetched[begin..begin + words.len().min(fetched.len() - begin)],
        words
    );
    // The traced bytes are those on the lines; equal consecutive bytes count once.
    let mut named: Vec<u8> = signals["board.i2c_byte"]
        .iter()
        .filter_map(|(_, byte)| byte.map(|byte| byte as u8))
        .collect();
    let mut decoded: Vec<u8> = bytes
        .iter()
        .filter_map(|it| match it {
            PassedSymbol::Byte(byte, _) => Some(*byte),
            _ => None,
        })
        .collect();
    named.dedup();
    decoded.dedup();
    assert!(named.len().abs_diff(decoded.len()) <= 1);
    let both = named.len().min(decoded.len());
    assert_eq!(named[..both], decoded[..both]);
}

#[test]
fn scl_has_its_period_and_its_low_time_and_edges_call_for_frames() {
    let mut bench = RecordedBoard::of(traced());
    bench.stream();
    bench.run(Time::from_ms(50));
    let edges = bench.board.wire_log().unwrap().edges.clone();
    let signals = dump(&mut bench);
    let scl = &signals["board.scl"];
    let bits: Vec<(u64, u64)> = scl
        .windows(3)
        .filter(|three| three[0].1 == Some(0.0))
        .map(|three| (three[1].0 - three[0].0, three[2].0 - three[0].0))
        .collect();
    let mut periods: Vec<u64> = bits.iter().map(|(_, period)| *period).collect();
    periods.sort_unstable();
    let median = periods[periods.len() / 2];
    assert!((2_490..=2_510).contains(&median), "{median} ns");
    assert!(periods[0] >= 2_490, "{} ns", periods[0]);
    let low = bits.iter().map(|(low, _)| *low).min().unwrap();
    assert!(low >= 1_300, "{low} ns");
    let falls: Vec<u64> = signals["board.intb"]
        .iter()
        .filter_map(|(at, level)| (*level == Some(0.0)).then_some(*at))
        .collect();
    let expected: Vec<u64> = edges.iter().map(|edge| edge.as_ps() / 1_000).collect();
    assert_eq!(falls.len(), expected.len());
    for (fall, edge) in falls.iter().zip(expected) {
        assert!(fall.abs_diff(edge) < 1_000, "{fall} {edge}");
    }
}

/// Share of a time in which a signal is high.
fn high_part(changes: &Changes, (from, to): (u64, u64)) -> f64 {
    let begin = changes.partition_point(|(at, _)| *at <= from).max(1) - 1;
    let mut high_ns = 0;
    for (index, (at, level)) in changes.iter().enumerate().skip(begin) {
        let end = changes.get(index + 1).map_or(to, |(next, _)| *next).min(to);
        if *at >= to {
            break;
        }
        if *level == Some(1.0) {
            high_ns += end.saturating_sub((*at).max(from));
        }
    }
    high_ns as f64 / (to - from) as f64
}

/// Mean of a signal over a time. A single value of the current includes its ripple.
fn mean(changes: &Changes, (from, to): (u64, u64)) -> f64 {
    let begin = changes.partition_point(|(at, _)| *at <= from).max(1) - 1;
    let later = changes.iter().enumerate().skip(begin);
    let sum: f64 = later
        .take_while(|(_, (at, _))| *at < to)
        .map(|(index, (at, value))| {
            let end = changes.get(index + 1).map_or(to, |(next, _)| *next).min(to);
            value.unwrap_or(0.0) * end.saturating_sub((*at).max(from)) as f64
        })
        .sum();
    sum / (to - from) as f64
}

#[test]
fn pulses_of_the_bridge_drive_the_current_through_its_resistance() {
    let mut bench = ramping_on(traced());
    let signals = dump(&mut bench);
    let current = &signals["board.coil_current_a"];
    let ampere = |at_ns: u64| {
        let index = current.partition_point(|(at, _)| *at <= at_ns);
        current[index.max(1) - 1].1.unwrap_or(0.0)
    };
    let end = current.last().unwrap().0;
    let mut checked = 0;
    // Whole milliseconds, each with 62.5 pulses.
    for from in (0..end - 1_000_000).step_by(1_000_000) {
        let to = from + 1_000_000;
        let (first_a, last_a) = (ampere(from), ampere(to));
        // While the bridge limits, as in the self-test, its inputs do not determine the current.
        let limits = high_part(&signals["board.nfault"], (from, to)) < 1.0;
        if limits || first_a.min(last_a) < 2.0 || (last_a - first_a).abs() > 0.6 {
            continue;
        }
        let [in1, in2] =
            ["board.in1", "board.in2"].map(|name| high_part(&signals[name], (from, to)));
        // 12 V at the bridge; the change of current takes its part across 40 uH, the rest drives
        // the current through 0.39 ohm of coil and 0.08 ohm of bridge. The currents are
        // instantaneous, within a ripple of half an ampere.
        let resistive_v = 12.0 * (in1 - in2) - 40e-6 * (last_a - first_a) / 1e-3;
        let resistance_ohm = resistive_v / mean(current, (from, to));
        assert!(
            (0.44..0.50).contains(&resistance_ohm),
            "{from}: {resistance_ohm} ohm"
        );
        checked += 1;
    }
    assert!(checked > 10, "{checked}");
    let on = |name: &str| signals[name].iter().any(|(_, level)| *level == Some(1.0));
    assert!(on("board.nsleep") && on("board.nfault"));
}

#[test]
fn a_wire_that_is_pulled_low_is_traced_so() {
    let mut bench = RecordedBoard::of(traced());
    bench.stream();
    let begin = bench.board.now().as_ps() / 1_000;
    bench.board.disturb(LineFault::SclHeld {
        bit: 40,
        lasting: Some(Time::from_us(1_000)),
    });
    bench.run(Time::from_ms(10));
    let signals = dump(&mut bench);
    let longest = signals["board.scl"]
        .windows(2)
        .filter(|two| two[0].0 > begin && two[0].1 == Some(0.0))
        .map(|two| two[1].0 - two[0].0)
        .max();
    // The recovery itself may pull the line low at the time at which the fault ends.
    assert!(
        (999_000..1_050_000).contains(&longest.unwrap()),
        "{longest:?}"
    );
}
