//! Stiffness of ideal presses, computed in `f64` by the test's own sensor.

use crate::support::Rig;
use crate::support::calibration::{
    contact, settings, springs, stiffening, temperature_coefficients, temperature_effect,
};
use crate::support::sensor::{Sensor, Shape};
use palpate_model::magnetorheological::{Saturating, Stiffening};
use palpate_model::units::{Ampere, NewtonPerMetre, Tesla};
use palpate_procedure::event::{Conditions, Event};
use palpate_wire::Command;
use palpate_wire::code::{Contact, Drift, State};
use palpate_wire::command::{Settings, StiffeningCurve, StiffeningKnot};
use palpate_wire::record::{Estimate, LoadPoint, Sample, UncertaintyBudget};

const DRIFTS: [Drift; 5] = [
    Drift::None,
    Drift::Linear,
    Drift::Logarithmic,
    Drift::Exponential,
    Drift::SawTooth,
];

/// Ratios c_L/c_S of the tested loads.
const RATIOS: [f64; 7] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];

/// Returns a rig that is armed, and pressed by a load of `ratio` times c_S.
fn pressed(ratio: f64, sensor: Sensor, change: impl FnOnce(&mut Settings)) -> Rig {
    let mut rig = Rig::armed(sensor, settings(change));
    rig.sensor.load_n_per_m = ratio * rig.sensor.sensing_n_per_m;
    rig.touch(3e-4);
    rig
}

/// Returns the relative error of c_L.
fn error(estimate: &Estimate, rig: &Rig) -> f64 {
    let found = estimate.stiffness_n_per_m.expect("not rigid");
    f64::from(found) / rig.sensor.load_n_per_m - 1.0
}

#[test]
fn an_ideal_press_gives_its_stiffness_with_every_drift_setting() {
    let mut greatest = 0.0_f64;
    for drift in DRIFTS {
        for ratio in RATIOS {
            let mut rig = pressed(ratio, Sensor::default(), |of| of.drift = drift);
            let error = error(&rig.measure(), &rig);
            assert!(error.abs() < 5e-3, "{drift}, c_L/c_S {ratio}: {error:e}");
            greatest = greatest.max(error.abs());
        }
    }
    // The largest error is 5.6e-4, at a load of ten times c_S.
    assert!(greatest < 1e-3, "{greatest:e}");
}

#[test]
fn a_drift_of_the_kind_that_is_set_does_not_count() {
    // Each shape phi is as the protocol describes it. The deformation is x (1 + d phi), with size d. The
    // logarithmic drift starts at the touch.
    let shapes: [(Drift, Shape); 4] = [
        (Drift::Linear, |time_s| time_s),
        (Drift::Logarithmic, |time_s| {
            (1.0 + time_s / 0.2).ln() + 0.5 * time_s
        }),
        (Drift::Exponential, |time_s| {
            1.0 - (-time_s / 0.5).exp() + 0.5 * time_s
        }),
        // A saw-tooth drift restarts from ramp to ramp; the first ramp rises 5 ms after it was sent.
        (Drift::SawTooth, |time_s| {
            (time_s - 0.005) / 0.1 % 1.0 + 0.5 * time_s
        }),
    ];
    for (drift, shape) in shapes {
        for ratio in [0.2, 1.0, 5.0] {
            let mut rig = pressed(ratio, Sensor::default(), |of| of.drift = drift);
            let touched_s = rig.now_us as f64 * 1e-6;
            rig.accepted(Command::Measure);
            rig.until(State::Peak, 1_000);
            let began_s = rig.now_us as f64 * 1e-6;
            // The touch was 0.2 s before the train, the time for detecting a steady press.
            assert!(
                (began_s - touched_s - 0.2).abs() < 2e-3,
                "{began_s} {touched_s}"
            );
            rig.sensor.creep.size = 0.01;
            rig.sensor.creep.since_s = began_s;
            rig.sensor.creep.shape = shape;
            rig.until(State::Estimating, 5_000);
            let error = error(&rig.last(), &rig);
            assert!(error.abs() < 5e-3, "{drift}, c_L/c_S {ratio}: {error:e}");
        }
    }
}

