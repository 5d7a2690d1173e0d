//! The virtual board by itself.

use palpate_sim::Time;
use palpate_sim::board::{Hardware, TimedRecord, VirtualBoard, default_settings};
use palpate_sim::device::Device;
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_wire::code::State;
use palpate_wire::{Command, Record};

fn world() -> World {
    let stack = Stack::builtin("ultrasoft").unwrap();
    let plant = draw(&stack, &Disturbances::builtin().unwrap(), 1);
    World::new(&plant, Switches::all(), Setup::default()).unwrap()
}

fn states(records: &[TimedRecord]) -> Vec<State> {
    let states = records.iter().filter_map(|(_, record)| match record {
        Record::State(change) => Some(change.state),
        _ => None,
    });
    states.collect()
}

#[test]
fn it_says_who_it_is_tests_itself_and_streams_what_the_chip_converted() {
    let hardware = Hardware::new(world());
    let mut board = VirtualBoard::new(&hardware);
    board.run_until(Time::from_ms(500)).unwrap();
    let records = board.take_records();
    assert!(matches!(&records[0].1, Record::Hello(hello) if hello.simulated));
    assert_eq!(states(&records), [State::Baseline]);
    let words: Vec<u32> = records
        .iter()
        .filter_map(|(_, record)| match record {
            Record::Sample(sample) => Some(sample.channels[0].word),
            _ => None,
        })
        .collect();
    // From the end of the start, 15 ms, at 1 kHz.
    assert!((480..=486).contains(&words.len()), "{}", words.len());
    let last = hardware.chip().borrow().last_read(0).unwrap().word;
    assert_eq!(*words.last().unwrap(), last);
}

#[test]
fn several_channels_come_scan_by_scan() {
    let hardware = Hardware::for_several_channels(world());
    let mut board = VirtualBoard::new(&hardware);
    let settings = palpate_wire::command::Settings {
        channels: 0b1111,
        rate_hz: 100.0,
        ..default_settings()
    };
    board.send(Command::SetSettings(settings)).unwrap();
    board.run_until(Time::from_ms(300)).unwrap();
    let records = board.take_records();
    let scans: Vec<_> = records
        .iter()
        .filter_map(|(at, record)| match record {
            Record::Sample(sample) if sample.channels.len() == 4 => Some((at.as_ticks(), sample)),
            _ => None,
        })
        .collect();
    assert!(scans.len() > 20);
    for (_, scan) in &scans {
        assert!(
            scan.channels
                .is_sorted_by_key(|conversion| conversion.offset_us)
        );
        // Nothing is connected to channels 1 to 3: no count, and still told.
        assert_eq!(scan.channels[3].word & 0x0FFF_FFFF, 0);
    }
    let steps = scans.windows(2).map(|pair| pair[1].0 - pair[0].0);
    let steps: Vec<u64> = steps.collect();
    assert!(
        steps.iter().all(|step| (9_000..=10_100).contains(step)),
        "{steps:?}"
    );
}

#[test]
fn the_same_seed_gives_the_same_records() {
    let run = || {
        let hardware = Hardware::new(world());
        let mut board = VirtualBoard::new(&hardware);
        board.run_until(Time::from_ms(300)).unwrap();
        board.take_records()
    };
    let (here, there) = (run(), std::thread::spawn(run).join().unwrap());
    assert_eq!(here, there);
}
