//! The guards of the coil's driver, each from both sides: it acts within its stated time, and not
//! earlier.

use crate::common::{regulated, tested};
use coil_hbridge::{
    ATTENDED_WITHIN, BALANCED_WITHIN, BLOCK, CurrentLine, DriveState, FOLLOWS_WITHIN,
    FROZEN_WITHIN, Fault, HELD_BEFORE, Limits, Refusal, Supervisor,
};
use palpate_sim::electrical::{
    CircuitParameters, ConverterParameters, Regulated, reference_limits,
};

fn with_limits(circuit: CircuitParameters, limits: Limits) -> Regulated {
    regulated(circuit, ConverterParameters::RP2040, 1, limits)
}

fn common() -> CircuitParameters {
    CircuitParameters::common(0.389, 40e-6, 12.0)
}

fn ready() -> Regulated {
    tested(common())
}

fn driving(to_a: f32) -> Regulated {
    let mut loop_ = ready();
    loop_.go(to_a, 1e-3).unwrap();
    loop_.run_for(10e-3);
    loop_
}

/// Number of periods until a fault latches, and the fault.
fn trips(loop_: &mut Regulated, within: u32) -> Option<(u32, Fault)> {
    (1..=within).find_map(|period| {
        loop_.period();
        match loop_.state() {
            DriveState::Latched(fault) => Some((period, fault)),
            _ => None,
        }
    })
}

fn latched(loop_: &Regulated) -> Option<Fault> {
    match loop_.state() {
        DriveState::Latched(fault) => Some(fault),
        _ => None,
    }
}

// ---- over-current ----

#[test]
fn the_greatest_current_does_not_trip_and_a_little_more_does() {
    let mut loop_ = driving(12.0);
    loop_.run_for(0.3);
    assert_eq!(loop_.state(), DriveState::Driving);
    // The amplifier's output is stuck at the limit of 12.7 A, whatever current flows; first just
    // below the limit, by four times the noise.
    let volts = |current_a: f64| Some(1.65 + 0.125 * current_a);
    let mut below = driving(12.0);
    below.slow.stuck_v = volts(12.7 - 0.15);
    assert_ne!(
        trips(&mut below, 2).map(|(_, fault)| fault),
        Some(Fault::OverCurrent)
    );
    let mut above = driving(12.0);
    above.slow.stuck_v = volts(12.7 + 0.15);
    assert_eq!(trips(&mut above, 2), Some((1, Fault::OverCurrent)));
}

/// Peak, energy and periods of a dead short, with or without the hardware limit.
fn short(limit_a: f64, current_a: f32) -> (f64, f64, u32) {
    let mut loop_ = driving(current_a);
    loop_.circuit.parameters = CircuitParameters {
        coil_ohm: 10e-3,
        inductance_h: 2e-6,
        limit_a,
        ..loop_.circuit.parameters
    };
    loop_.circuit.forget_peak();
    let before = loop_.circuit.totals();
    let (periods, fault) = trips(&mut loop_, 200).expect("a short does not last");
    assert!(
        matches!(fault, Fault::OverCurrent | Fault::Bridge),
        "{fault:?}"
    );
    loop_.run_for(1e-3);
    assert_eq!(loop_.circuit.current_a(), 0.0);
    let energy_j = loop_.circuit.totals().supply_j - before.supply_j;
    (loop_.circuit.peak().0, energy_j, periods)
}

#[test]
fn a_dead_short_lets_little_through() {
    for current_a in [1.0, 5.0, 12.0] {
        let (peak_a, energy_j, periods) = short(15.0, current_a);
        // The hardware limit of 15 A, plus 12 V / 2 uH during its delay of 1.5 us.
        assert!(peak_a < 25.0, "{current_a} A: peak {peak_a} A");
        assert!(energy_j < 0.02, "{current_a} A: {energy_j} J");
        assert!(periods <= 8, "{current_a} A: {periods} periods");
    }
}

