//! Unplugged cables and rebooted boards.

use palpate_emulator::Time;
use palpate_emulator::usb::{ControlOutcome, ControlTransfer};
use palpate_wire::Command;
use palpate_wire::code::RebootTarget;
use palpate_wire::command::Reboot;

use super::descriptors::RESET_INTERFACE;
use super::{ENUMERATION, START, UsbBench};

/// Unplugs the cable and plugs it in again after a time; returns the time until the port was open.
pub(crate) fn replug(bench: &mut UsbBench, away: Time) -> Time {
    bench.probe.board.usb_mut().unplug();
    bench.run(away);
    bench.probe.board.usb_mut().plug();
    bench.until_open(ENUMERATION)
}

/// Reboots the board by a command over USB; returns the time until the port was open again, and the
/// boot ids of both runs.
pub(crate) fn reboot(bench: &mut UsbBench) -> (Time, [u32; 2]) {
    let boot_id = |bench: &UsbBench| bench.port.frames.last().map_or(0, |it| it.header.boot_id);
    let before = boot_id(bench);
    let resets = bench.probe.board.resets().watchdog;
    let target = RebootTarget::Firmware;
    bench.send(&Command::Reboot(Reboot { target }));
    let is_reset = |bench: &mut UsbBench| bench.probe.board.resets().watchdog > resets;
    bench
        .until(Time::from_ms(400), is_reset)
        .expect("the board starts anew");
    let took = bench.until_open(START);
    (took, [before, boot_id(bench)])
}

/// Result of a request to restart.
#[derive(Clone, Debug)]
pub(crate) struct Restart {
    pub(crate) outcome: Option<ControlOutcome>,
    /// Time from the request until the bridge is off; `None` if it was off already.
    pub(crate) off: Option<Time>,
    /// Whether the bridge went off before the board was reset.
    pub(crate) off_first: bool,
    /// Time from the request to the reset.
    pub(crate) reset: Time,
    pub(crate) in_boot_loader: bool,
}

/// Sends picotool's requests (pico-sdk, `pico/usb_reset_interface.h`): 1 for the boot loader, 2 for
/// the firmware.
pub(crate) fn ask_for_restart(bench: &mut UsbBench, request: u8, value: u16) -> Restart {
    let [low, high] = value.to_le_bytes();
    let setup = [0x21, request, low, high, RESET_INTERFACE, 0, 0, 0];
    let resets = bench.probe.board.resets().watchdog;
    let was_on = bench.probe.board.bridge().awake;
    let begin = bench.probe.board.now();
    let id = bench.submit(ControlTransfer::new(setup));
    let board = &mut bench.probe.board;
    let is_reset = |board: &palpate_emulator::EmulatedBoard<_>| {
        board.resets().watchdog > resets || board.is_in_boot_loader()
    };
    board
        .run_until(Time::from_ms(200), |board| !board.bridge().awake)
        .expect("the bridge goes off");
    let off = was_on.then(|| board.now() - begin);
    let off_first = !is_reset(board);
    board
        .run_until(Time::from_ms(400), is_reset)
        .expect("the board is reset");
    let reset = board.now() - begin;
    let results = board.usb_mut().take_results();
    let outcome = results.into_iter().find(|(of, _)| *of == id);
    Restart {
        outcome: outcome.map(|(_, outcome)| outcome),
        off,
        off_first,
        reset,
        in_boot_loader: board.is_in_boot_loader(),
    }
}
