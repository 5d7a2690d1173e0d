//! Times of events, against numbers computed by hand from the datasheet's equations.

use crate::common::*;
use ldc161x_sim::{
    ExternalClock, InternalClock, Misuse, Overhead, PartNumber, Sensors, Settings, Time,
    TrueConversion,
};

/// Start-up time: 16384 / 43.4 MHz.
const START_UP_S: f64 = 377.511_521e-6;

fn last<S: Sensors>(rig: &ChipRig<S>, channel: u8) -> TrueConversion {
    *rig.chip
        .borrow()
        .last_conversion(channel)
        .expect("a conversion")
}

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
fn the_first_conversion_waits_for_start_up_and_settling() {
    let rig = ChipRig::new(quiet(40e6), [3e6]);
    rig.prepare(0, 2500, 100);
    rig.write(0x1B, 0x020D);
    let woken = wake(&rig, 0x1601);
    rig.convert(0, 1);
    let first = last(&rig, 0);
    // Settling takes 16 * 100 / 40 MHz = 40 us, the conversion 16 * 2500 / 40 MHz = 1 ms.
    close(first.start, woken + START_UP_S + 40e-6);
    close(first.end, woken + START_UP_S + 40e-6 + 1e-3);
    assert_eq!(rig.now(), first.end);
}

#[test]
fn settle_counts_of_zero_and_one_take_32_clocks() {
    for (count, clocks) in [(0, 32.0), (1, 32.0), (2, 32.0), (3, 48.0), (10, 160.0)] {
        let rig = ChipRig::new(quiet(10e6), [1e6]);
        rig.prepare(0, 100, count);
        rig.write(0x1B, 0x020D);
        let woken = wake(&rig, 0x1601);
        rig.convert(0, 1);
        close(last(&rig, 0).start, woken + START_UP_S + clocks / 10e6);
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
        let settings = with_switches(quiet(12e6), |switches| switches.overhead = overhead);
        let rig = ChipRig::new(settings, [3e6]);
        rig.single(1512);
        rig.convert(0, 1);
        let first = last(&rig, 0);
        rig.convert(0, 100);
        let later = last(&rig, 0);
        close(later.end, first.end.as_secs_f64() + 100.0 * interval_s);
        close(later.end - later.start, 24_192.0 / 12e6);
        assert_eq!(later.number, first.number + 100);
    }
}

#[test]
fn the_grid_holds_for_ten_minutes() {
    let rig = ChipRig::new(quiet(12e6), [3e6]);
    rig.single(3049);
    rig.convert(0, 1);
    let first = last(&rig, 0).end;
    // An interval is 48 795 clocks of 12 MHz, 4.06625 ms.
    let count = 147_556;
    rig.convert(0, count);
    let expected_ps = count * 4_066_250_000;
    let error_ps = (last(&rig, 0).end - first).as_ps().abs_diff(expected_ps);
    assert!(error_ps < 10, "{error_ps} ps after ten minutes");
}

#[test]
fn autoscan_dwells_on_each_channel() {
    // Time per channel: settling of 16*50 clocks, conversion of 16*(500 + 100 ch) clocks, 692 ns
    // and 5 clocks; at 40 MHz.
    let rig = ChipRig::new(quiet(40e6), [3e6; 4]);
    let dwell =
        |channel: u8| (800.0 + 16.0 * (500.0 + 100.0 * f64::from(channel)) + 5.0) / 40e6 + 692e-9;
    for channel in 0..4 {
        rig.prepare(channel, 500 + 100 * u16::from(channel), 50);
    }
    rig.write(0x1B, 0xC20D);
    let woken = wake(&rig, 0x1601);
    rig.convert(3, 3);
    let period: f64 = (0..4).map(dwell).sum();
    let mut begin = woken + START_UP_S + 2.0 * period;
    for channel in 0..4 {
        let conversion = last(&rig, channel);
        assert_eq!(conversion.number, 2);
        close(conversion.start, begin + 800.0 / 40e6);
        begin += dwell(channel);
    }
}

