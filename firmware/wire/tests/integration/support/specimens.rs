//! One message of every kind, with typical values.

use palpate_wire::code::*;
use palpate_wire::command::*;
use palpate_wire::record::*;
use palpate_wire::{Command, Record, SCHEMA_HASH, configuration_crc};

/// Returns one record of every kind.
pub(crate) fn records() -> Vec<Record> {
    let mut records = reports();
    records.extend(measured());
    records.extend(happened());
    records.extend(configured());
    records
}

fn reports() -> Vec<Record> {
    let setters: Vec<_> = commands()
        .into_iter()
        .filter(|command| (0x90..0xA0).contains(&palpate_wire::Message::kind(command)))
        .collect();
    vec![
        Record::Hello(Hello {
            minor_version: 0,
            schema_hash: SCHEMA_HASH,
            firmware_major: 0,
            firmware_minor: 1,
            firmware_patch: 0,
            commit: 0x00C0_FFEE,
            dirty: false,
            simulated: true,
            board: Board::Pico,
            unit: 0xE661_0CAF_E7A5_1234,
            reset_cause: ResetCause::Panic,
            chip: Chip::Ldc161x,
            second_chip: Chip::Absent,
            configuration_crc: configuration_crc(&setters),
        }),
        Record::Crash(Crash {
            cause: ResetCause::Panic,
            streak: 1,
            file: "firmware/src/tasks/sensing.rs".try_into().unwrap(),
            line: 42,
            program_counter: 0,
            link_register: 0,
            uptime_ms: 86_400_000,
        }),
    ]
}

fn measured() -> Vec<Record> {
    vec![
        Record::Sample(sample(1)),
        Record::Raw(Raw {
            sensor: 0,
            missed: 2,
            channels: 0b0001,
            period_us: 247.5,
            words: [0x0440_9E8B, 0x0440_9E8C, 0x1440_9E8A]
                .into_iter()
                .collect(),
        }),
        Record::Estimate(Estimate {
            measurement: 1,
            stiffness_n_per_m: Some(6_010.0),
            standard_error_n_per_m: Some(85.0),
            lower_n_per_m: 5_850.0,
            upper_n_per_m: Some(6_180.0),
            load_ratio: 0.998,
            load_ratio_standard_error: 0.014,
            samples: 400,
            ramps: 8,
            reduced_chi_square: Some(1.02),
            tangent_n_per_m: None,
            tangent_standard_error_n_per_m: None,
            two_state_n_per_m: Some(7_420.0),
            force_n: 1.506,
            total_displacement_m: 0.000_875,
            temperature_c: Some(31.5),
            duration_s: 0.82,
            load_points: 1,
        }),
        Record::LoadPoint(LoadPoint {
            measurement: 1,
            index: 0,
            points: 1,
            displacement_m: 0.000_25,
            displacement_sigma_m: 2e-7,
            force_n: 1.506,
            force_sigma_n: 0.015,
        }),
        Record::Refusal(Refusal {
            measurement: 2,
            reason: RefusalReason::SignalTooSmall,
            value: Some(1.4),
            limit: Some(2.0),
            wait_s: None,
        }),
    ]
}

/// Returns a sample of up to four channels.
pub(crate) fn sample(channels: u8) -> Sample {
    let conversion = |channel: u8| Conversion {
        channel,
        offset_us: u16::from(channel) * 240,
        word: 0x0440_9E8B,
        frequency_hz: 3_188_531.875,
        sigma_hz: 3.25,
        deformation_m: Some(0.000_251),
        deformation_sigma_m: Some(1.5e-8),
        extrapolated: false,
    };
    Sample {
        sensor: 0,
        missed: 0,
        gap: false,
        channels: (0..channels).map(conversion).collect(),
        contact: Contact::Held,
        force_n: Some(1.506),
        force_sigma_n: Some(0.015),
        current_a: Some(9.75),
        ripple_a: Some(0.25),
    }
}

/// Returns a full raw record of up to four channels.
pub(crate) fn full_raw(channels: u8) -> Raw {
    Raw {
        sensor: 0,
        missed: 0,
        channels: (1 << channels) - 1,
        period_us: 247.5 * f32::from(channels),
        words: (0x0440_9E8B..).take(32).collect(),
    }
}

