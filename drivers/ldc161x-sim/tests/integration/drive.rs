//! Amplitude, drive current and settling, and the behaviour when the oscillation fails.

use crate::common::*;
use ldc161x_sim::{
    DRIVE_CURRENTS_UA, Errors, SensorDrive, Sensors, Settings, SleepExit, Tank, Time,
    TrueConversion, amplitude_v, calibrated_code, drive_current_a,
};

/// A 3 MHz resonator with this parallel loss resistance and quality factor.
fn tank(parallel_resistance_ohm: f64, quality_factor: f64) -> Tank {
    let omega = core::f64::consts::TAU * 3e6;
    Tank {
        inductance_h: parallel_resistance_ohm / (quality_factor * omega),
        capacitance_f: quality_factor / (parallel_resistance_ohm * omega),
        parallel_resistance_ohm,
    }
}

fn first_conversion<S: Sensors>(rig: &ChipRig<S>) -> TrueConversion {
    rig.convert(0, 1);
    *rig.chip.borrow().last_conversion(0).expect("a conversion")
}

/// A rig whose channel 0 converts with this drive code.
fn driven<S: Sensors>(settings: Settings, sensors: S, code: u16, config: u16) -> ChipRig<S> {
    let rig = ChipRig::new(settings, sensors);
    rig.prepare(0, 2500, 0x100);
    rig.write(0x1E, code << 11);
    rig.write(0x19, 0xF8FD);
    rig.write(0x1B, 0x020D);
    rig.write(0x1A, config);
    rig
}

#[test]
fn amplitude_flags_follow_equation_12_for_every_code() {
    for code in 0..32_u16 {
        let current_a = f64::from(DRIVE_CURRENTS_UA[usize::from(code)]) * 1e-6;
        for (amplitude, expected) in [
            (1.0, Errors::AMPLITUDE_LOW),
            (1.19, Errors::AMPLITUDE_LOW),
            (1.21, Errors::NONE),
            (1.79, Errors::NONE),
            (1.81, Errors::AMPLITUDE_HIGH),
            (3.0, Errors::AMPLITUDE_HIGH),
        ] {
            let resistance_ohm = core::f64::consts::PI * amplitude / (4.0 * current_a);
            let rig = driven(quiet(40e6), [tank(resistance_ohm, 20.0)], code, 0x1601);
            let conversion = first_conversion(&rig);
            assert!((conversion.amplitude_v - amplitude).abs() < 1e-6);
            assert_eq!(conversion.errors, expected, "code {code}, {amplitude} V");
            assert_eq!(conversion.drive_code, code as u8);
            let flag = if expected.is_empty() { 0 } else { 0x1000 };
            assert_eq!(rig.frame(0).0, flag);
        }
    }
}

#[test]
fn sensors_without_losses_of_their_own_have_ordinary_ones() {
    let closure = |_: usize, _: f64| 3e6;
    assert_eq!(closure.parallel_resistance_ohm(0, 0.0), 3e3);
    assert_eq!(closure.quality_factor(0, 0.0), 25.0);
    let tanks = [tank(4e3, 30.0)];
    assert!((tanks.frequency_hz(0, 0.0) - 3e6).abs() < 1.0);
    assert!((tanks.quality_factor(0, 0.0) - 30.0).abs() < 1e-9);
    assert_eq!(tanks.parallel_resistance_ohm(0, 0.0), 4e3);
    assert_eq!(tanks.quality_factor(1, 0.0), 0.0);
    assert_eq!(tanks.parallel_resistance_ohm(1, 0.0), 0.0);
}

#[test]
fn oscillation_stops_below_the_least_amplitude() {
    for (amplitude, oscillates) in [(0.59, false), (0.61, true)] {
        let resistance_ohm = core::f64::consts::PI * amplitude / (4.0 * 297e-6);
        let rig = driven(quiet(40e6), [tank(resistance_ohm, 20.0)], 20, 0x1601);
        let conversion = first_conversion(&rig);
        assert_eq!(conversion.word != 0, oscillates, "{amplitude} V");
        assert_eq!(conversion.errors.contains(Errors::ZERO_COUNT), !oscillates);
        assert!(conversion.errors.contains(Errors::AMPLITUDE_LOW));
    }
}

