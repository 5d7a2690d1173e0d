//! Equal bits on the emulated processor and on this computer: the procedure through a whole press
//! with its measurement, and the arithmetic that such a press does not reach.

use std::sync::OnceLock;

use crate::support::calibration::settings;
use crate::support::sensor::Sensor;
use crate::support::{Observed, OwnEvent, Rig};
use crate::{arithmetic, tape};
use ldc161x_sim::Settings;
use palpate_emulator::{EmulatedBoard, Image, Options, Still, Time, firmware};
use palpate_procedure::Actions;
use palpate_wire::code::{Drift, State};
use palpate_wire::{Command, Message, Record, encode};

/// Time limit, longer than any operation of the target at the ring oscillator's 52 MHz.
const PATIENCE: Time = Time::from_ms(60_000);

fn image() -> &'static Image {
    static IMAGE: OnceLock<Image> = OnceLock::new();
    IMAGE.get_or_init(|| {
        let path = firmware::build_example("on_target").unwrap_or_else(|error| panic!("{error}"));
        Image::load(&path).unwrap()
    })
}

/// The processor, with access to the image's variables.
#[derive(Clone)]
struct Target(EmulatedBoard<Still>);

impl Target {
    fn new() -> Self {
        let plant = Still::new([3e6; 4]);
        let options = Options::default();
        let mut target = Self(EmulatedBoard::new(
            image(),
            plant,
            Settings::default(),
            options,
        ));
        let answer = target.symbol("ANSWER");
        target
            .0
            .run_until(PATIENCE, |board| board.peek(answer) == tape::READY)
            .unwrap();
        target
    }

    fn symbol(&self, name: &str) -> u32 {
        self.0.image().symbol(name).expect("the image has it")
    }

    /// Sends the target an event of the procedure or the number of a function, and returns its sum.
    fn tell(&mut self, words: &[u32]) -> u32 {
        let (mailbox, answer) = (self.symbol("MAILBOX"), self.symbol("ANSWER"));
        for (location, word) in (1..).zip(words) {
            self.0.poke(mailbox + 4 * location, *word);
        }
        self.0.poke(mailbox, words.len() as u32);
        self.0
            .run_until(PATIENCE, |board| board.peek(mailbox) == 0)
            .unwrap();
        self.0.peek(answer)
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn every_function_has_the_same_bits() {
    let mut target = Target::new();
    let different: Vec<&str> = (0..)
        .zip(arithmetic::CHECKS)
        .filter(|(number, (_, check))| arithmetic::sum(*check) != target.tell(&[*number]))
        .map(|(_, (name, _))| name)
        .collect();
    assert!(different.is_empty(), "{different:?}");
}

fn split(time: u64) -> [u32; 2] {
    [time as u32, (time >> 32) as u32]
}

fn number(number: Option<f32>) -> [u32; 2] {
    [
        number.is_some().into(),
        number.unwrap_or_default().to_bits(),
    ]
}

/// An event, encoded in the words that the target reads.
fn words(observed: &Observed) -> Vec<u32> {
    let mut words = split(observed.now_us).to_vec();
    match &observed.event {
        OwnEvent::Tick => words.push(tape::TICK),
        OwnEvent::Scan(scan) => {
            let reading = &scan.conversions[0].reading;
            words.push(tape::SCAN);
            words.extend(split(scan.middle.as_ticks()));
            words.extend([scan.window.as_ticks() as u32, scan.lost, scan.gap.into()]);
            words.extend(number(scan.current.map(|current| current.0)));
            words.push(reading.word.bits());
            words.extend(split(reading.frequency_hz.to_bits()));
            words.push(reading.sigma_hz.to_bits());
        }
        OwnEvent::Command(frame) => {
            let mut buffer = [0; Command::MAX_FRAME];
            let bytes = encode(&frame.header, &frame.message, &mut buffer).unwrap();
            words.push(tape::COMMAND);
            words.extend(bytes.iter().map(|&byte| u32::from(byte)));
        }
        OwnEvent::Conditions(conditions) => {
            words.push(tape::CONDITIONS);
            words.extend(number(conditions.temperature.map(|it| it.0)));
            words.extend(number(conditions.supply_v));
        }
        OwnEvent::CoilTested(found) => {
            words.push(tape::COIL_TESTED);
            let numbers = [
                found.resistance_ohm,
                found.inductance_h,
                found.lost,
                found.zero_v,
                found.supply_v,
            ];
            words.extend(numbers.map(f32::to_bits));
            words.extend(number(found.limited_to_a));
        }
        OwnEvent::Other => unreachable!("no such event in these presses"),
    }
    words
}

/// A recorded press of a disturbed sensor with its measurement.
fn recorded(drift: Drift) -> Vec<Observed> {
    let sensor = Sensor {
        attraction_n_per_a2: 3e-4,
        crosstalk_m_per_a2: 2e-8,
        crosstalk_growth_per_m: 200.0,
        noise_m: 20e-9,
        stated: 4e-6,
        ..Sensor::default()
    };
    let mut rig = Rig::started_as(tape::board());
    rig.tape = Some(Vec::new());
    rig.sensor = sensor.clone();
    rig.temperature(25.0);
    rig.accepted(Command::SetSettings(settings(|of| of.drift = drift)));
    for command in crate::support::calibration::calibration(&sensor) {
        rig.accepted(command);
    }
    rig.accepted(Command::Arm);
    rig.until(State::Watching, 60_000);
    rig.touch(3e-4);
    rig.temperature(27.5);
    rig.measure();
    rig.run(20);
    rig.tape.unwrap()
}

fn has_estimate(actions: &Actions) -> bool {
    actions.iter().any(|action| {
        matches!(
            action,
            palpate_procedure::Action::Record {
                record: Record::Estimate(_),
                ..
            }
        )
    })
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn the_procedure_gives_the_same_bits_through_a_whole_press() {
    let ready = Target::new();
    for drift in [Drift::Logarithmic, Drift::SawTooth] {
        let tape = recorded(drift);
        assert!(tape.iter().any(|observed| has_estimate(&observed.actions)));
        let mut target = ready.clone();
        for (location, observed) in tape.iter().enumerate() {
            let there = target.tell(&words(observed));
            let here = tape::sum(&observed.actions);
            assert_eq!(
                there,
                here,
                "{drift}: step {location} of {}: {:?}",
                tape.len(),
                observed.actions
            );
        }
        println!("{drift}: {} steps", tape.len());
    }
}

/// A single different bit in the tape changes the sums.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_single_bit_is_seen() {
    let mut target = Target::new();
    let mut tape = recorded(Drift::Logarithmic);
    let location = tape
        .iter()
        .position(|observed| matches!(observed.event, OwnEvent::Scan(_)))
        .unwrap();
    for observed in &tape[..location] {
        assert_eq!(target.tell(&words(observed)), tape::sum(&observed.actions));
    }
    let OwnEvent::Scan(scan) = &mut tape[location].event else {
        unreachable!();
    };
    let reading = &mut scan.conversions[0].reading;
    reading.frequency_hz = f64::from_bits(reading.frequency_hz.to_bits() + (1 << 29));
    assert_ne!(
        target.tell(&words(&tape[location])),
        tape::sum(&tape[location].actions)
    );
}