#[test]
fn each_channel_has_its_own_reference_divider() {
    let rig = ChipRig::new(quiet(40e6), [3e6; 2]);
    rig.prepare(0, 500, 50);
    rig.prepare(1, 500, 50);
    rig.write(0x15, 0x1004);
    rig.write(0x1B, 0x820D);
    rig.write(0x1A, 0x1601);
    rig.convert(1, 1);
    close(last(&rig, 0).end - last(&rig, 0).start, 8_000.0 / 40e6);
    close(last(&rig, 1).end - last(&rig, 1).start, 8_000.0 / 10e6);
    assert_eq!(last(&rig, 1).reference_hz, 10e6);
}

#[test]
fn sequences_by_part() {
    // (RR_SEQUENCE, number of channels of an LDC1614, number of channels of an LDC1612)
    for (code, four, two) in [(0, 2, 2), (1, 3, 2), (2, 4, 2), (3, 2, 2)] {
        for (part, channels) in [(PartNumber::Ldc1614, four), (PartNumber::Ldc1612, two)] {
            let rig = ChipRig::new(
                Settings {
                    part,
                    ..quiet(40e6)
                },
                [3e6; 4],
            );
            (0..4).for_each(|channel| rig.prepare(channel, 100, 10));
            rig.write(0x1B, 0x820D | code << 13);
            rig.write(0x1A, 0x1601);
            rig.convert(0, 3);
            for channel in 0..4 {
                let done = rig.chip.borrow().conversions(channel);
                let expected = match channel {
                    0 => 3,
                    _ if channel < channels => 2,
                    _ => 0,
                };
                assert_eq!(
                    done, expected,
                    "{part:?}, RR_SEQUENCE {code}, channel {channel}"
                );
            }
        }
    }
}

#[test]
fn the_active_channel_by_part() {
    for (code, four, two) in [(0, 0, 0), (1, 1, 1), (2, 2, 0), (3, 3, 1)] {
        for (part, channel) in [(PartNumber::Ldc1614, four), (PartNumber::Ldc1612, two)] {
            let rig = ChipRig::new(
                Settings {
                    part,
                    ..quiet(40e6)
                },
                [3e6; 4],
            );
            (0..4).for_each(|channel| rig.prepare(channel, 100, 10));
            rig.write(0x1B, 0x020D);
            rig.write(0x1A, 0x1601 | code << 14);
            rig.convert(channel, 5);
            let total: u64 = (0..4)
                .map(|channel| rig.chip.borrow().conversions(channel))
                .sum();
            assert_eq!(total, 5, "{part:?}, ACTIVE_CHAN {code}");
        }
    }
}

#[test]
fn the_internal_oscillator_and_its_temperature() {
    for (hz, temperature_c, true_hz) in [
        (43.4e6, 25.0, 43.4e6),
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
        let conversion = last(&rig, 0);
        close(
            conversion.start,
            woken + 16_384.0 / true_hz + 320.0 / (true_hz / 2.0),
        );
        close(
            conversion.end - conversion.start,
            32_000.0 / (true_hz / 2.0),
        );
        let exact = 268_435_456.0 * 3e6 / (true_hz / 2.0);
        assert!((f64::from(conversion.word) - exact).abs() <= 0.5001);
    }
}

