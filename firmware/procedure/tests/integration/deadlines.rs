//! Every state ends in time without further events, and no jump of the clock keeps the coil on.
//! `crate::support::promises` checks at every step that the coil is off outside of peak and ramps.

use crate::support::{Rig, STATES, clear, micros};
use palpate_procedure::event::Conditions;
use palpate_procedure::{Action, Event};
use palpate_wire::Command;
use palpate_wire::code::{FaultCode, RefusalReason, State};

/// Longest start-up of a converter, in microseconds.
const BRING_UP_US: u64 = 140_000;
const DAY_US: u64 = 86_400_000_000;

#[test]
fn without_any_event_the_first_that_comes_finds_it() {
    for state in STATES {
        for (gone_us, event) in [
            (50_001 + BRING_UP_US, Event::Tick),
            (
                50_001 + BRING_UP_US,
                Event::Conditions(Conditions::default()),
            ),
            (1_000_000, Event::Tick),
            (DAY_US, Event::Tick),
            (u64::MAX, Event::Tick),
        ] {
            let mut rig = Rig::standing_in(state, |_| {});
            rig.now_us = rig.now_us.saturating_add(gone_us);
            let actions = rig.step(&event);
            assert_eq!(actions[0], Action::SafeState, "{state} {gone_us}");
            assert_eq!(rig.state(), State::Fault);
            // `now_us` may be at its maximum, where time stands still. No drive starts, and no step
            // panics.
            for _ in 0..100 {
                rig.convert();
                assert!(rig.line.is_off());
            }
        }
    }
}

#[test]
fn a_conversion_after_a_long_time_does_not_go_on_with_the_train() {
    for state in [State::Peak, State::Ramps] {
        for gone_us in [DAY_US, u64::MAX] {
            let mut rig = Rig::standing_in(state, |_| {});
            rig.now_us = rig.now_us.saturating_add(gone_us);
            // The conversion arrives before the tick that would detect the silence.
            rig.convert();
            assert!(!matches!(rig.state(), State::Peak | State::Ramps));
            assert!(rig.line.is_off());
        }
    }
}

#[test]
fn a_clock_that_jumps_to_and_fro_keeps_no_coil_on() {
    let mut rig = Rig::standing_in(State::Ramps, |_| {});
    let start_us = rig.now_us;
    for jump in 0..200_u64 {
        let far = [0, 5_000, DAY_US, u64::MAX / 2, u64::MAX][jump as usize % 5];
        rig.now_us = start_us.saturating_add(far);
        rig.convert();
        rig.wait(0);
        if jump > 3 {
            assert!(rig.line.is_off());
        }
        rig.outcome(clear(FaultCode::Clock));
        rig.outcome(Command::Arm);
        rig.outcome(Command::Sweep);
    }
}

#[test]
fn scans_at_one_and_the_same_time_end_with_the_train_when_time_goes_on() {
    let mut rig = Rig::standing_in(State::Ramps, |_| {});
    for _ in 0..1_000 {
        let scan = rig.scan();
        rig.step(&Event::Scan(&scan));
    }
    rig.wait(5_200_000);
    assert!(rig.line.is_off());
}

#[test]
fn a_press_that_does_not_become_steady_is_refused_in_time() {
    for (settling_s, allowed_ms) in [(0.0, 250), (1.0, 1_000), (3.0, 3_000)] {
        let mut rig = Rig::touched(|of| of.settling_s = settling_s);
        rig.sensor.creep.size = 1.0;
        rig.sensor.creep.since_s = rig.now_us as f64 * 1e-6;
        rig.sensor.creep.shape = |time_s| 0.2 * time_s;
        rig.accepted(Command::Measure);
        rig.run(allowed_ms);
        assert_eq!(rig.state(), State::Settling);
        rig.convert();
        assert_eq!(rig.state(), State::Release);
        let refusal = rig.refusals().remove(0);
        let found = (refusal.reason, refusal.limit);
        assert_eq!(found, (RefusalReason::Unsteady, Some(50e-6)));
        let rate = refusal.value.expect("a rate");
        assert!((rate / 60e-6 - 1.0).abs() < 1e-3, "{rate}");
    }
}

#[test]
fn a_late_event_makes_the_train_longer_and_no_segment_shorter() {
    let mut rig = Rig::touched(|_| {});
    rig.accepted(Command::Measure);
    rig.until(State::Peak, 1_000);
    let mut lines = vec![];
    for _ in 0..1_000 {
        if rig.state() == State::Estimating {
            break;
        }
        rig.now_us += 7_000;
        let actions = rig.convert();
        let set = actions.iter().filter_map(|action| match action {
            Action::Current(line) => Some(micros(line.over_s)),
            _ => None,
        });
        lines.extend(set.map(|over_us| (rig.now_us, over_us)));
    }
    // Each line lasts at least its duration. The second line is a fall of 60 ms.
    for pair in lines.windows(2) {
        let lasted_us = pair[1].0 - pair[0].0;
        assert!(lasted_us >= pair[0].1, "{pair:?}");
    }
    assert_eq!(lines.len(), 24, "{lines:?}");
}

#[test]
fn a_slower_converter_is_silent_later() {
    let mut rig = Rig::touched(|of| of.rate_hz = 20.0);
    rig.wait(500_000);
    assert_eq!(rig.state(), State::Contact);
    rig.wait(1);
    assert_eq!(rig.state(), State::Fault);
    assert_eq!(rig.faults()[0].limit, Some(0.5));
}

#[test]
fn no_delay_makes_a_train_longer_than_the_board_allows() {
    let mut rig = Rig::touched(|of| {
        of.rate_hz = 1.0;
        (of.peak_current_a, of.ramp_s, of.steady_m_per_s) = (1.0, 1.6, 1.0);
    });
    rig.accepted(Command::Measure);
    rig.until(State::Peak, 20_000);
    rig.until(State::Release, 30_000);
    let refusal = rig.refusals().remove(0);
    let found = (refusal.reason, refusal.limit);
    assert_eq!(found, (RefusalReason::TimedOut, Some(20.0)));
    let took_s = refusal.value.expect("a time");
    assert!((20.0..=21.0).contains(&took_s), "{took_s}");
}

#[test]
fn a_slow_converter_has_time_to_show_that_a_press_is_steady() {
    let mut rig = Rig::touched(|of| {
        (of.rate_hz, of.settling_s) = (2.0, 0.0);
        (of.rise_s, of.hold_s, of.ramp_s, of.ramps) = (1.0, 1.0, 5.0, 1);
        of.peak_current_a = 2.0;
    });
    rig.accepted(Command::Measure);
    rig.until(State::Peak, 5_000);
}

#[test]
fn a_sweep_into_silence_is_stopped_in_its_own_step() {
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    rig.now_us += 60_000;
    // The sweep starts and is acknowledged. The same step detects the silent sensor and ends the
    // current.
    rig.accepted(Command::Sweep);
    assert_eq!(rig.state(), State::Fault);
    assert!(rig.line.is_off());
}