#[test]
fn two_samples_above_the_limit_end_the_drive_by_themselves_and_say_how_much_it_was() {
    // Without the hardware limit: the software alone, with a coil of which all but a tenth of the
    // turns are shorted.
    let mut loop_ = driving(8.0);
    loop_.circuit.parameters.inductance_h = 4e-6;
    loop_.circuit.parameters.coil_ohm = 0.04;
    loop_.circuit.parameters.limit_a = f64::INFINITY;
    let mut above = None;
    for period in 0..100 {
        // Both samples of a period precede its interrupt; the true current marks the first one.
        let begin_a = loop_.circuit.current_a();
        loop_.period();
        if above.is_none() && begin_a > 12.8 {
            above = Some(period);
        }
        if latched(&loop_).is_some() {
            let first = above.unwrap_or(period);
            assert!(period - first <= 2, "{first} {period}");
            assert_eq!(latched(&loop_), Some(Fault::OverCurrent));
            loop_.run_for(2e-3);
            let found = loop_.supervisor().value_and_limit(Fault::OverCurrent);
            let [value_a, limit_a] = found.expect("a current");
            assert!(value_a > 12.0 && limit_a == 12.7, "{value_a} of {limit_a}");
            return;
        }
    }
    panic!("it never tripped");
}

/// A single sample at the end of the converter's range must not latch a fault: at any point of a
/// period and of a line, and during the test.
#[test]
fn a_single_wild_sample_is_no_current() {
    for wild_v in [0.0, 3.3] {
        for current_a in [-8.0, 0.0, 5.0, 12.0] {
            let mut loop_ = driving(current_a);
            loop_.circuit.forget_peak();
            for _ in 0..20 {
                loop_.slow.wild_v = Some(wild_v);
                assert_eq!(trips(&mut loop_, 7), None, "{current_a} A, {wild_v} V");
            }
            let off_a = loop_.circuit.current_a() - f64::from(current_a);
            assert!(off_a.abs() < 0.6, "{current_a} A: {off_a}");
            assert!(loop_.circuit.peak().0 < f64::from(current_a.abs()) + 0.8);
            // One wild sample in each of two periods counts as a current above the limit.
            loop_.slow.wild_v = Some(wild_v);
            loop_.period();
            loop_.slow.wild_v = Some(wild_v);
            assert_eq!(trips(&mut loop_, 1), Some((1, Fault::OverCurrent)));
        }
        let mut loop_ = with_limits(common(), reference_limits());
        loop_.begin_test().unwrap();
        loop_.run_for(20e-3);
        loop_.slow.wild_v = Some(wild_v);
        loop_.run_for(0.2);
        assert_eq!(
            loop_.state(),
            DriveState::Off { tested: true },
            "{wild_v} V"
        );
    }
}

// ---- a bridge that wakes ----

/// Steps, ramps and the test, on bridges that take this long to wake and report a fault meanwhile.
#[test]
fn a_bridge_that_wakes_within_its_time_is_driven_as_one_that_is_awake() {
    for wake_s in [0.0, 0.8e-3, 1e-3, 1.9e-3, 2e-3] {
        let circuit = CircuitParameters { wake_s, ..common() };
        let mut loop_ = tested(circuit);
        for (to_a, over_s) in [
            (1.0, 1e-3),
            (1.0, 0.0),
            (10.0, 1e-3),
            (10.0, 10e-3),
            (-5.0, 0.0),
        ] {
            loop_.circuit.forget_peak();
            loop_.go(to_a, over_s).unwrap();
            loop_.run_for(15e-3);
            assert_eq!(loop_.state(), DriveState::Driving, "{wake_s} s, {to_a} A");
            let (off_a, peak_a) = (
                loop_.circuit.current_a() - f64::from(to_a),
                loop_.circuit.peak().0,
            );
            assert!(off_a.abs() < 0.5, "{wake_s} s, {to_a} A: {off_a} A off");
            assert!(
                peak_a < f64::from(to_a.abs()) + 0.7,
                "{wake_s} s, {to_a} A: {peak_a} A"
            );
            loop_.order(&Supervisor::stop());
            loop_.run_for(5e-3);
            assert_eq!(loop_.circuit.current_a(), 0.0);
        }
    }
}