#[test]
fn a_step_of_the_drive_and_the_clamp_shift_the_frequency() {
    let drive = SensorDrive {
        shift_per_code: 3e-6,
        clamp_shift_per_volt: -1e-3,
        ..Settings::ideal().drive
    };
    let settings = Settings {
        drive,
        ..Settings::ideal()
    };
    let shift = |code| {
        let rig = driven(settings, [tank(5e3, 20.0)], code, 0x1601);
        let conversion = first_conversion(&rig);
        (
            conversion.oscillation_hz / conversion.sensor_hz - 1.0,
            conversion.amplitude_v,
        )
    };
    assert!((shift(18).0 - 18.0 * 3e-6).abs() < 1e-12);
    assert!((shift(17).0 - shift(18).0 + 3e-6).abs() < 1e-12);
    let (clamped, amplitude) = shift(21);
    assert!(amplitude > 2.0);
    assert!((clamped - (21.0 * 3e-6 - 1e-3 * (amplitude - 1.8))).abs() < 1e-12);
}

#[test]
fn too_short_a_settling_shows_in_amplitude_and_frequency() {
    // With Q 100 at 3 MHz the time constant is 10.6 us. With code 21 and 3.9 kohm the settled
    // amplitude is 1.70 V.
    let settings = Settings {
        drive: SensorDrive {
            settling_shift: -1e-3,
            ..Settings::ideal().drive
        },
        ..Settings::ideal()
    };
    // Low-power activation, with a settling time of 16*n/40 MHz.
    for (settle, missing, errors) in [
        (26_u16, (-10.4_f64 / 10.61).exp(), Errors::AMPLITUDE_LOW),
        (84, (-33.6_f64 / 10.61).exp(), Errors::NONE), // Q/f = 33.3 us: datasheet equation 10
        (1000, 0.0, Errors::NONE),
    ] {
        let rig = ChipRig::new(settings, [tank(3.9e3, 100.0)]);
        rig.single(2500);
        rig.write(0x1A, 0x3601);
        rig.write(0x10, settle);
        rig.write(0x1A, 0x1E01);
        let first = first_conversion(&rig);
        let settled = amplitude_v(3.9e3, drive_current_a(21));
        assert!(
            (1.0 - first.amplitude_v / settled - missing).abs() < 0.01,
            "{settle}"
        );
        assert_eq!(first.errors, errors, "{settle}");
        let shift = first.oscillation_hz / first.sensor_hz - 1.0;
        assert!((shift + 1e-3 * missing).abs() < 1e-5, "{settle}: {shift}");
        let second = first_conversion(&rig);
        assert!(second.errors.is_empty(), "a single channel oscillates on");
    }
}

#[test]
fn full_current_activation_settles_sooner_than_low_power() {
    let amplitude = |config| {
        let rig = ChipRig::new(Settings::ideal(), [tank(3.9e3, 100.0)]);
        rig.single(2500);
        rig.write(0x1A, 0x3601);
        rig.write(0x10, 26);
        rig.write(0x1A, config);
        first_conversion(&rig).amplitude_v
    };
    assert!(amplitude(0x1601) > 1.69);
    assert!(amplitude(0x1E01) < 1.2);
}

#[test]
fn autoscan_settles_each_time() {
    let rig = ChipRig::new(quiet(40e6), [tank(3.9e3, 100.0); 2]);
    rig.autoscan(1, 500, 26);
    rig.write(0x1A, 0x3601);
    rig.write(0x1A, 0x1E01);
    rig.convert(1, 10);
    let chip = rig.chip.borrow();
    for channel in 0..2 {
        let conversion = chip.last_conversion(channel).expect("a conversion");
        assert!(conversion.errors.contains(Errors::AMPLITUDE_LOW));
    }
}

