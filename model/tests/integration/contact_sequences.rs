//! Contact over many touches of a sensor that creeps, recovers and warms: no contact is reported
//! without an object, no touch is missed, and the zero of each touch is right within its
//! uncertainty.

use crate::common::rng::Rng;
use palpate_model::contact::{Detector, Touch, Watch};
use palpate_model::units::{Metre, Second};

const INTERVAL_S: f64 = 1e-3;
/// True noise of a reading; `SIGMA_M` and `RELEASE_M` are the detector's settings.
const NOISE_M: f64 = 0.06e-6;
const SIGMA_M: f64 = 0.2e-6;
const RELEASE_M: f64 = 5e-6;
/// Largest change of the untouched sensor's reading per kelvin.
const PER_KELVIN_M: f64 = 0.19e-6;
/// Longest time from the removal of an object to the reported end of the contact, s.
const GONE_S: f64 = 1.0;
/// Times at which the zero of a touch is checked, as numbers of readings after the touch has
/// reached its depth.
const JUDGED: [u32; 6] = [150, 400, 1_000, 3_000, 10_000, 60_000];

/// A simulated layer of elastomer with three modes of creep (ranges of
/// sim-host/stacks/disturbances.toml), in a room that warms.
struct Layer {
    rng: Rng,
    amplitudes: [f64; 3],
    times_s: [f64; 3],
    per_kelvin_m: f64,
    kelvin_per_s: f64,
    start_k: f64,
    time_s: f64,
    /// Creep left by earlier touches, m, for each mode.
    left_m: [f64; 3],
    /// Creep of the current touch, m, for each mode.
    creep_m: [f64; 3],
}

impl Layer {
    fn drawn(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let amplitudes = [(); 3].map(|()| rng.between(0.02, 0.10));
        let ranges = [(0.05, 5.0), (5.0, 100.0), (100.0, 1000.0)];
        let times_s = ranges.map(|(low, high)| log_between(&mut rng, low, high));
        Self {
            amplitudes,
            times_s,
            per_kelvin_m: rng.between(-0.1e-6, 0.1e-6),
            kelvin_per_s: rng.between(-2.0, 2.0) / 60.0,
            start_k: rng.between(-5.0, 5.0),
            rng,
            time_s: 0.0,
            left_m: [0.0; 3],
            creep_m: [0.0; 3],
        }
    }

    /// Temperature difference from that of the calibration, K: at most 10 K either way.
    fn kelvin(&self) -> f64 {
        self.start_k + (self.kelvin_per_s * self.time_s).clamp(-10.0, 10.0)
    }

    /// Removes the object: creep of this touch becomes creep left by earlier touches.
    fn lifted(&mut self) {
        for (left, creep) in self.left_m.iter_mut().zip(&mut self.creep_m) {
            *left += core::mem::take(creep);
        }
    }

    /// Advances by an interval; returns the reading with this elastic deformation.
    fn reading(&mut self, elastic_m: f64) -> f64 {
        self.time_s += INTERVAL_S;
        for i in 0..3 {
            let part = INTERVAL_S / self.times_s[i];
            self.left_m[i] -= self.left_m[i] * part;
            self.creep_m[i] += (self.amplitudes[i] * elastic_m - self.creep_m[i]) * part;
        }
        let creep_m: f64 = self.creep_m.iter().sum();
        self.zero_m() + elastic_m + creep_m + NOISE_M * self.rng.normal()
    }

    /// What the sensor would read without the current touch.
    fn zero_m(&self) -> f64 {
        self.left_m.iter().sum::<f64>() + self.per_kelvin_m * self.kelvin()
    }
}

/// Check of a touch's zero: its error and its standard uncertainty, m.
#[derive(Clone, Copy, Debug)]
struct Judged {
    error_m: f64,
    sigma_m: f64,
}

/// A detector on a simulated layer, with the results of its checks.
struct ContactBench {
    layer: Layer,
    detector: Detector,
    ghosts: u32,
    missed: u32,
    doubted: u32,
    zeros: Vec<Judged>,
}

impl ContactBench {
    fn new(seed: u64) -> Self {
        Self {
            layer: Layer::drawn(seed),
            detector: Detector::new(watch()).unwrap(),
            ghosts: 0,
            missed: 0,
            doubted: 0,
            zeros: Vec::new(),
        }
    }

    fn step(&mut self, elastic_m: f64) -> Touch {
        // The temperature is known to one kelvin, so the detector is given one kelvin more.
        let away_k = self.layer.kelvin().abs() + 1.0;
        let rest = Metre((PER_KELVIN_M * away_k) as f32);
        self.detector.set_rest(Some(rest));
        let reading = Metre(self.layer.reading(elastic_m) as f32);
        self.detector.push(Second(INTERVAL_S as f32), reading).touch
    }