/// A line requested while the bridge wakes replaces the previous one, and an order to stop ends
/// both.
#[test]
fn orders_hold_while_the_bridge_wakes() {
    let mut loop_ = ready();
    loop_.go(8.0, 0.0).unwrap();
    loop_.run_for(0.5e-3);
    loop_.go(2.0, 1e-3).unwrap();
    loop_.circuit.forget_peak();
    loop_.run_for(10e-3);
    assert!((loop_.circuit.current_a() - 2.0).abs() < 0.5);
    assert!(loop_.circuit.peak().0 < 2.7, "{}", loop_.circuit.peak().0);
    loop_.order(&Supervisor::stop());
    loop_.run_for(5e-3);
    loop_.go(8.0, 0.0).unwrap();
    loop_.run_for(1.5e-3);
    loop_.order(&Supervisor::stop());
    loop_.run_for(5e-3);
    assert_eq!(loop_.circuit.current_a(), 0.0);
    // Without its supervisor the drive does not stay awake.
    loop_.go(8.0, 0.0).unwrap();
    loop_.slow.attended = false;
    let (_, fault) = trips(&mut loop_, ATTENDED_WITHIN + 2).expect("it latches");
    assert_eq!(fault, Fault::Unattended);
}

#[test]
fn a_bridge_that_does_not_wake_in_time_is_a_fault() {
    let circuit = CircuitParameters {
        wake_s: 50e-3,
        ..common()
    };
    let mut loop_ = with_limits(circuit, reference_limits());
    assert_eq!(loop_.test(), Err(Fault::Bridge));
    loop_ = with_limits(common(), reference_limits());
    loop_.test().unwrap();
    loop_.circuit.parameters.wake_s = 50e-3;
    loop_.go(2.0, 0.0).unwrap();
    // The fault latches at the end of the wake-up time.
    let (periods, fault) = trips(&mut loop_, 1_000).expect("it latches");
    assert_eq!(fault, Fault::Bridge);
    assert!((125..=130).contains(&periods), "{periods}");
}

// ---- current that does not match its voltage ----

#[test]
fn a_lost_measurement_and_an_open_coil_are_found_in_time_and_not_at_once() {
    let mut lost = driving(3.0);
    lost.slow.stuck_v = Some(1.65);
    let mut open = driving(3.0);
    open.circuit.parameters.coil_ohm = 1e4;
    let mut reported = driving(3.0);
    reported.slow.stuck_v = Some(1.65);
    // A bridge that reports its limit latches earlier.
    let (periods, fault) = trips(&mut reported, 1_000).unwrap();
    assert_eq!(fault, Fault::Bridge);
    assert!(periods < BALANCED_WITHIN, "{periods}");
    for loop_ in [&mut lost, &mut open] {
        loop_.slow.limit_faults = false;
        loop_.circuit.forget_peak();
        let (periods, fault) = trips(loop_, 1_000).unwrap();
        assert_eq!(fault, Fault::CurrentMissing);
        assert!(periods <= BALANCED_WITHIN, "{periods}");
        assert!(periods > BALANCED_WITHIN - 2 * BLOCK, "{periods}");
        // A dead measurement drives the current to the hardware limit, which works.
        assert!(loop_.circuit.peak().0 < 16.0);
    }
}

#[test]
fn a_disturbance_shorter_than_that_is_survived() {
    let mut loop_ = driving(3.0);
    loop_.slow.limit_faults = false;
    loop_.slow.stuck_v = Some(1.65);
    assert_eq!(trips(&mut loop_, 2 * BLOCK), None);
    loop_.slow.stuck_v = None;
    let after = trips(&mut loop_, 2_000);
    // The current driven meanwhile may be too large; another guard covers that.
    assert!(
        matches!(after, None | Some((1 | 2, Fault::OverCurrent))),
        "{after:?}"
    );
}

