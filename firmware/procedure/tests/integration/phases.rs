//! Sequence of states from start-up to the next start, with their records.

use crate::support::calibration::{crosstalk, settings};
use crate::support::sensor::Sensor;
use crate::support::{Rig, board, micros};
use palpate_procedure::{Action, Actions, Instant};
use palpate_wire::Command;
use palpate_wire::code::{Mode, Outcome, State};
use palpate_wire::record::{Estimate, LoadPoint, Sample};

#[test]
fn a_press_is_measured_and_every_state_is_reported_in_its_order() {
    let mut rig = Rig::touched(|_| {});
    rig.measure();
    rig.until(State::Release, 100);
    rig.lift();
    let expected = [
        State::Baseline,
        State::Watching,
        State::Contact,
        State::Settling,
        State::Peak,
        State::Ramps,
        State::Estimating,
        State::Release,
        State::Baseline,
        State::Watching,
    ];
    assert_eq!(rig.states(), expected);
    // Every change names the previous state.
    let mut stands = State::SelfTest;
    for change in rig.changes() {
        assert_eq!(change.previous, stands, "{change:?}");
        assert!(change.state != change.previous || change.armed);
        stands = change.state;
    }
    assert!(rig.refusals().is_empty() && rig.faults().is_empty());
}

#[test]
fn a_measurement_has_the_same_number_in_all_its_records() {
    let mut rig = Rig::touched(|_| {});
    for number in 1..=2 {
        rig.records.clear();
        let estimate = rig.measure();
        rig.until(State::Release, 100);
        assert_eq!(estimate.measurement, number);
        let points = rig.all::<LoadPoint>().into_iter();
        let points = points.map(|point| (point.measurement, point.index, point.points));
        assert!(points.eq((0..8).map(|index| (number, index, 8))));
        assert_eq!(estimate.load_points, 8);
        let changes = rig.changes();
        let begun = changes.iter().filter(|of| of.state != State::Settling);
        assert!(begun.map(|of| of.measurement).all(|of| of == number));
    }
}

#[test]
fn a_load_that_is_lifted_during_the_report_loses_no_point_of_its_curve() {
    for points in [8, 64] {
        let mut rig = Rig::touched(|of| of.load_points = points);
        let estimate = rig.measure();
        assert_eq!(estimate.load_points, points);
        rig.sensor.depth_m = 0.0;
        // Setting a calibration part does not end the report of the curve either.
        rig.accepted(Command::Disarm);
        rig.accepted(Command::SetCrosstalk(crosstalk(&rig.sensor.clone())));
        rig.until(State::Watching, 3_000);
        let sent = rig.all::<LoadPoint>().into_iter();
        assert!(sent.map(|point| point.index).eq(0..points));
        assert!(!rig.states().contains(&State::Release), "it was lifted");
    }
}

#[test]
fn the_train_rises_falls_and_ends_at_zero() {
    let mut rig = Rig::touched(|_| {});
    rig.accepted(Command::Measure);
    let mut lines = Vec::new();
    let mut off_at = None;
    let mut began_us = 0;
    for _ in 0..2_000 {
        if rig.state() == State::Estimating {
            break;
        }
        for action in rig.convert() {
            match action {
                Action::Current(line) => {
                    if lines.is_empty() {
                        began_us = line.start_us;
                    }
                    // Every line starts at the current that the previous one has reached, midway or at
                    // its end.
                    lines.push((line.from_a, line.to_a, micros(line.over_s)));
                }
                Action::SafeState => off_at = Some(lines.len()),
                _ => {}
            }
        }
    }
    let mut expected = [(0.0, 10.0, 10_000), (10.0, 0.0, 60_000)].repeat(12);
    expected.push((0.0, 0.0, 10_000));
    assert_eq!(lines.len(), expected.len());
    for (line, expected) in lines.iter().zip(expected) {
        assert_eq!((line.1, line.2), (expected.1, expected.2));
        // A fall may end half a conversion early, at 1/120 of its change before the final current.
        assert!((line.0 - expected.0).abs() < 0.1, "{line:?}");
    }
    assert_eq!(off_at, Some(25), "the bridge goes off after the way down");
    // The train takes twelve periods of 0.1 s and the ramp-down; every segment may start a conversion
    // late.
    let took_us = rig.now_us - began_us;
    assert!(
        (1_210_000..=1_210_000 + 37_000).contains(&took_us),
        "{took_us}"
    );
}

