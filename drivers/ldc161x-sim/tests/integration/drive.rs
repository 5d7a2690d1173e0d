//! Amplitude, drive current and settling, and the behaviour when the oscillation fails.

use core::f64::consts::{PI, TAU};

use crate::common::*;
use ldc161x_sim::{Errors, SensorDrive, Sensors, Settings, Tank, Time, TrueConversion};

/// A 3 MHz resonator with this parallel loss resistance and quality factor.
fn tank(parallel_resistance_ohm: f64, quality_factor: f64) -> Tank {
    let omega = TAU * 3e6;
    Tank {
        inductance_h: parallel_resistance_ohm / (quality_factor * omega),
        capacitance_f: quality_factor / (parallel_resistance_ohm * omega),
        parallel_resistance_ohm,
    }
}

/// A tank with this amplitude at a drive current.
fn tank_of(amplitude_v: f64, current_ua: f64) -> Tank {
    tank(PI * amplitude_v / (4.0 * current_ua * 1e-6), 20.0)
}

fn first_conversion<S: Sensors>(rig: &ChipRig<S>) -> TrueConversion {
    rig.convert(0, 1);
    rig.last(0)
}

/// A rig whose channel 0 converts with this drive code.
fn driven<S: Sensors>(settings: Settings, sensors: S, code: u16, config: u16) -> ChipRig<S> {
    let rig = ChipRig::new(settings, sensors);
    rig.prepare(0, 2500, 0x100);
    rig.configure(&[
        (0x1E, code << 11),
        (0x19, 0xF8FD),
        (0x1B, 0x020D),
        (0x1A, config),
    ]);
    rig
}

/// Datasheet table 42, uA.
const CURRENTS_UA: [u16; 32] = [
    16, 18, 20, 23, 28, 32, 40, 46, 52, 59, 72, 82, 95, 110, 127, 146, 169, 195, 212, 244, 297,
    342, 424, 489, 551, 635, 763, 880, 1017, 1173, 1355, 1563,
];

#[test]
fn amplitude_flags_follow_equation_12_for_every_code() {
    let silent = Errors::ZERO_COUNT | Errors::AMPLITUDE_LOW;
    for (code, current_ua) in (0..).zip(CURRENTS_UA) {
        for (amplitude_v, expected) in [
            (0.59, silent),
            (0.61, Errors::AMPLITUDE_LOW),
            (1.19, Errors::AMPLITUDE_LOW),
            (1.21, Errors::NONE),
            (1.79, Errors::NONE),
            (1.81, Errors::AMPLITUDE_HIGH),
            (3.0, Errors::AMPLITUDE_HIGH),
        ] {
            let tank = tank_of(amplitude_v, f64::from(current_ua));
            let rig = driven(quiet(40e6), [tank], code, 0x1601);
            let conversion = first_conversion(&rig);
            assert_eq!(conversion.errors, expected, "code {code}, {amplitude_v} V");
            assert_eq!(u16::from(conversion.drive_code), code);
            if expected == silent {
                assert_eq!(conversion.word, 0);
            } else {
                assert!((conversion.amplitude_v - amplitude_v).abs() < 1e-6);
            }
            let flag = if expected.is_empty() { 0 } else { 0x1000 };
            assert_eq!(rig.frame(0).0, flag);
        }
    }
}

#[test]
fn too_short_a_settling_shows_in_amplitude_and_frequency() {
    // With Q 100 at 3 MHz the time constant is 10.6 us. With code 21, 342 uA, and 3.9 kohm the
    // settled amplitude is 1.70 V.
    let settings = Settings {
        drive: SensorDrive {
            settling_shift: -1e-3,
            ..Settings::ideal().drive
        },
        ..Settings::ideal()
    };
    let settled_v = 4.0 * 3.9e3 * 342e-6 / PI;
    // Settling lasts 16*settle/40 MHz. Activation is low-power; in the last case it uses full current.
    for (config, settle, missing, errors) in [
        (
            0x1E01,
            26_u16,
            (-10.4_f64 / 10.61).exp(),
            Errors::AMPLITUDE_LOW,
        ),
        (0x1E01, 84, (-33.6_f64 / 10.61).exp(), Errors::NONE), // Q/f = 33.3 us: equation 10
        (0x1E01, 1000, 0.0, Errors::NONE),
        (0x1601, 26, 0.0, Errors::NONE),
    ] {
        let rig = ChipRig::new(settings, [tank(3.9e3, 100.0)]);
        rig.single(2500);
        rig.configure(&[(0x1A, 0x3601), (0x10, settle), (0x1A, config)]);
        let first = first_conversion(&rig);
        let left = 1.0 - first.amplitude_v / settled_v;
        assert!((left - missing).abs() < 0.01, "{settle}");
        assert_eq!(first.errors, errors, "{settle}");
        let shift = first.oscillation_hz / first.sensor_hz - 1.0;
        assert!((shift + 1e-3 * missing).abs() < 1e-5, "{settle}: {shift}");
        let second = first_conversion(&rig);
        assert!(second.errors.is_empty(), "a single channel oscillates on");
    }
    // In autoscan every activation is too short.
    let rig = ChipRig::new(settings, [tank(3.9e3, 100.0); 2]);
    rig.autoscan(1, 500, 26);
    rig.configure(&[(0x1A, 0x3601), (0x1A, 0x1E01)]);
    rig.convert(1, 10);
    for channel in 0..2 {
        assert_eq!(rig.last(channel).errors, Errors::AMPLITUDE_LOW);
    }
}