#[test]
fn a_partly_shorted_coil_is_found_and_a_hot_one_is_not() {
    let mut shorted = driving(6.0);
    shorted.circuit.parameters.coil_ohm = 0.02;
    let found = trips(&mut shorted, 2_000).map(|(_, fault)| fault);
    assert!(
        matches!(found, Some(Fault::CurrentUnexplained | Fault::OverCurrent)),
        "{found:?}"
    );
    for factor in [0.7, 1.4] {
        let mut changed = driving(6.0);
        changed.circuit.parameters.coil_ohm *= factor;
        assert_eq!(trips(&mut changed, 20_000), None, "{factor}");
    }
}

/// Latches a fault on a supply of 5 V, after a change that keeps the current from following.
fn weak(to_a: f32, change: impl Fn(&mut Regulated)) -> (u32, Fault, Regulated) {
    let weak = CircuitParameters::common(0.389, 40e-6, 5.0);
    let mut loop_ = tested(weak);
    // 5 V drive 9.8 A through 0.51 ohm.
    loop_.go(8.0, 1e-3).unwrap();
    assert_eq!(trips(&mut loop_, 5_000), None);
    change(&mut loop_);
    loop_.go(to_a, 0.0).unwrap();
    let (periods, fault) = trips(&mut loop_, 5_000).unwrap();
    (periods, fault, loop_)
}

/// Fault that the driver reports once the cause is known.
fn reported(loop_: &mut Regulated) -> Option<Fault> {
    // One poll per millisecond.
    for _ in 0..10 {
        loop_.run_for(1e-3);
        if loop_.supervisor().is_cause_known() {
            return latched(loop_);
        }
    }
    None
}

#[test]
fn a_current_that_is_not_reached_is_found_in_time_and_not_before() {
    let (periods, fault, mut loop_) = weak(11.5, |_| ());
    assert_eq!(fault, Fault::NotFollowing);
    assert!(
        (FOLLOWS_WITHIN - 2 * BLOCK..=FOLLOWS_WITHIN).contains(&periods),
        "{periods}"
    );
    // 11.5 A need 6 V through the coil as tested: the supply is too low for them.
    assert_eq!(reported(&mut loop_), Some(Fault::SupplyLow));
    let [supply_v, needed_v] = loop_
        .supervisor()
        .value_and_limit(Fault::SupplyLow)
        .expect("what was found");
    assert!((4.0..5.0).contains(&supply_v), "{supply_v}");
    assert!((5.4..6.2).contains(&needed_v), "{needed_v}");
    // Through a coil with a third more resistance, 8.4 A would not flow even if the supply
    // sufficed.
    let (_, fault, mut loop_) = weak(8.4, |of| of.circuit.parameters.coil_ohm *= 1.35);
    assert_eq!(fault, Fault::NotFollowing);
    assert_eq!(reported(&mut loop_), Some(Fault::NotFollowing));
}

/// A change of bridge, coil or supply.
type GuardedChange = fn(&mut Regulated);