    /// Waits without an object. A contact that starts in this time, or that is not over after
    /// `GONE_S`, is a ghost.
    fn wait(&mut self, seconds: f64) {
        self.layer.lifted();
        let mut ghost = false;
        for step in 0..(seconds / INTERVAL_S) as u32 {
            let touch = self.step(0.0);
            let is_late = f64::from(step) * INTERVAL_S >= GONE_S;
            ghost |= matches!(touch, Touch::Began { .. }) || (is_late && touch == Touch::Held);
        }
        self.ghosts += u32::from(ghost);
    }

    /// Presses to a depth at a speed, holds for a time, and releases at the same speed.
    fn press(&mut self, depth_m: f64, speed_m_per_s: f64, seconds: f64) {
        let way = (depth_m / speed_m_per_s / INTERVAL_S) as u32;
        let deep = |step: u32| depth_m * f64::from(step) / f64::from(way.max(1));
        let (mut began, mut ended) = (0, 0);
        let mut count = |touch| {
            began += u32::from(matches!(touch, Touch::Began { .. }));
            ended += u32::from(touch == Touch::Ended);
        };
        for step in 0..way {
            count(self.step(deep(step)));
        }
        for step in 0..(seconds / INTERVAL_S) as u32 {
            count(self.step(depth_m));
            if JUDGED.contains(&step) {
                self.judge();
            }
        }
        self.missed += u32::from(began != 1 || ended != 0);
        for step in (0..way).rev() {
            self.step(deep(step));
        }
    }

    fn judge(&mut self) {
        if self.detector.doubtful_rest().is_some() {
            self.doubted += 1;
        } else if let Some(zero) = self.detector.zero() {
            self.zeros.push(Judged {
                error_m: f64::from(zero.value().0) - self.layer.zero_m(),
                sigma_m: f64::from(zero.variance_m2()).sqrt(),
            });
        }
    }

    /// Places an object that causes this deformation; returns whether it is detected in the end.
    fn lie(&mut self, depth_m: f64, seconds: f64) -> bool {
        let steps = 0..(seconds / INTERVAL_S) as u32;
        let last = steps.map(|_| self.step(depth_m)).last();
        last == Some(Touch::Held)
    }
}

fn watch() -> Watch {
    Watch {
        release: Metre(RELEASE_M as f32),
        rest: Some(Metre(0.0)),
        per_kelvin: Metre(PER_KELVIN_M as f32),
        ..Watch::new(Metre(SIGMA_M as f32))
    }
}

fn log_between(rng: &mut Rng, low: f64, high: f64) -> f64 {
    rng.between(low.ln(), high.ln()).exp()
}

/// Ten presses in succession to 0.1 to 1.4 times 0.3 mm, with gaps of 0.2 to 20 s.
fn ten_presses(seed: u64, longest_s: f64) -> ContactBench {
    let mut bench = ContactBench::new(seed);
    bench.wait(1.0);
    for _ in 0..10 {
        let rng = &mut bench.layer.rng;
        let depth_m = 0.3e-3 * rng.between(0.1, 1.4);
        let speed_m_per_s = log_between(rng, 0.2e-3, 5e-3);
        let (held_s, gap_s) = (
            log_between(rng, 0.2, longest_s),
            log_between(rng, 0.2, 20.0),
        );
        bench.press(depth_m, speed_m_per_s, held_s);
        bench.wait(gap_s);
    }
    bench.wait(5.0);
    bench
}

/// Asserts that there is no ghost and no missed touch, and that the errors of the zeros agree with
/// their uncertainties.
fn assert_sound(benches: &[ContactBench]) {
    let sum = |of: fn(&ContactBench) -> u32| benches.iter().map(of).sum::<u32>();
    let found = (
        sum(|of| of.ghosts),
        sum(|of| of.missed),
        sum(|of| of.doubted),
    );
    let zeros: Vec<_> = benches.iter().flat_map(|of| &of.zeros).collect();
    let count = zeros.len() as f64;
    let outside = zeros
        .iter()
        .filter(|of| of.error_m.abs() > 1.96 * of.sigma_m)
        .count() as f64;
    let rms = |of: fn(&Judged) -> f64| {
        (zeros.iter().map(|zero| of(zero).powi(2)).sum::<f64>() / count).sqrt()
    };
    println!(
        "{} sensors; ghosts, missed, doubted {found:?}; {count} zeros, {outside} outside of 95 %, off by {:.2} um, stated {:.2} um",
        benches.len(),
        rms(|of| of.error_m) * 1e6,
        rms(|of| of.sigma_m) * 1e6
    );
    assert_eq!(found, (0, 0, 0));
    assert!(count >= 20.0 * benches.len() as f64, "{count} zeros");
    assert!(outside <= 0.05 * count, "{outside} of {count}");
}

#[test]
fn ten_presses_in_a_row_are_ten_touches() {
    assert_sound(
        &(1..=20)
            .map(|seed| ten_presses(seed, 10.0))
            .collect::<Vec<_>>(),
    );
}

