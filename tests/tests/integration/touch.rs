//! Touches by the image on the emulated board, with an array calibrated on the simulated sensor.

use std::sync::OnceLock;

use ldc161x_sim::{Sensors, Settings as ChipSettings};
use palpate_calibration::touch::{
    ArrayCalibration, Bench, DeclaredIndenter, Design, KnownPress, Scales, Tip, calibrate,
};
use palpate_calibration::touch::{CommonError, Layer as BondedLayer};
use palpate_emulator::{EmulatedBoard, Image, Options, Plant, SecondSensors, Time, firmware};
use palpate_sim::replay::{ActiveConfiguration, Replay};
use palpate_sim::touch::{
    Demand, Indenter, Layer, Layout, Press, Surroundings, Timeline, TouchSensor,
};
use palpate_wire::code::{Outcome, StorageState, TouchVerdict};
use palpate_wire::command::Settings;
use palpate_wire::record::{Hello, Touch};
use palpate_wire::{Command, Frame, Header, Message, Record, RecordDecoder, encode};

const LAYER: Layer = Layer {
    thickness_m: 5e-3,
    shear_modulus_pa: 20e3,
    poisson: 0.5,
};
/// Noise of a reading at these rates, as relative change of inductance. A period of 40 MHz is 3e-5 of a
/// conversion of 0.8 ms. Rounding to whole periods at both ends makes 1/√6 of that in the frequency, and
/// twice as much, 2.5e-5, in the inductance.
const NOISE: f64 = 3e-5;
/// The test's press: from 1.2 s on, for two seconds, 1 mm to either side of a place.
const BEGIN_S: f64 = 1.2;
const LENGTH_S: f64 = 2.0;

fn image() -> &'static Image {
    static IMAGE: OnceLock<Image> = OnceLock::new();
    IMAGE.get_or_init(|| {
        let path = firmware::build().unwrap_or_else(|error| panic!("{error}"));
        Image::load(&path).unwrap()
    })
}

/// Calibration of a sensor by 40 presses with pins and balls, without errors of the bench.
fn calibrated(sensor: &TouchSensor, reach_m: f64) -> ArrayCalibration {
    let coils = &sensor.parameters().coils;
    let design = Design {
        coils_m: coils.iter().map(|coil| coil.coil.centre_m).collect(),
        place_tolerance_m: 0.3e-3,
        gain_tolerance: 0.15,
        noise: NOISE,
        scales: Scales {
            spacing_m: 2e-3,
            radii_m: [1e-3, 5e-3],
        },
        reach_m,
        radius_in_use: 0.46,
        bench: Bench {
            place_m: 0.02e-3,
            force: 3e-3,
            radius: 0.02,
            common: CommonError::default(),
        },
    };
    let layer = BondedLayer {
        thickness_m: sensor.parameters().layer.thickness_m,
        shear_modulus_pa: sensor.parameters().layer.shear_modulus_pa,
    };
    let tips = [
        Tip::Pin(1.5e-3),
        Tip::Ball(6e-3),
        Tip::Pin(3e-3),
        Tip::Ball(10e-3),
    ];
    let at_rest = |coil| sensor.inductance_at_rest_h(coil).unwrap();
    let mut presses = Vec::new();
    for (number, tip) in tips.iter().enumerate() {
        let indenter = match *tip {
            Tip::Pin(radius_m) => Indenter::Pin { radius_m },
            Tip::Ball(radius_m) => Indenter::Ball { radius_m },
        };
        let pressing = sensor.pressed_by(&indenter, [0.0; 2], 0);
        for hole in (number..40).step_by(4) {
            let share = (hole as f64 + 0.5) / 40.0;
            let (r, angle) = ((reach_m + 2e-3) * share.sqrt(), 2.399_963 * hole as f64);
            let place_m = [r * angle.cos(), r * angle.sin()];
            // About the depth of the press that is judged.
            let demand = Demand::Depth(0.15e-3 + 0.25e-3 * (7.0 * share).fract());
            let press = Press { place_m, demand };
            let mut one = pressing.again(hole as u64);
            let (inductances_h, truth) = one.inductances_h(0.0, &press, &Surroundings::default());
            let change = |(coil, h): (usize, &f64)| h / at_rest(coil) - 1.0;
            presses.push(KnownPress {
                place_m,
                force_n: truth.force_n,
                radius_m: tip.contact_radius_m(&layer, truth.force_n),
                readings: inductances_h.iter().enumerate().map(change).collect(),
            });
        }
    }
    calibrate(&design, &presses).unwrap()
}