#[test]
fn automatic_calibration_finds_and_shows_the_code() {
    for resistance_ohm in [800.0, 3e3, 6.6e3, 20e3, 80e3] {
        // CONFIG is 0x0201, as in Klipper's LDC_CALIBRATE_DRIVE_CURRENT.
        let rig = driven(quiet(40e6), [tank(resistance_ohm, 20.0)], 5, 0x0201);
        let code = calibrated_code(resistance_ohm);
        for _ in 0..3 {
            rig.convert(0, 1);
            let shown = rig.read(0x1E);
            assert_eq!(
                shown,
                5 << 11 | u16::from(code) << 6,
                "{resistance_ohm} ohm"
            );
        }
        let chip = rig.chip.borrow();
        assert_eq!(
            chip.last_conversion(0).expect("a conversion").drive_code,
            code
        );
        drop(chip);
        // With the found code written back to IDRIVE and RP_OVERRIDE_EN set, the amplitude is
        // right.
        rig.write(0x1A, 0x2001);
        rig.write(0x1E, u16::from(code) << 11);
        rig.write(0x1A, 0x1601);
        assert!(first_conversion(&rig).errors.is_empty());
        assert_eq!(rig.read(0x1E) >> 11, u16::from(code));
    }
}

#[test]
fn automatic_correction_follows_the_sensor_and_its_opposite_does_not() {
    struct Loaded;
    impl Sensors for Loaded {
        fn frequency_hz(&self, _: usize, _: f64) -> f64 {
            3e6
        }
        fn parallel_resistance_ohm(&self, _: usize, time_s: f64) -> f64 {
            if time_s < 20e-3 { 6e3 } else { 2e3 }
        }
    }
    for (config, follows) in [(0x0201, true), (0x0601, false), (0x1601, false)] {
        let rig = driven(quiet(40e6), Loaded, 17, config);
        rig.convert(0, 50);
        let conversion = first_conversion(&rig);
        assert_eq!(
            conversion.errors.is_empty(),
            follows,
            "CONFIG {config:#06x}"
        );
        let code = conversion.drive_code;
        let expected = match config {
            0x0201 => code > 20,
            0x0601 => code == calibrated_code(6e3),
            _ => code == 17,
        };
        assert!(expected, "CONFIG {config:#06x}: code {code}");
    }
}

#[test]
fn init_idrive_is_read_only_and_zero_without_calibration() {
    let rig = driven(quiet(40e6), [tank(3e3, 20.0)], 20, 0x1601);
    rig.convert(0, 3);
    assert_eq!(rig.read(0x1E), 0xA000);
}

#[test]
fn high_current_drives_channel_0_of_a_single_channel_alone() {
    // With 400 ohm, 3.5 mA cause an amplitude of 1.78 V, and code 31 one of 0.80 V.
    let rig = driven(quiet(40e6), [tank(400.0, 20.0); 2], 31, 0x1641);
    assert!((first_conversion(&rig).amplitude_v - 1.78).abs() < 0.01);
    rig.write(0x1A, 0x3601);
    rig.prepare(1, 2500, 0x100);
    rig.write(0x1F, 0xF800);
    rig.write(0x1B, 0x820D);
    rig.write(0x1A, 0x1641);
    assert!((first_conversion(&rig).amplitude_v - 0.796).abs() < 0.01);
    assert!(rig.chip.borrow().misuse().high_current_in_autoscan > 0);
}

// ---- a sensor or a reference that falls silent ----

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
    let status = rig.read(0x18);
    assert_eq!(status & 0x3F00, 0x0300, "ZC and ALE");
    assert_eq!(
        rig.frame(0),
        (0x1000, 0),
        "zero count shows as zero in DATA, with AE"
    );
    // The watchdog acts 5.2 ms after the last conversion with edges.
    rig.wait(ms(5));
    let status = rig.read(0x18);
    assert_eq!(status & 0x0800, 0x0800, "WD");
}