#[test]
fn another_drift_than_the_one_that_is_set_does_count() {
    let mut rig = pressed(1.0, Sensor::default(), |of| of.drift = Drift::None);
    rig.sensor.creep.size = 0.01;
    rig.sensor.creep.since_s = rig.now_us as f64 * 1e-6;
    rig.sensor.creep.shape = |time_s| time_s;
    let error = error(&rig.measure(), &rig);
    assert!(error.abs() > 5e-3, "{error:e}");
}

/// RMS ripple of a coil of 20 uH and 0.5 ohm at 12 V, switched every 16 us: a triangle of 2.3 A at 10 A.
fn ripple_a(mean_a: f64) -> f64 {
    let duty = mean_a.abs() * 0.5 / 12.0;
    12.0 * duty * (1.0 - duty) * 16e-6 / 20e-6 / f64::sqrt(12.0)
}

#[test]
fn the_ripple_counts_and_is_counted() {
    let (mut reported, mut unreported) = (0.0_f64, 0.0_f64);
    // Attraction and cross-talk also depend on the mean square of the current.
    for ratio in RATIOS {
        for tells_ripple in [true, false] {
            let sensor = Sensor {
                attraction_n_per_a2: 3e-4,
                crosstalk_m_per_a2: 2e-8,
                crosstalk_growth_per_m: 200.0,
                ..Sensor::default()
            };
            let mut rig = pressed(ratio, sensor, |_| {});
            (rig.ripple_a, rig.tells_ripple) = (ripple_a, tells_ripple);
            let error = error(&rig.measure(), &rig).abs();
            let worst = if tells_ripple {
                &mut reported
            } else {
                &mut unreported
            };
            *worst = worst.max(error);
        }
    }
    println!("reported {reported:.1e}, not reported {unreported:.1e}");
    assert!(reported < 5e-3, "{reported:e}");
    assert!(
        unreported > 2.0 * reported,
        "it does not count: {unreported:e}"
    );
}

/// Compares `Scan::acting_current` with the law's mean over a triangular ripple.
#[test]
fn the_law_at_the_acting_current_is_its_mean() {
    for half_way_a in [20.0_f32, 43.0] {
        let law = Saturating::new(NewtonPerMetre(15e3), 0.15, Ampere(10.0)).unwrap();
        let law = law
            .saturating(Tesla(10.0 / half_way_a), Tesla(1.0))
            .unwrap();
        let rise = |current_a: f64| f64::from(law.rise(Ampere(current_a as f32)).value);
        for mean_a in [1.0, 3.0, 6.0, 10.0] {
            let ripple_a = ripple_a(mean_a);
            let steps = 1_000;
            let mean = (0..steps)
                .map(|step| (f64::from(step) + 0.5) / f64::from(steps) - 0.5)
                .map(|at| rise(mean_a + at * ripple_a * f64::sqrt(12.0)))
                .sum::<f64>()
                / f64::from(steps);
            let bound = 4.0 * (ripple_a / f64::from(half_way_a)).powi(2);
            let acting = rise(mean_a.hypot(ripple_a)) / mean - 1.0;
            assert!(
                acting.abs() < bound + 2e-6,
                "{mean_a}: {acting:e}, {bound:e}"
            );
            // The reference stacks are far from saturation.
            let at_mean = (rise(mean_a) / mean - 1.0).abs();
            assert!(
                half_way_a < 40.0 || at_mean > 3.0 * acting.abs(),
                "{mean_a}: {at_mean:e}"
            );
        }
    }
}

#[test]
fn a_curve_of_the_stiffening_does_as_the_law() {
    let mut rig = Rig::calibrated(Sensor::default(), settings(|_| {}));
    for first in [0_u8, 8, 16] {
        let knot = |of: u8| {
            let current_a = f64::from(of) * 0.5;
            StiffeningKnot {
                current_a: current_a as f32,
                rise: (0.1 * (current_a / 10.0).powi(2)) as f32,
            }
        };
        rig.accepted(Command::SetStiffeningCurve(StiffeningCurve {
            total: 21,
            first,
            rise_uncertainty: 0.0,
            knots: (first..(first + 8).min(21)).map(knot).collect(),
        }));
    }
    rig.arm_and_touch();
    let error = error(&rig.measure(), &rig);
    assert!(error.abs() < 5e-3, "{error:e}");
}