#[test]
fn every_ramp_begins_with_the_conversion_that_is_nearest_to_its_time() {
    // At this rate 10, 40 and 100 conversions last a little less than 10, 40 and 100 ms.
    let mut rig = Rig::touched(|of| of.rate_hz = 1_001.0);
    rig.accepted(Command::Measure);
    let falls = |actions: &Actions| {
        let is_fall =
            |of: &&Action| matches!(of, Action::Current(line) if micros(line.over_s) == 60_000);
        actions.iter().filter(is_fall).count()
    };
    let mut begun_us = Vec::new();
    for _ in 0..2_000 {
        // Events between conversions start no segment.
        let between = rig.wait(600);
        assert_eq!(falls(&between), 0);
        rig.now_us -= 600;
        if falls(&rig.convert()) > 0 {
            begun_us.push(rig.now_us);
        }
    }
    assert_eq!(begun_us.len(), 12);
    for pair in begun_us.windows(2) {
        assert_eq!(pair[1] - pair[0], 100 * 999);
    }
}

#[test]
fn a_fall_begins_with_a_conversion_however_late_the_last_was_reported() {
    for late_us in [0, 300, 900] {
        let mut rig = Rig::touched(|_| {});
        rig.accepted(Command::Measure);
        let mut falls = 0;
        for _ in 0..2_000 {
            let mut end_us = 0;
            let actions = rig.convert_with(|scan| {
                scan.middle = Instant::from_ticks(scan.middle.as_ticks() - late_us);
                end_us = scan.middle.as_ticks() + scan.window.as_ticks() / 2;
            });
            for action in actions {
                if let Action::Current(line) = action
                    && micros(line.over_s) == 60_000
                {
                    falls += 1;
                    assert_eq!(line.from_a, 10.0);
                    // A fall starts two conversions of 1 ms after the conversion that triggers it, less
                    // the 20 us by which every segment precedes the end of a conversion.
                    assert_eq!(line.start_us - end_us, 2_000 - 20, "{late_us}");
                }
            }
        }
        assert_eq!(falls, 12);
    }
}

/// A fall starts a whole number of conversions ahead, at least 1.5 ms. Their interval is measured, but
/// not across a lost conversion; until it is measured, it is that of the set rate.
#[test]
fn a_fall_is_planned_by_the_measured_interval_of_the_conversions() {
    let cases: [(f32, &[u64], u64); 2] = [
        (2_000.0, &[600, 600, 600, 1_200], 3 * 600),
        (1_000.0, &[2_000], 2 * 1_000),
    ];
    for (rate_hz, intervals_us, ahead_us) in cases {
        let mut rig = Rig::touched(|of| of.rate_hz = rate_hz);
        rig.accepted(Command::Measure);
        let mut falls = 0;
        for interval_us in intervals_us.iter().cycle().take(2_000) {
            rig.now_us += interval_us - rig.period_us();
            for action in rig.convert() {
                if let Action::Current(line) = action
                    && micros(line.over_s) == 60_000
                {
                    falls += 1;
                    assert_eq!(line.start_us - rig.now_us, ahead_us - 20, "{rate_hz} Hz");
                }
            }
        }
        assert_eq!(falls, 12, "{rate_hz} Hz");
    }
}

#[test]
fn self_test_wants_ten_good_conversions_in_a_row() {
    let mut rig = Rig::started();
    for _ in 0..9 {
        rig.convert();
    }
    rig.sensor.flags = 0x1000;
    rig.convert();
    rig.sensor.flags = 0;
    for _ in 0..9 {
        rig.convert();
        assert_eq!(rig.state(), State::SelfTest);
    }
    rig.convert();
    assert_eq!(rig.state(), State::Baseline);
}

#[test]
fn without_a_curve_there_is_no_contact() {
    let mut rig = Rig::started();
    rig.run(1_000);
    rig.sensor.press(3e-4);
    rig.run(1_000);
    assert_eq!(rig.states(), [State::Baseline]);
    let sample: Sample = rig.last();
    assert_eq!(sample.channels[0].deformation_m, None);
    assert_eq!(sample.force_n, None);
}

