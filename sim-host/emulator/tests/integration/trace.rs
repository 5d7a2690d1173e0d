//! The value change dump, read back by the library of a waveform viewer: its lines must show the
//! chip's true signals.

use std::collections::BTreeMap;
use std::io::Cursor;

use crate::common::{RecordedBoard, image, recording};
use ldc161x_sim::Settings;
use palpate_emulator::{EmulatedBoard, Options, Still, Time};
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
