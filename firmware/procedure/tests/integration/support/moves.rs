//! Random events of any kind, with enough usual ones between to reach every state.

use palpate_procedure::event::{Conditions, Failure};
use palpate_procedure::units::{Ampere, Celsius};
use palpate_procedure::{Duration, Event, Instant, Link};
use palpate_wire::code::{Drift, FaultCode, Location, Part, Stream};
use palpate_wire::command::{DriveCoil, GetCalibration, Settings};
use palpate_wire::{Command, FrameError, Header, PayloadError};
use proptest::prelude::*;
use proptest::sample::select;

use super::calibration::{
    COIL, attraction, calibration, crosstalk, curve, settings, springs, stiffening,
};
use super::sensor::Sensor;
use super::{BOOT, Rig, clear, frame};

/// A change of the rig, or an event that it receives.
#[derive(Clone, Debug)]
pub(crate) enum Move {
    /// This many usual conversions.
    Convert(u16),
    /// A conversion with an anomaly.
    Odd(Oddity),
    /// Time passes, in microseconds.
    Wait(u64),
    /// The clock is set back.
    Back(u64),
    /// The sensor is pressed to this deformation; zero lifts the object.
    Press(f64),
    Noise(f64),
    Flags(u16),
    /// The gain of the current measurement changes to this.
    Gain(f64),
    /// The true rise of the actuated layer changes to this.
    Rise(f64),
    Load(f64),
    /// A command, and the boot id that it carries.
    Command(Box<Command>, u32),
    /// A command with the sequence number of the previous one.
    Again(Box<Command>),
    /// The duration of a coil test changes to this, in microseconds.
    Test(u64),
    NotUnderstood(FrameError),
    Conditions(Conditions),
    Fault(Failure),
    Recovered(FaultCode),
    /// Restores the initial rig except its clock, and arms it.
    Restore,
}

#[derive(Clone, Debug)]
pub(crate) enum Oddity {
    Lost(u32),
    Gap,
    Sensor(u8),
    Current(Option<f32>),
    Frequency(f64),
    Sigma(f32),
    Word(u16, u16),
    Empty,
    Full,
    Middle(u64),
    Window(u64),
}

/// Carries a move out.
pub(crate) fn carry_out(rig: &mut Rig, of: &Move) {
    match of {
        Move::Convert(count) => (0..*count).for_each(|_| drop(rig.convert())),
        Move::Odd(oddity) => drop(rig.convert_with(|scan| {
            let conversion = scan.conversions[0];
            let reading = &mut scan.conversions[0].reading;
            match *oddity {
                Oddity::Lost(lost) => scan.lost = lost,
                Oddity::Gap => (scan.gap, reading.after_gap) = (true, true),
                Oddity::Sensor(sensor) => scan.sensor = sensor,
                Oddity::Current(current_a) => scan.current = current_a.map(Ampere),
                Oddity::Frequency(frequency_hz) => reading.frequency_hz = frequency_hz,
                Oddity::Sigma(sigma_hz) => reading.sigma_hz = sigma_hz,
                Oddity::Word(msb, lsb) => reading.word = ldc161x::Word::from_registers(msb, lsb),
                Oddity::Empty => scan.conversions.clear(),
                Oddity::Full => scan.conversions = core::iter::repeat_n(conversion, 4).collect(),
                Oddity::Middle(us) => scan.middle = Instant::from_ticks(us),
                Oddity::Window(us) => scan.window = Duration::from_ticks(us),
            }
        })),
        Move::Wait(time_us) => drop(rig.wait(*time_us)),
        Move::Back(time_us) => {
            rig.now_us = rig.now_us.saturating_sub(*time_us);
            rig.wait(0);
        }
        Move::Press(deformation_m) => rig.sensor.press(*deformation_m),
        Move::Noise(noise_m) => rig.sensor.noise_m = *noise_m,
        Move::Flags(flags) => rig.sensor.flags = *flags,
        Move::Gain(gain) => rig.current_gain = *gain,
        Move::Rise(rise) => rig.sensor.rise = *rise,
        Move::Load(load_n_per_m) => rig.sensor.load_n_per_m = *load_n_per_m,
        Move::Command(command, boot) => {
            rig.command(command.as_ref().clone(), *boot);
        }
        Move::Again(command) => {
            let frame = frame(command.as_ref().clone(), BOOT, rig.sequence);
            rig.step(&Event::Command(Link::Probe, &frame));
        }
        Move::Test(test_us) => rig.test_us = *test_us,
        Move::NotUnderstood(error) => drop(rig.step(&Event::NotUnderstood(Link::Probe, *error))),
        Move::Conditions(conditions) => drop(rig.step(&Event::Conditions(*conditions))),
        Move::Fault(failure) => drop(rig.step(&Event::Fault(*failure))),
        Move::Recovered(code) => drop(rig.step(&Event::Recovered(*code))),
        Move::Restore => restore(rig),
    }
}

