//! Random control transfers while the coil is driven.

use palpate_emulator::usb::{ControlOutcome, ControlTransfer, TransferId, UsbState};
use palpate_emulator::{LevelTimes, Time};
use palpate_wire::Command;

use super::descriptors::RESET_INTERFACE;
use super::{Chance, UsbBench};

/// Duration after which a transfer counts as hanging. The firmware handles a stage when the
/// instrument's task pauses, within 4 ms.
const HANGS: Time = Time::from_ms(100);
/// Time after which the host gives up a transfer in which it sends less than it announced: the
/// device waits for the rest, as required.
const CUT_SHORT: Time = Time::from_ms(8);
/// Time for which packets of an abandoned transfer may remain: until the instrument's task pauses,
/// plus the next transfer.
const LEFT_OVER: Time = Time::from_ms(5);
/// One in `RESETS` transfers ends early by a bus reset, one in `OVERTAKEN` by the next setup packet.
const RESETS: u32 = 100;
const OVERTAKEN: u32 = 10;
/// Number of transfers between two enumerations.
const BATCH: u32 = 100;

/// bRequest of the standard requests (USB 2.0 table 9-4), and neighbouring values.
const STANDARD: std::ops::RangeInclusive<u8> = 0..=13;
/// Requests of CDC (CDC 1.2 table 19, PSTN 1.2 table 13) and neighbouring values.
const CDC: [u8; 8] = [0x00, 0x01, 0x02, 0x20, 0x21, 0x22, 0x23, 0x24];
/// Requests of the reset interface, which reboot the board and are therefore left out.
const RESTARTS: [u8; 2] = [1, 2];
/// Lengths at the limits of a device with packets of 64 bytes, a control buffer of 128, and
/// descriptors of 18 and 84 bytes.
const LENGTHS: [u16; 20] = [
    0, 1, 2, 7, 8, 9, 18, 63, 64, 65, 84, 85, 127, 128, 129, 192, 255, 256, 512, 0xFFFF,
];
/// Most bytes that the host sends in a transfer; it may announce more.
const MOST_SENT: usize = 512;

const DEVICE_DESCRIPTOR: [u8; 4] = [0x80, 6, 0, 1];

/// Counts of the transfers by outcome.
#[derive(Clone, Debug, Default)]
pub(crate) struct ControlFindings {
    pub(crate) done: u32,
    pub(crate) stalled: u32,
    /// Cancelled by a bus reset.
    pub(crate) cancelled: u32,
    /// Replaced by the next setup packet.
    pub(crate) overtaken: u32,
    /// Given up by the host, which had sent less than it announced.
    pub(crate) cut_short: u32,
    /// Transfers that received leftovers of a transfer that the host had given up: a packet that
    /// waits on endpoint 0 is sent until the processor has read the setup packet.
    pub(crate) spoiled: u32,
    /// Uninterrupted transfers that ended with neither data nor a stall. They count whatever the
    /// host did before.
    pub(crate) hung: Vec<(ControlTransfer, ControlOutcome)>,
    /// Number of wrong or refused device descriptors.
    pub(crate) wrong: u32,
    /// Longest duration of a transfer that ended with success or a stall.
    pub(crate) longest: Time,
    pub(crate) levels: LevelTimes,
    /// Worst delay from an edge of INTB to START.
    pub(crate) edge_to_start: Time,
    pub(crate) enumerations: u32,
}

/// Intended end of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    ByItself,
    /// The next setup packet replaces the transfer.
    Overtaken,
    /// The bus is reset after this time.
    Reset(Time),
}

/// Runs random control transfers, while the coil runs its train as often as allowed.
pub(crate) fn disturb_control(bench: &mut UsbBench, count: u32, seed: u64) -> ControlFindings {
    let mut chance = Chance::new(seed);
    let mut found = ControlFindings::default();
    let edges = bench
        .probe
        .board
        .wire_log()
        .map_or(0, |it| it.edge_to_start.len());
    bench.arm();
    let mut given_up = None;
    for number in 0..count {
        if number.is_multiple_of(BATCH) {
            enumerate(bench, &mut found);
            given_up = None;
            drive(bench, &mut found);
        }
        let ending = match chance.below(RESETS) {
            0 => Ending::Reset(Time::from_us(chance.below(150).into())),
            _ if chance.below(OVERTAKEN) == 0 => Ending::Overtaken,
            _ => Ending::ByItself,
        };
        let transfer = draw(&mut chance);
        let now = bench.probe.board.now();
        let may_get_left = given_up.is_some_and(|at| now - at < LEFT_OVER);
        if one(bench, transfer, ending, may_get_left, &mut found) {
            given_up = Some(bench.probe.board.now());
        }
    }
    enumerate(bench, &mut found);
    add_levels(bench, &mut found);
    let log = bench.probe.board.wire_log();
    let worst = log.and_then(|it| it.edge_to_start[edges..].iter().max().copied());
    found.edge_to_start = worst.unwrap_or_default();
    found
}

