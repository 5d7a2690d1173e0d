//! The image at a USB host.

use ldc161x_sim::Settings;
use palpate_emulator::{EmulatedBoard, Still, Time};

use crate::common::{FREQUENCIES_HZ, image, recording};

#[test]
fn a_pc_finds_the_device() {
    let mut board = EmulatedBoard::new(
        image(),
        Still::new(FREQUENCIES_HZ),
        Settings::default(),
        recording(),
    );
    board.usb_mut().plug();
    board.usb_mut().enumerate();
    for ms in 0..600 {
        if let Err(stop) = board.run_for(Time::from_ms(1)) {
            panic!("{ms} ms: {stop} {:08x}", board.pc());
        }
    }
    println!("{:?}", board.usb().state());
    println!("{:?}", board.usb().enumerated());
    println!("{:?}", board.usb_mut().read().len());
}
