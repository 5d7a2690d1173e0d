//! Contact detection: false alarms, onset, release, age.

use crate::common::rng::Rng;
use palpate_model::contact::{Baseline, Cusum, Detector, Touch, Watch};
use palpate_model::units::{Metre, Second};

const SIGMA: f64 = 10e-9;
const INTERVAL: f64 = 1e-3;

fn watch(threshold: f32) -> Watch {
    let watch = Watch::new(Metre(SIGMA as f32));
    Watch {
        cusum: Cusum {
            allowance: 1.0,
            threshold,
        },
        ..watch
    }
}

/// A simulated sensor with noise, a steady drift and a press.
struct World {
    rng: Rng,
    drift: f64,
    time: f64,
}

impl World {
    fn new(seed: u64, drift: f64) -> Self {
        Self {
            rng: Rng::new(seed),
            drift,
            time: 0.0,
        }
    }

    fn reading(&mut self, pressed: f64) -> Metre {
        self.time += INTERVAL;
        Metre((1e-6 + self.drift * self.time + pressed + SIGMA * self.rng.normal()) as f32)
    }
}

#[test]
fn false_alarms_come_as_rarely_as_stated() {
    const RUNS: u32 = 300;
    const LONGEST: u64 = 1_000_000;
    let (mut samples, mut early) = (0u64, 0);
    let mut world = World::new(1, 1e-9);
    for _ in 0..RUNS {
        let mut detector = Detector::new(watch(4.0)).unwrap();
        let mut next = || {
            let reading = world.reading(0.0);
            detector.push(Second(INTERVAL as f32), reading).touch
        };
        // A detection while the baseline's memory is still short does not count.
        match (0..LONGEST)
            .map(|_| next())
            .find(|touch| *touch != Touch::Settling)
        {
            Some(Touch::Clear) => {}
            other => {
                assert!(matches!(other, Some(Touch::Began { .. })), "{other:?}");
                early += 1;
                continue;
            }
        }
        let alarm = (1..LONGEST).find(|_| matches!(next(), Touch::Began { .. }));
        samples += alarm.expect("an alarm comes");
    }
    let length = samples as f64 / f64::from(RUNS - early);
    println!("{early} of {RUNS} within the first half second");
    println!("{length:.0} readings between false alarms");
    assert!((9_000.0..12_000.0).contains(&length), "{length}");
}

/// Mean delay of detection, and mean and root mean square error of the onset, in readings, over
/// `runs` presses that deepen by `speed` sigma per reading. Each press starts at a random time
/// between two readings.
fn presses(speed: f64, runs: u64) -> (f64, f64, f64) {
    let (mut delay, mut late, mut squares) = (0.0, 0.0, 0.0);
    for seed in 0..runs {
        let mut world = World::new(seed, 1e-9);
        let mut detector = Detector::new(watch(10.0)).unwrap();
        let onset = 1000.0 + world.rng.uniform();
        let found = (0u32..3000).find_map(|i| {
            let pressed = (f64::from(i) - onset).max(0.0) * speed * SIGMA;
            match detector
                .push(Second(INTERVAL as f32), world.reading(pressed))
                .touch
            {
                Touch::Began { ago } => Some((f64::from(i), f64::from(ago.0) / INTERVAL)),
                _ => None,
            }
        });
        let (at, ago) = found.unwrap();
        let error = at - ago - onset;
        delay += (at - onset) / runs as f64;
        late += error / runs as f64;
        squares += error * error / runs as f64;
    }
    println!(
        "speed {speed}: delay {delay:.2}, onset late by {late:.2}, rms {:.2}",
        squares.sqrt()
    );
    (delay, late, squares.sqrt())
}

#[test]
fn touches_are_found_and_dated_as_stated() {
    for (speed, delay, early, rms) in [
        (0.1, 24.2, 0.9, 8.2),
        (1.0, 5.4, 0.9, 1.8),
        (10.0, 1.55, 0.5, 0.9),
    ] {
        let found = presses(speed, 1000);
        assert!(
            (found.0 - delay).abs() < 0.04 * delay + 0.1,
            "delay at {speed}: {found:?}"
        );
        assert!(
            (found.1 + early).abs() < 0.1 * rms,
            "onset at {speed}: {found:?}"
        );
        assert!(
            (found.2 / rms - 1.0).abs() < 0.15,
            "onset at {speed}: {found:?}"
        );
    }
}