fn happened() -> Vec<Record> {
    vec![
        Record::State(StateChange {
            state: State::Ramps,
            previous: State::Peak,
            mode: Mode::Stiffness,
            armed: true,
            measurement: 1,
        }),
        Record::Fault(Fault {
            code: FaultCode::OverCurrent,
            location: Location::Coil,
            active: true,
            value: Some(16.5),
            limit: Some(12.0),
        }),
        Record::Status(Status {
            conversions: 60_000,
            conversions_lost: 2,
            conversions_flagged: 1,
            second_conversions: 0,
            second_conversions_lost: 0,
            second_conversions_flagged: 0,
            bus_errors: 3,
            recoveries: 1,
            logs_dropped: 17,
            commands_damaged: 0,
            commands_refused: 1,
            measurements: 2,
            refusals: 1,
            temperature_c: Some(31.5),
            supply_v: Some(11.9),
            processor_load: Some(0.25),
            stack_bytes: 2_048,
        }),
        Record::CoilTest(CoilTest {
            resistance_ohm: 0.476,
            inductance_h: 4e-5,
            lost: 0.0065,
            zero_v: 1.652,
            supply_v: 11.9,
            limited_to_a: Some(2.1),
        }),
        Record::CurrentTrace(CurrentTrace {
            total: 128,
            first: 112,
            interval_s: 1.6e-5,
            currents_a: [9.02, 8.99, 9.01].into_iter().collect(),
        }),
        Record::Acknowledgement(Acknowledgement {
            command: 12,
            kind: 0x90,
            outcome: Outcome::OutOfRange,
            field: Some(11),
            item: None,
            value: Some(25.0),
            low: Some(0.05),
            high: Some(20.0),
        }),
    ]
}

fn configured() -> Vec<Record> {
    vec![
        Record::Settings(settings()),
        Record::Tank(tank()),
        Record::DeformationCurve(deformation_curve()),
        Record::Crosstalk(crosstalk()),
        Record::Springs(springs()),
        Record::Stiffening(stiffening()),
        Record::StiffeningCurve(stiffening_curve()),
        Record::Coil(coil()),
        Record::Attraction(attraction()),
        Record::TemperatureEffect(temperature_effect()),
        Record::CurrentCorrection(current_correction()),
        Record::CalibrationIdentity(calibration_identity()),
        Record::TemperatureCoefficients(temperature_coefficients()),
        Record::Storage(Storage {
            action: StorageAction::Store,
            succeeded: true,
            state: StorageState::Whole,
            generation: 17,
            stored_crc: 0x3610_A686,
            in_force_crc: 0x3610_A686,
            items: 37,
            unknown_items: 1,
            refused_items: 0,
            calibration_id: Some(4),
            calibrated_at_s: Some(1_795_000_000),
            calibrated_at_c: Some(23.5),
            calibration_hash: Some(0xCBF4_3926),
            took_s: 0.42,
        }),
        Record::UncertaintyBudget(UncertaintyBudget {
            measurement: 1,
            noise: 0.006,
            springs: 0.004,
            stiffening: 0.005,
            zero: 0.001,
            temperature: 0.011,
            bend: 0.002,
            off_calibration_k: Some(4.9),
        }),
    ]
}

/// Returns one command of every kind.
pub(crate) fn commands() -> Vec<Command> {
    vec![
        Command::Identify,
        Command::Arm,
        Command::Disarm,
        Command::Measure,
        Command::Abort,
        Command::SensingOnly,
        Command::ClearFault(ClearFault {
            code: FaultCode::CoilTooHot,
        }),
        Command::Sweep,
        Command::GetSettings,
        Command::TestCoil,
        Command::DriveCoil(DriveCoil {
            to_a: -2.5,
            over_s: 0.01,
            trace_interval_s: 1.6e-5,
        }),
        Command::GetCalibration(GetCalibration {
            part: Part::DeformationCurve,
            sensor: 0,
            channel: 1,
        }),
        Command::SetSettings(settings()),
        Command::SetTank(tank()),
        Command::SetDeformationCurve(deformation_curve()),
        Command::SetCrosstalk(crosstalk()),
        Command::SetSprings(springs()),
        Command::SetStiffening(stiffening()),
        Command::SetStiffeningCurve(stiffening_curve()),
        Command::SetCoil(coil()),
        Command::SetAttraction(attraction()),
        Command::SetTemperatureEffect(temperature_effect()),
        Command::SetCurrentCorrection(current_correction()),
        Command::SetCalibrationIdentity(calibration_identity()),
        Command::SetTemperatureCoefficients(temperature_coefficients()),
        Command::Store,
        Command::Load,
        Command::Erase,
        Command::GetStorage,
        Command::Reboot(Reboot {
            target: RebootTarget::BootLoader,
        }),
        Command::Locate(Locate { duration_s: 3.0 }),
    ]
}

