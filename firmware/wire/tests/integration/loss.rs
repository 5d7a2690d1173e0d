//! Compares the receiver's account with the true events.

use std::collections::HashSet;

use palpate_wire::loss::{Account, Arrival, Tally};
use palpate_wire::{Header, Sequencer};
use proptest::prelude::*;

/// True event of a frame.
#[derive(Clone, Copy, Debug)]
enum Fate {
    Arrives,
    DroppedByDevice,
    Lost,
    Twice,
    /// The frame arrives after this many later frames.
    Late(usize),
}

fn any_fate() -> impl Strategy<Value = Fate> {
    prop_oneof![
        6 => Just(Fate::Arrives),
        1 => Just(Fate::DroppedByDevice),
        1 => Just(Fate::Lost),
        1 => Just(Fate::Twice),
        1 => (1..100_usize).prop_map(Fate::Late),
    ]
}

/// Returns the headers in order of arrival, by the fates of the frames produced from number `first` on.
fn arrivals(boot_id: u32, first: u32, dropped_before: u32, fates: &[Fate]) -> Vec<Header> {
    let mut sequencer = Sequencer::after(&Header {
        dropped: dropped_before,
        ..header(boot_id, first.wrapping_sub(1))
    });
    let mut arriving: Vec<(usize, Header)> = Vec::new();
    for (slot, fate) in fates.iter().enumerate() {
        let header = sequencer.stamp(0);
        match *fate {
            Fate::Arrives => arriving.push((2 * slot, header)),
            Fate::DroppedByDevice => sequencer.count_dropped(),
            Fate::Lost => {}
            Fate::Twice => arriving.extend([(2 * slot, header), (2 * slot + 3, header)]),
            Fate::Late(others) => arriving.push((2 * (slot + others) + 1, header)),
        }
    }
    arriving.sort_by_key(|(when, _)| *when);
    arriving.into_iter().map(|(_, header)| header).collect()
}

/// Checks a tally against the arrived headers, evaluated all at once.
fn assert_true(tally: &Tally, headers: &[Header]) {
    let first = headers[0].sequence;
    // Positions from the first received frame, negative for those before it.
    let places = headers
        .iter()
        .map(|header| i64::from(header.sequence.wrapping_sub(first) as i32));
    let distinct: HashSet<i64> = places.clone().filter(|slot| *slot >= 0).collect();
    let last = places.clone().max().unwrap();
    let before = places.clone().filter(|slot| *slot < 0).count();
    let dropped_at = |slot: i64| {
        headers
            .iter()
            .find(|header| header.sequence == first.wrapping_add(slot as u32))
            .unwrap()
            .dropped
    };
    assert_eq!(tally.produced(), last as u64 + 1);
    assert_eq!(tally.received(), distinct.len() as u64);
    assert_eq!(tally.missing(), tally.produced() - tally.received());
    assert_eq!(tally.stale(), before as u64);
    assert_eq!(
        tally.duplicates(),
        (headers.len() - before - distinct.len()) as u64
    );
    let dropped = u64::from(dropped_at(last).wrapping_sub(dropped_at(0)));
    assert_eq!(tally.dropped_by_device(), dropped);
    assert_eq!(tally.lost_on_the_way(), Some(tally.missing() - dropped));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    /// Also covers the wrap of both counters: sequence numbers, and dropped frames.
    #[test]
    fn produced_is_received_and_missing(
        first in prop_oneof![any::<u32>(), (u32::MAX - 200)..],
        dropped in prop_oneof![any::<u32>(), (u32::MAX - 20)..],
        fates in prop::collection::vec(any_fate(), 1..400),
    ) {
        let headers = arrivals(7, first, dropped, &fates);
        let mut account = Account::new();
        for header in &headers {
            account.take(header);
        }
        match account.current() {
            Some(tally) => assert_true(tally, &headers),
            None => prop_assert!(headers.is_empty()),
        }
        prop_assert_eq!(account.boots(), u32::from(!headers.is_empty()));
    }

    /// Two runs, with the frames of the first one arriving among those of the second.
    #[test]
    fn a_restart_is_no_loss(
        first in any::<u32>(),
        one in prop::collection::vec(any_fate(), 1..100),
        other in prop::collection::vec(any_fate(), 1..100),
        overlap in 0..20_usize,
    ) {
        let mut before = arrivals(7, first, 0, &one);
        let after = arrivals(8, 0, 0, &other);
        prop_assume!(!before.is_empty() && !after.is_empty());
        let expected = before.clone();
        let late = before.split_off(before.len() - overlap.min(before.len() - 1));
        let mut account = Account::new();
        let mut late = late.iter();
        for header in &before {
            account.take(header);
        }
        for header in &after {
            account.take(header);
            late.next().map(|header| account.take(header));
        }
        for header in late {
            account.take(header);
        }
        prop_assert_eq!(account.boots(), 2);
        assert_true(account.previous().unwrap(), &expected);
        assert_true(account.current().unwrap(), &after);
    }
}

