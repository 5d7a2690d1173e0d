//! Rest reading of the calibration: an object that lies on the sensor from the start, or arrives
//! undetected, falsifies no estimate.

use palpate_procedure::Event;
use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_wire::Command;
use palpate_wire::code::{Contact, FaultCode, Location, RefusalReason, State};
use palpate_wire::command::Tank;
use palpate_wire::record::{Estimate, Sample};

use crate::support::Rig;
use crate::support::calibration::{settings, temperature_effect};
use crate::support::sensor::Sensor;

/// Returns a rig with the calibration's rest reading, at the calibration's temperature.
fn calibrated(sensor: Sensor) -> Rig {
    let mut rig = Rig::calibrated(sensor, settings(|_| {}));
    rig.accepted(Command::SetTank(Tank {
        sensor: 0,
        channel: 0,
        capacitance_f: 330e-12,
        rest_frequency_hz: 3e6,
    }));
    rig.accepted(temperature_effect(25.0, 0.0, 0.0));
    rig
}

/// Returns a rig under an object that adds this deformation to every other one.
fn under(object_m: f64) -> Rig {
    let mut rig = calibrated(Sensor {
        noise_m: 20e-9,
        ..Sensor::default()
    });
    rig.sensor.offset_m = object_m;
    rig
}

fn last_sample(rig: &Rig) -> Sample {
    rig.last()
}

/// Returns the relative error of c_L.
fn error(estimate: &Estimate, rig: &Rig) -> f32 {
    estimate.stiffness_n_per_m.unwrap() / rig.sensor.load_n_per_m as f32 - 1.0
}

#[test]
fn what_lies_there_from_the_beginning_is_a_touch_that_is_not_measured() {
    for object_m in [10e-6, 20e-6, 50e-6, 300e-6] {
        let mut rig = under(object_m);
        rig.accepted(Command::Arm);
        rig.until(State::Contact, 3_000);
        let read_m = f64::from(last_sample(&rig).channels[0].deformation_m.unwrap());
        assert!((read_m / object_m - 1.0).abs() < 0.01, "{read_m:e}");
        rig.sensor.press(3e-4);
        rig.run(500);
        let refusal = rig.refused();
        assert_eq!(refusal.reason, RefusalReason::RestMoved, "{object_m:e}");
        assert!((f64::from(refusal.value.unwrap()) / object_m - 1.0).abs() < 0.01);
        // After the object is lifted, measurements work again.
        rig.sensor.offset_m = 0.0;
        rig.lift();
        rig.touch(3e-4);
        let estimate = rig.measure();
        assert!(rig.covers(&estimate), "{object_m:e}: {estimate:?}");
        let off = error(&estimate, &rig);
        assert!(off.abs() < 0.01, "{object_m:e}: {off}");
    }
}

#[test]
fn what_is_too_light_to_be_noticed_widens_the_interval() {
    for (load_n_per_m, object_m) in [
        (6e3, 1e-6),
        (6e3, 3e-6),
        (6e3, 5e-6),
        (30e3, 3e-6),
        (1.2e3, 5e-6),
    ] {
        let mut rig = under(object_m);
        rig.sensor.load_n_per_m = load_n_per_m;
        rig.arm_and_touch();
        let estimate = rig.measure();
        assert!(rig.covers(&estimate), "{object_m:e}: {estimate:?}");
    }
}

#[test]
fn a_sensor_that_reads_below_its_rest_is_not_measured() {
    let mut rig = under(-20e-6);
    rig.accepted(Command::Arm);
    rig.run(2_000);
    assert_eq!(rig.state(), State::Baseline);
    rig.touch(3e-4);
    let refusal = rig.refused();
    assert_eq!(refusal.reason, RefusalReason::RestMoved);
    assert!(
        (refusal.value.unwrap() / -20e-6 - 1.0).abs() < 0.01,
        "{refusal:?}"
    );
}

#[test]
fn a_rest_within_what_temperature_makes_of_it_is_no_touch() {
    // The temperature may change the rest by 0.3 um/K; 5 um more may be an object too light to be
    // detected.
    let mut rig = under(8e-6);
    rig.temperature(40.0);
    rig.arm();
}

#[test]
fn a_touch_outlasts_settings_and_faults() {
    let mut rig = calibrated(Sensor::default());
    rig.until(State::Watching, 3_000);
    rig.touch(3e-4);
    rig.accepted(Command::SetSettings(DEFAULT_SETTINGS));
    rig.until(State::Contact, 1_000);
    rig.run(1_000);
    assert_eq!(last_sample(&rig).contact, Contact::Held);
    rig.fail(FaultCode::BusTimeout, Location::Bus);
    rig.run(100);
    rig.step(&Event::Recovered(FaultCode::BusTimeout));
    rig.until(State::Contact, 1_000);
    rig.accepted(Command::Arm);
    let estimate = rig.measure();
    let off = error(&estimate, &rig);
    assert!(rig.covers(&estimate) && off.abs() < 0.2, "{estimate:?}");
    rig.until(State::Release, 1_000);
    rig.lift();
}

#[test]
fn an_object_that_comes_during_a_sweep_is_a_touch_that_is_not_measured() {
    let mut rig = calibrated(Sensor::default());
    rig.arm();
    rig.accepted(Command::Sweep);
    rig.run(200);
    rig.sensor.press(3e-4);
    rig.until(State::Contact, 10_000);
    assert_eq!(rig.refused().reason, RefusalReason::RestMoved);
    rig.lift();
}

#[test]
fn taps_in_a_row_leave_no_touch_behind() {
    let mut rig = calibrated(Sensor {
        noise_m: 20e-9,
        ..Sensor::default()
    });
    rig.arm();
    for gap_ms in [50, 150, 300, 450, 600, 2_000] {
        for _ in 0..2 {
            rig.touch(3e-4);
            rig.run(300);
            rig.sensor.depth_m = 0.0;
            rig.run(gap_ms);
            assert_ne!(last_sample(&rig).contact, Contact::Held, "{gap_ms} ms");
        }
    }
    assert_eq!(rig.refusals(), []);
    rig.run(1_000);
    rig.touch(3e-4);
    let estimate = rig.measure();
    let off = error(&estimate, &rig);
    assert!(off.abs() < 0.01, "{off}");
}
