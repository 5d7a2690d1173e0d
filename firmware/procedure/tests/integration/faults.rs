//! Faults: the bridge goes off first, they are latched, and end only as documented.

use crate::support::calibration::{calibration, settings};
use crate::support::sensor::Sensor;
use crate::support::{Rig, STATES, clear};
use palpate_procedure::event::{Conditions, Failure};
use palpate_procedure::units::Celsius;
use palpate_procedure::{Action, Actions, Event};
use palpate_wire::Command;
use palpate_wire::code::{FaultCode, Location, Mode, Outcome, Part, State};
use palpate_wire::command::GetCalibration;
use palpate_wire::record::Fault;

/// Longest start-up of a converter, in seconds.
const BRING_UP_S: f32 = 0.14;

/// Checks that the bridge is off first, and the fault is reported as standing, disarmed.
#[track_caller]
fn stops(rig: &Rig, actions: &Actions, code: FaultCode) -> Fault {
    assert_eq!(actions[0], Action::SafeState);
    let fault = rig.faults().pop().expect("a fault");
    assert_eq!((fault.code, fault.active), (code, true));
    assert_eq!(rig.state(), State::Fault);
    assert!(rig.line.is_off() && !rig.procedure.is_armed());
    fault
}

/// Converts until a fault stands.
fn comes(rig: &mut Rig) -> Actions {
    for _ in 0..10_000 {
        let actions = rig.convert();
        if rig.state() == State::Fault {
            return actions;
        }
    }
    panic!("no fault; {} {:?}", rig.state(), rig.refusals());
}

#[test]
fn any_fault_stops_any_state() {
    for state in STATES {
        let rig = Rig::standing_in(state, |_| {});
        for (location, code) in Location::ALL.iter().cycle().zip(FaultCode::ALL) {
            let mut rig = rig.clone();
            rig.records.clear();
            let failure = Failure {
                value: Some(1.0),
                limit: Some(2.0),
                ..Failure::new(*code, *location)
            };
            let actions = rig.step(&Event::Fault(failure));
            let fault = stops(&rig, &actions, *code);
            assert_eq!((fault.value, fault.limit), (Some(1.0), Some(2.0)));
            assert_eq!(fault.location, *location);
            // The fault stands until a command clears it, regardless of the conversions meanwhile.
            rig.sensor.depth_m = 0.0;
            rig.run(1_000);
            assert_eq!((rig.state(), rig.faults().len()), (State::Fault, 1));
        }
    }
}

#[test]
fn silence_is_a_fault_and_ends_with_it() {
    for state in STATES {
        let mut rig = Rig::standing_in(state, |_| {});
        // Neither ticks nor thermometer readings keep the sensor from counting as silent.
        let quiet = |rig: &mut Rig| {
            let actions = rig.wait(1_000);
            rig.temperature(25.0);
            actions
        };
        for _ in 0..50 {
            quiet(&mut rig);
        }
        assert_ne!(rig.state(), State::Fault, "{state}");
        let mut actions = quiet(&mut rig);
        let mut limit_s = 0.05;
        // In these states the converter may still be busy with its configuration, which lengthens the
        // limit.
        if matches!(state, State::SelfTest | State::Baseline) {
            while rig.state() != State::Fault {
                actions = quiet(&mut rig);
                limit_s += 0.001;
            }
            assert!(limit_s <= 0.0501 + BRING_UP_S, "{limit_s}");
        }
        let fault = stops(&rig, &actions, FaultCode::SensorSilent);
        assert_eq!(fault.location, Location::Sensor);
        assert!((fault.limit.expect("a time") - limit_s).abs() < 1e-3);
        assert!((fault.value.expect("a time") - limit_s - 0.001).abs() < 1e-6);
        // A flagged conversion does not end the fault of a silent sensor.
        rig.sensor.flags = 0x1000;
        rig.run(20);
        assert_eq!(rig.state(), State::Fault);
        rig.sensor.flags = 0;
        rig.sensor.depth_m = 0.0;
        rig.convert();
        assert_eq!(rig.state(), State::SelfTest);
        assert!(!rig.procedure.is_armed());
        rig.until(State::Watching, 3_000);
    }
}

