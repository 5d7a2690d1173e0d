//! Every reason of a refusal, with its values. Each leaves the coil without current, which
//! `crate::support::promises` checks at every step, and the next measurement works.

use crate::support::calibration::{
    COIL, attraction, crosstalk, curve, settings, springs, stiffening,
};
use crate::support::sensor::Sensor;
use crate::support::{Rig, clear};
use palpate_procedure::units::Ampere;
use palpate_wire::Command;
use palpate_wire::code::{Drift, FaultCode, Location, Part, RefusalReason, State};
use palpate_wire::command::{Springs, Stiffening};
use palpate_wire::record::{Refusal, UncertaintyBudget};

/// Advances a rig to `ms` after the start of a train.
fn driving(mut rig: Rig, ms: u64) -> Rig {
    rig.accepted(Command::Measure);
    rig.until(State::Peak, 1_000);
    rig.run(ms);
    rig
}

/// Converts until a refusal.
fn comes(rig: &mut Rig) -> Refusal {
    let before = rig.refusals().len();
    for _ in 0..60_000 {
        if let Some(refusal) = rig.refusals().get(before) {
            return refusal.clone();
        }
        rig.convert();
    }
    panic!("no refusal; {}", rig.state());
}

#[track_caller]
fn is(refusal: &Refusal, reason: RefusalReason, value: Option<f32>, limit: Option<f32>) {
    assert_eq!(refusal.reason, reason, "{refusal:?}");
    assert_eq!((refusal.value, refusal.limit), (value, limit), "{reason}");
}

/// Checks reason and limit, and returns the value.
#[track_caller]
fn value(refusal: &Refusal, reason: RefusalReason, limit: Option<f32>) -> f32 {
    is(refusal, reason, refusal.value, limit);
    refusal.value.expect("a value")
}

/// Checks that the next measurement works under usual conditions.
fn recovers(mut rig: Rig) {
    assert!(rig.line.is_off());
    rig.sensor = Sensor::default();
    (rig.current_gain, rig.current_offset_a) = (1.0, 0.0);
    rig.accepted(Command::Disarm);
    for command in crate::support::calibration::calibration(&rig.sensor.clone()) {
        rig.accepted(command);
    }
    rig.accepted(Command::SetSettings(settings(|_| {})));
    rig.arm_and_touch();
    let load = rig.measure().stiffness_n_per_m.expect("a soft load");
    assert!((load / 6e3 - 1.0).abs() < 5e-3, "{load}");
}

#[test]
fn a_part_of_the_calibration_is_missing() {
    let sensor = Sensor::default();
    let parts = [
        (Part::Springs, Command::SetSprings(springs(&sensor))),
        (
            Part::Stiffening,
            Command::SetStiffening(stiffening(&sensor)),
        ),
        (
            Part::Attraction,
            Command::SetAttraction(attraction(&sensor)),
        ),
        (Part::Crosstalk, Command::SetCrosstalk(crosstalk(&sensor))),
    ];
    for (missing, _) in &parts {
        let mut rig = Rig::started();
        rig.accepted(Command::SetDeformationCurve(curve()));
        rig.accepted(Command::SetCoil(COIL));
        for (part, command) in &parts {
            if part != missing {
                rig.accepted(command.clone());
            }
        }
        rig.arm_and_touch();
        let refusal = rig.refused();
        let kind = f32::from(missing.number());
        is(&refusal, RefusalReason::NotCalibrated, Some(kind), None);
        assert_eq!(refusal.measurement, 0, "it did not begin");
        recovers(rig);
    }
}

#[test]
fn the_object_lets_go() {
    let mut rig = Rig::touched(|_| {});
    rig.accepted(Command::Measure);
    rig.run(100);
    rig.sensor.depth_m = 0.0;
    let after_s = value(&comes(&mut rig), RefusalReason::ContactLost, None);
    assert!((0.1..0.12).contains(&after_s), "{after_s}");
    assert_eq!(rig.state(), State::Baseline);

    rig.until(State::Watching, 3_000);
    rig.touch(3e-4);
    let mut rig = driving(rig, 500);
    rig.sensor.depth_m = 0.0;
    let refusal = comes(&mut rig);
    let after_s = value(&refusal, RefusalReason::ContactLost, None);
    // The time counts from the first rise, which starts 5 ms after it was sent.
    assert!((0.495..0.515).contains(&after_s), "{after_s}");
    assert_eq!((refusal.measurement, rig.state()), (1, State::Baseline));
    recovers(rig);
}