/// Presses are held for up to 300 s, as long as people hold an object.
#[test]
#[ignore = "hours of simulated readings"]
fn ten_long_presses_in_a_row_are_ten_touches() {
    assert_sound(
        &(1_001..=1_400)
            .map(|seed| ten_presses(seed, 300.0))
            .collect::<Vec<_>>(),
    );
}

#[test]
fn each_tap_of_two_is_found_however_soon_it_follows() {
    let mut benches = Vec::new();
    for seed in 1..=20 {
        for gap_s in [0.05, 0.15, 0.3, 0.45, 0.6] {
            let mut bench = ContactBench::new(seed);
            bench.wait(1.5);
            bench.press(0.27e-3, 5e-3, 0.3);
            bench.wait(gap_s);
            let held_s = log_between(&mut bench.layer.rng, 0.2, 1.5);
            bench.press(0.27e-3, 5e-3, held_s);
            bench.wait(5.0);
            benches.push(bench);
        }
    }
    let found: u32 = benches.iter().map(|of| of.ghosts + of.missed).sum();
    assert_eq!(found, 0);
    assert_eq!(benches.len(), 100);
}

/// An object that is present at power-on is reported as a touch with a doubtful zero; after it is
/// lifted, the sensor works normally.
#[test]
fn an_object_that_lies_there_from_the_beginning_is_found() {
    for seed in 1..=20 {
        for depth_m in [10e-6, 20e-6, 80e-6, 300e-6] {
            let mut bench = ContactBench::new(seed);
            let held_s = log_between(&mut bench.layer.rng, 0.8, 30.0);
            assert!(
                bench.lie(depth_m, held_s),
                "{seed}: {depth_m:e} m not found"
            );
            assert!(bench.detector.doubtful_rest().is_some(), "{seed}");
            bench.wait(1.5);
            bench.press(0.3e-3, 2e-3, 1.0);
            bench.wait(2.0);
            let found = (bench.ghosts, bench.missed, bench.doubted);
            assert_eq!(found, (0, 0, 0), "{seed}: {depth_m:e} m");
            assert!(!bench.zeros.is_empty());
        }
    }
}

/// A contact that is too light to be detected widens the uncertainty of the next zero.
#[test]
fn what_is_too_light_to_be_found_is_uncertain() {
    let mut seen = 0;
    for seed in 1..=20 {
        for depth_m in [1e-6, 3e-6, 5e-6] {
            let mut bench = ContactBench::new(seed);
            if bench.lie(depth_m, 1.0) {
                continue;
            }
            seen += 1;
            // Presses on the object, which counts as part of the touch from then on.
            for _ in 0..300 {
                bench.step(0.3e-3);
            }
            let zero = bench.detector.zero().expect("a touch");
            let error_m = f64::from(zero.value().0) - bench.layer.zero_m();
            let reach_m = 1.96 * f64::from(zero.variance_m2()).sqrt();
            // The temperature's effect on the rest may hide this much more deformation.
            let hidden_m = PER_KELVIN_M * 5.0;
            assert!(
                error_m.abs() < reach_m + hidden_m,
                "{seed}: {error_m:e} of {reach_m:e}"
            );
        }
    }
    assert!(seen > 30, "{seen}");
}

/// After an interruption by new settings, or by a fault that ends, a touch continues and keeps its
/// zero.
#[test]
fn a_touch_outlasts_an_interruption() {
    for seed in 1..=20 {
        let mut bench = ContactBench::new(seed);
        bench.wait(2.0);
        bench.press(0.2e-3, 2e-3, 5.0);
        bench.wait(3.0);
        for _ in 0..500 {
            bench.step(0.25e-3);
        }
        bench.detector.resume(watch());
        assert!(bench.lie(0.25e-3, 2.0), "{seed}");
        bench.judge();
        // The detector is interrupted once more, while the untouched sensor recovers.
        bench.wait(1.0);
        bench.detector.resume(watch());
        bench.wait(3.0);
        assert_eq!(
            (bench.ghosts, bench.missed, bench.doubted),
            (0, 0, 0),
            "{seed}"
        );
    }
}

/// Without a known rest, an object that is present from the start cannot be detected; but the step
/// when it is lifted is not learnt as a drift.
#[test]
fn a_step_down_is_never_learnt_as_a_drift() {
    let (mut rng, mut found) = (Rng::new(3), Vec::new());
    for step_m in [-2e-6, -20e-6, -300e-6] {
        let mut detector = Detector::new(Watch {
            rest: None,
            ..watch()
        })
        .unwrap();
        for i in 0..60_000 {
            let level_m = if i < 1_500 { 0.0 } else { step_m };
            let reading = Metre((level_m + NOISE_M * rng.normal()) as f32);
            let touch = detector.push(Second(1e-3), reading).touch;
            assert!(
                matches!(touch, Touch::Settling | Touch::Clear),
                "{step_m:e}: {touch:?} at {i}"
            );
        }
        found.push(detector.baseline().value().0);
    }
    assert!(
        (found[0] + 2e-6).abs() < 0.1e-6 && (found[2] + 300e-6).abs() < 0.1e-6,
        "{found:?}"
    );
}