/// Flags of a word, and the fault for each when it persists.
const FLAGS: [(u16, FaultCode); 4] = [
    (0x1000, FaultCode::SensorAmplitude),
    (0x2000, FaultCode::SensorNotOscillating),
    (0x4000, FaultCode::SensorOverRange),
    (0x8000, FaultCode::SensorNotOscillating),
];

#[test]
fn flags_that_persist_are_a_fault_and_end_with_their_cause() {
    for state in STATES {
        for (flags, code) in FLAGS {
            let mut rig = Rig::standing_in(state, |_| {});
            let convert = |rig: &mut Rig, flags| {
                rig.sensor.flags = flags;
                // Commands from the PC keep a commanded current from ending.
                rig.accepted(Command::Identify);
                rig.convert()
            };
            // Flagged readings for 50 ms at 1 kHz are no fault: here twice, each time after a good
            // reading.
            for _ in 0..2 {
                convert(&mut rig, 0);
                for _ in 0..51 {
                    convert(&mut rig, flags);
                }
                assert!(rig.faults().is_empty(), "{state} {code}");
            }
            let actions = convert(&mut rig, flags);
            let fault = stops(&rig, &actions, code);
            assert_eq!((fault.location, fault.value), (Location::Sensor, Some(0.0)));
            // After a fault of the amplitude, the drive is searched again: it may have been found while
            // the sensor was pressed.
            let seeks = actions.contains(&Action::SeekDrive { sensor: 0 });
            assert_eq!(seeks, code == FaultCode::SensorAmplitude);
            // Neither the recovery of the converter nor a different flag ends the fault.
            rig.step(&Event::Recovered(code));
            for (other, _) in FLAGS {
                convert(&mut rig, other);
            }
            assert_eq!((rig.state(), rig.faults().len()), (State::Fault, 1));
            rig.sensor.depth_m = 0.0;
            convert(&mut rig, 0);
            let ended = rig.faults().pop().expect("a fault");
            assert_eq!((ended.code, ended.active), (code, false));
            assert_eq!(rig.state(), State::SelfTest);
            assert!(!rig.procedure.is_armed());
            rig.until(State::Watching, 3_000);
        }
    }
}

#[test]
fn flags_of_a_slow_converter_have_ten_conversions() {
    let mut rig = Rig::standing_in(State::Watching, |of| of.rate_hz = 100.0);
    rig.sensor.flags = 0x2000;
    rig.run(110);
    assert_eq!(rig.state(), State::Watching);
    rig.run(10);
    assert_eq!(rig.state(), State::Fault);
    // A fault that is cleared while its cause persists is raised again.
    rig.accepted(clear(FaultCode::SensorNotOscillating));
    rig.run(110);
    assert_eq!(rig.state(), State::SelfTest);
    rig.run(10);
    assert_eq!(rig.state(), State::Fault);
}

