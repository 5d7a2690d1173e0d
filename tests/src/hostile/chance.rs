//! Random scripts, with enough usual commands to reach every state.

use palpate_procedure::Link;
use palpate_wire::code::{FaultCode, RebootTarget};
use palpate_wire::command::{ClearFault, DriveCoil, Locate, Reboot};
use palpate_wire::schema::{Field, Kind, Type};
use palpate_wire::{Command, Message};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::frame::{DAMAGES, Damage, payload, varint};
use super::script::{Addressee, Move, write};
use super::sensor::settings;

/// Number of moves in a script.
const MOVES: usize = 400;

/// Script of a seed.
#[must_use]
pub fn script(seed: u64) -> Vec<u8> {
    let mut chance = Pcg64::seed_from_u64(seed);
    let mut script = Vec::new();
    if chance.random_range(0..8) > 0 {
        for of in [Move::Run(255), Move::Calibrate(link(&mut chance))] {
            write(&of, &mut script);
        }
    }
    for _ in 0..MOVES {
        write(&next(&mut chance), &mut script);
    }
    script
}

fn link(chance: &mut Pcg64) -> Link {
    Link::ALL[chance.random_range(0..Link::ALL.len())]
}

fn next(chance: &mut Pcg64) -> Move {
    match chance.random_range(0..100) {
        0..25 => Move::Run(chance.random_range(0..12)),
        25..29 => Move::Run(chance.random_range(12..=255)),
        29..33 => Move::Press([0, 0, 120, 200, 255, chance.random()][chance.random_range(0..6)]),
        33 => Move::Calibrate(link(chance)),
        34..59 => command(chance, usual),
        59..76 => command(chance, any_values),
        76..80 => command(chance, any_bytes),
        80..97 => damaged(chance),
        _ => {
            let length = chance.random_range(0..256);
            // Frequent zeros, so that frames end often.
            let byte =
                |chance: &mut Pcg64| chance.random::<u8>() * u8::from(chance.random_ratio(3, 4));
            let bytes = (0..length).map(|_| byte(chance)).collect();
            Move::Raw(link(chance), bytes)
        }
    }
}

/// Kind and payload.
type Payload = (u8, Vec<u8>);

fn command(chance: &mut Pcg64, make: fn(&mut Pcg64) -> Payload) -> Move {
    let (kind, payload) = make(chance);
    Move::Command(link(chance), addressee(chance), kind, payload)
}

fn damaged(chance: &mut Pcg64) -> Move {
    let (kind, payload) = if chance.random() {
        usual(chance)
    } else {
        any_values(chance)
    };
    let damage = Damage {
        kind: chance.random_range(0..DAMAGES),
        at: chance.random(),
        with: chance.random(),
    };
    Move::Damaged(link(chance), addressee(chance), kind, payload, damage)
}

fn addressee(chance: &mut Pcg64) -> Addressee {
    match chance.random_range(0..20) {
        0 => Addressee::Any,
        1 => Addressee::Next,
        2 => Addressee::None,
        _ => Addressee::Present,
    }
}

/// A usual command of a user.
fn usual(chance: &mut Pcg64) -> Payload {
    let command = match chance.random_range(0..40) {
        0..10 => Command::Arm,
        10..13 => Command::Measure,
        13..15 => Command::Sweep,
        15 => Command::TestCoil,
        16 => Command::Abort,
        17..20 => Command::Disarm,
        20 => Command::Identify,
        21 => Command::GetSettings,
        22 => Command::SensingOnly,
        23..26 => Command::Store,
        26 => Command::Load,
        27 => Command::Erase,
        28 => Command::GetStorage,
        29 => Command::Locate(Locate { duration_s: 1.0 }),
        30 if chance.random_ratio(1, 4) => Command::Reboot(Reboot {
            target: RebootTarget::Firmware,
        }),
        31..34 => Command::SetSettings(settings()),
        34..37 => Command::DriveCoil(DriveCoil {
            to_a: chance.random_range(-12.0..12.0),
            over_s: chance.random_range(0.0..0.1),
            trace_interval_s: chance.random_range(0.0..0.01),
        }),
        _ => {
            let codes = FaultCode::ALL;
            let code = codes[chance.random_range(0..codes.len())];
            Command::ClearFault(ClearFault { code })
        }
    };
    (command.kind(), payload(&command))
}