#[test]
fn pressed_too_little_or_too_far() {
    let mut rig = Rig::touched(|_| {});
    rig.sensor.press(40e-6);
    let refusal = rig.refused();
    let pressed_m = value(&refusal, RefusalReason::PressedTooLittle, Some(50e-6));
    assert!((pressed_m - 40e-6).abs() < 1e-8, "{pressed_m}");

    rig.sensor.press(1.05e-3);
    let too_far = |refusal| {
        let pressed_m = value(&refusal, RefusalReason::PressedTooFar, Some(1e-3));
        assert!((1e-3..1.1e-3).contains(&pressed_m), "{pressed_m}");
    };
    too_far(rig.refused());
    // Here the deformation exceeds the curve only once the current stiffens the actuated layer.
    rig.sensor.press(0.98e-3);
    let refusal = rig.refused();
    assert_eq!(refusal.measurement, 1);
    too_far(refusal);
    recovers(rig);
}

#[test]
fn too_few_samples() {
    // No conversion of 10 ms fits into a fall of 5 ms.
    let mut rig = Rig::touched(|of| (of.rate_hz, of.ramp_s) = (100.0, 0.005));
    let refusal = rig.refused();
    is(&refusal, RefusalReason::TooFewSamples, Some(0.0), Some(4.0));
    recovers(rig);
    // One or two conversions of 5 ms fit into a single fall of 12 ms.
    let mut rig = Rig::touched(|of| (of.rate_hz, of.ramp_s, of.ramps) = (200.0, 0.012, 1));
    let have = value(&rig.refused(), RefusalReason::TooFewSamples, Some(4.0));
    assert!((1.0..=2.0).contains(&have), "{have}");
}

/// Sends `count` flagged conversions, with a good one after every forty.
fn flagged(rig: &mut Rig, count: u32) {
    for number in 1..=count {
        rig.sensor.flags = 0x1000;
        rig.convert();
        rig.sensor.flags = 0;
        if number % 40 == 0 {
            rig.convert();
        }
    }
}

#[test]
fn conversions_are_lost_or_flagged() {
    // One in ten conversions may be lost: 121 in a train of 1.21 s at 1 kHz.
    let mut rig = driving(Rig::touched(|_| {}), 100);
    rig.convert_with(|scan| scan.lost = 121);
    assert_eq!(rig.state(), State::Ramps);
    rig.convert_with(|scan| scan.lost = 1);
    let refusal = rig.refusals().remove(0);
    is(
        &refusal,
        RefusalReason::ConversionsLost,
        Some(122.0),
        Some(121.0),
    );
    recovers(rig);

    // Good readings between the flagged ones prevent a fault of the sensor.
    let mut rig = driving(Rig::touched(|_| {}), 100);
    flagged(&mut rig, 121);
    assert_eq!(rig.state(), State::Ramps);
    flagged(&mut rig, 1);
    is(
        &rig.refusals().remove(0),
        RefusalReason::Flagged,
        Some(122.0),
        Some(121.0),
    );
    recovers(rig);

    // Without a single good reading, a steady press cannot be detected.
    let mut rig = Rig::touched(|of| of.settling_s = 0.5);
    rig.accepted(Command::Measure);
    for _ in 0..501 {
        rig.convert_with(|scan| scan.conversions[0].reading.after_gap = true);
    }
    is(
        &rig.refusals().remove(0),
        RefusalReason::Flagged,
        Some(501.0),
        Some(0.0),
    );
    recovers(rig);
}