fn header(boot_id: u32, sequence: u32) -> Header {
    Header {
        boot_id,
        sequence,
        time_us: 0,
        dropped: 0,
    }
}

#[test]
fn arrivals_are_distinguished() {
    let mut account = Account::new();
    let mut take = |boot_id, sequence| account.take(&header(boot_id, sequence));
    assert_eq!(take(7, 100), Arrival::FirstOfBoot);
    assert_eq!(take(7, 99), Arrival::Stale);
    assert_eq!(take(7, 100), Arrival::Duplicate);
    assert_eq!(take(7, 101), Arrival::Next);
    assert_eq!(take(7, 300), Arrival::AfterGap { missing: 198 });
    // The account covers the last 128 numbers, not those before.
    assert_eq!(take(7, 173), Arrival::Late);
    assert_eq!(take(7, 173), Arrival::Duplicate);
    assert_eq!(take(7, 172), Arrival::Stale);
    assert_eq!(take(7, 101), Arrival::Stale);
    assert_eq!(take(8, 0), Arrival::FirstOfBoot);
    assert_eq!(take(7, 299), Arrival::Late);
    assert_eq!(take(8, 1), Arrival::Next);
    let previous = account.previous().unwrap();
    assert_eq!((previous.produced(), previous.received()), (201, 5));
    assert_eq!((previous.before_first(), previous.stale()), (100, 3));
    assert_eq!(previous.duplicates(), 2);
    assert_eq!(previous.boot_id(), 7);
}

#[test]
fn a_gap_of_any_length_is_exact() {
    let greatest = u32::MAX / 2;
    for missing in [0, 1, 126, 127, 128, 129, 1_000, greatest - 1, greatest] {
        let mut account = Account::new();
        account.take(&header(7, 5));
        let last = missing.wrapping_add(6);
        account.take(&header(7, last));
        let tally = *account.current().unwrap();
        assert_eq!((tally.missing(), tally.received()), (missing.into(), 2));
        if missing == greatest {
            // Repeating the first frame is not tested here: its number is as far ahead of the last as a
            // gap can be.
            continue;
        }
        // The first frame again is a duplicate if it is recent enough, and stale otherwise.
        let again = account.take(&header(7, 5));
        let known = missing <= 126;
        assert_eq!(again == Arrival::Duplicate, known, "{missing}");
        assert_eq!(again == Arrival::Stale, !known, "{missing}");
    }
}

/// The device sends more frames than 32 bits can count.
#[test]
fn the_account_goes_on_after_the_numbers_wrap() {
    let mut account = Account::new();
    account.take(&header(7, 0));
    let step = 1 << 30;
    for turn in 1..=16_u64 {
        let arrival = account.take(&header(7, (turn * step) as u32));
        assert_eq!(
            arrival,
            Arrival::AfterGap {
                missing: step as u32 - 1
            }
        );
    }
    let tally = account.current().unwrap();
    assert_eq!(tally.produced(), 16 * step + 1);
    assert_eq!(tally.missing(), 16 * (step - 1));
}

#[test]
fn a_device_that_claims_too_much_is_found_out() {
    let mut account = Account::new();
    account.take(&header(7, 0));
    account.take(&Header {
        dropped: 3,
        ..header(7, 2)
    });
    let tally = account.current().unwrap();
    assert_eq!((tally.missing(), tally.dropped_by_device()), (1, 3));
    assert_eq!(tally.lost_on_the_way(), None);
}

#[test]
fn the_sequencer_counts_what_is_produced() {
    let mut sequencer = Sequencer::new(7);
    for expected in 0..3 {
        let header = sequencer.stamp(5);
        assert_eq!(
            (header.boot_id, header.sequence, header.time_us),
            (7, expected, 5)
        );
        assert_eq!(header.dropped, expected);
        sequencer.count_dropped();
    }
    sequencer.address(9);
    let header = sequencer.stamp(6);
    assert_eq!((header.boot_id, header.sequence), (9, 3));
}