/// Coils as the first converter's sensors. A channel without a coil has a fixed resonator, so that it
/// oscillates.
#[derive(Clone)]
struct Coils(Timeline);

impl Sensors for Coils {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        // Six times the capacitance of the drawn sensor: within the 2 to 5 MHz of the board.
        let coil_hz = 0.4 * self.0.frequency_hz(channel, time_s);
        if coil_hz > 0.0 { coil_hz } else { 3e6 }
    }
}

impl Plant for Coils {
    fn advance_to(&mut self, _: Time) {}

    fn set_current(&mut self, _: f64, _: f64) {}
}

/// A board with a PC on its debug channels.
struct Desk {
    board: EmulatedBoard<Coils>,
    frames: Vec<Frame<Record>>,
    decoder: RecordDecoder,
    sequence: u32,
}

impl Desk {
    fn of(board: EmulatedBoard<Coils>) -> Self {
        let mut bench = Self {
            board,
            frames: Vec::new(),
            decoder: RecordDecoder::new(),
            sequence: 0,
        };
        bench.run(400);
        bench
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..ms {
            let run = self.board.run_for(Time::from_ms(1));
            run.unwrap_or_else(|stop| panic!("at {}: {stop}", self.board.now()));
            let bytes = self.board.read_channel(1);
            let frames = self.decoder.frames(&bytes);
            self.frames
                .extend(frames.map(|frame| frame.expect("whole frames")));
        }
    }

    fn send(&mut self, command: &Command) -> Outcome {
        self.sequence += 1;
        let header = Header {
            boot_id: self.frames.last().unwrap().header.boot_id,
            sequence: self.sequence,
            time_us: 0,
            dropped: 0,
        };
        let mut buffer = [0; Command::MAX_FRAME];
        let bytes = encode(&header, command, &mut buffer).unwrap();
        self.board.write_channel(0, bytes);
        for _ in 0..100 {
            self.run(1);
            let answer = self.records().find_map(|record| match record {
                Record::Acknowledgement(of) if of.command == header.sequence => Some(of.outcome),
                _ => None,
            });
            if let Some(outcome) = answer {
                return outcome;
            }
        }
        panic!("{command:?} is not answered");
    }

    fn accepted(&mut self, command: &Command) {
        assert_eq!(self.send(command), Outcome::Accepted, "{command:?}");
    }

    fn records(&self) -> impl Iterator<Item = &Record> {
        self.frames.iter().map(|frame| &frame.message)
    }

    fn touches(&self) -> Vec<(u64, Touch)> {
        let touch = |frame: &Frame<Record>| match &frame.message {
            Record::Touch(touch) => Some((frame.header.time_us, touch.clone())),
            _ => None,
        };
        self.frames.iter().filter_map(touch).collect()
    }

    fn hello(&self) -> Hello {
        let hello = |record: &Record| match record {
            Record::Hello(hello) => Some(hello.clone()),
            _ => None,
        };
        self.records().find_map(hello).unwrap()
    }

    /// Greatest depth of the stack.
    fn stack_bytes(&self) -> u32 {
        let depths = self.records().filter_map(|record| match record {
            Record::Status(status) => Some(status.stack_bytes),
            _ => None,
        });
        depths.max().unwrap_or_default()
    }

    /// Greatest load of the processor, over a tenth of a second.
    fn load(&self) -> f32 {
        let loads = self.records().filter_map(|record| match record {
            Record::Status(status) => status.processor_load,
            _ => None,
        });
        loads.fold(0.0, f32::max)
    }
}

fn settings(rate_hz: f32) -> Settings {
    Settings {
        channels: 0b1111,
        rate_hz,
        status_period_s: 0.1,
        ..palpate_procedure::configuration::DEFAULT_SETTINGS
    }
}