#[test]
fn two_effects_cannot_be_distinguished() {
    // The reported current does not change.
    let mut rig = Rig::touched(|of| (of.peak_current_a, of.end_current_a) = (5.0, 4.9));
    rig.accepted(Command::Measure);
    for _ in 0..2_000 {
        rig.convert_with(|scan| {
            scan.current = scan.current.map(|current| {
                if current.0 > 4.8 {
                    Ampere(4.95)
                } else {
                    current
                }
            });
        });
    }
    let term = value(&rig.refusals()[0], RefusalReason::IllConditioned, None);
    assert_eq!(term, 1.0, "the slope");
    recovers(rig);
    // Within a single ramp, a saw-tooth differs from a straight line by a constant. This constant
    // together with the level has the shape of the signal.
    let mut rig = Rig::touched(|of| (of.ramps, of.drift) = (1, Drift::SawTooth));
    let term = value(&rig.refused(), RefusalReason::IllConditioned, None);
    assert_eq!(term, 1.0, "the slope");
    recovers(rig);
}

#[test]
fn the_sums_leave_the_range_of_numbers() {
    // Two overflows: a sigma of 1e18 m over a deformation of 0.3 mm, squared; and residuals of 0.1 nm
    // over a sigma of 1e-34 m, squared.
    for stated in [1e20, 1e-32] {
        let mut rig = Rig::touched(|_| {});
        rig.sensor.stated = stated;
        is(&rig.refused(), RefusalReason::NotFinite, None, None);
        recovers(rig);
    }
}

/// Returns a rig pressed on a sensor whose stiffening is half saturated at this current. The calibration
/// does not include the saturation.
fn saturating(half_way_a: f64, (springs_uncertain, bend): (f32, f32)) -> Rig {
    let mut rig = Rig::calibrated(Sensor::default(), settings(|_| {}));
    rig.accepted(Command::SetSprings(Springs {
        sensing_uncertainty: springs_uncertain,
        bend,
        ..springs(&rig.sensor)
    }));
    rig.accepted(Command::Arm);
    rig.until(State::Watching, 3_000);
    rig.sensor.half_way_a = half_way_a;
    rig.touch(3e-4);
    rig
}

#[test]
fn the_stiffening_is_not_the_calibrated_one() {
    let mut rig = saturating(10.0, (0.02, 0.0));
    let refusal = rig.refused();
    assert_eq!(refusal.reason, RefusalReason::Misfit, "{refusal:?}");
    let (value, limit) = (refusal.value.unwrap(), refusal.limit.unwrap());
    // The limit is the uncertainty of the springs and of the residuals from the misfit.
    assert!((0.02..0.04).contains(&limit), "{refusal:?}");
    assert!(value > 10.0 * limit, "{refusal:?}");
    assert_eq!((refusal.measurement, rig.state()), (1, State::Release));
    recovers(rig);

    // The limit is at least half a per cent of the slope, times the whole compliance 1 + c_S/c_L +
    // c_S/c_D, which is 3.5.
    let refusal = saturating(40.0, (0.0, 0.0)).refused();
    assert_eq!(refusal.reason, RefusalReason::Misfit, "{refusal:?}");
    let limit = refusal.limit.unwrap();
    assert!((limit / (0.005 * 3.5) - 1.0).abs() < 0.05, "{refusal:?}");
    saturating(200.0, (0.0, 0.0)).measure();

    // If the calibration's own trains bent by as much, the bend is no misfit, but widens the interval.
    let estimate = saturating(40.0, (0.0, 0.05)).measure();
    assert!(estimate.load_ratio_standard_error > 0.02, "{estimate:?}");
}

/// An object that relaxes bends the line as a stiffening does that saturates less than calibrated.
#[test]
fn the_line_bends_as_with_an_object_that_relaxes() {
    let mut rig = Rig::calibrated(Sensor::default(), settings(|_| {}));
    rig.accepted(Command::SetStiffening(Stiffening {
        field_at_peak_t: 1.0,
        ..stiffening(&rig.sensor)
    }));
    rig.arm_and_touch();
    let refusal = rig.refused();
    assert_eq!(refusal.reason, RefusalReason::Relaxes, "{refusal:?}");
    assert!(refusal.value > refusal.limit, "{refusal:?}");
}

#[test]
fn a_misfit_within_the_claim_widens_it() {
    let straight = saturating(f64::INFINITY, (0.1, 0.0)).measure();
    let mut rig = saturating(50.0, (0.1, 0.0));
    let bent = rig.measure();
    let errors = [&straight, &bent].map(|of| of.load_ratio_standard_error);
    assert!((errors[0] - 0.1).abs() < 1e-3, "{errors:?}");
    assert!(
        (1.05..1.41).contains(&(errors[1] / errors[0])),
        "{errors:?}"
    );
    assert!(rig.covers(&bent) && bent.upper_n_per_m.is_some());
}