#[test]
fn the_other_numbers_are_those_of_the_sensor() {
    let mut rig = pressed(0.5, Sensor::default(), |_| {});
    let estimate = rig.measure();
    let close = |found: f32, is: f64| (f64::from(found) / is - 1.0).abs() < 5e-3;
    assert!(close(estimate.load_ratio, 2.0), "{estimate:?}");
    // The estimate's force is that at the reference state, the first sample of the first fall, just
    // below the peak.
    let peak_n = 6e3 * rig.sensor.deformation_m(10.0, 0.0);
    assert!(close(estimate.force_n, peak_n), "{estimate:?} {peak_n}");
    assert!(
        close(estimate.total_displacement_m, rig.sensor.depth_m),
        "{estimate:?}"
    );
    assert!(close(estimate.duration_s, 1.21), "{estimate:?}");
    assert_eq!(estimate.ramps, 12);
    // Only conversions entirely within a fall count: 58 or 59 for each fall.
    assert!(
        (12 * 57..=12 * 60).contains(&estimate.samples),
        "{estimate:?}"
    );
    // The reported temperature is the thermometer's, not that of the copper, which the train has heated.
    assert_eq!(estimate.temperature_c, Some(25.0));
}

#[test]
fn the_loads_curve_is_that_of_the_spring() {
    for ratio in [0.2, 1.0, 5.0] {
        let mut rig = pressed(ratio, Sensor::default(), |of| of.load_points = 5);
        rig.measure();
        rig.until(State::Release, 100);
        let points: Vec<LoadPoint> = rig.all();
        assert_eq!(points.len(), 5);
        for point in &points {
            let force_n = rig.sensor.load_n_per_m * f64::from(point.displacement_m);
            let error = force_n / f64::from(point.force_n) - 1.0;
            assert!(error.abs() < 1e-2, "c_L/c_S {ratio}: {error:e} {point:?}");
        }
    }
}

#[test]
fn two_states_are_computed_as_in_the_paper() {
    for ratio in RATIOS {
        let mut rig = pressed(ratio, Sensor::default(), |_| {});
        rig.accepted(Command::Measure);
        rig.until(State::Ramps, 1_000);
        // The first and the last of the conversions that lie entirely within the first fall.
        let mut states: Vec<(f64, f64)> = Vec::new();
        let (began_us, ends_us) = (rig.now_us, rig.now_us + 60_000);
        while rig.now_us < ends_us {
            rig.convert();
            let (middle_us, half_us) = (rig.now_us - 500, 500);
            if middle_us >= began_us + half_us && middle_us + half_us <= ends_us {
                let current_a = 10.0 * (1.0 - (middle_us - began_us) as f64 / 60e3);
                let x = rig.sensor.deformation_m(current_a, 0.0);
                states.push((x, rig.sensor.actuated(current_a)));
            }
        }
        assert_eq!(states.len(), 60);
        let ((x1, d1), (x2, d2)) = (states[0], states[59]);
        let s = rig.sensor.sensing_n_per_m;
        // Stiffness by eq. (2) of the paper.
        let expected =
            s * d1 * d2 * (x1 - x2) / (x2 * (d1 * d2 + s * d1) - x1 * (d1 * d2 + s * d2));
        assert!((expected / rig.sensor.load_n_per_m - 1.0).abs() < 1e-9);
        rig.until(State::Estimating, 5_000);
        let found = rig.last::<Estimate>().two_state_n_per_m;
        let found = found.expect("a number");
        let error = f64::from(found) / expected - 1.0;
        assert!(error.abs() < 3e-3, "c_L/c_S {ratio}: {error:e}");
    }
}

#[test]
fn a_press_may_be_as_old_as_it_likes() {
    for age_s in [0, 10, 30, 100, 1_000, 10_000] {
        let mut rig = pressed(1.0, Sensor::default(), |_| {});
        // The touch lasts for `age_s`, with a conversion every 39 ms: just often enough to keep the
        // sensor from counting as silent.
        for _ in 0..age_s * 25 {
            rig.now_us += 39_000;
            rig.convert();
        }
        // This sensor does not creep, but the interval allows for the possible creep since the touch.
        let estimate = rig.measure();
        assert!(rig.covers(&estimate), "{age_s} s: {estimate:?}");
        assert!(
            age_s > 0 || error(&estimate, &rig).abs() < 5e-3,
            "{estimate:?}"
        );
    }
    for drift_time_s in [0.1, 1.0, 30.0, 40.0, 100.0, 10_000.0] {
        let mut rig = pressed(1.0, Sensor::default(), |of| {
            (of.drift, of.drift_time_s) = (Drift::Exponential, drift_time_s);
        });
        let error = error(&rig.measure(), &rig);
        assert!(error.abs() < 5e-3, "{drift_time_s} s: {error:e}");
    }
}