#[test]
fn the_watchdog_restarts_until_the_sensor_returns() {
    let rig = ChipRig::new(quiet(40e6), interrupted);
    rig.single(20_000); // 8 ms: longer than the watchdog
    rig.convert(0, 2);
    let before = rig.chip.borrow().conversions(0);
    let mut timeouts: Vec<Time> = Vec::new();
    while rig.now() < ms(50) {
        rig.read(0x18);
        let limit = ms(50);
        if let Some(time) = rig.chip.borrow_mut().advance_to_interrupt(limit) {
            timeouts.push(time);
        }
        if rig.chip.borrow().register(0x18) & 0x0800 != 0 {
            assert_eq!(rig.frame(0), (0x2000, 0), "data are invalid");
            assert_eq!(
                rig.chip.borrow().last_read(0),
                None,
                "and belong to no conversion"
            );
        }
    }
    assert!((4..=7).contains(&timeouts.len()), "{timeouts:?}");
    let restarts = timeouts
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).as_secs_f64());
    assert!(
        restarts.skip(1).all(|span| (span - 5.2e-3).abs() < 1e-4),
        "{timeouts:?}"
    );
    rig.convert(0, 2);
    assert!(rig.chip.borrow().conversions(0) >= before + 2);
    assert!(
        rig.chip
            .borrow()
            .last_conversion(0)
            .expect("one")
            .errors
            .is_empty()
    );
}

#[test]
fn the_watchdog_takes_less_than_250_hz_for_silence() {
    for (sensor_hz, barks) in [(240.0, true), (260.0, false)] {
        let rig = ChipRig::new(quiet(2e6), [sensor_hz]);
        rig.single(0xFFFF); // 0.5 s
        rig.wait(ms(1_200));
        let status = rig.read(0x18);
        assert_eq!(status & 0x0800 != 0, barks, "{sensor_hz} Hz");
        assert_eq!(rig.chip.borrow().conversions(0) > 0, !barks);
    }
}

#[test]
fn autoscan_has_no_watchdog_but_zero_counts() {
    let rig = ChipRig::new(quiet(40e6), [3e6, 0.0]);
    rig.autoscan(1, 20_000, 20);
    rig.convert(1, 3);
    let status = rig.read(0x18);
    assert_eq!(status & 0x0800, 0, "no WD");
    assert_eq!(status & 0xC100, 0x4100, "ZC of channel 1");
    assert!(
        rig.chip
            .borrow()
            .last_conversion(0)
            .expect("one")
            .errors
            .is_empty()
    );
}

#[test]
fn without_a_reference_nothing_ends() {
    for (clkin, dividers) in [(None, 0x1001), (quiet(40e6).external_clock, 0x1000)] {
        let settings = Settings {
            external_clock: clkin,
            ..quiet(40e6)
        };
        let rig = ChipRig::new(settings, [3e6; 2]);
        rig.single(1000);
        rig.write(0x1A, 0x3601);
        rig.write(0x14, dividers);
        rig.write(0x1A, 0x1601);
        rig.wait(ms(30));
        assert_eq!(rig.chip.borrow().conversions(0), 0);
        assert_eq!(
            rig.read(0x18) & 0x0800,
            0x0800,
            "the watchdog runs on its own clock"
        );

        let rig = ChipRig::new(settings, [3e6; 2]);
        rig.autoscan(1, 1000, 20);
        rig.write(0x1A, 0x3601);
        rig.write(0x14, dividers);
        rig.write(0x1A, 0x1601);
        rig.wait(ms(30));
        assert_eq!(rig.chip.borrow().conversions(0), 0);
        assert_eq!(rig.read(0x18) & 0x0900, 0x0100, "zero count in autoscan");
    }
}

#[test]
fn leaving_sleep_may_lose_the_registers_once() {
    for &exit in SleepExit::VARIANTS {
        let settings = with_switches(quiet(40e6), |switches| switches.sleep_exit = exit);
        let rig = ChipRig::new(settings, [3e6]);
        rig.single(1000);
        let loses = exit == SleepExit::LosesOnce;
        assert_eq!(
            rig.read(0x1A),
            if loses { 0x2801 } else { 0x1601 },
            "{exit:?}"
        );
        assert_eq!(rig.read(0x08), if loses { 0x0080 } else { 1000 });
        rig.single(1000);
        assert_eq!(rig.read(0x1A), 0x1601, "the second time it holds");
        rig.convert(0, 1);
    }
}