#[test]
fn sensing_only_needs_no_coil_and_never_drives_it() {
    let mut board = board();
    board.coil = false;
    let mut rig = Rig::started_as(board);
    for command in crate::support::calibration::calibration(&Sensor::default()) {
        rig.accepted(command);
    }
    rig.accepted(Command::SetSettings(settings(|of| of.automatic = true)));
    assert_eq!(rig.outcome(Command::Arm), Outcome::NoCoil);
    rig.until(State::Watching, 3_000);
    rig.touch(3e-4);
    assert_eq!(rig.outcome(Command::Measure), Outcome::SensingOnly);
    assert_eq!(rig.outcome(Command::Sweep), Outcome::NotArmed);
    rig.run(2_000);
    // In sensing-only mode deformation and force are reported as usual.
    let sample: Sample = rig.last();
    let deformation_m = sample.channels[0].deformation_m.expect("a curve is set");
    assert!((deformation_m - 3e-4).abs() < 3e-8, "{deformation_m}");
    let force_n = sample.force_n.expect("springs are set");
    assert!((force_n - 1.8).abs() < 2e-4, "{force_n}");
    rig.lift();
    let expected = [
        State::Baseline,
        State::Watching,
        State::Contact,
        State::Baseline,
        State::Watching,
    ];
    assert_eq!(rig.states(), expected);
    let changes = rig.changes();
    assert!(
        changes
            .iter()
            .all(|of| of.mode == Mode::SensingOnly && !of.armed)
    );
    assert!(rig.line.is_off());
}

#[test]
fn automatic_measures_at_every_contact_while_armed_and_only_then() {
    let automatic = settings(|of| of.automatic = true);
    let mut rig = Rig::armed(Sensor::default(), automatic);
    for number in 1..=2 {
        rig.sensor.press(3e-4);
        rig.until(State::Estimating, 5_000);
        let estimate: Estimate = rig.last();
        assert_eq!(estimate.measurement, number);
        // One measurement per contact.
        rig.until(State::Release, 100);
        rig.run(2_000);
        assert_eq!(rig.state(), State::Release);
        rig.lift();
    }
    rig.accepted(Command::Disarm);
    rig.touch(3e-4);
    rig.run(500);
    assert_eq!(rig.state(), State::Contact);
}

#[test]
fn without_automatic_a_contact_waits_for_its_command() {
    let mut rig = Rig::touched(|_| {});
    rig.run(2_000);
    assert_eq!(rig.state(), State::Contact);
    // Measures repeatedly without a release between.
    rig.measure();
    rig.until(State::Release, 100);
    rig.measure();
}

#[test]
fn a_sweep_drives_the_train_and_evaluates_nothing() {
    let mut rig = Rig::armed(Sensor::default(), settings(|_| {}));
    rig.records.clear();
    rig.accepted(Command::Sweep);
    rig.until(State::Baseline, 3_000);
    let mut expected = vec![State::Peak, State::Ramps, State::Baseline];
    assert_eq!(rig.states(), expected);
    assert!(rig.refusals().is_empty());
    rig.until(State::Watching, 3_000);
    rig.touch(3e-4);
    rig.accepted(Command::Sweep);
    rig.until(State::Release, 3_000);
    expected.extend([
        State::Watching,
        State::Contact,
        State::Peak,
        State::Ramps,
        State::Release,
    ]);
    assert_eq!(rig.states(), expected);
    let samples: Vec<Sample> = rig.all();
    assert!(samples.iter().any(|sample| sample.current_a > Some(9.9)));
    assert_eq!(rig.all::<Estimate>(), []);
}

#[test]
fn an_object_that_lets_go_during_a_sweep_is_not_waited_for() {
    let mut rig = Rig::touched(|_| {});
    rig.accepted(Command::Sweep);
    rig.run(300);
    rig.sensor.depth_m = 0.0;
    rig.until(State::Watching, 5_000);
}

#[test]
fn the_same_events_give_the_same_records() {
    let records = |()| {
        let mut rig = Rig::touched(|_| {});
        rig.sensor.noise_m = 1e-7;
        rig.measure();
        rig.lift();
        rig.records
    };
    assert!(records(()) == records(()));
}