/// The reading creeps by 1.8 % of each step of a press for each factor of e by which the step's age
/// exceeds 1.5 s. The force does not creep.
#[test]
fn what_has_crept_is_allowed_for_however_the_press_came_to_its_depth() {
    // Depth and time of two steps. In the first case, step, creep and current together deepen the first
    // press by a quarter at the peak of the train.
    for (steps, most) in [
        ([(262e-6, 0.1), (300e-6, 100.0)], 0.05),
        ([(300e-6, 0.1), (300e-6, 100.0)], 0.05),
        ([(200e-6, 100.0), (300e-6, 3.0)], 0.15),
        ([(30e-6, 100.0), (300e-6, 1.0)], 0.15),
    ] {
        let mut rig = Rig::armed(Sensor::default(), settings(|_| {}));
        let (mut before_m, mut increments) = (0.0, Vec::new());
        for (depth_m, held_s) in steps {
            rig.sensor.press(depth_m);
            increments.push((rig.now_us, depth_m - before_m));
            before_m = depth_m;
            if rig.state() != State::Contact {
                rig.until(State::Contact, 3_000);
            }
            let ends_us = rig.now_us + (held_s * 1e6) as u64;
            while rig.now_us < ends_us {
                rig.now_us += 9_000;
                rig.convert();
                let crept = |(since_us, depth_m): &(u64, f64)| {
                    let age_s = (rig.now_us - since_us) as f64 * 1e-6;
                    0.018 * depth_m * (age_s / 1.5).max(1.0).ln()
                };
                rig.sensor.offset_m = increments.iter().map(crept).sum();
            }
        }
        // Measures the press twice; the reading does not creep further between the trains.
        for _ in 0..2 {
            let estimate = rig.measure();
            let error = error(&estimate, &rig);
            assert!(
                rig.covers(&estimate) && error.abs() < most,
                "{steps:?}: {error}, {estimate:?}"
            );
            rig.until(State::Release, 100);
            rig.run(1_000);
        }
    }
}

#[test]
fn the_interval_covers_the_truth_as_often_as_it_says() {
    // White noise of 20 nm is the only disturbance, so the interval is that of the noise alone.
    let (runs, mut covered) = (200, 0);
    let mut rig = Rig::armed(Sensor::default(), settings(|of| of.ramps = 6));
    rig.sensor.noise_m = 20e-9 * 3.0_f64.sqrt();
    rig.sensor.stated = 2e-6;
    rig.touch(3e-4);
    for _ in 0..runs {
        let estimate = rig.measure();
        rig.until(State::Release, 100);
        covered += usize::from(rig.covers(&estimate));
        // Reports a cold coil, so that the next train is not refused.
        rig.temperature(25.0);
        rig.run(500);
    }
    // The bound is 95 % of 200, less three standard deviations. More may be covered, since the scatter
    // of the ramps only widens the intervals.
    assert!((181..=200).contains(&covered), "{covered} of {runs}");
    assert!(covered < runs, "an interval that always covers is too wide");
}

