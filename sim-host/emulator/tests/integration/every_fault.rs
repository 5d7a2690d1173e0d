//! Every fault code of the protocol, raised on the image by its cause.
//!
//! A code without a cause here does not compile: [`cause`] matches all of them.

use crate::common::driven::{Wired, drive, wired};
use crate::common::stored::{AREA, Amount, configuration, streaming_with};
use crate::common::{Crash, LOOP, RecordedBoard, SPARE, image, ramping, recording};
use ldc161x_sim::{ChipFault, FaultEvent, Lost, Path, Settings, Strike};
use palpate_emulator::{
    BridgeCircuit, EmulatedBoard, FlashTimes, Image, LineFault, Options, Plant, PlantConditions,
    Time, firmware,
};
use palpate_wire::code::{FaultCode, Outcome};
use palpate_wire::command::ClearFault;
use palpate_wire::record;
use palpate_wire::{Command, configuration_crc};

/// Exception number of the timer's interrupt, in which the coil's task runs.
const TASKS: u32 = 16;

/// Faults that the cause of this code raises.
fn cause(code: FaultCode) -> Vec<record::Fault> {
    use FaultCode::*;
    match code {
        SensorAbsent => from_start(ChipFault::Absent),
        SensorIdentity => from_start(ChipFault::WrongIdentity {
            manufacturer: 0x5449,
            device: 0x3054,
        }),
        SensorReset => in_stream(ChipFault::BrownOut(Lost::Registers(u64::MAX))),
        SensorRegister => from_start(ChipFault::BitFlip {
            path: Path::WriteData,
            strike: Strike::Probability(1.0),
        }),
        SensorSilent => without_clock(),
        InterruptStuck => from_start(ChipFault::IntbStuck { low: true }),
        BusDataStuck => in_stream(ChipFault::SdaStuck { clocks: None }),
        BusClockStuck => in_stream(ChipFault::SclStuck),
        BusNotAcknowledged => in_stream(ChipFault::Nack { after_bytes: 1 }),
        BusTimeout => a_wire_that_is_freed_again_and_again(),
        SensorAmplitude => of_sensors(|plant| plant.parallel_ohm = 1_800.0),
        SensorNotOscillating => of_sensors(|plant| plant.sensors.frequencies_hz[0] = 0.0),
        SensorOverRange => of_sensors(|plant| plant.sensors.frequencies_hz[0] = 9e6),
        Bridge => driven(2.0, |bench| bench.board.drive_mut().bridge_faults = true),
        OverCurrent => driven(2.0, |bench| amplifier_reads(bench, 12.9)),
        CurrentMissing => driven(2.0, |bench| conditions(bench).coil_ohm = 1e4),
        CurrentUnwanted => a_switch_that_conducts_for_ever(),
        CoilTooHot => driven(2.0, |bench| conditions(bench).coil_c = 90.0),
        Thermometer => driven(5.0, |bench| {
            bench.board.drive_mut().thermistor_v = Some(3.3);
        }),
        SupplyLow => driven_at(5.0, 2.0, |bench| conditions(bench).supply_v = 4.3),
        SupplyHigh => driven(2.0, |bench| conditions(bench).supply_v = 14.6),
        TooMuchEnergy => driven(9.9, |bench| talk(bench, Time::from_ms(2_000))),
        Watchdog => crashed(Crash::Loop),
        HardFault => crashed(Crash::HardFault),
        Panic => panicked(),
        CrashUnreadable => reset_by_itself(),
        ConfigurationDamaged => upset(),
        StorageDamaged => started_with_a_damaged_calibration(),
        StorageFailed => stored_in_worn_flash(),
        Overrun => driven(2.0, |bench| hold_tasks(bench, Time::from_ms(25))),
        Clock => without_crystal(),
        CoilOpen => tested(|plant| plant.conditions.coil_ohm = 1e4),
        CoilShort => tested(|plant| plant.conditions.inductance_h = 4e-6),
        CoilUnknown => tested(|plant| plant.conditions.inductance_h = 1e-3),
        CurrentSense => driven(5.0, |bench| {
            amplifier_reads(bench, 5.0);
            talk(bench, Time::from_ms(300));
        }),
        NoHardwareLimit => without_limit(),
        // A coil far too hot: the supply cannot drive the current through its resistance.
        CurrentOffTarget => driven_at(5.0, 8.0, |bench| {
            conditions(bench).coil_ohm *= 1.35;
            bench.command(&drive(8.4, 0.0));
        }),
        OnTime => driven(1.0, |bench| talk(bench, Time::from_ms(20_100))),
        HostSilent => driven(2.0, |bench| bench.run(Time::from_ms(110))),
        CrashStreak => crashed_five_times(),
        Unknown(_) => Vec::new(),
    }
}