#[test]
fn each_channel_and_converter_is_at_fault_by_itself() {
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    let scan_of = |rig: &mut Rig, sensor: u8, flagged: bool| {
        rig.now_us += 1_000;
        let mut scan = rig.scan();
        scan.sensor = sensor;
        let mut third = scan.conversions[0];
        third.reading.channel = ldc161x::Channel::Two;
        if flagged {
            third.reading.word = ldc161x::Word::from_registers(0x2000, 0);
        }
        scan.conversions.push(third).expect("room");
        rig.step(&Event::Scan(&scan))
    };
    for (sensor, location) in [(0, Location::Sensor), (1, Location::SecondSensor)] {
        let mut rig = rig.clone();
        for _ in 0..60 {
            scan_of(&mut rig, 0, sensor == 0);
            scan_of(&mut rig, 1, sensor == 1);
        }
        let fault = rig.faults().pop().expect("a fault");
        assert_eq!((fault.location, fault.value), (location, Some(2.0)));
        assert_eq!(fault.code, FaultCode::SensorNotOscillating);
        // Good readings of the other converter do not end the fault.
        scan_of(&mut rig, 1 - sensor, false);
        assert_eq!(rig.state(), State::Fault);
        scan_of(&mut rig, sensor, false);
        assert_eq!(rig.state(), State::SelfTest);
    }
    // A reading that is old or follows a gap proves no fault of the sensor.
    for _ in 0..200 {
        rig.convert_with(|scan| scan.conversions[0].reading.after_gap = true);
    }
    assert!(rig.faults().is_empty());
}

#[test]
fn a_converter_that_is_being_configured_may_be_silent_for_longer() {
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    rig.run(1_000);
    rig.accepted(Command::Disarm);
    let four = settings(|settings| settings.channels = 0b1111);
    rig.accepted(Command::SetSettings(four));
    // A scan with the old settings may still arrive.
    rig.convert();
    for _ in 0..189 {
        rig.wait(1_000);
    }
    assert_eq!((rig.state(), rig.faults().len()), (State::Baseline, 0));
    let actions = rig.wait(1_000);
    let fault = stops(&rig, &actions, FaultCode::SensorSilent);
    assert!((fault.limit.expect("a time") - 0.05 - BRING_UP_S).abs() < 2e-3);
}

#[test]
fn the_coil_gets_hotter_than_was_forecast() {
    for sweep in [false, true] {
        let mut rig = Rig::standing_in(State::Contact, |_| {});
        rig.accepted(if sweep {
            Command::Sweep
        } else {
            Command::Measure
        });
        rig.until(State::Ramps, 1_000);
        rig.temperature(81.0);
        let actions = rig.convert();
        let fault = stops(&rig, &actions, FaultCode::CoilTooHot);
        assert_eq!((fault.location, fault.limit), (Location::Coil, Some(80.0)));
        assert!((fault.value.expect("a temperature") - 81.0).abs() < 0.1);
        // The thermometer reports that the coil has cooled, which does not clear the fault.
        rig.temperature(25.0);
        rig.run(1_000);
        assert_eq!(rig.state(), State::Fault);
        rig.accepted(clear(FaultCode::CoilTooHot));
        assert_eq!(rig.state(), State::SelfTest);
    }
}

#[test]
fn more_energy_went_into_the_coil_than_was_forecast() {
    // Finds the forecast energy of the train from a refusal: the energy exceeds the limit of 1 J.
    let mut rig = Rig::standing_in(State::Contact, |of| of.greatest_energy_j = 1.0);
    let forecast_j = rig.refused().value.expect("an energy");
    let limit_j = 1.01 * forecast_j;
    let mut rig = Rig::standing_in(State::Contact, |of| of.greatest_energy_j = limit_j);
    rig.current_gain = 1.095;
    rig.accepted(Command::Measure);
    let actions = comes(&mut rig);
    let fault = stops(&rig, &actions, FaultCode::TooMuchEnergy);
    let (found_j, allowed_j) = (fault.value.unwrap(), fault.limit.unwrap());
    assert_eq!((fault.location, allowed_j), (Location::Coil, limit_j));
    // The energy is checked every 10 ms, in which 11 A add half a joule.
    let found_in = limit_j..limit_j + 0.5;
    assert!(found_in.contains(&found_j), "{found_j} {limit_j}");
}