/// kappa = c_S/c_L = 1, whole compliance W = 3.5, rise rho = 0.1 at the peak: 2 % of c_S give 0.02, 3 %
/// of the rise give 0.03 W/(1 + rho), and 0.3 % of the rise per kelvin give as much at ten kelvin.
#[test]
fn what_the_calibration_leaves_open_widens_the_interval() {
    let of_rise = 0.03 * 3.5 / 1.1;
    for (sensing, rise, per_k) in [
        (0.0, 0.0, 0.0),
        (0.02, 0.0, 0.0),
        (0.0, 0.03, 0.0),
        (0.0, 0.0, 0.003),
    ] {
        let mut rig = Rig::calibrated(Sensor::default(), settings(|_| {}));
        let mut uncertain = springs(&rig.sensor);
        uncertain.sensing_uncertainty = sensing;
        rig.accepted(Command::SetSprings(uncertain));
        let mut uncertain = stiffening(&rig.sensor);
        uncertain.rise_uncertainty = rise;
        rig.accepted(Command::SetStiffening(uncertain));
        rig.accepted(temperature_effect(15.0, 0.0, per_k));
        rig.arm_and_touch();
        let estimate = rig.measure();
        let budget: UncertaintyBudget = rig.last();
        assert_eq!(budget.measurement, estimate.measurement);
        assert_eq!(budget.off_calibration_k, Some(10.0));
        let is_about = |part: f32, expected: f32| (part - expected).abs() < 0.01 * expected + 1e-6;
        assert!(budget.noise < 1e-3, "{budget:?}");
        assert!(is_about(budget.springs, sensing), "{budget:?}");
        assert!(
            is_about(budget.stiffening, rise / 0.03 * of_rise),
            "{budget:?}"
        );
        assert!(
            is_about(budget.temperature, per_k / 0.003 * of_rise),
            "{budget:?}"
        );
        let UncertaintyBudget {
            noise,
            springs,
            stiffening,
            zero,
            temperature,
            bend,
            ..
        } = budget;
        let parts = [noise, springs, stiffening, zero, temperature, bend];
        let whole = parts.iter().map(|part| part * part).sum::<f32>().sqrt();
        assert!(
            is_about(whole, estimate.load_ratio_standard_error),
            "{budget:?} {estimate:?}"
        );
    }
}

#[test]
fn coefficients_that_are_known_within_limits_reach_less_far_than_measured_ones() {
    let reaches = [false, true].map(|measured| {
        let mut rig = Rig::calibrated(Sensor::default(), settings(|_| {}));
        rig.accepted(temperature_effect(15.0, 0.0, 0.003));
        if measured {
            rig.accepted(temperature_coefficients(0.0, 0.0));
        }
        rig.arm_and_touch();
        let estimate = rig.measure();
        let sensing_n_per_m = rig.sensor.sensing_n_per_m as f32;
        let upper = sensing_n_per_m / estimate.lower_n_per_m - estimate.load_ratio;
        upper / estimate.load_ratio_standard_error
    });
    // Nearly all of the uncertainty is that of the temperature, so the interval reaches as far as that
    // of a uniform error.
    assert!((reaches[0] - 1.645).abs() < 0.01, "{reaches:?}");
    assert!((reaches[1] - 1.960).abs() < 0.01, "{reaches:?}");
}

/// A tolerance of the contact widens by W u/(1 + rho) for the rise and W u/x for the zero.
#[test]
fn the_tolerance_of_the_contact_widens() {
    let measured = |tolerance: Option<Command>| {
        let mut rig = Rig::calibrated(Sensor::default(), settings(|of| of.greatest_error = 10.0));
        if let Some(tolerance) = tolerance {
            rig.accepted(tolerance);
        }
        rig.arm_and_touch();
        (rig.measure(), rig.last::<UncertaintyBudget>(), rig.sensor)
    };
    let (plain, before, sensor) = measured(None);
    let whole = 2.0 + sensor.sensing_n_per_m / sensor.actuated_n_per_m;
    let depth_m = f64::from(plain.force_n) / sensor.sensing_n_per_m;
    let added = |after: f32, before: f32| f64::from(after * after - before * before).sqrt();
    let is_about = |found: f64, expected: f64| (found / expected - 1.0).abs() < 0.02;

    let (none, ..) = measured(Some(contact(0.0, 0.0)));
    assert_eq!(none, plain);
    let (_, of_place, _) = measured(Some(contact(0.05, 0.0)));
    let (found, expected) = (
        added(of_place.stiffening, before.stiffening),
        0.05 * whole / (1.0 + sensor.rise),
    );
    assert!(is_about(found, expected), "{found} {expected}");
    assert_eq!(of_place.zero, before.zero);
    let (estimate, of_tilt, _) = measured(Some(contact(0.0, 5e-6)));
    let (found, expected) = (added(of_tilt.zero, before.zero), 5e-6 * whole / depth_m);
    assert!(is_about(found, expected), "{found} {expected}");
    assert_eq!(estimate.load_ratio, plain.load_ratio);
}