fn calibration_identity() -> CalibrationIdentity {
    CalibrationIdentity {
        id: 4,
        calibrated_at_s: 1_795_000_000,
        calibrated_at_c: 23.5,
        hash: 0xCBF4_3926,
    }
}

/// Correction of an amplifier that reads 1 % too much, and of an ADC whose characteristic is bent.
fn current_correction() -> CurrentCorrection {
    CurrentCorrection {
        greatest_a: 10.0,
        changes_a: [0.1, 0.03, 0.0, -0.07, -0.1].into_iter().collect(),
    }
}

/// Settings for the sensor design `ultrasoft`.
pub(crate) fn settings() -> Settings {
    Settings {
        channels: 0b0001,
        rate_hz: 1_000.0,
        stream: Stream::Samples,
        decimation: 1,
        status_period_s: 1.0,
        contact_noise_m: 5e-8,
        release_m: 2.5e-7,
        least_press_m: 5e-5,
        steady_m_per_s: 2e-6,
        settling_s: 5.0,
        automatic: true,
        peak_current_a: 10.0,
        end_current_a: 0.5,
        rise_s: 0.05,
        hold_s: 0.02,
        ramps: 8,
        ramp_s: 0.05,
        drift: Drift::Logarithmic,
        drift_time_s: 0.02,
        greatest_error: 0.5,
        load_points: 1,
        greatest_temperature_c: 60.0,
        greatest_energy_j: 30.0,
    }
}

fn tank() -> Tank {
    Tank {
        sensor: 0,
        channel: 0,
        capacitance_f: 330e-12,
        rest_frequency_hz: 3_190_108.94,
    }
}

/// A whole curve of three knots.
pub(crate) fn deformation_curve() -> DeformationCurve {
    let knot = |inductance_change, deformation_m| DeformationKnot {
        inductance_change,
        deformation_m,
    };
    DeformationCurve {
        sensor: 0,
        channel: 0,
        total: 3,
        first: 0,
        knots: [knot(0.0, 0.0), knot(0.125, 2e-4), knot(0.27, 4e-4)]
            .into_iter()
            .collect(),
    }
}

fn crosstalk() -> Crosstalk {
    Crosstalk {
        sensor: 0,
        channel: 0,
        apparent_m_per_a2: 8e-8,
        growth_per_m: -500.0,
        uncertainty: 0.05,
    }
}

fn springs() -> Springs {
    Springs {
        sensing_n_per_m: 6_000.0,
        sensing_uncertainty: 0.005,
        actuated_n_per_m: 4_000.0,
        actuated_uncertainty: 0.005,
        force_scale_uncertainty: 0.001,
        bend: 0.012,
        zero_uncertainty_m: 1e-7,
    }
}

fn stiffening() -> Stiffening {
    Stiffening {
        peak_current_a: 10.0,
        rise_at_peak: 0.1,
        rise_uncertainty: 0.01,
        field_at_peak_t: 0.022,
        field_half_t: 0.25,
    }
}

/// The last chunk of a curve of ten knots.
pub(crate) fn stiffening_curve() -> StiffeningCurve {
    let knot = |current_a, rise| StiffeningKnot { current_a, rise };
    StiffeningCurve {
        total: 10,
        first: 8,
        rise_uncertainty: 0.01,
        knots: [knot(9.0, 0.0815), knot(10.0, 0.1)].into_iter().collect(),
    }
}

fn temperature_effect() -> TemperatureEffect {
    TemperatureEffect {
        calibrated_at_c: 20.0,
        springs_uncertainty_per_k: 0.0021,
        rise_uncertainty_per_k: 0.0029,
    }
}

fn temperature_coefficients() -> TemperatureCoefficients {
    TemperatureCoefficients {
        springs_per_k: -0.0015,
        rise_per_k: -0.004,
    }
}

fn attraction() -> Attraction {
    Attraction {
        attraction_n_per_a2: 0.3e-3,
        uncertainty: 0.05,
    }
}

fn coil() -> Coil {
    Coil {
        resistance_ohm: 0.389,
        copper_capacity_j_per_k: 0.8,
        pad_capacity_j_per_k: 60.0,
        copper_to_pad_k_per_w: 0.5,
        pad_to_ambient_k_per_w: 8.0,
        current_uncertainty: 0.01,
    }
}
