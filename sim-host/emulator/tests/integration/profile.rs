//! Cycle profile: it accounts for all cycles, and does not change the run.

use crate::common::streaming;
use palpate_emulator::{Sources, Time, firmware};

const LENGTH: Time = Time::from_ms(200);

#[test]
fn the_cycles_of_all_handlers_are_the_time_awake_and_counting_changes_nothing() {
    let mut plain = streaming();
    let mut bench = plain.clone();
    let (begin, asleep) = (bench.board.now(), bench.board.time_asleep());
    bench.board.profile(&[]);
    bench.run(LENGTH);
    let profile = bench.board.take_profile().unwrap();
    let passed = bench.board.now() - begin;
    let awake_s = (passed - (bench.board.time_asleep() - asleep)).as_secs_f64();
    let cycles: u64 = profile.handlers().values().map(|it| it.cycles).sum();
    let counted_s = cycles as f64 / bench.board.frequencies_hz().0;
    assert!(
        (counted_s / awake_s - 1.0).abs() < 1e-5,
        "{counted_s} of {awake_s}"
    );
    let executed: u64 = profile.instructions().map(|(_, it)| it.own_cycles).sum();
    let charged: u64 = profile
        .instructions()
        .map(|(_, it)| it.charged_cycles)
        .sum();
    assert_eq!(executed, charged);
    // The handler of the edge runs once a sample and starts at once: sixteen cycles at 200 MHz for
    // the entry, and fetches; nothing delays it for long.
    let edge = profile.handlers()[&(16 + 13)];
    assert!((195..=205).contains(&edge.runs), "{edge:?}");
    let (least, worst) = edge.start.unwrap();
    assert!(least >= Time::from_ns(80), "{edge:?}");
    assert!(worst <= Time::from_us(2), "{edge:?}");
    assert!(edge.worst_cycles < 1_000, "{edge:?}");
    plain.run(LENGTH);
    assert_eq!(bench.board.instructions(), plain.board.instructions());
    assert_eq!(bench.board.now(), plain.board.now());
    assert_eq!(bench.words(), plain.words());
}

#[test]
fn addresses_are_found_in_the_sources() {
    let path = firmware::build().unwrap_or_else(|error| panic!("{error}"));
    let sources = Sources::load(&path).unwrap();
    let (range, _) = sources
        .functions()
        .iter()
        .find(|(_, name)| name.ends_with("engine::on_edge"))
        .expect("the handler of the edge has a name");
    let inlined = sources.at(range.start + 8);
    let outermost = inlined.last().expect("its code has a source");
    assert!(outermost.name.ends_with("on_edge"), "{inlined:?}");
    assert!(
        outermost
            .file
            .ends_with("firmware/src/board/rp2040/i2c/engine.rs"),
        "{inlined:?}"
    );
}