/// The bridge goes off within the guard's time, whatever the cause; the cause follows from the
/// supply's reading. (If the supply falls only to 6 V, the control compensates for it.)
#[test]
fn a_supply_that_collapses_is_the_cause_and_an_open_coil_is_not() {
    let collapses: [(&str, GuardedChange); 4] = [
        ("0 V", |of| of.circuit.parameters.supply_v = 0.0),
        ("3 V", |of| of.circuit.parameters.supply_v = 3.0),
        ("4.3 V", |of| of.circuit.parameters.supply_v = 4.3),
        // Only under load: the supply recovers when the bridge goes off.
        ("3 ohm", |of| of.circuit.parameters.supply_ohm = 3.0),
    ];
    for (what, change) in collapses {
        // At every phase of the supervisor's polls, which come every 62 periods.
        for phase in [0, 10, 20, 30, 40, 50, 60] {
            let mut loop_ = driving(5.0);
            loop_.periods_of(phase);
            change(&mut loop_);
            let (periods, fault) = trips(&mut loop_, 1_000).expect(what);
            println!("{what}: {fault:?} after {periods} periods");
            assert!(periods <= BALANCED_WITHIN, "{what}: {periods}");
            assert_eq!(
                reported(&mut loop_),
                Some(Fault::SupplyLow),
                "{what} {phase}"
            );
            assert_eq!(loop_.circuit.current_a(), 0.0);
        }
    }
    let others: [(&str, GuardedChange); 3] = [
        ("open", |of| of.circuit.parameters.coil_ohm = 1e4),
        ("open behind a weak supply", |of| {
            of.circuit.parameters.supply_ohm = 0.24;
            of.run_for(50e-3);
            of.circuit.parameters.coil_ohm = 1e4;
        }),
        ("dead measurement behind a weak supply", |of| {
            of.circuit.parameters.supply_ohm = 0.24;
            of.run_for(50e-3);
            of.slow.stuck_v = Some(1.65);
        }),
    ];
    for (what, change) in others {
        let mut loop_ = driving(5.0);
        loop_.slow.limit_faults = false;
        change(&mut loop_);
        trips(&mut loop_, 1_000).expect(what);
        assert_eq!(reported(&mut loop_), Some(Fault::CurrentMissing), "{what}");
    }
}

// ---- a frozen measurement ----

/// Corners of resistance, inductance and supply.
const CORNERS: [(f64, f64, f64); 6] = [
    (0.389, 40e-6, 12.0),
    (0.545, 200e-6, 5.0),
    (0.233, 20e-6, 12.0),
    (0.233, 200e-6, 12.0),
    (0.545, 20e-6, 5.0),
    (0.389, 40e-6, 5.0),
];
/// Tested currents. The converter's wide codes are at 3.3 A and 9.9 A.
const CURRENTS_A: [f32; 6] = [0.6, 1.0, 3.3, 5.0, 7.0, -3.0];
const LOOK_PERIODS: u32 = 62;

fn held(
    (coil_ohm, inductance_h, supply_v): (f64, f64, f64),
    converter: ConverterParameters,
    to_a: f32,
    seed: u64,
) -> Regulated {
    let circuit = CircuitParameters::common(coil_ohm, inductance_h, supply_v);
    let mut loop_ = regulated(circuit, converter, seed, reference_limits());
    loop_.test().expect("a sound coil passes");
    // The current limit of the test lasts another 20 us.
    loop_.run_for(1e-3);
    loop_.go(to_a, 1e-3).unwrap();
    loop_.run_for(10e-3);
    assert_eq!(loop_.state(), DriveState::Driving);
    loop_
}

/// The amplifier freezes exactly at the setpoint, so the regulator has no error to correct.
#[test]
fn a_measurement_that_freezes_at_its_target_is_found_in_time() {
    // Promised in docs/faults.md, at 16 us a period.
    assert!(f64::from(FROZEN_WITHIN + HELD_BEFORE) * 16e-6 < 0.175);
    let (mut longest, mut least_a, mut greatest_a) = (0, f64::MAX, 0.0_f64);
    for corner in CORNERS {
        for converter in [ConverterParameters::EXACT, ConverterParameters::RP2040] {
            for to_a in CURRENTS_A {
                // At any time between two steps of the frozen test.
                for later in [0, 45, 60, 67, 71, 75] {
                    let mut loop_ = held(corner, converter, to_a, 1 + u64::from(later));
                    loop_.periods_of(later * LOOK_PERIODS);
                    loop_.slow.stuck_v = Some(1.65 + 0.125 * f64::from(to_a));
                    let within = FROZEN_WITHIN + HELD_BEFORE;
                    let what = format!("{corner:?} {to_a} A, {later} looks later");
                    let (periods, fault) =
                        trips(&mut loop_, within).unwrap_or_else(|| panic!("{what}: not found"));
                    // The current may change so fast that another guard trips first.
                    let others = [Fault::CurrentMissing, Fault::CurrentUnexplained];
                    assert!(
                        fault == Fault::SenseFrozen || others.contains(&fault),
                        "{what}: {fault:?}"
                    );
                    if fault == Fault::SenseFrozen {
                        let error_a = (loop_.circuit.current_a() - f64::from(to_a)).abs();
                        longest = longest.max(periods);
                        (least_a, greatest_a) = (least_a.min(error_a), greatest_a.max(error_a));
                    }
                }
            }
        }
    }
    println!(
        "found within {:.0} ms, off by {least_a:.2} to {greatest_a:.2} A",
        f64::from(longest) * 16e-3
    );
}