/// Place of the press at a time, m.
fn place_m(time_s: f64) -> [f64; 2] {
    let part = ((time_s - BEGIN_S) / LENGTH_S).clamp(0.0, 1.0);
    [2e-3 * part - 1e-3, 0.5e-3]
}

struct Case {
    layout: Layout,
    reach_m: f64,
    rate_hz: f32,
    channels: u8,
    indenter: Option<DeclaredIndenter>,
}

impl Case {
    fn four() -> Self {
        Self {
            layout: Layout::three_around_one(),
            reach_m: 2.8e-3,
            rate_hz: 250.0,
            channels: 0b1111,
            // The ball of 10 mm by Hertz, wider than on this layer.
            indenter: Some(DeclaredIndenter {
                radius_m: 4.3e-3,
                exponent: 1.0 / 3.0,
                uncertainty: 0.1,
            }),
        }
    }

    fn seven() -> Self {
        Self {
            layout: Layout::seven(),
            reach_m: 5.6e-3,
            rate_hz: 140.0,
            channels: 0b111_1111,
            indenter: None,
        }
    }

    /// A board with the press, and the commands that set its array.
    fn board(&self) -> (EmulatedBoard<Coils>, Vec<Command>) {
        let sensor = TouchSensor::draw(&self.layout, &LAYER, 7).unwrap();
        let calibration = calibrated(&sensor, self.reach_m);
        let commands = calibration.commands(self.channels, self.indenter);
        let ball = Indenter::Ball { radius_m: 10e-3 };
        let path = |time_s: f64| {
            let is_down = (BEGIN_S..BEGIN_S + LENGTH_S).contains(&time_s);
            // Down within a fifth of a second.
            let depth_m = 0.4e-3 * (5.0 * (time_s - BEGIN_S)).min(1.0);
            Press {
                place_m: place_m(time_s),
                demand: Demand::Depth(if is_down { depth_m } else { -1e-3 }),
            }
        };
        let steps = (0.0, 4e-3, 950);
        let mut pressing = sensor.pressed_by(&ball, [0.0; 2], 1);
        let timeline = Timeline::record(&mut pressing, steps, path, &Surroundings::default());
        let is_two = self.channels >> 4 != 0;
        let second = Coils(timeline.second_converter());
        let options = Options {
            second_converter: is_two.then(|| SecondSensors::new(second)),
            ..Options::default()
        };
        let chip = ChipSettings::default();
        let board = EmulatedBoard::new(image(), Coils(timeline), chip, options);
        (board, commands)
    }
}