/// Returns a sensor `by_k` kelvin above its calibration: its springs change by -0.4 %/K, its rise by
/// -0.6 %/K.
fn warmer(by_k: f64) -> Sensor {
    let cold = Sensor::default();
    Sensor {
        sensing_n_per_m: cold.sensing_n_per_m * (-4e-3 * by_k).exp(),
        actuated_n_per_m: cold.actuated_n_per_m * (-4e-3 * by_k).exp(),
        rise: cold.rise * (-6e-3 * by_k).exp(),
        ..cold
    }
}

#[test]
fn a_measurement_at_another_temperature_is_corrected_by_the_coefficients() {
    let cold = Sensor::default();
    let warm = Sensor {
        attraction_n_per_a2: 3e-4,
        ..warmer(10.0)
    };
    let errors = [false, true].map(|known| {
        let mut rig = Rig::calibrated(warm.clone(), settings(|_| {}));
        rig.accepted(Command::SetSprings(springs(&cold)));
        rig.accepted(Command::SetStiffening(stiffening(&cold)));
        rig.accepted(temperature_effect(15.0, 0.0, 0.0));
        if known {
            rig.accepted(temperature_coefficients(-4e-3, -6e-3));
        }
        rig.arm_and_touch();
        let estimate = rig.measure();
        // The temperature is that at the start of the train. The train then heats the coil, but the
        // calibration's trains did so too, so this is not corrected.
        assert_eq!(estimate.temperature_c, Some(25.0));
        error(&estimate, &rig)
    });
    // A rise assumed 6 % too large makes kappa larger by 6 % of W/(1 + rho), with W = 3.5. A c_S assumed
    // 4 % too large makes c_L larger by 4 %.
    assert!((-0.21..-0.17).contains(&errors[0]), "{errors:?}");
    assert!(errors[1].abs() < 1e-4, "{errors:?}");
}

#[test]
fn without_a_thermometer_nothing_is_corrected_and_the_interval_holds_at_any_temperature() {
    const CALIBRATED_C: f64 = 20.0;
    for temperature_c in [0.0, 20.0, 35.0, 60.0] {
        for known in [false, true] {
            let cold = Sensor::default();
            let sensor = warmer(temperature_c - CALIBRATED_C);
            let settings = settings(|of| of.greatest_error = 10.0);
            let mut rig = Rig::calibrated(sensor, settings);
            rig.step(&Event::Conditions(Conditions::default()));
            rig.accepted(Command::SetSprings(springs(&cold)));
            rig.accepted(Command::SetStiffening(stiffening(&cold)));
            let of_material = |per_k: f32| if known { 0.0 } else { per_k / 3_f32.sqrt() };
            rig.accepted(temperature_effect(
                CALIBRATED_C as f32,
                of_material(5e-3),
                of_material(8e-3),
            ));
            if known {
                rig.accepted(temperature_coefficients(-4e-3, -6e-3));
            }
            rig.arm_and_touch();
            let estimate = rig.measure();
            assert_eq!(estimate.temperature_c, None);
            assert!(
                rig.covers(&estimate),
                "{temperature_c}, {known}: {estimate:?}"
            );
            if temperature_c == CALIBRATED_C {
                let off = estimate.load_ratio - 1.0;
                assert!(off.abs() < 1e-4, "{known}: {off}");
            }
        }
    }
}

#[test]
fn force_and_its_uncertainty_in_a_sample() {
    let mut rig = Rig::calibrated(Sensor::default(), settings(|_| {}));
    let mut scale = springs(&rig.sensor);
    scale.force_scale_uncertainty = 0.02;
    // The uncertainty of c_S affects a stiffness but not a force. The force's uncertainty is that of the
    // force scale.
    scale.sensing_uncertainty = 0.05;
    rig.accepted(Command::SetSprings(scale));
    rig.until(State::Watching, 3_000);
    rig.touch(3e-4);
    rig.run(10);
    let sample: Sample = rig.last();
    assert_eq!(sample.contact, Contact::Held);
    let force_n = f64::from(sample.force_n.expect("springs"));
    assert!((force_n / (6e3 * 3e-4) - 1.0).abs() < 1e-4, "{force_n}");
    let sigma_n = f64::from(sample.force_sigma_n.expect("springs"));
    assert!((sigma_n / (0.02 * 1.8) - 1.0).abs() < 1e-3, "{sigma_n}");
}