#[test]
fn a_measurement_that_works_is_not_called_frozen() {
    for (index, corner) in CORNERS.into_iter().enumerate() {
        for (seed, noise_lsb, wide_codes) in [(1, 0.0, true), (2, 2.0, true), (3, 6.0, true)] {
            for to_a in CURRENTS_A {
                let converter = ConverterParameters {
                    noise_lsb,
                    wide_codes,
                    ..ConverterParameters::RP2040
                };
                let mut loop_ = held(corner, converter, to_a, seed);
                // Mains ripple on the supply, a coil that heats up, and steps of the supply.
                let supply_v = corner.2.max(5.5);
                for ms in 0..400_u32 {
                    let time_s = f64::from(ms) * 1e-3;
                    let ripple = 0.03 * (std::f64::consts::TAU * 100.0 * time_s).sin();
                    let step = if ms % 37 < 5 { -0.05 } else { 0.0 };
                    let parameters = &mut loop_.circuit.parameters;
                    parameters.supply_v = supply_v * (1.0 + ripple + step);
                    parameters.coil_ohm *= 1.0 + 2e-4;
                    loop_.run_for(1e-3);
                    assert_eq!(
                        loop_.state(),
                        DriveState::Driving,
                        "corner {index}, {to_a} A, noise {noise_lsb}, {ms} ms"
                    );
                }
            }
        }
    }
}

/// A setpoint beyond the supply's reach is not a frozen measurement.
#[test]
fn a_current_at_the_end_of_its_supply_is_not_called_frozen() {
    let weak = CircuitParameters::common(0.389, 40e-6, 5.0);
    for to_a in [9.3, 9.5, 9.6, 9.7, 9.8, 9.9, 10.2] {
        let mut loop_ = tested(weak);
        loop_.go(to_a, 1e-3).unwrap();
        assert_eq!(trips(&mut loop_, 30_000), None, "{to_a} A");
    }
}

#[test]
fn the_test_of_the_measurement_stays_within_its_step() {
    // The test shifts the current by 3 counts of 6.4 mA either way, for 3 ms each, every 23 ms.
    for to_a in [12.0_f32, 5.0, -5.0, 1.0] {
        let mut loop_ = driving(to_a);
        loop_.run_for(0.1);
        let (mut least_a, mut most_a, mut sum_a) = (f64::MAX, 0.0_f64, 0.0);
        for _ in 0..12_400 {
            let mean_a = loop_.period().mean_a.abs();
            (least_a, most_a) = (least_a.min(mean_a), most_a.max(mean_a));
            sum_a += mean_a;
        }
        let target_a = f64::from(to_a.abs());
        let mean_a = sum_a / 12_400.0;
        println!("{to_a} A: {least_a:.3} to {most_a:.3}, mean {mean_a:.4}");
        assert!(most_a - target_a < 0.08, "{most_a}");
        assert!(target_a - least_a < 0.12, "{least_a}");
    }
}

// ---- bridge, supply, supervisor ----

#[test]
fn a_fault_of_the_bridge_ends_the_drive_in_its_period() {
    let mut loop_ = driving(3.0);
    loop_.slow.bridge_faults = true;
    assert_eq!(trips(&mut loop_, 10), Some((1, Fault::Bridge)));
    loop_.slow.bridge_faults = false;
    loop_.run_for(0.1);
    assert_eq!(latched(&loop_), Some(Fault::Bridge), "it is latched");
    let refused = loop_.go(1.0, 0.1);
    assert_eq!(refused, Err(Refusal::Latched(Fault::Bridge)));
    loop_.order(&Supervisor::clear());
    assert_eq!(loop_.go(1.0, 0.1), Err(Refusal::NotTested));
    loop_.test().unwrap();
    loop_.go(1.0, 0.1).unwrap();
}