#[test]
fn a_temperature_that_is_no_number_does_not_hide_the_coils_heat() {
    for temperature_c in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut rig = Rig::standing_in(State::Ramps, |_| {});
        rig.temperature(temperature_c);
        rig.run(100);
        assert_eq!(rig.state(), State::Ramps);
        rig.temperature(90.0);
        let actions = rig.convert();
        stops(&rig, &actions, FaultCode::CoilTooHot);
    }
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    rig.step(&Event::Conditions(Conditions {
        temperature: Some(Celsius(f32::NAN)),
        supply_v: Some(f32::NAN),
        processor_load: Some(f32::INFINITY),
        ..Conditions::default()
    }));
    let status = rig.status();
    assert_eq!(status.temperature_c, None);
    assert_eq!((status.supply_v, status.processor_load), (None, None));
}

#[test]
fn a_clock_that_is_set_back_is_a_fault() {
    for state in STATES {
        for back_us in [300_000, 86_400_000_000] {
            let mut rig = Rig::standing_in(state, |_| {});
            rig.now_us = rig.now_us.saturating_sub(back_us);
            let actions = rig.convert();
            stops(&rig, &actions, FaultCode::Clock);
        }
        let mut rig = Rig::standing_in(state, |_| {});
        rig.now_us -= 10_001;
        let actions = rig.wait(0);
        let fault = stops(&rig, &actions, FaultCode::Clock);
        assert_eq!((fault.location, fault.value), (Location::Clock, None));
        // After the fault is cleared, the procedure continues with the new time, and detects silence
        // with it.
        rig.accepted(clear(FaultCode::Clock));
        rig.sensor.depth_m = 0.0;
        rig.until(State::Watching, 3_000);
        assert_eq!(rig.faults().len(), 2, "{:?}", rig.faults());
        rig.wait(51_000);
        assert_eq!(rig.state(), State::Fault);
    }
}

#[test]
fn events_of_two_tasks_may_change_places() {
    let mut rig = Rig::standing_in(State::Ramps, |_| {});
    for _ in 0..100 {
        rig.convert();
        rig.now_us -= 300;
        rig.wait(0);
        rig.now_us += 300;
    }
    assert!(rig.faults().is_empty() && rig.refusals().is_empty());
}

#[test]
fn no_other_command_clears_a_fault() {
    let mut commands = vec![
        Command::Identify,
        Command::Arm,
        Command::Disarm,
        Command::Measure,
        Command::Abort,
        Command::SensingOnly,
        Command::Sweep,
        Command::GetSettings,
        Command::SetSettings(settings(|_| {})),
    ];
    commands.extend(Part::ALL.iter().map(|&part| {
        let (sensor, channel) = (0, 0);
        Command::GetCalibration(GetCalibration {
            part,
            sensor,
            channel,
        })
    }));
    commands.extend(calibration(&Sensor::default()));
    for code in FaultCode::ALL {
        let mut rig = Rig::standing_in(State::Ramps, |_| {});
        assert_eq!(rig.outcome(clear(*code)), Outcome::OtherFault);
        rig.fail(*code, Location::Bridge);
        for command in &commands {
            rig.outcome(command.clone());
            assert_eq!((rig.state(), rig.faults().len()), (State::Fault, 1));
            assert!(!rig.procedure.is_armed() && rig.line.is_off());
        }
        for other in FaultCode::ALL.iter().filter(|other| *other != code) {
            assert_eq!(rig.outcome(clear(*other)), Outcome::OtherFault);
        }
        rig.step(&Event::Recovered(*code));
        assert_eq!(rig.state(), State::Fault);
        // A cleared fault is reported as ended, and the device starts again, disarmed.
        rig.accepted(clear(*code));
        let ended = rig.faults().pop().expect("a fault");
        assert_eq!((ended.code, ended.active), (*code, false));
        let change = rig.changes().pop().expect("a change");
        assert_eq!(
            (change.state, change.previous),
            (State::SelfTest, State::Fault)
        );
        assert_eq!((change.mode, change.armed), (Mode::SensingOnly, false));
        assert_eq!(rig.outcome(Command::Measure), Outcome::SensingOnly);
    }
}