/// Restores the state after plugging, whatever was set at random; the stream continues.
fn enumerate(bench: &mut UsbBench, found: &mut ControlFindings) {
    bench.probe.board.usb_mut().reset();
    bench.run(Time::from_ms(1));
    bench.until_open(super::ENUMERATION);
    found.enumerations += 1;
}

/// Starts the next train, by a command over RTT, so that the PC at USB cannot end it.
fn drive(bench: &mut UsbBench, found: &mut ControlFindings) {
    if bench.probe.board.bridge().awake {
        return;
    }
    add_levels(bench, found);
    bench.probe.command(&Command::Sweep);
    bench.run(Time::from_ms(20));
    // Writes before the first period with current do not count.
    bench.probe.board.take_level_times();
}

fn add_levels(bench: &mut UsbBench, found: &mut ControlFindings) {
    let of_train = bench.probe.board.take_level_times();
    let levels = &mut found.levels;
    levels.written += of_train.written;
    levels.late += of_train.late;
    levels.least_left = levels.least_left.min(of_train.least_left);
    levels.longest_gap = levels.longest_gap.max(of_train.longest_gap);
}

/// Runs a transfer; returns whether the host gave it up.
fn one(
    bench: &mut UsbBench,
    mut transfer: ControlTransfer,
    ending: Ending,
    may_get_left: bool,
    found: &mut ControlFindings,
) -> bool {
    let promised = usize::from(u16::from_le_bytes([transfer.setup[6], transfer.setup[7]]));
    let is_short = transfer.setup[0] & 0x80 == 0 && transfer.data.len() < promised;
    transfer.deadline = match ending {
        Ending::Overtaken => Time::from_us(1),
        _ if is_short => CUT_SHORT,
        _ => HANGS,
    };
    if ending == Ending::Overtaken {
        late_in_frame(bench);
    }
    let begin = bench.probe.board.now();
    let id = bench.submit(transfer.clone());
    if let Ending::Reset(after) = ending {
        reset_after(bench, after);
    }
    let outcome = outcome(bench, id);
    let is_right = is_right(bench, &transfer, &outcome);
    match (&outcome, ending) {
        (ControlOutcome::TimedOut, Ending::Overtaken) => found.overtaken += 1,
        (ControlOutcome::TimedOut, _) if is_short => found.cut_short += 1,
        (ControlOutcome::Cancelled, Ending::Reset(_)) => found.cancelled += 1,
        (ControlOutcome::Done(_), _) if is_right => found.done += 1,
        (ControlOutcome::Stalled, _) if asks_for_device(&transfer) => found.wrong += 1,
        (ControlOutcome::Stalled, _) => found.stalled += 1,
        (ControlOutcome::Done(_) | ControlOutcome::Broken(_), _) if may_get_left => {
            found.spoiled += 1;
        }
        (ControlOutcome::Done(_), _) => found.wrong += 1,
        _ => found.hung.push((transfer.clone(), outcome.clone())),
    }
    if let Ending::Reset(_) = ending {
        if outcome == ControlOutcome::Cancelled {
            bench.until_open(super::ENUMERATION);
        } else {
            // The transfer had ended before the reset, or ran only after the enumeration, where a
            // SET_ADDRESS or a SET_CONFIGURATION ends the stream.
            bench
                .until(super::ENUMERATION, |bench| {
                    bench.probe.board.usb().description().is_some()
                })
                .expect("the device is enumerated");
        }
        return false;
    }
    let is_over = matches!(outcome, ControlOutcome::Done(_) | ControlOutcome::Stalled);
    if is_over {
        found.longest = found.longest.max(bench.probe.board.now() - begin);
    }
    outcome == ControlOutcome::TimedOut
}

fn reset_after(bench: &mut UsbBench, time: Time) {
    let board = &mut bench.probe.board;
    board.run_for(time).expect("the image runs on");
    board.usb_mut().reset();
    // The order takes effect with the next step.
    board
        .run_until(Time::from_us(10), |board| {
            board.usb().state() == UsbState::Resetting
        })
        .expect("the bus is reset");
}

/// Whether a transfer requests the device descriptor.
fn asks_for_device(transfer: &ControlTransfer) -> bool {
    transfer.setup.starts_with(&DEVICE_DESCRIPTOR)
}

/// Whether an answer is the device descriptor, if it was requested.
fn is_right(bench: &UsbBench, transfer: &ControlTransfer, outcome: &ControlOutcome) -> bool {
    let (Some(data), true) = (outcome.data(), asks_for_device(transfer)) else {
        return true;
    };
    let [.., low, high] = transfer.setup;
    let asked = usize::from(u16::from_le_bytes([low, high])).min(transfer.read_limit);
    let description = bench.probe.board.usb().description();
    // During another enumeration the description is unknown.
    let is_part = description.is_none_or(|it| it.device.starts_with(data));
    is_part && data.len() >= asked.min(18)
}

/// Runs until so late in a frame that a new transfer cannot finish in it; the host gives the transfer
/// up at the frame's end.
fn late_in_frame(bench: &mut UsbBench) {
    let board = &mut bench.probe.board;
    let frame = board.usb().counts().frames;
    board
        .run_until(Time::from_ms(2), |board| {
            board.usb().counts().frames > frame
        })
        .expect("frames come");
    board
        .run_for(Time::from_us(900))
        .expect("the image runs on");
}