#[test]
fn the_supply_ends_the_drive_beyond_its_limits_and_not_within() {
    for (supply_v, fault) in [
        (4.7, None),
        (4.3, Some(Fault::SupplyLow)),
        (13.9, None),
        (14.3, Some(Fault::SupplyHigh)),
    ] {
        // The supply starts near the limit: a sudden collapse would trip another guard.
        let near_v = if supply_v < 9.0 { 5.0 } else { 12.0 };
        let near = CircuitParameters::common(0.389, 40e-6, near_v);
        let mut loop_ = tested(near);
        loop_.go(2.0, 1e-3).unwrap();
        loop_.run_for(10e-3);
        loop_.circuit.parameters.supply_v = supply_v;
        // Found within 10 ms: five time constants of the supply's capacitor, and a poll every
        // millisecond.
        let found = trips(&mut loop_, 625).map(|(_, fault)| fault);
        assert_eq!(found, fault, "{supply_v} V");
        if fault.is_some() {
            loop_.order(&Supervisor::clear());
            // The supply's fault says nothing against the coil, which needs no new test.
            assert_eq!(loop_.state(), DriveState::Off { tested: true });
        }
    }
}

#[test]
fn an_unattended_drive_ends_in_twenty_milliseconds_and_not_before() {
    let mut loop_ = driving(3.0);
    loop_.slow.attended = false;
    let (periods, fault) = trips(&mut loop_, 5_000).unwrap();
    assert_eq!(fault, Fault::Unattended);
    assert!(
        periods <= ATTENDED_WITHIN + 1 && periods > ATTENDED_WITHIN - 70,
        "{periods}"
    );
}

// ---- time and energy ----

#[test]
fn the_on_time_ends_the_drive_and_not_before() {
    let limits = Limits {
        on_time_s: 0.05,
        ..reference_limits()
    };
    let mut loop_ = with_limits(common(), limits);
    loop_.test().unwrap();
    assert_eq!(loop_.go(1.0, 0.06), Err(Refusal::Duration(0.06)));
    loop_.go(1.0, 1e-3).unwrap();
    let (periods, fault) = trips(&mut loop_, 10_000).unwrap();
    assert_eq!(fault, Fault::OnTime);
    // 0.05 s are 3 125 periods; before them the bridge wakes up in 125.
    let on = periods - 125;
    assert!((3_125 - BLOCK..=3_125).contains(&on), "{on}");
}

#[test]
fn energy_is_bounded_over_any_number_of_runs() {
    let limits = Limits {
        energy_j: 12.0,
        ..reference_limits()
    };
    let mut loop_ = with_limits(common(), limits);
    loop_.test().unwrap();
    let begin = loop_.circuit.totals();
    let mut ended = None;
    for _ in 0..200 {
        if loop_.go(10.0, 0.0).is_err() {
            loop_.order(&Supervisor::clear());
        }
        loop_.run_for(20e-3);
        ended = ended.or(latched(&loop_));
        loop_.order(&Supervisor::stop());
        loop_.run_for(1e-3);
        let now = loop_.circuit.totals();
        let taken_j = now.supply_j - begin.supply_j;
        let given_off_j = 3.5 * (now.time_s - begin.time_s);
        assert!(taken_j - given_off_j < 12.0, "{taken_j}");
    }
    assert_eq!(ended, Some(Fault::Energy));
    let taken_j = loop_.circuit.totals().supply_j - begin.supply_j;
    assert!(taken_j > 6.0, "{taken_j}: it may use what it is allowed");
}