/// Any command with any values, most of them valid.
fn any_values(chance: &mut Pcg64) -> Payload {
    let kind = any_kind(chance);
    let mut bytes = Vec::new();
    for field in kind.payload.map_or(&[][..], |structure| structure.fields) {
        any_field(field, chance, &mut bytes);
    }
    (kind.number, bytes)
}

/// Any kind; a restart is rare, because it ends everything that a script has reached.
fn any_kind(chance: &mut Pcg64) -> &'static Kind {
    loop {
        let kind = &Command::KINDS[chance.random_range(0..Command::KINDS.len())];
        if kind.name != "reboot" || chance.random_ratio(1, 8) {
            return kind;
        }
    }
}

/// Any kind, known or not, with any bytes.
fn any_bytes(chance: &mut Pcg64) -> Payload {
    let length = chance.random_range(0..100);
    let bytes = (0..length).map(|_| chance.random()).collect();
    (chance.random(), bytes)
}

fn any_field(field: &Field, chance: &mut Pcg64, to: &mut Vec<u8>) {
    let range = [field.range.low, field.range.high].map(f64::from);
    any_value(&field.of, range, chance, to);
}

/// Appends a value of a type, usually within its limits.
fn any_value(of: &Type, range: [f64; 2], chance: &mut Pcg64, to: &mut Vec<u8>) {
    // Small numbers as often as large ones.
    let bits = chance.random::<u32>() >> chance.random_range(0..32);
    match of {
        Type::Bool => to.push(u8::from(chance.random::<bool>())),
        Type::U8 if range[1].is_finite() && chance.random_ratio(9, 10) => {
            to.push(chance.random_range(range[0] as u8..=range[1] as u8));
        }
        Type::U8 => to.push(bits as u8),
        Type::U16 => varint(bits & 0xFFFF, to),
        Type::U32 | Type::U64 => varint(bits, to),
        Type::F32 => to.extend((any_number(range, chance) as f32).to_le_bytes()),
        Type::F64 => to.extend(any_number(range, chance).to_le_bytes()),
        Type::Optional(_) if chance.random() => to.push(0),
        Type::Optional(of) => {
            to.push(1);
            any_value(of, range, chance, to);
        }
        Type::List { item, capacity } => {
            let count = chance.random_range(0..=*capacity);
            to.push(count);
            (0..count).for_each(|_| any_value(item, range, chance, to));
        }
        Type::Text { capacity } => {
            let length = chance.random_range(0..=*capacity);
            to.push(length);
            to.extend((0..length).map(|_| b'm'));
        }
        Type::Code(table) if chance.random_ratio(9, 10) => {
            to.push(table.entries[chance.random_range(0..table.entries.len())].number);
        }
        Type::Code(_) => to.push(bits as u8),
        Type::Structure(structure) => {
            for field in structure.fields {
                any_field(field, chance, to);
            }
        }
    }
}

fn any_number([low, high]: [f64; 2], chance: &mut Pcg64) -> f64 {
    let part = match chance.random_range(0..40) {
        0 => return f64::NAN,
        1 => return f64::INFINITY,
        2 => return f64::from(f32::from_bits(chance.random())),
        3 => 0.0,
        4 => 1.0,
        5 => 1.001,
        // Limits often span powers of ten: small values are as frequent as large ones.
        of if of % 2 == 0 => chance.random_range(0.0..1.0_f64).powi(8),
        _ => chance.random_range(0.0..1.0),
    };
    if low.is_finite() && high.is_finite() {
        low + part * (high - low)
    } else {
        part
    }
}
