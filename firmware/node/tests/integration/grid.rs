//! Grid of the scans: which frames are passed on, counted as missed, or marked.

use palpate_node::acquisition::{Fetch, Finding, Grid, Parts, Scheme, Setpoint};

/// Bit time of the bus, in microseconds.
const BIT_US: f64 = 2.5;

fn scheme(channels: u8, rate_hz: f32, with_status: bool) -> Scheme {
    let setpoint = Setpoint {
        channels,
        rate_hz,
        shares_bus: false,
    };
    Scheme::new(setpoint, with_status).unwrap_or_else(|refusal| panic!("{refusal}"))
}

/// A converter that makes a scan in every period, and a master that reads it.
struct Bus {
    grid: Grid,
    period_us: f64,
    /// Duration of a frame.
    frame_us: f64,
    edge_us: f64,
    edges: u16,
}

impl Bus {
    fn new(channels: u8, rate_hz: f32, with_status: bool) -> Self {
        let scheme = scheme(channels, rate_hz, with_status);
        let registers = 2 * channels.count_ones() + u32::from(with_status);
        Self {
            grid: Grid::new(&scheme, with_status, 1),
            // The plan does not know the converter's overhead exactly.
            period_us: f64::from(scheme.period_us) - 0.3,
            frame_us: f64::from(47 * registers + 1) * BIT_US,
            edge_us: 70_000.4,
            edges: 40,
        }
    }

    /// Ends a scan `interval_us` after the previous one, and reads its frame `delay_us` after its edge.
    fn scan_after(&mut self, interval_us: f64, delay_us: f64) -> Finding {
        self.edge_us += interval_us;
        self.edges = self.edges.wrapping_add(1);
        let fetch = Fetch {
            edge_us: self.edge_us as u64,
            ended_us: [(delay_us + self.frame_us) as u32, 0, 0, 0],
            edges: self.edges,
        };
        self.grid.take(&fetch)
    }

    fn scan(&mut self) -> Finding {
        self.scan_after(self.period_us, 3.0)
    }

    /// Runs for some scans; the first follows a gap.
    fn settled(mut self) -> Self {
        let first = Finding::Scan {
            missed: 0,
            gap: true,
        };
        assert_eq!(self.scan(), first);
        for _ in 0..100 {
            assert_eq!(self.scan(), CLEAN);
        }
        self
    }
}

const CLEAN: Finding = Finding::Scan {
    missed: 0,
    gap: false,
};
const GAP: Finding = Finding::Scan {
    missed: 0,
    gap: true,
};

/// Channels, scan rate, and whether STATUS is read, in cases that the bus can carry, up to 98 % of its
/// limit.
const CASES: [(u8, f32, bool); 10] = [
    (0b0001, 1_000.0, false),
    (0b0001, 3_960.0, false),
    (0b0001, 2_685.0, true),
    (0b0011, 1_000.0, false),
    (0b0011, 2_032.0, false),
    (0b0011, 1_634.0, true),
    (0b0111, 1_366.0, false),
    (0b1111, 1_000.0, false),
    (0b1111, 1_029.0, false),
    (0b1111, 916.0, true),
];

#[test]
fn frames_in_time_are_passed_on_and_nothing_is_missing() {
    for (channels, rate_hz, with_status) in CASES {
        Bus::new(channels, rate_hz, with_status).settled();
    }
}

/// Returns the latest time at which a channel's word is latched, and the end of its next conversion,
/// after the edge: computed from the datasheet, not from the code under test.
fn word_and_end_us(case: (u8, f32, bool), index: u32, delay_us: f64) -> (f64, f64) {
    let (channels, rate_hz, with_status) = case;
    let scheme = scheme(channels, rate_hz, with_status);
    let count = channels.count_ones();
    let before = 2 * index + u32::from(with_status);
    // Bits of a register read before its first data bit: START, address and pointer, repeated START,
    // address: 29; then the first data bit.
    let latched_us = delay_us + f64::from(47 * before + 29) * BIT_US;
    let channel = scheme.configuration.acquisition.channel_at(index as u8);
    let settings = scheme.configuration.channel(channel.unwrap_or_default());
    let reference_hz = if count == 1 { 200e6 / 6.0 } else { 40e6 };
    let switch_s = 692e-9 + 5.0 / reference_hz;
    let clocks = f64::from(settings.rcount.get()) * 16.0;
    let settling = if count == 1 {
        0.0
    } else {
        f64::from(settings.settle_count.get()) * 16.0
    };
    let dwell_us = ((clocks + settling) / reference_hz + switch_s) * 1e6;
    (latched_us, dwell_us * f64::from(index + 1))
}

/// Returns the latest start of a frame after its edge, us.
fn latest_begin_us((channels, rate_hz, with_status): (u8, f32, bool)) -> u32 {
    Parts::new(&scheme(channels, rate_hz, with_status), with_status).latest_begin_us()[0]
}