fn restore(rig: &mut Rig) {
    rig.accepted(Command::Disarm);
    for code in FaultCode::ALL.iter().copied() {
        rig.outcome(clear(code));
    }
    rig.sensor = Sensor::default();
    rig.current_gain = 1.0;
    rig.temperature(25.0);
    rig.accepted(Command::SetSettings(short()));
    for command in calibration(&Sensor::default()) {
        rig.accepted(command);
    }
    rig.accepted(Command::Arm);
    rig.run(700);
}

/// Any move, usual ones more often.
pub(crate) fn moves() -> impl Strategy<Value = Move> {
    let deformations = prop_oneof![
        4 => Just(3e-4),
        1 => Just(0.0),
        1 => 0.0..1.2e-3,
    ];
    prop_oneof![
        30 => (1_u16..400).prop_map(Move::Convert),
        8 => deformations.prop_map(Move::Press),
        4 => oddities().prop_map(Move::Odd),
        2 => select(vec![0, 9_000, 40_000]).prop_map(Move::Wait),
        1 => select(vec![51_000, 86_400_000_000, 1 << 50]).prop_map(Move::Wait),
        1 => select(vec![1, 9_000, 11_000, 86_400_000_000]).prop_map(Move::Back),
        1 => select(vec![0.0, 1e-8, 1e-6]).prop_map(Move::Noise),
        1 => select(vec![0, 0, 0, 0x1000, 0xF000]).prop_map(Move::Flags),
        1 => select(vec![1.0, 1.0, 1.0, 0.8, 1.2, 0.0]).prop_map(Move::Gain),
        1 => select(vec![0.1, 0.1, 0.1, 0.0, -0.1, 1.0]).prop_map(Move::Rise),
        1 => select(vec![6e3, 6e2, 6e4, 1e9]).prop_map(Move::Load),
        14 => usual_commands().prop_map(to_us),
        6 => commands().prop_map(to_us),
        1 => (commands(), select(vec![0, BOOT + 1]))
            .prop_map(|(command, boot)| Move::Command(Box::new(command), boot)),
        2 => prop_oneof![usual_commands(), commands()]
            .prop_map(|command| Move::Again(Box::new(command))),
        2 => select(vec![0, 60_000, 200_000, 600_000]).prop_map(Move::Test),
        1 => not_understood().prop_map(Move::NotUnderstood),
        2 => conditions().prop_map(Move::Conditions),
        1 => failures().prop_map(Move::Fault),
        3 => select(FaultCode::ALL).prop_map(Move::Recovered),
        4 => Just(Move::Restore),
    ]
}

fn to_us(command: Command) -> Move {
    Move::Command(Box::new(command), BOOT)
}

/// Short trains, so that many fit into a run.
pub(crate) fn short() -> Settings {
    settings(|of| {
        (of.ramps, of.ramp_s, of.hold_s, of.rise_s) = (3, 0.03, 0.01, 0.005);
        (of.automatic, of.settling_s) = (true, 0.5);
    })
}

fn usual_commands() -> impl Strategy<Value = Command> {
    select(vec![
        Command::Arm,
        Command::Arm,
        Command::Measure,
        Command::Sweep,
        Command::TestCoil,
        Command::Abort,
        clear(FaultCode::Clock),
        clear(FaultCode::CoilTooHot),
        clear(FaultCode::Bridge),
    ])
}

/// A number that is finite or not, small or large, positive or negative.
fn floats() -> impl Strategy<Value = f32> {
    prop_oneof![
        select(vec![
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            0.0,
            -0.0,
            f32::MIN_POSITIVE
        ]),
        any::<f32>(),
        1e-6_f32..1.0,
        1.0_f32..100.0,
    ]
}

fn commands() -> impl Strategy<Value = Command> {
    let get = (select(Part::ALL), 0_u8..3, 0_u8..5).prop_map(|(part, sensor, channel)| {
        Command::GetCalibration(GetCalibration {
            part,
            sensor,
            channel,
        })
    });
    prop_oneof![
        select(vec![
            Command::Identify,
            Command::Disarm,
            Command::Abort,
            Command::SensingOnly,
            Command::GetSettings,
            Command::TestCoil,
            Command::SetSettings(short()),
        ]),
        (floats(), floats(), floats()).prop_map(drive_coil),
        (-9.0..9.0_f32, 0.0..0.1_f32, 0.0..0.01_f32).prop_map(drive_coil),
        select(FaultCode::ALL).prop_map(clear),
        get,
        changed_settings().prop_map(Command::SetSettings),
        calibrations(),
    ]
}

