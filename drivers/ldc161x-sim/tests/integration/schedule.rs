//! Times of events, against numbers computed by hand from the datasheet's equations.

use crate::common::*;
use ldc161x_sim::{InternalClock, Overhead, Sensors, Settings, Time};

/// Start-up time: 16384 / 43.4 MHz.
const START_UP_S: f64 = 377.511_521e-6;

fn close(time: Time, seconds: f64) {
    let error = time.as_secs_f64() - seconds;
    assert!(error.abs() < 2e-9, "{time} instead of {seconds} s");
}

/// Wakes the chip; returns the time at which the last byte of that write ended.
fn wake<S: Sensors>(rig: &ChipRig<S>, config: u16) -> f64 {
    rig.write(0x1A, config);
    // The byte is followed by a STOP bit of 2.5 us.
    rig.now().as_secs_f64() - 2.5e-6
}

#[test]
fn a_conversion_follows_start_up_and_settling_and_lasts_16_counts() {
    for (settle_count, settle_clocks) in [(0, 32.0), (1, 32.0), (2, 32.0), (3, 48.0), (100, 1600.0)]
    {
        let rig = ChipRig::new(quiet(40e6), [3e6]);
        rig.prepare(0, 2500, settle_count);
        rig.write(0x1B, 0x020D);
        let woken = wake(&rig, 0x1601);
        rig.convert(0, 1);
        let first = rig.last(0);
        let start_s = woken + START_UP_S + settle_clocks / 40e6;
        close(first.start, start_s);
        close(first.end, start_s + 16.0 * 2500.0 / 40e6);
        assert_eq!(rig.now(), first.end);
    }
}

#[test]
fn single_channel_intervals_have_the_overhead_of_the_switch() {
    // A conversion takes 16 * 1512 = 24192 clocks of 12 MHz, in addition to the overhead.
    for (overhead, interval_s) in [
        (Overhead::MEASURED, 24_203.0 / 12e6),
        (Overhead::EQUATION_7, 24_196.0 / 12e6),
        (Overhead::EQUATION_8, 24_197.0 / 12e6 + 692e-9),
        (Overhead::NONE, 24_192.0 / 12e6),
    ] {
        let settings = with_switches(quiet(12e6), |s| s.overhead = overhead);
        let rig = ChipRig::new(settings, [3e6]);
        rig.single(1512);
        rig.convert(0, 1);
        let first = rig.last(0);
        rig.convert(0, 100);
        let later = rig.last(0);
        close(later.end, first.end.as_secs_f64() + 100.0 * interval_s);
        close(later.end - later.start, 24_192.0 / 12e6);
        assert_eq!(later.number, first.number + 100);
    }
}

#[test]
fn autoscan_dwells_on_each_channel_in_the_clocks_of_its_divider() {
    // Time per channel: settling of 16*50 clocks, conversion of 16*(500 + 100 ch) clocks, 692 ns
    // and 5 clocks; at 40 MHz, divided by 2 for channel 1.
    let rig = ChipRig::new(quiet(40e6), [3e6; 4]);
    let clock_hz = |channel: u8| if channel == 1 { 20e6 } else { 40e6 };
    let dwell = |channel: u8| {
        let conversion = 16.0 * (500.0 + 100.0 * f64::from(channel));
        (800.0 + conversion + 5.0) / clock_hz(channel) + 692e-9
    };
    for channel in 0..4 {
        rig.prepare(channel, 500 + 100 * u16::from(channel), 50);
    }
    rig.write(0x15, 0x1002);
    rig.write(0x1B, 0xC20D);
    let woken = wake(&rig, 0x1601);
    rig.convert(3, 3);
    let period: f64 = (0..4).map(dwell).sum();
    let mut begin = woken + START_UP_S + 2.0 * period;
    for channel in 0..4 {
        let conversion = rig.last(channel);
        assert_eq!(conversion.number, 2);
        assert_eq!(conversion.reference_hz, clock_hz(channel));
        close(conversion.start, begin + 800.0 / clock_hz(channel));
        begin += dwell(channel);
    }
}

#[test]
fn the_internal_oscillator_and_its_temperature() {
    for (hz, temperature_c, true_hz) in [
        (35e6, 25.0, 35e6),
        (55e6, 125.0, 55e6 * (1.0 - 1300e-6)),
        (43.4e6, -40.0, 43.4e6 * (1.0 + 845e-6)),
    ] {
        let settings = Settings {
            internal_clock: InternalClock {
                frequency_hz: hz,
                ..InternalClock::default()
            },
            temperature_c,
            external_clock: None,
            ..Settings::ideal()
        };
        let rig = ChipRig::new(settings, [3e6]);
        rig.prepare(0, 2000, 20);
        rig.write(0x14, 0x1002);
        rig.write(0x1B, 0x020D);
        let woken = wake(&rig, 0x1401); // REF_CLK_SRC 0
        rig.convert(0, 1);
        let conversion = rig.last(0);
        let half_hz = true_hz / 2.0;
        close(
            conversion.start,
            woken + 16_384.0 / true_hz + 320.0 / half_hz,
        );
        close(conversion.end - conversion.start, 32_000.0 / half_hz);
        let exact = 268_435_456.0 * 3e6 / half_hz;
        assert!((f64::from(conversion.word) - exact).abs() <= 0.5001);
    }
}

#[test]
fn sleep_stops_and_keeps_the_registers() {
    let rig = ChipRig::new(quiet(40e6), [3e6]);
    rig.single(100);
    rig.convert(0, 3);
    rig.write(0x1A, 0x3601);
    let done = rig.chip.borrow().conversions(0);
    assert!(!rig.chip.borrow().is_converting());
    assert!(!rig.intb_is_low(), "sleep releases INTB");
    rig.wait(ms(5));
    assert_eq!(rig.chip.borrow().conversions(0), done);
    assert_eq!(rig.read(0x08), 100);
    assert_eq!(rig.frame(0), (0, 0), "sleep clears results");
    assert_eq!(rig.chip.borrow().last_read(0), None);
    assert_eq!(rig.read(0x18), 0, "and STATUS");
    rig.write(0x1A, 0x1601);
    rig.convert(0, 1);
    assert_ne!(rig.frame(0).1, 0);
}