/// Runs until a transfer has ended.
pub(crate) fn outcome(bench: &mut UsbBench, id: TransferId) -> ControlOutcome {
    let mut steps = 0;
    loop {
        let results = bench.probe.board.usb_mut().take_results();
        if let Some((_, outcome)) = results.into_iter().find(|(of, _)| *of == id) {
            return outcome;
        }
        bench
            .probe
            .board
            .run_for(Time::from_us(20))
            .unwrap_or_else(|stop| panic!("{stop}"));
        steps += 1;
        if steps % 50 == 0 {
            bench.probe.listen();
            bench.listen();
        }
        assert!(steps < 50_000, "no result of a transfer");
    }
}

fn draw(chance: &mut Chance) -> ControlTransfer {
    loop {
        let setup = match chance.below(6) {
            0 | 5 => plain(chance),
            1 => standard(chance),
            2 => class(chance),
            3 => vendor(chance),
            _ => anything(chance),
        };
        if !is_restart_request(setup) {
            return with_data(setup, chance);
        }
    }
}

/// Whether a setup packet is one of the two requests that reboot the board.
fn is_restart_request([kind, request, _, _, index, index_high, ..]: [u8; 8]) -> bool {
    kind == 0x21 && RESTARTS.contains(&request) && [index, index_high] == [RESET_INTERFACE, 0]
}

fn setup(kind: u8, request: u8, value: u16, index: u16, length: u16) -> [u8; 8] {
    let [value, index, length] = [value, index, length].map(u16::to_le_bytes);
    [
        kind, request, value[0], value[1], index[0], index[1], length[0], length[1],
    ]
}

fn length(chance: &mut Chance) -> u16 {
    match chance.below(3) {
        0 => chance.below(300) as u16,
        _ => chance.one_of(&LENGTHS),
    }
}

/// Existing and nonexistent interfaces and endpoints.
fn index(chance: &mut Chance) -> u16 {
    chance.one_of(&[
        0, 1, 2, 3, 4, 5, 0x0F, 0x80, 0x81, 0x82, 0x83, 0x8F, 0xFF, 0x0100, 0xFFFF,
    ])
}

/// A request of the device descriptor, whose answer is known.
fn plain(chance: &mut Chance) -> [u8; 8] {
    let [kind, request, ..] = DEVICE_DESCRIPTOR;
    setup(kind, request, 0x0100, 0, length(chance))
}

fn standard(chance: &mut Chance) -> [u8; 8] {
    let kind = chance.one_of(&[0x00, 0x01, 0x02, 0x80, 0x81, 0x82]);
    let request = chance.below(u32::from(*STANDARD.end()) + 1) as u8;
    let value = match chance.below(3) {
        0 => chance.word() as u16,
        // Descriptors of every type, with a small index.
        1 => (chance.below(18) as u16) << 8 | chance.below(6) as u16,
        _ => chance.below(4) as u16,
    };
    let index = match chance.below(4) {
        0 => 0x0409,
        _ => index(chance),
    };
    setup(kind, request, value, index, length(chance))
}

fn class(chance: &mut Chance) -> [u8; 8] {
    let kind = chance.one_of(&[0x21, 0xA1, 0x22, 0xA2, 0x20, 0xA0]);
    let request = chance.one_of(&CDC);
    let value = chance.below(4) as u16;
    let index = match chance.below(2) {
        0 => 0,
        _ => index(chance),
    };
    setup(kind, request, value, index, length(chance))
}

fn vendor(chance: &mut Chance) -> [u8; 8] {
    let kind = chance.one_of(&[0x40, 0x41, 0x42, 0xC0, 0xC1, 0xC2]);
    let (request, value) = (chance.word() as u8, chance.word() as u16);
    setup(kind, request, value, index(chance), length(chance))
}

fn anything(chance: &mut Chance) -> [u8; 8] {
    let (one, other) = (chance.word().to_le_bytes(), chance.word().to_le_bytes());
    let mut setup = [0; 8];
    setup[..4].copy_from_slice(&one);
    setup[4..].copy_from_slice(&other);
    setup
}

/// Adds as much data as the setup packet announces, or less, or more.
fn with_data(setup: [u8; 8], chance: &mut Chance) -> ControlTransfer {
    let promised = usize::from(u16::from_le_bytes([setup[6], setup[7]]));
    let amount = match chance.below(6) {
        0 => chance.below(promised as u32 + 1) as usize,
        1 => promised + chance.below(100) as usize,
        _ => promised,
    };
    if setup[0] & 0x80 == 0 {
        let data: Vec<u8> = (0..amount.min(MOST_SENT))
            .map(|_| chance.word() as u8)
            .collect();
        ControlTransfer::with_data(setup, &data)
    } else {
        ControlTransfer {
            // A host that expects no data sets wLength to zero.
            read_limit: amount.min(promised).max(promised.min(1)),
            ..ControlTransfer::new(setup)
        }
    }
}