#[test]
fn automatic_calibration_finds_and_shows_the_code() {
    // The highest code with an amplitude below 1.8 V.
    for (resistance_ohm, code) in [(800.0, 31), (3e3, 22), (6.6e3, 18), (20e3, 9), (80e3, 0)] {
        // CONFIG is 0x0201, as in Klipper's LDC_CALIBRATE_DRIVE_CURRENT.
        let rig = driven(quiet(40e6), [tank(resistance_ohm, 20.0)], 5, 0x0201);
        for _ in 0..3 {
            rig.convert(0, 1);
            assert_eq!(rig.read(0x1E), 5 << 11 | code << 6, "{resistance_ohm} ohm");
        }
        assert_eq!(u16::from(rig.last(0).drive_code), code);
        // With the found code written back to IDRIVE and RP_OVERRIDE_EN set, the amplitude is
        // right.
        rig.configure(&[(0x1A, 0x2001), (0x1E, code << 11), (0x1A, 0x1601)]);
        assert!(first_conversion(&rig).errors.is_empty());
        assert_eq!(rig.read(0x1E) >> 11, code);
    }
    // Without the calibration INIT_IDRIVE0 stays zero.
    let rig = driven(quiet(40e6), [tank(3e3, 20.0)], 20, 0x1601);
    rig.convert(0, 3);
    assert_eq!(rig.read(0x1E), 0xA000);
}

// ---- a sensor that falls silent ----

/// A frequency of 3 MHz, except for 20 ms to 50 ms, when the sensor is silent.
fn interrupted(_: usize, time_s: f64) -> f64 {
    if (20e-3..50e-3).contains(&time_s) {
        0.0
    } else {
        3e6
    }
}

#[test]
fn zero_counts_precede_the_watchdog_in_single_channel_mode() {
    let rig = ChipRig::new(quiet(40e6), interrupted);
    rig.single(2500);
    while rig.now() < ms(22) {
        rig.convert(0, 1);
    }
    rig.read(0x18);
    rig.convert(0, 1);
    assert_eq!(rig.read(0x18) & 0x3F00, 0x0300, "ZC and ALE");
    assert_eq!(rig.frame(0), (0x1000, 0), "zero, with AE");
    // The watchdog acts 5.2 ms after the last conversion with edges.
    rig.wait(ms(5));
    assert_eq!(rig.read(0x18) & 0x0800, 0x0800, "WD");
}

#[test]
fn the_watchdog_restarts_until_the_sensor_returns() {
    let rig = ChipRig::new(quiet(40e6), interrupted);
    rig.single(20_000); // 8 ms: longer than the watchdog
    rig.convert(0, 2);
    let mut timeouts: Vec<Time> = Vec::new();
    while rig.now() < ms(50) {
        rig.read(0x18);
        let interrupt = rig.chip.borrow_mut().advance_to_interrupt(ms(50));
        timeouts.extend(interrupt);
        if rig.chip.borrow().register(0x18) & 0x0800 != 0 {
            assert_eq!(rig.frame(0), (0x2000, 0), "data are invalid");
            let truth = rig.chip.borrow().last_read(0).copied();
            assert_eq!(truth, None, "and belong to no conversion");
        }
    }
    assert!((4..=7).contains(&timeouts.len()), "{timeouts:?}");
    for pair in timeouts.windows(2).skip(1) {
        let span_s = (pair[1] - pair[0]).as_secs_f64();
        assert!((span_s - 5.2e-3).abs() < 1e-4, "{timeouts:?}");
    }
    rig.convert(0, 2);
    assert!(rig.last(0).errors.is_empty());
}

#[test]
fn autoscan_has_no_watchdog_but_zero_counts() {
    let rig = ChipRig::new(quiet(40e6), [3e6, 0.0]);
    rig.autoscan(1, 20_000, 20);
    rig.convert(1, 3);
    let status = rig.read(0x18);
    assert_eq!(status & 0x0800, 0, "no WD");
    assert_eq!(status & 0xC100, 0x4100, "ZC of channel 1");
    assert!(rig.last(0).errors.is_empty());
}
