//! Links of the native board, byte by byte.

use palpate_procedure::Link;
use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::native::{FIRST_BOOT_ID, NativeBoard, Wiring};
use palpate_sim::switches::Switches;
use palpate_sim::world::Setup;
use palpate_wire::code::RebootTarget;
use palpate_wire::command::Reboot;
use palpate_wire::{Command, Frame, Header, Message, Record, RecordDecoder, encode};

use crate::common::{middle, world};

fn wiring() -> Wiring {
    Wiring::new(world(
        &middle("ultrasoft"),
        Switches::none(),
        Setup::default(),
    ))
}

/// Frame of a command to the first run.
fn bytes(command: &Command, sequence: u32) -> Vec<u8> {
    let header = Header {
        boot_id: FIRST_BOOT_ID,
        sequence,
        time_us: 0,
        dropped: 0,
    };
    let mut buffer = [0; Command::MAX_FRAME];
    encode(&header, command, &mut buffer).unwrap().to_vec()
}

fn run(board: &mut NativeBoard<'_>, ms: u64) {
    board.run_until(board.now() + Time::from_ms(ms)).unwrap();
}

/// Frames that a PC reads; every one must be valid.
fn frames(board: &mut NativeBoard<'_>, link: Link) -> Vec<Frame<Record>> {
    let bytes = board.read(link);
    let mut decoder = RecordDecoder::new();
    decoder.frames(&bytes).map(Result::unwrap).collect()
}

/// Numbers of the answered commands.
fn answers(frames: &[Frame<Record>]) -> Vec<u32> {
    let answers = frames.iter().filter_map(|frame| match &frame.message {
        Record::Acknowledgement(answer) => Some(answer.command),
        _ => None,
    });
    answers.collect()
}

#[test]
fn each_link_has_its_own_answers_and_the_samples_go_to_both() {
    let wiring = wiring();
    let mut board = NativeBoard::new(&wiring);
    board.write(Link::Probe, &bytes(&Command::GetSettings, 7));
    board.write(Link::Usb, &bytes(&Command::Identify, 8));
    run(&mut board, 200);
    let [probe, usb] = Link::ALL.map(|link| frames(&mut board, link));
    assert_eq!((answers(&probe), answers(&usb)), (vec![7], vec![8]));
    let samples = |frames: &[Frame<Record>]| {
        let samples = frames.iter().filter_map(|frame| match &frame.message {
            Record::Sample(sample) => Some((frame.header.time_us, sample.clone())),
            _ => None,
        });
        samples.collect::<Vec<_>>()
    };
    assert!(samples(&probe).len() > 100);
    assert_eq!(samples(&probe), samples(&usb));
    for frames in [&probe, &usb] {
        let numbers = frames.iter().map(|frame| frame.header.sequence);
        assert!(numbers.eq(0..frames.len() as u32));
    }
}

#[test]
fn half_a_frame_from_before_a_restart_spoils_nothing_after_it() {
    let wiring = wiring();
    let mut board = NativeBoard::new(&wiring);
    let target = RebootTarget::Firmware;
    let half = bytes(&Command::GetSettings, 2);
    board.write(Link::Usb, &bytes(&Command::Reboot(Reboot { target }), 1));
    board.write(Link::Usb, &half[..half.len() / 2]);
    run(&mut board, 600);
    assert_eq!(board.boot_id(), FIRST_BOOT_ID + 1);
    assert_eq!(answers(&frames(&mut board, Link::Usb)), [1]);
    board.write(Link::Usb, &bytes(&Command::Identify, 3));
    run(&mut board, 10);
    assert_eq!(answers(&frames(&mut board, Link::Usb)), [3]);
}