#[test]
fn an_erring_and_drifting_clock_shows_in_intervals_and_words() {
    let clock = ExternalClock {
        frequency_hz: 40e6,
        relative_error: 50e-6,
        drift_per_s: 1e-6,
    };
    let settings = Settings {
        external_clock: Some(clock),
        ..Settings::ideal()
    };
    let rig = ChipRig::new(settings, [3e6]);
    rig.single(2500);
    rig.convert(0, 1);
    let early = last(&rig, 0);
    rig.convert(0, 10_000);
    let late = last(&rig, 0);
    let at = |time: Time| 40e6 * (1.0 + 50e-6 + 1e-6 * time.as_secs_f64());
    for conversion in [early, late] {
        let reference_hz = at(conversion.start);
        assert!((conversion.reference_hz - reference_hz).abs() < 1e-3);
        assert!((f64::from(conversion.word) - 268_435_456.0 * 3e6 / reference_hz).abs() < 0.51);
    }
    // 10 000 intervals of 40 011 clocks; half-way through, the clock is 55 ppm fast.
    let span = (late.end - early.end).as_secs_f64();
    let nominal = 10_000.0 * 40_011.0 / 40e6;
    assert!((span / nominal - 1.0 + 55e-6).abs() < 2e-7, "{span}");
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

#[test]
fn next_event_is_where_the_interrupt_falls() {
    let rig = ChipRig::new(quiet(40e6), [3e6]);
    rig.single(2500);
    let edge = rig.next_interrupt();
    assert_eq!(edge, last(&rig, 0).end);
    assert_eq!(rig.chip.borrow().last_interrupt(), Some(edge));
    let mut chip = rig.chip.borrow_mut();
    chip.set_shutdown(true);
    assert_eq!(chip.next_event(), None);
}

/// Violations of the datasheet that are counted for one conversion on channel 0.
fn misuse(clkin_hz: f64, sensor_hz: f64, writes: &[(u8, u16)]) -> Misuse {
    let settings = Settings {
        internal_clock: InternalClock {
            frequency_hz: clkin_hz,
            ..InternalClock::default()
        },
        ..quiet(clkin_hz)
    };
    let rig = ChipRig::new(settings, [sensor_hz; 2]);
    for channel in 0..2 {
        rig.prepare(channel, 1000, 20);
    }
    for &(register, value) in writes {
        rig.write(register, value);
    }
    rig.convert(0, 1);
    rig.chip.borrow().misuse()
}

#[test]
fn rules_of_table_43_are_watched() {
    let single = [(0x1B, 0x020F), (0x1A, 0x1601)];
    let autoscan = [(0x1B, 0x820F), (0x1A, 0x1601)];
    let internal = [(0x1B, 0x820F), (0x1A, 0x1401)];
    for (clkin_hz, writes, too_fast) in [
        (35e6, &single, 0),
        (36e6, &single, 1),
        (40e6, &autoscan, 0),
        (41e6, &autoscan, 1),
        (55e6, &internal, 0),
        (56e6, &internal, 1),
    ] {
        let noted = misuse(clkin_hz, 3e6, writes);
        let expected = Misuse {
            reference_too_fast: too_fast,
            ..Misuse::default()
        };
        assert_eq!(noted, expected, "{clkin_hz} Hz, {writes:?}");
    }
    for (sensor_hz, dividers, too_fast) in [
        (8.74e6, 0x1001, 0),
        (8.76e6, 0x1001, 1), // 8.75 MHz needs a divider, and a quarter of 35 MHz is 8.75 MHz too
        (8.76e6, 0x2001, 0),
        (4.3e6, 0x1002, 0),
        (4.4e6, 0x1002, 1),
        (4.4e6, 0x2002, 0),
    ] {
        let writes = [(0x14, dividers), (0x1B, 0x020F), (0x1A, 0x1601)];
        let noted = misuse(35e6, sensor_hz, &writes);
        assert_eq!(
            noted.sensor_too_fast, too_fast,
            "{sensor_hz} Hz, {dividers:#06x}"
        );
    }
    // An undivided sensor above 8.75 MHz breaks a rule even if the reference is fast enough.
    let noted = misuse(40e6, 9e6, &autoscan);
    assert_eq!(noted.sensor_too_fast, 1);
    for (register, value, reserved) in [
        (0x08, 9, 0),
        (0x08, 8, 1),
        (0x10, 4, 0),
        (0x10, 3, 1),
        (0x14, 0x1001, 0),
        (0x14, 0x0001, 1),
    ] {
        let writes = [(register, value), (0x1B, 0x020F), (0x1A, 0x1601)];
        let noted = misuse(30e6, 3e6, &writes);
        assert_eq!(
            noted.reserved_values, reserved,
            "{value:#06x} to {register:#04x}"
        );
    }
}