/// Runs a press, and prints and checks what the board sends.
fn press(case: &Case) {
    let (board, commands) = case.board();
    let mut bench = Desk::of(board);
    bench.accepted(&Command::SetSettings(settings(case.rate_hz)));
    bench.run(200);
    let (without, stack_without) = (bench.load(), bench.stack_bytes());
    for command in &commands {
        bench.accepted(command);
    }
    let begun = bench.board.now();
    bench.run(3_400);
    let passed_s = (bench.board.now() - begun).as_secs_f64();

    let touches = bench.touches();
    let expected = f64::from(case.rate_hz) * passed_s;
    assert!(
        (touches.len() as f64 - expected).abs() < 3.0,
        "{} of {expected}",
        touches.len()
    );
    for record in bench.records() {
        match record {
            Record::Sample(sample) => assert_eq!(sample.missed, 0),
            Record::Fault(fault) => panic!("{fault:?}"),
            _ => {}
        }
    }
    let of = |wanted: TouchVerdict| touches.iter().filter(|of| of.1.verdict == wanted).count();
    let claimed: Vec<_> = touches.iter().filter(|of| of.1.x_m.is_some()).collect();
    let is_down = |at_us: u64| {
        // From the end of the approach to the end of the press.
        (BEGIN_S + 0.2..BEGIN_S + LENGTH_S).contains(&(at_us as f64 * 1e-6))
    };
    let down: Vec<_> = claimed.iter().filter(|of| is_down(of.0)).collect();
    // Distance from the true place in standard errors of its direction.
    let sigmas = down.iter().map(|(at_us, touch)| {
        let [x, y] = place_m(*at_us as f64 * 1e-6);
        let error = |found: Option<f32>, truth: f64, sigma: Option<f32>| {
            (f64::from(found.unwrap()) - truth) / f64::from(sigma.unwrap())
        };
        error(touch.x_m, x, touch.x_sigma_m).hypot(error(touch.y_m, y, touch.y_sigma_m))
    });
    let worst = sigmas.fold(0.0, f64::max);
    println!(
        "{} coils: load {without:.3} without an array, {:.3} at most; of {} touches {} settling, {} clear, {} claimed; \
         place at most {worst:.1} standard errors off; stack {stack_without} and {} bytes",
        case.channels.count_ones(),
        bench.load(),
        touches.len(),
        of(TouchVerdict::Settling),
        of(TouchVerdict::Clear),
        claimed.len(),
        bench.stack_bytes()
    );
    let expected = f64::from(case.rate_hz) * (LENGTH_S - 0.2);
    assert!(
        down.len() as f64 > 0.95 * expected,
        "{} of {expected}",
        down.len()
    );
    assert!(worst < 4.0, "{worst}");
    assert!(bench.load() <= 0.6, "{}", bench.load());

    let mut replay = Replay::default();
    let configuration = ActiveConfiguration {
        hello: bench.hello(),
        settings: settings(case.rate_hz),
        calibration: commands,
    };
    let boot_id = bench.frames[0].header.boot_id;
    replay.configure(boot_id, configuration);
    let mut compared: Vec<_> = bench.frames.iter().flat_map(|of| replay.take(of)).collect();
    compared.extend(replay.finish());
    compared.retain(|of| matches!(of.frame.message, Record::Touch(_)));
    let same = compared
        .iter()
        .filter(|of| of.is_identical() == Some(true))
        .count();
    let different = compared.iter().find(|of| of.is_identical() == Some(false));
    assert!(different.is_none(), "{different:?}");
    println!(
        "replayed: {same} of {} touches, all the same",
        touches.len()
    );
    assert!(same + 10 > touches.len(), "{same} of {}", touches.len());
}

#[test]
fn four_coils_send_touches_at_250_scans_a_second_with_the_bits_of_a_pc() {
    press(&Case::four());
}

#[test]
fn seven_coils_send_touches_at_140_scans_a_second_with_the_bits_of_a_pc() {
    press(&Case::seven());
}

/// Old or new after a cut of the power at many times of a save; the touches go on afterwards.
#[test]
fn a_power_cut_while_an_array_is_stored_leaves_the_old_or_the_new_one() {
    let (board, commands) = Case::four().board();
    let mut desk = Desk::of(board);
    let crc = |desk: &mut Desk| {
        desk.accepted(&Command::GetStorage);
        desk.records()
            .filter_map(|record| match record {
                Record::Storage(of) => Some((of.state, of.stored_crc, of.in_force_crc)),
                _ => None,
            })
            .last()
            .unwrap()
    };
    desk.accepted(&Command::SetSettings(settings(250.0)));
    desk.accepted(&Command::Store);
    desk.run(2_000);
    let (state, old, _) = crc(&mut desk);
    assert_eq!(state, StorageState::Whole);
    commands.iter().for_each(|of| desk.accepted(of));
    let (_, _, new) = crc(&mut desk);
    let mut seen = [0, 0];
    for cut_ms in (0..=200).step_by(25) {
        let mut cut = Desk {
            board: desk.board.clone(),
            frames: desk.frames.clone(),
            decoder: RecordDecoder::new(),
            sequence: desk.sequence,
        };
        cut.accepted(&Command::Store);
        // A command that reads the array back while flash is erased.
        cut.send(&Command::Identify);
        cut.run(cut_ms);
        cut.board.cycle_power();
        cut.frames.clear();
        cut.decoder = RecordDecoder::new();
        cut.run(700);
        let (state, stored, in_force) = crc(&mut cut);
        assert_eq!(
            (state, stored),
            (StorageState::Whole, in_force),
            "{cut_ms} ms"
        );
        let is_new = stored == new;
        assert!(is_new || stored == old, "{cut_ms} ms");
        assert_eq!(cut.touches().is_empty(), !is_new, "{cut_ms} ms");
        seen[usize::from(is_new)] += 1;
    }
    println!("old, new: {seen:?}");
    assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
}
