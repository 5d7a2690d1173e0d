//! The counter: the form of its words, and the effects of dividers, offset and filter on them.

use std::collections::BTreeSet;

use crate::common::*;
use ldc161x_sim::{Counter, Deglitch33, Errors, Overhead, Sensors, Settings, TrueConversion};

const FULL_SCALE: f64 = 268_435_456.0;

fn convert<S: Sensors>(rig: &ChipRig<S>) -> TrueConversion {
    rig.convert(0, 1);
    rig.last(0)
}

fn reported_hz(conversion: &TrueConversion) -> f64 {
    f64::from(conversion.word) / FULL_SCALE * conversion.reference_hz
}

fn counting(clkin_hz: f64, counter: Counter) -> Settings {
    with_switches(quiet(clkin_hz), |s| s.counter = counter)
}

/// A sensor whose frequency rises slowly, so that all phases occur.
fn rising(start_hz: f64, slope_hz_per_s: f64) -> impl Sensors {
    move |_: usize, time_s: f64| start_hz + slope_hz_per_s * time_s
}

/// Recorded words, as (RCOUNT, word), at 12 MHz: from eddy-ng issue 3 (posted as frequencies), 99,
/// 107 and README. The word of issue 105 is left out: its sensor is above a quarter of the
/// reference.
const RECORDED: [(u16, u32); 9] = [
    (1512, 0x43F_D702),
    (1512, 0x43F_D5A8),
    (1512, 0x43F_DA10),
    (1512, 0x43F_DB6A),
    (1512, 0x43F_C5BC),
    (3049, 0x43C_923B),
    (3049, 0x435_4E00),
    (3049, 0x443_36D2),
    (1512, 0x440_9E8B),
];

#[test]
fn words_are_quotients_and_each_recorded_one_occurs_to_the_bit() {
    for &counter in Counter::VARIANTS {
        for (rcount, recorded) in RECORDED {
            let centre_hz = f64::from(recorded) / FULL_SCALE * 12e6;
            // The sensor sweeps ±60 ppm about the recorded word within 20 s.
            let sensor = rising(centre_hz * (1.0 - 60e-6), centre_hz * 6e-6);
            let rig = ChipRig::new(counting(12e6, counter), sensor);
            rig.single(rcount);
            let found = (0..10_000).any(|_| {
                let conversion = convert(&rig);
                let (m, n) = (conversion.counts.sensor, conversion.counts.reference);
                let exact = FULL_SCALE * m as f64 / n as f64;
                assert!((f64::from(conversion.word) - exact).abs() <= 0.5);
                let missing = 32 * u64::from(rcount) - n;
                assert!(
                    (12..=28).contains(&missing),
                    "{counter:?}: N = 32 R - {missing}"
                );
                conversion.word.abs_diff(recorded) <= 1
            });
            assert!(found, "{counter:?} never gives {recorded:#09x}");
        }
    }
}

#[test]
fn the_phase_runs_on_in_a_single_channel_and_begins_by_chance_at_each_activation() {
    // The sensor is at exactly a sixteenth of the reference, so every conversion of a single
    // channel has the same edges.
    let settings = with_switches(quiet(12e6), |s| s.overhead = Overhead::NONE);
    let rig = ChipRig::new(settings, [3e6 / 4.0; 2]);
    rig.single(1500);
    let first = convert(&rig).counts;
    assert!((0..200).all(|_| convert(&rig).counts == first));
    rig.write(0x1A, 0x3601);
    rig.autoscan(1, 1500, 20);
    let gaps: BTreeSet<u64> = (0..100).map(|_| convert(&rig).counts.reference).collect();
    assert!(gaps.len() > 1);
}

#[test]
fn dividers_and_offset_follow_equation_6() {
    // f = FIN_DIVIDER * fREF * (DATA / 2^28 + OFFSET / 2^16)
    for (fin, fref, offset) in [
        (1_u16, 1_u16, 0_u16),
        (2, 1, 0),
        (4, 2, 0),
        (1, 3, 0x1000),
        (3, 2, 0x07FF),
    ] {
        let rig = ChipRig::new(Settings::ideal(), [2.5e6]);
        rig.single_with(1000, &[(0x14, fin << 12 | fref), (0x0C, offset)]);
        let conversion = convert(&rig);
        let reference_hz = 40e6 / f64::from(fref);
        let ratio = f64::from(conversion.word) / FULL_SCALE + f64::from(offset) / 65_536.0;
        let off_hz = f64::from(fin) * reference_hz * ratio - 2.5e6;
        // Limit in hertz: half a unit of the word's last bit.
        let most_hz = 0.5 * f64::from(fin) * reference_hz / FULL_SCALE;
        assert!(
            off_hz.abs() <= 1.001 * most_hz,
            "{fin} {fref} {offset}: {off_hz}"
        );
    }
}

#[test]
fn under_range_over_range_and_zero_count() {
    for (sensor_hz, dividers, offset, frame, errors) in [
        // An offset of 0x8000 is half of the reference frequency.
        (2e6, 0x1001, 0x8000, (0x8000, 0), Errors::UNDER_RANGE),
        (12e6, 0x1001, 0, (0x4000, 0xFFF_FFFF), Errors::OVER_RANGE),
        // FIN_DIVIDER 0 is reserved: no edges are counted.
        (2e6, 0x0001, 0, (0, 0), Errors::ZERO_COUNT),
        (
            2e6,
            0x0001,
            1,
            (0x8000, 0),
            Errors::ZERO_COUNT | Errors::UNDER_RANGE,
        ),
    ] {
        let rig = ChipRig::new(quiet(10e6), [sensor_hz]);
        rig.single_with(1000, &[(0x14, dividers), (0x0C, offset), (0x1B, 0x020F)]);
        assert_eq!(convert(&rig).errors, errors);
        assert_eq!(rig.frame(0), frame, "{errors}");
    }
}

#[test]
fn a_slow_deglitch_filter_spoils_the_count_silently() {
    let of = |code, switch| if switch { (code, 33e6) } else { (code, 1e6) };
    for &widest in Deglitch33::VARIANTS {
        for (code, bandwidth_hz) in [
            (0b001, 1e6_f64),
            (0b100, 3.3e6),
            (0b101, 10e6),
            of(0b111, widest == Deglitch33::Code111),
            of(0b011, widest == Deglitch33::Code011),
        ] {
            let settings = with_switches(quiet(40e6), |s| s.deglitch_33 = widest);
            let rig = ChipRig::new(settings, [3.2e6]);
            rig.single_with(1000, &[(0x1B, 0x0208 | code)]);
            let conversion = convert(&rig);
            let spoilt = bandwidth_hz < 3.2e6;
            assert_eq!(conversion.spoilt, spoilt, "{widest:?}, code {code:#05b}");
            let expected = if spoilt {
                0.8 * bandwidth_hz..bandwidth_hz
            } else {
                3.19e6..3.21e6
            };
            assert!(expected.contains(&reported_hz(&conversion)));
            assert!(conversion.errors.is_empty(), "the chip says nothing");
        }
    }
}
