//! The world behind a simulated converter, as a driver reads it.

use crate::common::*;
use embedded_hal::i2c::{I2c, Operation};
use ldc161x_sim::{Bus, Settings};
use palpate_sim::Time;
use palpate_sim::switches::Switches;
use palpate_sim::world::{SharedWorld, World};

const CLOCK_HZ: f64 = 30e6;

fn read(chip: &SharedChip) -> (u16, u32) {
    let (mut high, mut low) = ([0; 2], [0; 2]);
    let mut operations = [
        Operation::Write(&[0x00]),
        Operation::Read(&mut high),
        Operation::Write(&[0x01]),
        Operation::Read(&mut low),
    ];
    Bus::new(chip, 400_000)
        .transaction(0x2A, &mut operations)
        .expect("the chip answers");
    let (high, low) = (u16::from_be_bytes(high), u16::from_be_bytes(low));
    (high >> 12, u32::from(high & 0x0FFF) << 16 | u32::from(low))
}

/// Presses, ramps and reads for a second; returns the readings.
fn measure(world: World, settings: Settings) -> Vec<(u16, u32)> {
    let world = SharedWorld::new(world);
    let chip = converting(&world, settings);
    let mut words = Vec::new();
    for millisecond in 1..=1_000_u64 {
        let now = ms(millisecond);
        world.borrow_mut().advance_to(now);
        if millisecond % 100 == 0 && millisecond >= 500 {
            world.borrow_mut().set_current(10.0);
            world.borrow_mut().ramp_current(0.0, ms(90));
        }
        chip.borrow_mut().advance_to(now);
        words.push(read(&chip));
    }
    let last = *chip.borrow().last_conversion(0).expect("it converts");
    let (from, to) = (last.start.as_secs_f64(), last.end.as_secs_f64());
    let mean = simpson(
        |time_s| world.borrow().frequency_hz(time_s).unwrap(),
        from,
        to,
    );
    assert!(
        (last.sensor_hz / mean - 1.0).abs() < 1e-9,
        "the chip saw the world's coil"
    );
    words
}

fn simpson(f: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let pieces = 2_000;
    let at = |piece: i32| f(from + (to - from) * f64::from(piece) / f64::from(pieces));
    let inner: f64 = (1..pieces)
        .map(|piece| at(piece) * f64::from(2 + 2 * (piece % 2)))
        .sum();
    (at(0) + inner + at(pieces)) / (3.0 * f64::from(pieces))
}

#[test]
fn the_words_are_those_of_the_sensing_coil() {
    let plant = plant("ultrasoft", 3);
    let world = world(&plant, Switches::none(), pressed(&plant));
    let settings = world.chip_settings(CLOCK_HZ);
    let mut alone = world.clone();
    let words = measure(world, settings);
    let hertz = |word: u32| f64::from(word) / f64::from(1 << 28) * CLOCK_HZ;
    // Before contact, and during the hold.
    for millisecond in [20_usize, 400] {
        let (flags, word) = words[millisecond];
        assert_eq!(flags, 0);
        alone.advance_to(ms(millisecond as u64));
        let expected = alone.frequency_hz(1e-3 * millisecond as f64).unwrap();
        let error = hertz(word) / expected - 1.0;
        assert!(error.abs() < 1e-7, "{millisecond} ms: {error}");
    }
    assert!(words[400].1 < words[20].1, "a press lowers the frequency");
}

#[test]
fn quantisation_noise_and_clock_reach_the_words() {
    let plant = plant("ultrasoft", 3);
    let words = |switches: Switches| {
        let world = world(&plant, switches, pressed(&plant));
        let settings = world.chip_settings(CLOCK_HZ);
        measure(world, settings)
    };
    let ideal = words(Switches::none());
    assert_eq!(ideal, words(Switches::none()));
    for name in [
        "ldc_quantisation",
        "ldc_noise",
        "reference_clock",
        "ldc_drive_shift",
    ] {
        let disturbed = words(Switches::only(name).unwrap());
        // During the hold, so that a slightly later conversion sees the same state.
        let pairs = ideal.iter().zip(&disturbed).skip(300).take(180);
        let off: Vec<f64> = pairs
            .map(|(a, b)| f64::from(b.1) / f64::from(a.1) - 1.0)
            .collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        let rms = (off.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt();
        println!("{name}: mean {mean:e}, rms {rms:e}");
        match name {
            // sigma_f/f = 1/(sqrt(12) f_ref t_c), 9.6e-6
            "ldc_quantisation" => assert!((4e-6..15e-6).contains(&rms)),
            "ldc_noise" => assert!((0.9e-6..1.1e-6).contains(&rms)),
            "reference_clock" => {
                let expected = 1.0 / (1.0 + plant.ldc.reference_clock_error) - 1.0;
                // A word has 25 bits here.
                assert!((mean - expected).abs() < 4e-8 && rms < 4e-8);
            }
            _ => assert!((29.9e-6..30.1e-6).contains(&mean), "15 codes of 2e-6"),
        }
    }
}

#[test]
fn a_transfer_may_run_ahead_of_the_world() {
    let plant = plant("ultrasoft", 3);
    let world = SharedWorld::new(world(&plant, Switches::all(), pressed(&plant)));
    let settings = world.borrow().chip_settings(CLOCK_HZ);
    let chip = converting(&world, settings);
    let ahead = ms(30);
    chip.borrow_mut().advance_to(ahead);
    assert_eq!(world.borrow().now(), Time::ZERO);
    assert!(chip.borrow().conversions(0) > 20);
    let seen = chip
        .borrow()
        .last_conversion(0)
        .expect("it converts")
        .sensor_hz;
    world.borrow_mut().advance_to(ahead);
    let there = world.borrow().frequency_hz(29e-3).unwrap();
    assert!((seen / there - 1.0).abs() < 1e-5);
}