#[test]
fn a_fault_of_sensor_or_bus_ends_when_its_cause_does_and_no_other() {
    for location in Location::ALL {
        let mut rig = Rig::standing_in(State::Ramps, |_| {});
        let code = FaultCode::BusTimeout;
        rig.fail(code, *location);
        rig.step(&Event::Recovered(FaultCode::BusDataStuck));
        assert_eq!(rig.state(), State::Fault);
        let actions = rig.step(&Event::Recovered(code));
        let ends = matches!(
            location,
            Location::Sensor | Location::SecondSensor | Location::Bus
        );
        let expected = if ends { State::SelfTest } else { State::Fault };
        assert_eq!(rig.state(), expected, "{location}");
        let configures = |action: &Action| matches!(action, Action::ConfigureSensors { .. });
        assert_eq!(actions.iter().any(configures), ends);
        assert!(!rig.procedure.is_armed());
    }
}

#[test]
fn a_fault_that_waits_for_its_user_is_not_hidden_by_one_that_does_not() {
    for bridge_first in [false, true] {
        let mut rig = Rig::standing_in(State::Watching, |_| {});
        let mut faults = [
            (FaultCode::BusTimeout, Location::Bus),
            (FaultCode::Bridge, Location::Bridge),
        ];
        if bridge_first {
            faults.reverse();
        }
        for (code, location) in faults {
            let actions = rig.fail(code, location);
            stops(&rig, &actions, code);
        }
        rig.step(&Event::Recovered(FaultCode::BusTimeout));
        assert_eq!(
            rig.outcome(clear(FaultCode::BusTimeout)),
            Outcome::OtherFault
        );
        assert_eq!(rig.state(), State::Fault);
        rig.accepted(clear(FaultCode::Bridge));
        assert_eq!(rig.state(), State::SelfTest);
    }
    // Of two faults of equal rank the first stands.
    let mut rig = Rig::standing_in(State::Watching, |_| {});
    rig.fail(FaultCode::Bridge, Location::Bridge);
    rig.fail(FaultCode::OverCurrent, Location::Coil);
    assert_eq!(
        rig.outcome(clear(FaultCode::OverCurrent)),
        Outcome::OtherFault
    );
    rig.accepted(clear(FaultCode::Bridge));
}

/// Each reported fault ends once: with its cause, or with the standing fault.
#[test]
fn of_two_faults_at_once_both_ends_are_reported() {
    let bus = (FaultCode::BusTimeout, Location::Bus);
    let register = (FaultCode::SensorRegister, Location::Sensor);
    let coil = (FaultCode::CoilOpen, Location::Coil);
    let bridge = (FaultCode::Bridge, Location::Bridge);
    // Two faults, whether the cause of the bus fault ends before the standing fault is cleared, and the
    // faults in the order in which they end.
    for (faults, recovers, ends) in [
        ([bus, coil], false, [coil, bus]),
        ([bus, coil], true, [bus, coil]),
        ([coil, bus], false, [coil, bus]),
        ([coil, bus], true, [bus, coil]),
        ([coil, bridge], false, [coil, bridge]),
        ([bus, register], false, [bus, register]),
    ] {
        let mut rig = Rig::standing_in(State::Watching, |_| {});
        for (code, location) in faults {
            rig.fail(code, location);
        }
        if recovers {
            rig.step(&Event::Recovered(bus.0));
            assert_eq!(rig.state(), State::Fault, "{faults:?}");
        }
        let stands = ends[usize::from(recovers)];
        rig.accepted(clear(stands.0));
        let ended = rig.faults().into_iter().filter(|fault| !fault.active);
        let ended: Vec<_> = ended.map(|fault| fault.code).collect();
        assert_eq!(ended, ends.map(|(code, _)| code), "{faults:?}");
        assert_eq!(rig.state(), State::SelfTest, "{faults:?}");
        rig.arm();
    }
}