#[test]
fn no_signal_a_reversed_one_or_one_too_large() {
    let mut rig = Rig::touched(|_| {});
    rig.sensor.rise = 1e-6;
    rig.sensor.noise_m = 2e-6;
    // One in twenty noise sequences resembles a signal; the sequence that starts here does not.
    rig.run(10);
    let normal_975 = 1.959_964;
    let of_errors = value(
        &rig.refused(),
        RefusalReason::SignalTooSmall,
        Some(normal_975),
    );
    assert!(of_errors.abs() < normal_975 + 0.1, "{of_errors}");
    recovers(rig);

    let mut rig = Rig::touched(|_| {});
    rig.sensor.rise = -0.05;
    let of_errors = value(&rig.refused(), RefusalReason::SignalReversed, None);
    assert!(of_errors < -100.0, "{of_errors}");
    recovers(rig);

    // A rigid load on a layer whose stiffening is 1.5 times the calibrated one. The estimated whole
    // compliance kappa + 1 + g is then two thirds of 2.5 for small rises, so kappa is negative.
    let mut rig = Rig::touched(|_| {});
    rig.sensor.rise = 0.15;
    rig.sensor.load_n_per_m = 1e9;
    rig.sensor.press(3e-4);
    let highest = value(&rig.refused(), RefusalReason::NegativeStiffness, None);
    assert!((highest - (2.5 / 1.5 - 2.5)).abs() < 0.1, "{highest}");
    recovers(rig);
}

#[test]
fn the_error_is_too_large() {
    let mut rig = Rig::touched(|of| of.greatest_error = 0.02);
    rig.accepted(Command::Disarm);
    let mut uncertain = stiffening(&rig.sensor);
    uncertain.rise_uncertainty = 0.05;
    rig.accepted(Command::SetStiffening(uncertain));
    rig.accepted(Command::Arm);
    let part = value(&rig.refused(), RefusalReason::TooUncertain, Some(0.02));
    // With load ratio kappa = 1, whole compliance W = 3.5 and rise rho = 0.1 at the peak, the relative
    // uncertainty of the stiffness is 0.05 W/(1 + rho).
    assert!((part - 0.05 * 3.5 / 1.1).abs() < 1e-3, "{part}");
    let UncertaintyBudget { stiffening, .. } = rig.last();
    assert!((stiffening - part).abs() < 1e-3, "{stiffening}");
    recovers(rig);
}

#[test]
fn the_current_is_not_the_one_that_was_requested() {
    let mut rig = Rig::touched(|_| {});
    rig.current_gain = 0.85;
    let current_a = value(&rig.refused(), RefusalReason::PeakNotReached, Some(10.0));
    assert!((current_a - 8.5).abs() < 1e-3, "{current_a}");
    recovers(rig);

    let mut rig = Rig::touched(|_| {});
    rig.current_gain = 1.15;
    let current_a = value(&rig.refused(), RefusalReason::CurrentOffTarget, Some(10.0));
    assert!((current_a - 11.5).abs() < 1e-3, "{current_a}");
    recovers(rig);

    // An offset of the current remains during the fall, where 5 A are requested 30 ms after its start.
    let mut rig = driving(Rig::touched(|_| {}), 74);
    rig.current_offset_a = 1.2;
    let refusal = comes(&mut rig);
    let (found, requested) = (refusal.value.unwrap(), refusal.limit.unwrap());
    assert_eq!(refusal.reason, RefusalReason::CurrentOffTarget);
    assert!((found - requested - 1.2).abs() < 0.02 && (4.0..6.0).contains(&requested));
    recovers(rig);
}

