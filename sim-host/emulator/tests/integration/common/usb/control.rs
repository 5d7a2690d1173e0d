//! Control transfers of any kind, while the coil is driven.

use palpate_emulator::usb::{ControlOutcome, ControlTransfer, TransferId, UsbState};
use palpate_emulator::{LevelTimes, Time};
use palpate_wire::Command;

use super::{Chance, UsbBench};

/// The most that a transfer may take before it counts as hanging. The firmware handles a stage of it
/// when the task of the instrument pauses, which takes 4 ms at most.
const HANGS: Time = Time::from_ms(100);
/// After which the host gives up a transfer in which it sends less than it has promised: the device
/// waits for the rest, as it has to.
const CUT_SHORT: Time = Time::from_ms(8);
/// For how long packets of a transfer that the host gave up may be left: until the task of the
/// instrument pauses, and the transfer after that.
const LEFT_OVER: Time = Time::from_ms(5);
/// Transfers of one in so many end before their time: by a reset, by the next setup packet.
const RESETS: u32 = 100;
const OVERTAKEN: u32 = 10;
/// Transfers from one enumeration to the next.
const BATCH: u32 = 100;

/// bRequest of the standard requests (USB 2.0 table 9-4), and what is beside them.
const STANDARD: std::ops::RangeInclusive<u8> = 0..=13;
/// Requests of CDC (CDC 1.2 table 19, PSTN 1.2 table 13) and what is beside them.
const CDC: [u8; 8] = [0x00, 0x01, 0x02, 0x20, 0x21, 0x22, 0x23, 0x24];
/// Those of the interface that starts the board anew: left out, since they do.
const RESTARTS: [u8; 2] = [1, 2];
/// Lengths that are special to a device with packets of 64 bytes, a control buffer of 128, and
/// descriptors of 18 and 84 bytes.
const LENGTHS: [u16; 20] = [
    0, 1, 2, 7, 8, 9, 18, 63, 64, 65, 84, 85, 127, 128, 129, 192, 255, 256, 512, 0xFFFF,
];
/// The most that the host sends: it may promise more.
const MOST_SENT: usize = 512;

const DEVICE_DESCRIPTOR: [u8; 4] = [0x80, 6, 0, 1];

/// What became of the transfers.
#[derive(Clone, Debug, Default)]
pub(crate) struct ControlFindings {
    pub(crate) done: u32,
    pub(crate) stalled: u32,
    /// Ended by a reset of the bus.
    pub(crate) cancelled: u32,
    /// Ended by the next setup packet.
    pub(crate) overtaken: u32,
    /// Given up by the host, which had sent less than it promised.
    pub(crate) cut_short: u32,
    /// Followed one that the host gave up, and got what was left of it: a packet that waits on endpoint
    /// 0 goes out until the processor has seen the setup packet.
    pub(crate) spoiled: u32,
    /// Neither data nor stall, with nothing that ended them. What the host did before excuses none.
    pub(crate) hung: Vec<(ControlTransfer, ControlOutcome)>,
    /// The device descriptor, asked for between, was another one, or was refused.
    pub(crate) wrong: u32,
    /// The longest of those that ended well or in a stall.
    pub(crate) longest: Time,
    pub(crate) levels: LevelTimes,
    /// From an edge of INTB to START, at worst.
    pub(crate) edge_to_start: Time,
    pub(crate) enumerations: u32,
}

/// How a transfer is to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    ByItself,
    /// The next setup packet comes in its place.
    Overtaken,
    /// The bus is reset after so long.
    Reset(Time),
}

/// Does random control transfers, while the coil is in its train as often as it may.
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

/// The device as after its plug, whatever was set by chance, and the stream goes on.
fn enumerate(bench: &mut UsbBench, found: &mut ControlFindings) {
    bench.probe.board.usb_mut().reset();
    bench.run(Time::from_ms(1));
    bench.until_open(super::ENUMERATION);
    found.enumerations += 1;
}

/// Begins the next train, which goes by RTT: it is not the PC at USB that may end it.
fn drive(bench: &mut UsbBench, found: &mut ControlFindings) {
    if bench.probe.board.bridge().awake {
        return;
    }
    add_levels(bench, found);
    bench.probe.command(&Command::Sweep);
    bench.run(Time::from_ms(20));
    // The levels before the first period with current are none.
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

/// Does a transfer; says whether the host gave it up.
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
            // It was over before. Or it had not begun and was done after the enumeration, where a
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
    // What is ordered begins with the next step.
    board
        .run_until(Time::from_us(10), |board| {
            board.usb().state() == UsbState::Resetting
        })
        .expect("the bus is reset");
}

/// Whether a transfer asks for the device descriptor.
fn asks_for_device(transfer: &ControlTransfer) -> bool {
    transfer.setup.starts_with(&DEVICE_DESCRIPTOR)
}

/// Whether an answer is the device descriptor, if that was asked for.
fn is_right(bench: &UsbBench, transfer: &ControlTransfer, outcome: &ControlOutcome) -> bool {
    let (Some(data), true) = (outcome.data(), asks_for_device(transfer)) else {
        return true;
    };
    let [.., low, high] = transfer.setup;
    let asked = usize::from(u16::from_le_bytes([low, high])).min(transfer.read_limit);
    let description = bench.probe.board.usb().description();
    // While it is enumerated again nothing is known.
    let is_part = description.is_none_or(|it| it.device.starts_with(data));
    is_part && data.len() >= asked.min(18)
}

/// Runs until a transfer that begins is not over when the frame is, where the host gives it up.
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

/// A random transfer.
fn draw(chance: &mut Chance) -> ControlTransfer {
    loop {
        let setup = match chance.below(6) {
            0 | 5 => plain(chance),
            1 => standard(chance),
            2 => class(chance),
            3 => vendor(chance),
            _ => anything(chance),
        };
        if !starts_anew(setup) {
            return with_data(setup, chance);
        }
    }
}

/// Whether it is one of the two requests after which the board starts anew, as the interface with
/// number 2 takes them.
fn starts_anew([kind, request, _, _, index, index_high, ..]: [u8; 8]) -> bool {
    kind == 0x21 && RESTARTS.contains(&request) && index == 2 && index_high == 0
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

/// Interfaces and endpoints, those that there are and others.
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

/// With as much data as the setup packet says, or with less or more.
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
            // A host that wants nothing says so in wLength.
            read_limit: amount.min(promised).max(promised.min(1)),
            ..ControlTransfer::new(setup)
        }
    }
}