/// The short settings with one field changed, to any number or to a possible one.
fn changed_settings() -> impl Strategy<Value = Settings> {
    let fields = (0_u8..20, floats(), any::<u8>());
    fields.prop_map(|(field, value, number)| {
        let mut of = short();
        match field {
            0 => of.channels = number,
            1 => of.rate_hz = value,
            2 => of.stream = Stream::from_number(number % 5),
            3 => of.decimation = number.into(),
            4 => of.status_period_s = value,
            5 => of.contact_noise_m = value,
            6 => of.release_m = value,
            7 => of.least_press_m = value,
            8 => of.steady_m_per_s = value,
            9 => of.settling_s = value,
            10 => of.peak_current_a = value,
            11 => of.end_current_a = value,
            12 => of.rise_s = value,
            13 => of.hold_s = value,
            14 => of.ramps = number,
            15 => of.ramp_s = value,
            16 => of.drift = Drift::from_number(number % 7),
            17 => of.greatest_error = value,
            18 => of.load_points = number,
            _ => (of.greatest_temperature_c, of.greatest_energy_j) = (value, value),
        }
        of
    })
}

/// The sensor's own calibration with one number changed.
fn calibrations() -> impl Strategy<Value = Command> {
    (0_u8..12, floats(), any::<u8>()).prop_map(|(field, value, number)| {
        let sensor = Sensor::default();
        let mut coil = COIL;
        let (mut springs, mut rise) = (springs(&sensor), stiffening(&sensor));
        let (mut pull, mut crosstalk) = (attraction(&sensor), crosstalk(&sensor));
        let mut curve = curve();
        match field {
            0 => springs.sensing_uncertainty = value,
            1 => springs.zero_uncertainty_m = value,
            2 => springs.actuated_n_per_m = value,
            3 => rise.rise_at_peak = value,
            4 => rise.field_at_peak_t = value,
            5 => coil.resistance_ohm = value,
            6 => coil.copper_capacity_j_per_k = value,
            7 => pull.attraction_n_per_a2 = value,
            8 => crosstalk.apparent_m_per_a2 = value,
            9 => crosstalk.channel = number,
            10 => curve.knots[2].deformation_m = value,
            _ => curve.first = number % 8,
        }
        match field {
            0..=2 => Command::SetSprings(springs),
            3..=4 => Command::SetStiffening(rise),
            5..=6 => Command::SetCoil(coil),
            7 => Command::SetAttraction(pull),
            8..=9 => Command::SetCrosstalk(crosstalk),
            _ => Command::SetDeformationCurve(curve),
        }
    })
}

fn oddities() -> impl Strategy<Value = Oddity> {
    prop_oneof![
        prop_oneof![1_u32..30, any::<u32>()].prop_map(Oddity::Lost),
        Just(Oddity::Gap),
        (0_u8..4).prop_map(Oddity::Sensor),
        proptest::option::of(floats()).prop_map(Oddity::Current),
        floats().prop_map(|value| Oddity::Frequency(value.into())),
        floats().prop_map(Oddity::Sigma),
        (any::<u16>(), any::<u16>()).prop_map(|(msb, lsb)| Oddity::Word(msb, lsb)),
        (0_u16..0x1000, any::<u16>()).prop_map(|(msb, lsb)| Oddity::Word(msb, lsb)),
        Just(Oddity::Empty),
        Just(Oddity::Full),
        any::<u64>().prop_map(Oddity::Middle),
        any::<u64>().prop_map(Oddity::Window),
    ]
}

fn conditions() -> impl Strategy<Value = Conditions> {
    let temperatures = prop_oneof![3 => 15_f32..60.0, 1 => floats()];
    (proptest::option::of(temperatures), floats()).prop_map(|(temperature_c, other)| Conditions {
        temperature: temperature_c.map(Celsius),
        supply_v: Some(other),
        processor_load: Some(other),
        ..Conditions::default()
    })
}

fn failures() -> impl Strategy<Value = Failure> {
    let numbers = (
        proptest::option::of(floats()),
        proptest::option::of(floats()),
    );
    (select(FaultCode::ALL), select(Location::ALL), numbers).prop_map(
        |(code, location, (value, limit))| Failure {
            value,
            limit,
            ..Failure::new(code, location)
        },
    )
}

fn not_understood() -> impl Strategy<Value = FrameError> {
    let header = Header {
        boot_id: BOOT,
        sequence: 77,
        time_us: 0,
        dropped: 0,
    };
    let cause = PayloadError::Malformed;
    select(vec![
        FrameError::Checksum,
        FrameError::Header,
        FrameError::Version { found: 2 },
        FrameError::UnknownKind { header, kind: 0xEE },
        FrameError::Payload {
            header,
            kind: 0x90,
            cause,
        },
    ])
}

fn drive_coil((to_a, over_s, trace_interval_s): (f32, f32, f32)) -> Command {
    Command::DriveCoil(DriveCoil {
        to_a,
        over_s,
        trace_interval_s,
    })
}