/// Raises a part of the codes, so that the parts run in parallel.
fn raise(part: usize) {
    let parts = FaultCode::ALL.iter().enumerate();
    let mut missing = Vec::new();
    for (_, &code) in parts.filter(|(index, _)| index % PARTS == part) {
        let begin = std::time::Instant::now();
        let faults = cause(code);
        println!("{code} {:.1} s", begin.elapsed().as_secs_f64());
        if !faults.iter().any(|it| it.active && it.code == code) {
            missing.push((code, faults));
        }
    }
    assert!(missing.is_empty(), "not raised: {missing:#?}");
}

const PARTS: usize = 2;

#[test]
fn what_is_damaged_in_flash_and_flash_that_takes_nothing_are_faults() {
    for code in [FaultCode::StorageDamaged, FaultCode::StorageFailed] {
        let faults = cause(code);
        assert!(
            faults.iter().any(|it| it.active && it.code == code),
            "{faults:?}"
        );
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn every_code_of_even_index_is_raised_by_its_cause() {
    raise(0);
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn every_code_of_odd_index_is_raised_by_its_cause() {
    raise(1);
}

// ---- converter and bus ----

fn from_start(fault: ChipFault) -> Vec<record::Fault> {
    let mut bench = RecordedBoard::new();
    let event = FaultEvent::from(Time::ZERO, fault);
    bench.board.chip_mut().schedule(event).unwrap();
    bench.run(Time::from_ms(400));
    bench.faults()
}

fn in_stream(fault: ChipFault) -> Vec<record::Fault> {
    let mut bench = crate::common::streaming();
    let event = FaultEvent::from(bench.board.now(), fault);
    bench.board.chip_mut().schedule(event).unwrap();
    bench.run(Time::from_ms(400));
    bench.faults()
}

/// With a single channel, the converter's watchdog reports that the sensor does not oscillate
/// (SNOA959 3.3); with several channels that watchdog is inactive.
fn without_clock() -> Vec<record::Fault> {
    let mut bench = crate::common::streaming();
    let settings = palpate_wire::command::Settings {
        channels: 0b0011,
        rate_hz: 250.0,
        ..bench.settings()
    };
    bench.accepted(&Command::SetSettings(settings));
    bench.run(Time::from_ms(200));
    let event = FaultEvent::from(bench.board.now(), ChipFault::ClockLoss);
    bench.board.chip_mut().schedule(event).unwrap();
    bench.run(Time::from_ms(400));
    bench.faults()
}

fn a_wire_that_is_freed_again_and_again() -> Vec<record::Fault> {
    let mut bench = crate::common::streaming();
    for _ in 0..200 {
        if !bench.board.is_disturbed() {
            bench.board.disturb(LineFault::SdaLow {
                bit: 14,
                lasting: None,
                clocks: Some(5),
            });
        }
        bench.run(Time::from_ms(1));
    }
    bench.faults()
}

thread_local! {
    /// A board that streams with a healthy coil; `ARMED` is this board after arming.
    static USUAL: RecordedBoard<Wired> = wired(PlantConditions::default(), BridgeCircuit::default(), 1);
    static ARMED: RecordedBoard<Wired> = {
        let mut bench = usual();
        bench.arm();
        bench
    };
}

fn usual() -> RecordedBoard<Wired> {
    USUAL.with(Clone::clone)
}

fn armed() -> RecordedBoard<Wired> {
    ARMED.with(Clone::clone)
}

fn of_sensors(change: impl Fn(&mut Wired)) -> Vec<record::Fault> {
    let mut bench = usual();
    change(bench.board.plant_mut());
    bench.run(Time::from_ms(150));
    bench.faults()
}

// ---- the coil ----

fn conditions(bench: &mut RecordedBoard<Wired>) -> &mut PlantConditions {
    &mut bench.board.plant_mut().conditions
}

fn amplifier_reads(bench: &mut RecordedBoard<Wired>, current_a: f64) {
    bench.board.drive_mut().amplifier_v = Some(1.65 + 0.125 * current_a);
}

/// Runs while the PC sends commands now and then, until there is a fault.
fn talk(bench: &mut RecordedBoard<Wired>, time: Time) {
    let end = bench.board.now() + time;
    while bench.board.now() < end && bench.faults().is_empty() {
        bench.command(&Command::GetSettings);
        bench.run(Time::from_ms(50));
    }
}

fn driven(to_a: f64, change: impl Fn(&mut RecordedBoard<Wired>)) -> Vec<record::Fault> {
    driven_at(12.0, to_a, change)
}

fn driven_at(
    supply_v: f64,
    to_a: f64,
    change: impl Fn(&mut RecordedBoard<Wired>),
) -> Vec<record::Fault> {
    let conditions = PlantConditions {
        supply_v,
        ..PlantConditions::default()
    };
    let mut bench = if supply_v == 12.0 {
        armed()
    } else {
        let mut bench = wired(conditions, BridgeCircuit::default(), 1);
        bench.arm();
        bench
    };
    bench.go(to_a, 1e-3, Time::from_ms(10));
    assert_eq!(bench.faults(), []);
    change(&mut bench);
    if bench.faults().is_empty() {
        talk(&mut bench, Time::from_ms(400));
    }
    bench.run(Time::from_ms(5));
    assert_eq!(bench.board.current_a(), 0.0, "{:?}", bench.faults());
    bench.faults()
}

fn tested(change: impl Fn(&mut Wired)) -> Vec<record::Fault> {
    let mut bench = usual();
    change(bench.board.plant_mut());
    bench.command(&Command::SetCoil(crate::common::coil()));
    bench.command(&Command::Arm);
    bench.run(Time::from_ms(250));
    bench.faults()
}

fn without_limit() -> Vec<record::Fault> {
    let drive = BridgeCircuit {
        limit_a: f64::INFINITY,
        ..BridgeCircuit::default()
    };
    let mut bench = wired(PlantConditions::default(), drive, 1);
    bench.command(&Command::SetCoil(crate::common::coil()));
    bench.command(&Command::Arm);
    bench.run(Time::from_ms(150));
    bench.faults()
}

/// The current continues with the bridge off: a coil of a henry sustains it.
fn a_switch_that_conducts_for_ever() -> Vec<record::Fault> {
    let mut bench = armed();
    bench.go(4.0, 0.0, Time::from_ms(5));
    conditions(&mut bench).inductance_h = 1.0;
    bench.run(Time::from_us(300));
    bench.command(&Command::Abort);
    assert!(!bench.board.bridge().awake && bench.board.current_a() > 3.0);
    bench.run(Time::from_ms(15));
    assert_eq!(bench.faults(), [], "any coil may take 20 ms");
    bench.run(Time::from_ms(35));
    bench.faults()
}

// ---- flash ----

/// One bit flipped in every sixteen of a stored page.
fn started_with_a_damaged_calibration() -> Vec<record::Fault> {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    bench.save(&configuration(1, Amount::Usual));
    let written = bench.written();
    for address in written.into_iter().take(256).step_by(2) {
        bench.board.flash_mut().flip_bit(address, 3);
    }
    let found = bench.cycle_power();
    assert!(found.is_default(), "{found:?}");
    // After another save, the storage is valid again.
    let again = configuration(2, Amount::Usual);
    bench.accepted(&Command::ClearFault(ClearFault {
        code: FaultCode::StorageDamaged,
    }));
    bench.save(&again);
    let later = bench.cycle_power();
    assert!(later.is(&again), "{later:?}");
    found.faults
}

/// All sectors of the area are worn out: the previous data stay valid.
fn stored_in_worn_flash() -> Vec<record::Fault> {
    let mut bench = streaming_with(FlashTimes::Typical, 1);
    let old = configuration(1, Amount::Usual);
    bench.save(&old);
    bench.set(&configuration(2, Amount::Usual));
    for sector in AREA.step_by(4096) {
        bench.board.flash_mut().wear_out(sector);
    }
    let failed = bench.with_storage(&Command::Store);
    let crc = configuration_crc(&old);
    assert!(!failed.succeeded && failed.stored_crc == crc, "{failed:?}");
    bench.run(Time::from_ms(5));
    let faults = bench.faults();
    assert!(bench.cycle_power().is(&old));
    faults
}

// ---- processor and memory ----

fn crashed(crash: Crash) -> Vec<record::Fault> {
    let mut bench = ramping(image());
    crash
        .in_exception(&mut bench, crate::common::EXCEPTIONS[0])
        .unwrap();
    bench.run(Time::from_ms(50));
    bench.faults()
}

fn reset_by_itself() -> Vec<record::Fault> {
    let mut bench = ramping(image());
    crate::common::reset_without_a_record(&mut bench);
    bench.run(Time::from_ms(150));
    bench.faults()
}

fn crashed_five_times() -> Vec<record::Fault> {
    let mut bench = crate::common::streaming();
    for _ in 0..5 {
        Crash::HardFault.in_exception(&mut bench, crate::common::EXCEPTIONS[0]);
        bench.run(Time::from_ms(200));
    }
    bench.faults()
}

fn panicked() -> Vec<record::Fault> {
    let path = firmware::build_with_defect("panic").unwrap();
    let mut bench = ramping(&Image::load(&path).unwrap());
    crate::common::panic_in(&mut bench, 0).unwrap();
    bench.run(Time::from_ms(50));
    bench.faults()
}

/// Stops the tasks for a while: an endless loop in the interrupt that runs them.
fn hold_tasks(bench: &mut RecordedBoard<Wired>, time: Time) {
    bench
        .board
        .run_until(Time::from_ms(5), |board| board.exception() == TASKS)
        .unwrap();
    let pc = bench.board.pc();
    bench.board.poke(SPARE, LOOP);
    bench.board.set_pc(SPARE);
    bench.run(time);
    bench
        .board
        .run_until(Time::from_ms(1), |board| {
            board.exception() == TASKS && board.pc() == SPARE
        })
        .unwrap();
    bench.board.set_pc(pc);
}

#[test]
fn without_a_crystal_time_goes_by_the_ring_and_the_clock_is_a_fault() {
    let codes: Vec<FaultCode> = without_crystal().iter().map(|fault| fault.code).collect();
    // Without the right clock the bus is too slow, which may also be reported.
    assert_eq!(codes.first(), Some(&FaultCode::Clock));
}

fn without_crystal() -> Vec<record::Fault> {
    let options = Options {
        crystal_hz: 0.0,
        ..recording()
    };
    let mut bench = RecordedBoard::with(Settings::default(), options);
    bench.run(Time::from_ms(500));
    let begin_us = bench.board.timer_us();
    bench.run(Time::from_ms(500));
    assert_eq!(bench.board.resets().watchdog, 0);
    // The emulated ring oscillator has its typical speed; a real one adds its own error.
    let passed_us = bench.board.timer_us() - begin_us;
    assert!(passed_us.abs_diff(500_000) < 5_000, "{passed_us} us");
    bench.faults()
}

/// Addresses of a value in memory.
fn addresses_of<P: Plant>(board: &EmulatedBoard<P>, value: f32) -> Vec<u32> {
    let memory = (0x2000_0000..0x2004_2000_u32).step_by(4);
    memory
        .filter(|&at| board.peek(at) == value.to_bits())
        .collect()
}

/// Flips one bit of the coil's data.
fn upset() -> Vec<record::Fault> {
    const OHM: f32 = 0.512_345;
    let mut bench = usual();
    let coil = palpate_wire::command::Coil {
        resistance_ohm: OHM,
        ..crate::common::coil()
    };
    let set = Command::SetCoil(coil);
    assert_eq!(bench.command(&set).outcome, Outcome::Accepted);
    bench.run(Time::from_ms(1_100));
    assert_eq!(bench.faults(), []);
    for address in addresses_of(&bench.board, OHM) {
        let word = bench.board.peek(address);
        bench.board.poke(address, word ^ 1 << 21);
    }
    let begin = bench.board.now();
    talk(&mut bench, Time::from_ms(1_200));
    let took = bench.board.now() - begin;
    assert!(took <= Time::from_ms(1_150), "{took}");
    // When the coil's data are set again, the fault is gone.
    let clear = Command::ClearFault(ClearFault {
        code: FaultCode::ConfigurationDamaged,
    });
    for command in [set, clear] {
        assert_eq!(bench.command(&command).outcome, Outcome::Accepted);
    }
    let faults = bench.faults();
    bench.run(Time::from_ms(1_100));
    assert_eq!(bench.faults().len(), faults.len(), "{:?}", bench.faults());
    faults
}
