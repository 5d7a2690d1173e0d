use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::parameters::draw;
use palpate_sim::replay::{ActiveConfiguration, Replay};
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_simulate::instrument::SPEED_M_PER_S;
use palpate_simulate::press::automatic;
use palpate_wire::{Command, Frame, Record};

use super::agreement::Agreement;

/// Calibration of the sensor of seed 11 from its own bench, with settings.
const CALIBRATION: &str = include_str!("../../../tests/fixture/ultrasoft-11.jsonl");

/// Duration of a press after its estimate.
const HELD: Time = Time::from_ms(5_000);

/// Frames of a native board during two measured presses, with its configuration in force.
fn pressed() -> (Vec<Frame<Record>>, ActiveConfiguration) {
    let stack = Stack::builtin("ultrasoft").unwrap();
    let plant = draw(&stack, &Disturbances::builtin().unwrap(), 11);
    let setup = Setup {
        load: Load::Spring { n_per_m: 8e3 },
        profile: Profile::at(-0.2e-3),
        ..Setup::default()
    };
    let wiring = Wiring::new(World::new(&plant, Switches::all(), setup).unwrap());
    let mut board = NativeBoard::new(&wiring);
    let commands = CALIBRATION
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    let mut commands: Vec<Command> = commands.map(|command| automatic(&command)).collect();
    for command in &commands {
        board.send(command.clone()).unwrap();
    }
    board.send(Command::Arm).unwrap();
    board.run_until(Time::from_ms(800)).unwrap();
    let ends = |record: &Record| matches!(record, Record::Estimate(_));
    for _ in 0..2 {
        board.with_world(|world| {
            let position_m = world.press_for_depth_m(plant.press.depth_m);
            world.move_press(position_m, SPEED_M_PER_S);
        });
        let latest = board.now() + Time::from_ms(10_000);
        assert!(board.run_to(latest, ends).unwrap());
        board.run_until(board.now() + HELD).unwrap();
        board.with_world(|world| world.move_press(-0.2e-3, SPEED_M_PER_S));
        // The sensor has not recovered when it is pressed again.
        board.run_until(board.now() + Time::from_ms(1_300)).unwrap();
    }
    let frames = board.take_frames();
    let hello = frames.iter().find_map(|frame| match &frame.message {
        Record::Hello(hello) => Some(hello.clone()),
        _ => None,
    });
    let Command::SetSettings(settings) = commands.remove(0) else {
        panic!("the settings come first");
    };
    let active_configuration = ActiveConfiguration {
        hello: hello.unwrap(),
        settings,
        calibration: commands,
    };
    (frames, active_configuration)
}

fn compared(frames: &[Frame<Record>], active_configuration: &ActiveConfiguration) -> Agreement {
    let mut replay = Replay::default();
    replay.configure(frames[0].header.boot_id, active_configuration.clone());
    let mut agreement = Agreement::default();
    for frame in frames {
        agreement.enter(&replay.take(frame));
    }
    agreement.enter(&replay.finish());
    agreement
}

#[test]
fn a_replay_is_the_same_to_the_bit_and_shows_what_was_changed() {
    let (frames, active_configuration) = pressed();
    let agreement = compared(&frames, &active_configuration);
    assert_eq!(agreement.first_difference(), None);
    let samples = agreement.count("sample");
    assert!(samples.replayed > 2_000, "{samples:?}");
    assert_eq!(agreement.count("estimate").identical, 2);
    assert_eq!(agreement.count("load_point").identical, 16);

    // The rest is about the first press.
    let estimate = |frame: &Frame<Record>| matches!(frame.message, Record::Estimate(_));
    let end = frames.iter().position(estimate).unwrap();
    let frames = &frames[..end + 100];
    // Changes one bit of each conversion in a ramp, then one bit of the calibration.
    let mut other = frames.to_vec();
    let mut changed = Vec::new();
    for frame in &mut other[end - 200..end - 100] {
        if let Record::Sample(sample) = &mut frame.message {
            sample.channels[0].word ^= 0x10;
            changed.push(frame.header.sequence);
        }
    }
    let agreement = compared(&other, &active_configuration);
    let first = agreement.first_difference().unwrap();
    assert_eq!(first.sequence, changed[0]);
    assert_eq!(first.field, "channels.0.deformation_m");
    assert_eq!(agreement.count("estimate").identical, 0);

    let mut other = active_configuration.clone();
    for command in &mut other.calibration {
        if let Command::SetSprings(springs) = command {
            springs.sensing_n_per_m = f32::from_bits(springs.sensing_n_per_m.to_bits() + 1);
        }
    }
    let agreement = compared(frames, &other);
    let field = &agreement.first_difference().unwrap().field;
    assert!(field.starts_with("force"), "{field}");

    // Without one sample the replay waits for the next possible start and reports no difference.
    let mut fewer = frames.to_vec();
    fewer.remove(end - 300);
    let agreement = compared(&fewer, &active_configuration);
    assert_eq!(agreement.first_difference(), None);
    assert_eq!(agreement.count("estimate").passed_over, 1);
}