#[test]
fn a_line_that_is_too_hot_is_refused_with_a_waiting_time() {
    let mut loop_ = ready();
    let stay = |loop_: &Regulated, current_a: f32, for_s: f32| CurrentLine {
        start_us: loop_.now_us() + 1_000,
        from_a: current_a,
        to_a: current_a,
        over_s: for_s,
    };
    // 12 A through 0.48 ohm for 1 s: 144 * 0.48 = 69 J.
    let hot = stay(&loop_, 12.0, 1.0);
    let Err(Refusal::Energy(energy_j)) = loop_.follow(&hot) else {
        panic!("it was begun")
    };
    assert!((60.0..80.0).contains(&energy_j), "{energy_j}");
    let warm = |loop_: &mut Regulated| {
        let line = stay(loop_, 10.0, 0.6);
        loop_.follow(&line)
    };
    warm(&mut loop_).unwrap();
    loop_.run_for(0.65);
    loop_.order(&Supervisor::stop());
    let Err(Refusal::Energy(energy_j)) = warm(&mut loop_) else {
        panic!("it was begun")
    };
    let wait_s = f64::from(loop_.supervisor().account().time_until_s(energy_j));
    loop_.run_for(wait_s - 0.1);
    assert!(warm(&mut loop_).is_err(), "not before");
    loop_.run_for(0.2);
    warm(&mut loop_).unwrap();
}

// ---- self-test ----

#[test]
fn the_self_test_tells_what_is_wrong() {
    let cases: [(GuardedChange, Option<Fault>); 14] = [
        (|_| (), None),
        (|of| of.circuit.parameters.coil_ohm = 1e4, Some(Fault::Open)),
        (
            |of| {
                of.circuit.parameters.coil_ohm = 0.01;
                of.circuit.parameters.inductance_h = 2e-6;
            },
            Some(Fault::Short),
        ),
        // A coil with shorted turns.
        (
            |of| of.circuit.parameters.inductance_h = 6e-6,
            Some(Fault::Short),
        ),
        (
            |of| of.circuit.parameters.inductance_h = 1e-3,
            Some(Fault::NotACoil),
        ),
        (|of| of.slow.gain_error = -2.0, Some(Fault::SenseReversed)),
        (|of| of.slow.offset_a = 0.6, Some(Fault::Offset)),
        (|of| of.slow.offset_a = -0.6, Some(Fault::Offset)),
        // Within the tolerance.
        (|of| of.slow.offset_a = 0.35, None),
        (|of| of.slow.offset_a = -0.35, None),
        (|of| of.slow.stuck_v = Some(0.0), Some(Fault::Offset)),
        (|of| of.slow.stuck_v = Some(1.65), Some(Fault::Open)),
        (|of| of.slow.bridge_faults = true, Some(Fault::Bridge)),
        (
            |of| of.circuit.parameters.limit_a = f64::INFINITY,
            Some(Fault::NoHardwareLimit),
        ),
    ];
    for (index, (change, fault)) in cases.into_iter().enumerate() {
        let mut loop_ = with_limits(common(), reference_limits());
        change(&mut loop_);
        loop_.circuit.forget_peak();
        assert_eq!(loop_.test().err(), fault, "{index}");
        assert!(loop_.circuit.peak().0 < 16.0, "{:?}", loop_.circuit.peak());
    }
}

/// Short pulses lose more in the carrier's bridge than the dead time that the self-test finds.
#[test]
fn a_small_current_through_the_carriers_bridge_is_no_fault() {
    for supply_v in [8.0, 12.0, 13.9] {
        let carrier = CircuitParameters::common(0.389, 40e-6, supply_v).carrier();
        let mut loop_ = with_limits(carrier, reference_limits());
        loop_.slow.sample_delay_s = 1e-9 * f64::from(palpate_node::board::BRIDGE_DELAY_NS);
        loop_.test().unwrap();
        for to_a in [3.0, 1.0, 0.5, 0.25] {
            loop_.go(to_a, 1e-3).unwrap();
            loop_.run_for(0.05);
            assert!(
                loop_.report().holds,
                "{supply_v} V {to_a} A: {:?}",
                loop_.state()
            );
        }
    }
}