#[test]
fn no_frame_that_may_be_of_two_scans_is_passed_on_and_none_is_dropped_long_before() {
    for case @ (channels, rate_hz, with_status) in CASES {
        let bus = Bus::new(channels, rate_hz, with_status).settled();
        let period_us = bus.period_us;
        let mut dropped_from_us = f64::MAX;
        for delay_us in (0..period_us as u32).map(f64::from) {
            let whole = (0..channels.count_ones()).all(|index| {
                let (latched_us, end_us) = word_and_end_us(case, index, delay_us);
                latched_us < end_us
            });
            let mut bus = Bus::new(channels, rate_hz, with_status).settled();
            match bus.scan_after(period_us, delay_us) {
                Finding::Late => dropped_from_us = dropped_from_us.min(delay_us),
                Finding::Scan { .. } => assert!(whole, "{case:?}: {delay_us} us late"),
                Finding::Early => panic!("{case:?}: {delay_us} us"),
            }
            if whole {
                // A frame is dropped unnecessarily only within a margin of a few microseconds.
                assert!(dropped_from_us > delay_us - 10.0, "{case:?}: {delay_us} us");
            }
        }
        assert!(f64::from(latest_begin_us(case)) < dropped_from_us);
    }
}

#[test]
fn a_frame_that_comes_late_is_counted_with_the_next_one() {
    for (channels, rate_hz, with_status) in CASES {
        let mut bus = Bus::new(channels, rate_hz, with_status).settled();
        let late_us = bus.period_us - 20.0;
        assert_eq!(bus.scan_after(bus.period_us, late_us), Finding::Late);
        let missed = Finding::Scan {
            missed: 1,
            gap: true,
        };
        assert_eq!(bus.scan(), missed, "{channels:#b} {rate_hz}");
        assert_eq!(bus.scan(), CLEAN);
        // INTB was still low at the end of two more scans, so they made no edge.
        assert_eq!(bus.scan_after(bus.period_us, late_us), Finding::Late);
        let missed = Finding::Scan {
            missed: 3,
            gap: true,
        };
        assert_eq!(bus.scan_after(3.0 * bus.period_us, 3.0), missed);
        assert_eq!(bus.scan(), CLEAN);
    }
}

#[test]
fn a_conversion_that_the_watchdog_aborts_is_a_gap_and_no_loss() {
    for rate_hz in [200.0, 500.0, 940.0, 1_000.0, 2_000.0, 3_960.0] {
        let mut bus = Bus::new(0b0001, rate_hz, false).settled();
        // Since the last result: 5.2 ms until the watchdog aborts, settling, and the conversion itself.
        let interval_us = 5_200.0 + 27.0 + bus.period_us;
        assert_eq!(bus.scan_after(interval_us, 3.0), GAP, "{rate_hz} Hz");
        assert!(!bus.grid.needs_verify());
        assert_eq!(bus.scan(), CLEAN);
    }
}

#[test]
fn an_edge_that_was_not_seen_is_a_scan_that_is_missing() {
    let mut bus = Bus::new(0b0001, 1_000.0, false).settled();
    bus.edges += 1;
    let missed = Finding::Scan {
        missed: 1,
        gap: true,
    };
    assert_eq!(bus.scan_after(2.0 * bus.period_us, 3.0), missed);
}

#[test]
fn a_conversion_time_that_changes_is_marked_at_once_and_suspected_at_the_second() {
    for (channels, rate_hz, with_status) in CASES {
        // Changes of the period by each bit of RCOUNT that shifts a time stamp by two microseconds or
        // more.
        for changed_us in [4.0, 7.0, 30.0, 273.0, 1_000.0, -4.0, -30.0, -100.0] {
            let mut bus = Bus::new(channels, rate_hz, with_status).settled();
            bus.period_us += changed_us;
            let is_marked = |found| found == GAP || changed_us < 0.0 && found == Finding::Early;
            assert!(
                is_marked(bus.scan()),
                "{channels:#b} {rate_hz} {changed_us}"
            );
            assert!(!bus.grid.needs_verify());
            assert!(is_marked(bus.scan()));
            assert!(bus.grid.needs_verify(), "{channels:#b} {changed_us}");
            for _ in 0..6 {
                assert!(!bus.grid.is_off());
                assert!(is_marked(bus.scan()));
            }
            assert!(bus.grid.is_off());
        }
    }
}

#[test]
fn a_period_beside_the_plan_is_suspected_from_the_start() {
    let mut bus = Bus::new(0b0001, 1_000.0, false);
    bus.period_us += 20.0;
    for _ in 0..3 {
        assert_eq!(bus.scan(), GAP);
    }
    assert!(bus.grid.needs_verify());
}

#[test]
fn what_the_plan_does_not_know_of_the_period_is_learnt() {
    for (channels, rate_hz, with_status) in CASES {
        for unknown_us in [-0.9, -0.3, 0.4] {
            let mut bus = Bus::new(channels, rate_hz, with_status);
            bus.period_us += unknown_us * f64::from(channels.count_ones());
            assert_eq!(bus.scan(), GAP);
            for _ in 0..200 {
                assert_eq!(bus.scan(), CLEAN, "{channels:#b} {rate_hz} {unknown_us}");
            }
        }
    }
}