#[test]
fn the_deformation_is_free_of_drift_and_a_release_is_seen() {
    // The drift caused by a room that is heated by 2 K/min.
    let mut world = World::new(5, 6e-9);
    let mut detector = Detector::new(watch(10.0)).unwrap();
    let mut events = Vec::new();
    for i in 0..6000 {
        let pressed = if (2000..4000).contains(&i) {
            300e-6
        } else {
            0.0
        };
        let seen = detector.push(Second(INTERVAL as f32), world.reading(pressed));
        if i == 3999 {
            // Two seconds of drift remain, since a rising baseline is not extrapolated.
            let error = f64::from(seen.deformation.0) - 300e-6;
            assert!(error.abs() < 40e-9, "{error:e}");
        }
        match seen.touch {
            Touch::Began { .. } | Touch::Ended => events.push((i, seen.touch)),
            _ => {}
        }
    }
    assert!(
        matches!(
            events.as_slice(),
            [
                (2000..2003, Touch::Began { .. }),
                (4000..4004, Touch::Ended)
            ]
        ),
        "{events:?}"
    );
    assert!(
        (1900..2000).contains(&detector.baseline().readings()),
        "the baseline is learnt anew"
    );
}

#[test]
fn the_baseline_follows_a_line_and_its_noise_is_as_stated() {
    // Without noise the line is exact.
    let mut clean = Baseline::new(100.0);
    let mut last = 1.0_f32;
    for i in 0..2000 {
        let deviation = clean.deviation(Second(0.5), Metre(1e-6 + 2e-9 * i as f32));
        clean.learn(Second(0.5), deviation);
        last = deviation.from_line.0;
    }
    assert!(last.abs() < 1e-11 && (clean.rate() - 4e-9).abs() < 1e-12);
    // Variance of the prediction: the variance of the deviations minus that of a reading.
    let memory = 20.0;
    let (mut rng, mut baseline) = (Rng::new(9), Baseline::new(memory));
    let (mut squares, mut count) = (0.0, 0.0);
    for i in 0..200_000 {
        let noise = Metre((SIGMA * rng.normal()) as f32);
        let deviation = baseline.deviation(Second(1.0), noise);
        baseline.learn(Second(1.0), deviation);
        if i > 1000 {
            squares += (f64::from(deviation.from_line.0) / SIGMA).powi(2);
            count += 1.0;
        }
    }
    let of_prediction = squares / count - 1.0;
    println!(
        "variance of the prediction {of_prediction:.4}, stated {:.4}",
        1.25 / memory
    );
    assert!((of_prediction * f64::from(memory) / 1.25 - 1.0).abs() < 0.2);
}

#[test]
fn bad_readings_pass_without_effect() {
    let mut detector = Detector::new(watch(10.0)).unwrap();
    for i in 0..600 {
        detector.push(Second(1e-3), Metre(i as f32 * 1e-12));
    }
    let before = detector;
    let seen = detector.push(Second(1e-3), Metre(f32::NAN));
    assert_eq!((seen.touch, detector), (Touch::Clear, before));
    detector.push(Second(f32::INFINITY), Metre(0.0));
    assert_eq!(detector, before);
    assert!(Detector::new(Watch::new(Metre(0.0))).is_err());
    assert!(Detector::new(watch(f32::NAN)).is_err());
}

/// The age of a press is the time since it reached its depth, regardless of the path to it, of
/// creep and of the coil's current. A press that was lighter before is younger than the touch.
#[test]
fn the_age_of_a_press_is_that_of_its_depth() {
    let interval = Second(1e-2);
    for rise_s in [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8] {
        let mut detector = Detector::new(Watch::new(Metre(SIGMA as f32))).unwrap();
        for _ in 0..100 {
            detector.push(interval, Metre(0.0));
        }
        for step in 1..=6_000_u16 {
            let time_s = f64::from(step) * 1e-2;
            let crept = 1.0 + 0.02 * (time_s / 0.1).max(1.0).ln();
            // The deformation at the current's peak in a train of ramps.
            let deepened = if step == 6_000 { 1.06 } else { 1.0 };
            let pressed = if time_s < rise_s {
                time_s / rise_s
            } else {
                1.0
            };
            let depth_m = 0.3e-3 * pressed * crept * deepened;
            detector.push(interval, Metre(depth_m as f32));
        }
        let deformation = Metre((0.3e-3 * 1.06 * (1.0 + 0.02 * 600.0_f64.ln())) as f32);
        let Second(age_s) = detector.mean_age(deformation).unwrap();
        assert!((50.0..=60.0).contains(&age_s), "{rise_s} s: {age_s} s");
        // From here on twice as deep, for two seconds.
        for _ in 0..200 {
            detector.push(interval, deformation * 2.0);
        }
        let Second(age_s) = detector.mean_age(deformation * 2.0).unwrap();
        assert!((27.0..=33.0).contains(&age_s), "{rise_s} s: {age_s} s");
        // A deformation that is not positive has no age: an infinite age would give infinite creep
        // times a deformation of zero.
        assert!(
            [0.0, -1e-6]
                .into_iter()
                .all(|depth_m| detector.mean_age(Metre(depth_m)).is_none())
        );
    }
}