#[test]
fn a_current_that_is_not_measured_does_not_follow_its_setpoint() {
    for measured in [None, Some(Ampere(f32::NAN)), Some(Ampere(f32::INFINITY))] {
        for ms in [3, 20, 60] {
            let mut rig = driving(Rig::touched(|_| {}), ms);
            rig.convert_with(|scan| scan.current = measured);
            let refusal = rig.refusals().pop().expect("a refusal");
            let requested = refusal.limit;
            is(&refusal, RefusalReason::CurrentOffTarget, None, requested);
            assert!((0.0..=10.0).contains(&requested.expect("a limit")));
            recovers(rig);
        }
    }
}

#[test]
fn the_coil_could_not_bear_the_train() {
    let mut rig = Rig::touched(|_| {});
    rig.temperature(79.5);
    let refusal = rig.refused();
    let found = value(&refusal, RefusalReason::CoilTooHot, Some(80.0));
    assert!((found - 79.5).abs() < 0.1, "{found}");
    // The layer around the coil cools with a time constant of 480 s; the time to wait depends on the
    // surroundings of 25 degrees.
    let wait_s = refusal.wait_s.expect("a waiting time");
    assert!((1.0..480.0).contains(&wait_s), "{wait_s}");
    rig.temperature(25.0);
    recovers(rig);

    let mut rig = Rig::touched(|of| of.greatest_energy_j = 10.0);
    let forecast = value(&rig.refused(), RefusalReason::TooMuchEnergy, Some(10.0));
    // The energy is that of a mean square of 53 A^2 for 1.21 s in 0.389 ohm at 20 degrees, and up to a
    // fifth more for hot copper.
    let cold = 0.389 * 1.21 * (70.0 * 100.0 / 3.0 + 30.0 * 100.0) / 100.0;
    assert!((cold..1.2 * cold).contains(&forecast), "{forecast} {cold}");
    recovers(rig);

    let mut rig = Rig::touched(|of| (of.peak_current_a, of.ramp_s) = (1.0, 2.0));
    let takes_s = value(&rig.refused(), RefusalReason::TimedOut, Some(20.0));
    assert!((takes_s - 12.0 * 2.04 - 0.01).abs() < 1e-3, "{takes_s}");
    recovers(rig);
}

#[test]
fn events_that_come_too_late_stop_the_train() {
    // At 1 Hz a converter may be silent for ten seconds. Holds end with its conversions and may last
    // four seconds, so the peak current must be low.
    let mut rig = Rig::touched(|of| {
        (of.rate_hz, of.steady_m_per_s) = (1.0, 1.0);
        of.peak_current_a = 0.5;
    });
    rig.accepted(Command::Measure);
    rig.until(State::Peak, 20_000);
    rig.wait(8_000_000);
    let refusal = rig.refusals().remove(0);
    // The limit is 1.21 s for the train, and 0.1 s for each of its 39 segments.
    let took_s = value(&refusal, RefusalReason::TimedOut, Some(5.11));
    // The time counts from the first rise, which starts 5 ms after it was sent.
    assert_eq!(took_s, 7.995);
    recovers(rig);
}

#[test]
fn aborted_or_ended_by_a_fault() {
    for ms in [5, 20, 300] {
        let mut rig = driving(Rig::touched(|_| {}), ms);
        rig.accepted(Command::Abort);
        is(&rig.refusals()[0], RefusalReason::Aborted, None, None);
        assert_eq!(rig.state(), State::Release);
        recovers(rig);

        let mut rig = driving(Rig::touched(|_| {}), ms);
        rig.fail(FaultCode::Bridge, Location::Bridge);
        is(&rig.refusals()[0], RefusalReason::Faulted, Some(14.0), None);
        rig.accepted(clear(FaultCode::Bridge));
        recovers(rig);
    }
}

/// The press moves at 40 um/s, below the limit of 50. The time of the movement must include that of the
/// flagged readings.
#[test]
fn a_press_counts_as_steady_by_its_rate_however_many_readings_are_flagged() {
    for every in [1, 2, 4] {
        let mut rig = Rig::touched(|_| {});
        rig.accepted(Command::Measure);
        for number in 0..3_000 {
            if rig.state() != State::Settling {
                break;
            }
            rig.sensor.offset_m += 40e-6 * 1e-3;
            rig.convert_with(|scan| scan.conversions[0].reading.after_gap = number % every != 0);
        }
        assert_eq!(rig.state(), State::Peak, "{every}: {:?}", rig.refusals());
    }
}