#[test]
fn after_an_error_of_the_bus_nothing_is_known_of_what_went_before() {
    let mut bus = Bus::new(0b0001, 1_000.0, false).settled();
    bus.grid.interrupt();
    assert_eq!(bus.scan_after(7_777.0, 3.0), GAP);
    assert_eq!(bus.scan(), CLEAN);
}

#[test]
fn there_is_room_for_a_register_wherever_it_delays_no_frame_too_long() {
    for (channels, rate_hz, with_status) in CASES {
        let bus = Bus::new(channels, rate_hz, with_status).settled();
        // A register may be read if a frame may start 130 us late: the read may start just before the
        // edge and takes 48 bit times and the master's overhead. It also needs its turn between two
        // frames.
        let fits = latest_begin_us((channels, rate_hz, with_status)) >= 130;
        let turn_us = bus.period_us - bus.frame_us;
        let expected = fits && turn_us >= 40.0;
        assert_eq!(bus.grid.has_room(), expected, "{channels:#b} {rate_hz}");
    }
    for (channels, rate_hz, with_status) in [
        (0b0001, 1_000.0, true),
        (0b0011, 1_400.0, true),
        (0b0111, 950.0, true),
        (0b1111, 1_000.0, false),
        (0b1111, 740.0, true),
    ] {
        let scheme = scheme(channels, rate_hz, with_status);
        let grid = Grid::new(&scheme, with_status, 1);
        assert!(grid.has_room(), "{channels:#b} {rate_hz}");
    }
}

/// A disturbance that pulls INTB low for a moment ends no scan: the words are those of the last scan.
#[test]
fn an_edge_that_ends_no_scan_is_no_sample_and_loses_none() {
    for (channels, rate_hz, with_status) in CASES {
        for part in [0.05, 0.3, 0.5, 0.9] {
            let mut bus = Bus::new(channels, rate_hz, with_status).settled();
            let after_us = part * bus.period_us;
            assert_eq!(
                bus.scan_after(after_us, 3.0),
                Finding::Early,
                "{rate_hz} {part}"
            );
            // The scan that was in progress at the early edge is passed on.
            let left_us = bus.period_us - after_us;
            assert_eq!(bus.scan_after(left_us, 3.0), GAP, "{rate_hz} {part}");
            assert_eq!(bus.scan(), CLEAN);
            assert!(!bus.grid.needs_verify());
        }
    }
}

/// For two converters that take turns channel by channel: computes from the datasheet when each word of
/// one is latched and when it is overwritten, for every time between the edges of the two.
#[test]
fn what_two_converters_may_be_asked_for_the_bus_can_fetch() {
    const MASTER_US: f64 = 10.0;
    let mut fastest_hz = Vec::new();
    for channels in [0b0001, 0b0011, 0b0111, 0b1111] {
        let shared = |rate_hz| {
            let setpoint = Setpoint {
                channels,
                rate_hz,
                shares_bus: true,
            };
            Scheme::new(setpoint, true)
        };
        let rates = (10..200).map(|tens| 10.0 * tens as f32);
        let accepted: Vec<f32> = rates.filter(|rate| shared(*rate).is_ok()).collect();
        let most_hz = *accepted.last().unwrap();
        assert_eq!(accepted[0], 100.0);
        fastest_hz.push(most_hz);
        let count = channels.count_ones();
        let part_us = |index: u32| {
            let registers = if index == 0 { 3 } else { 2 };
            f64::from(47 * registers + 1) * BIT_US + MASTER_US
        };
        let scheme = shared(most_hz).unwrap();
        let latest_us = Parts::new(&scheme, true).latest_begin_us();
        let period_us = f64::from(scheme.period_us);
        for shift_us in (0..period_us as u32).map(f64::from) {
            // Simulates the edges of both converters over some periods; `turn` is the converter whose
            // turn on the bus it is.
            let mut time_us = 0.0_f64;
            let mut done = [0_u32; 2];
            let mut turn = 0;
            let edge_us = |of: usize, done: u32| {
                f64::from(done / count) * period_us + if of == 0 { 0.0 } else { shift_us }
            };
            while done[0] < 6 * count {
                let calls = |of: usize| edge_us(of, done[of]) <= time_us;
                let next = if calls(turn) { turn } else { 1 - turn };
                if !calls(next) {
                    time_us = edge_us(0, done[0]).min(edge_us(1, done[1]));
                    continue;
                }
                let index = done[next] % count;
                let late_us = time_us - edge_us(next, done[next]);
                let limit_us = f64::from(latest_us[index as usize]);
                assert!(
                    late_us <= limit_us,
                    "{channels:#b} {most_hz} {shift_us}: {late_us}"
                );
                time_us += part_us(index);
                done[next] += 1;
                turn = 1 - next;
            }
        }
    }
    println!("{fastest_hz:?} Hz");
    assert!(
        fastest_hz[0] >= 1_000.0 && fastest_hz[3] >= 400.0,
        "{fastest_hz:?}"
    );
}
