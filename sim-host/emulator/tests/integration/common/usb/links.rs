//! Two PCs at once, and one that sends garbage.

use palpate_emulator::Time;
use palpate_procedure::Link;
use palpate_wire::Command;
use palpate_wire::code::Outcome;

use super::super::driven::drive;
use super::{Chance, UsbBench, missing, streams};

/// Time for which a current flows after its commanding link has fallen silent, while the other link
/// sends a command every 10 ms.
pub(crate) fn silent_link(bench: &mut UsbBench, by: Link) -> Option<Time> {
    bench.arm();
    let line = drive(3.0, 0.0);
    let outcome = match by {
        Link::Usb => bench.command(&line),
        Link::Probe => bench.probe.command(&line).outcome,
    };
    assert_eq!(outcome, Outcome::Accepted);
    let since = bench.probe.board.now();
    while bench.probe.board.now() - since < Time::from_ms(500) {
        if (bench.probe.board.now() - since).as_ps() % 10_000_000_000 < 500_000_000 {
            match by {
                Link::Usb => bench.probe.send(&Command::GetSettings),
                Link::Probe => {
                    bench.send(&Command::GetSettings);
                }
            }
        }
        bench.run(Time::from_us(500));
        if !bench.probe.board.bridge().awake {
            return Some(bench.probe.board.now() - since);
        }
    }
    None
}

/// Results of a flood of garbage.
#[derive(Clone, Debug, Default)]
pub(crate) struct FloodFindings {
    pub(crate) bytes: usize,
    pub(crate) took: Time,
    pub(crate) commands: u32,
    pub(crate) answered: u32,
    pub(crate) slowest_answer: Time,
    pub(crate) scans: u32,
    pub(crate) scans_lost: u32,
    pub(crate) missing: (u64, u64),
    pub(crate) restarts: u32,
}

/// Sends random bytes as fast as the bus takes them, with regular commands in between.
pub(crate) fn flood(bench: &mut UsbBench, bytes: usize, seed: u64) -> FloodFindings {
    /// Number of bytes between two commands.
    const APART: usize = 8_192;
    let mut chance = Chance::new(seed);
    let before = bench.status();
    streams::begin(bench);
    let begin = bench.probe.board.now();
    let mut found = FloodFindings::default();
    while found.bytes < bytes {
        let length = APART.min(bytes - found.bytes);
        let rubbish: Vec<u8> = (0..length).map(|_| chance.word() as u8).collect();
        bench.probe.board.usb_mut().write(&rubbish);
        // A zero ends the invalid frame.
        bench.probe.board.usb_mut().write(&[0]);
        found.bytes += length + 1;
        let from = bench.port.frames.len();
        let number = bench.send(&Command::GetSettings);
        found.commands += 1;
        bench
            .until(Time::from_ms(2_000), |bench| {
                bench.probe.board.usb().unwritten() == 0
            })
            .expect("the device takes the bytes");
        let is_answered = |bench: &mut UsbBench| bench.answer(from, number).is_some();
        if let Some(took) = bench.until(Time::from_ms(100), is_answered) {
            found.answered += 1;
            found.slowest_answer = found.slowest_answer.max(took);
        }
    }
    found.took = bench.probe.board.now() - begin;
    found.missing = missing(&bench.port.tally());
    let after = bench.status();
    found.scans = after.conversions - before.conversions;
    found.scans_lost = after.conversions_lost - before.conversions_lost;
    found.restarts = bench.probe.board.resets().watchdog;
    found
}
