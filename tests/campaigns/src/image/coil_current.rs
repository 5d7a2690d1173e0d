//! `cargo campaign coil-current`: the coil's current as driven by the firmware image, over
//! resistance, inductance and supply; its error before any calibration; two uses weeks apart; and
//! two minutes of full telemetry. Prints its result as Markdown; fails if a limit is missed.

use std::fmt::Write;
use std::process::ExitCode;

use crate::evidence::conclude;

use super::common::RecordedBoard;
use super::common::driven::{PERIOD, Telemetry, Wired, bend, steps, telemetry, wired};
use ldc161x_sim::Time;
use palpate_emulator::{BridgeCircuit, PlantConditions};
use palpate_sim::electrical::ConverterParameters;
use palpate_sim::random;
use palpate_wire::code::Stream;

const FULL_SCALE_A: f64 = 10.0;
/// Limits of the claims: overshoot of a step, bend of a ramp, absolute and repeated error, delay
/// from an edge of INTB to START.
const OVERSHOOT: f64 = 0.02;
const BEND: f64 = 0.005;
const ABSOLUTE: f64 = 0.02;
const REPEATED: f64 = 0.002;
const LATENCY: Time = Time::from_us(10);
/// Number of measurement chains drawn.
const CHAINS: u64 = 10;
/// Duration of the run with samples; the run with raw words is as long.
const TELEMETRY: Time = Time::from_ms(60_000);

fn conditions(coil_ohm: f64, inductance_h: f64, supply_v: f64) -> PlantConditions {
    PlantConditions {
        coil_ohm,
        inductance_h,
        supply_v,
        ..PlantConditions::default()
    }
}

/// Greatest current that this supply can sustain, A, with a reserve for the control.
fn reachable_a(conditions: &PlantConditions) -> f64 {
    let ohm = conditions.coil_ohm + BridgeCircuit::default().bridge_ohm + conditions.supply_ohm;
    (0.8 * conditions.supply_v / ohm).min(FULL_SCALE_A)
}

/// Keeps the greatest values.
fn raise(worst: &mut [f64; 3], values: [f64; 3]) {
    for (worst, value) in worst.iter_mut().zip(values) {
        *worst = worst.max(value);
    }
}

/// Runs every corner; returns the worst delay of a step beyond the least possible, s, overshoot, and
/// bend of a ramp.
fn corners() -> [f64; 3] {
    let mut worst = [0.0; 3];
    println!("## Resistance, inductance and supply\n");
    println!(
        "| coil | inductance | supply | step to | 90 % within | possible | overshoot | ramp, 10 ms \
         | ramp, 60 ms | ripple |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for part in [0.6, 1.0, 1.4] {
        for inductance_h in [20e-6, 63e-6, 200e-6] {
            for supply_v in [5.0, 8.0, 12.0] {
                let conditions = conditions(part * 0.389, inductance_h, supply_v);
                raise(&mut worst, corner(&conditions));
            }
        }
    }
    println!();
    worst
}

fn corner(conditions: &PlantConditions) -> [f64; 3] {
    let mut bench = wired(*conditions, BridgeCircuit::default(), 1);
    bench.arm();
    let to_a = reachable_a(conditions);
    let step = steps(&mut bench, to_a, 8);
    let [fast, slow] = [0.01, 0.06].map(|fall_s| bend(&mut bench, to_a, fall_s));
    bench.go(0.6 * to_a, 1e-3, Time::from_ms(5));
    println!(
        "| {:.3} Ω | {:.0} µH | {:.0} V | {to_a:.1} A | {} | {} | {:.2} % | {:.2} % | {:.2} % | {:.2} A |",
        conditions.coil_ohm,
        conditions.inductance_h * 1e6,
        conditions.supply_v,
        micro(step.took),
        micro(step.possible),
        100.0 * step.overshoot,
        100.0 * fast,
        100.0 * slow,
        bench.ripple_a(),
    );
    let late_s = step.took.as_secs_f64() - step.possible.as_secs_f64();
    [late_s, step.overshoot, fast.max(slow)]
}

fn micro(time: Time) -> String {
    format!("{:.0} µs", time.as_secs_f64() * 1e6)
}

/// A measurement chain from the published ranges: gain within 1 % (amplifier 0.5 %, shunt 0.5 %),
/// offset within 0.1 A, reference within 0.5 %, non-linearity of any phase.
fn drawn(seed: u64) -> BridgeCircuit {
    let mut chance = random::Stream::named(seed, "coil_current");
    BridgeCircuit {
        converter: ConverterParameters {
            reference_error: chance.between(-0.005, 0.005),
            nonlinearity_phase: chance.phase(),
            ..ConverterParameters::RP2040
        },
        gain_error: chance.between(-0.01, 0.01),
        offset_a: chance.between(-0.1, 0.1),
        ..BridgeCircuit::default()
    }
}

/// The chain after ten kelvin and weeks: 50 ppm/K of the amplifier's gain, 50 ppm/K of the
/// reference, 5 mA of its offset; another resistance of the copper, another supply.
fn weeks_later(
    seed: u64,
    drive: &BridgeCircuit,
    conditions: &PlantConditions,
) -> (BridgeCircuit, PlantConditions) {
    let mut chance = random::Stream::named(seed, "coil_current.weeks");
    let mut drive = *drive;
    drive.gain_error += chance.between(-5e-4, 5e-4);
    drive.offset_a += chance.between(-5e-3, 5e-3);
    drive.converter.reference_error += chance.between(-5e-4, 5e-4);
    let conditions = PlantConditions {
        coil_ohm: 1.04 * conditions.coil_ohm,
        supply_v: 0.97 * conditions.supply_v,
        ..*conditions
    };
    (drive, conditions)
}

/// Data of one use: true means of conversions, at constant currents over the whole range, with
/// their setpoints, and on ramps between these currents.
struct Use {
    held: Vec<(f64, Vec<f64>)>,
    ramps: Vec<super::common::driven::ChargeCurve>,
}

fn use_it(bench: &mut RecordedBoard<Wired>) -> Use {
    bench.arm();
    let mut held = Vec::new();
    for half in 1..=20 {
        let to_a = 0.5 * f64::from(half);
        bench.go(to_a, 1e-3, Time::from_ms(3));
        held.push((to_a, bench.charge_curve(250).windows(1e-6)));
    }
    let ramps = (0..3)
        .map(|_| {
            bench.go(10.0, 2e-3, Time::from_ms(4));
            bench.send(&super::common::driven::drive(2.0, 16e-3));
            bench.charge_curve(1_100)
        })
        .collect();
    bench.rest();
    Use { held, ramps }
}

/// Greatest difference of constant currents and of ramps between two uses. A ramp starts when the
/// image has read the command, so its windows are at other times in each use: the ramps are
/// compared with the time offset, a few periods, that minimises the difference.
fn difference(first: &Use, second: &Use) -> [f64; 2] {
    let greatest = |first: &[f64], second: &[f64]| {
        let pairs = first.iter().zip(second);
        pairs
            .map(|(one, other)| (one - other).abs())
            .fold(0.0, f64::max)
    };
    let held = first.held.iter().zip(&second.held);
    let held_a = held.map(|((_, one), (_, other))| greatest(one, other));
    let ramps = first.ramps.iter().zip(&second.ramps);
    let ramps_a = ramps.map(|(one, other)| {
        let still = one.windows(2e-3);
        let shifted = (-400..=400).filter_map(|step| {
            let other = other.windows(2e-3 + f64::from(step) * 4e-6);
            // A window at either end may have no counterpart.
            (other.len() + 2 > still.len()).then(|| greatest(&still, &other))
        });
        shifted.fold(f64::MAX, f64::min)
    });
    [held_a.fold(0.0, f64::max), ramps_a.fold(0.0, f64::max)]
}

/// Runs every chain; returns the worst absolute error before calibration, and the worst differences of held
/// currents and of ramps weeks apart.
fn chains() -> [f64; 3] {
    let mut worst = [0.0; 3];
    println!("## Absolute error, and two uses weeks apart\n");
    println!(
        "| chain | gain | offset | absolute, before calibration | held, weeks apart | ramps, weeks apart |"
    );
    println!("|---|---|---|---|---|---|");
    for seed in 1..=CHAINS {
        let (drive, conditions) = (drawn(seed), conditions(0.389, 40e-6, 12.0));
        let first = use_it(&mut wired(conditions, drive, seed));
        let (later, others) = weeks_later(seed, &drive, &conditions);
        let second = use_it(&mut wired(others, later, seed + CHAINS));
        let error = |(to_a, means): &(f64, Vec<f64>)| {
            let errors = means.iter().map(|mean_a| (mean_a - to_a).abs());
            errors.fold(0.0, f64::max)
        };
        let absolute = first.held.iter().map(error).fold(0.0, f64::max) / FULL_SCALE_A;
        let apart = difference(&first, &second).map(|of_a| of_a / FULL_SCALE_A);
        println!(
            "| {seed} | {:+.2} % | {:+.0} mA | {:.2} % | {:.2} % | {:.2} % |",
            100.0 * (drive.gain_error - drive.converter.reference_error),
            1e3 * drive.offset_a,
            100.0 * absolute,
            100.0 * apart[0],
            100.0 * apart[1],
        );
        raise(&mut worst, [absolute, apart[0], apart[1]]);
    }
    println!();
    worst
}

/// Runs two minutes; returns a table, and whether no level, sample or limit was missed.
fn full_telemetry() -> (String, bool) {
    let mut text = String::from(
        "| stream | pulse widths set | set too late | least time before taking effect | longest between two | samples | lost \
         | edge to START, worst |\n|---|---|---|---|---|---|---|---|\n",
    );
    let mut holds = true;
    for (stream, name) in [(Stream::Samples, "samples"), (Stream::Raw, "raw")] {
        let mut bench = wired(PlantConditions::default(), BridgeCircuit::default(), 1);
        let Telemetry {
            levels,
            samples,
            lost,
            worst,
        } = telemetry(&mut bench, TELEMETRY, stream);
        let us = |time: Time| format!("{:.2} µs", time.as_secs_f64() * 1e6);
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {} | {} | {samples} | {lost} | {} |",
            levels.written,
            levels.late,
            us(levels.least_left),
            us(levels.longest_gap),
            us(worst),
        );
        let is_missed = levels.late > 0 || levels.longest_gap >= Time::from_us(24);
        holds &= !is_missed && lost == 0 && worst <= LATENCY;
    }
    (text, holds)
}

pub(crate) fn run() -> ExitCode {
    let [late_s, overshoot, bend] = corners();
    let [absolute, held, ramps] = chains();
    let (telemetry, nothing_missed) = full_telemetry();
    let latest_s = 2.0 * PERIOD.as_secs_f64();
    let percent = |part: f64| format!("{:.2} %", 100.0 * part);
    let text = format!(
        "A step overshoots by at most {} (limit {}); a ramp is within {} of a straight line (limit {}). Before calibration the current is \
         off by at most {} (limit {}); two uses weeks apart differ by {} at constant current and {} on ramps (limit {}).\n\n\
         Steps and ramps: 27 corners of 0.233 to 0.545 Ω, 20 to 200 µH and 5 to 12 V. A step reaches 90 % at most {:.0} µs later than supply \
         and inductance allow (limit {:.0} µs). Errors are relative to 10 A, over {CHAINS} randomly drawn \
         measurement chains, of the current's mean over a conversion of 1 ms.\n\n\
         Full telemetry while the coil is driven, {} simulated seconds each at 1 kHz, while the PC reads and sends a command every 60 ms:\n\n{telemetry}",
        percent(overshoot),
        percent(OVERSHOOT),
        percent(bend),
        percent(BEND),
        percent(absolute),
        percent(ABSOLUTE),
        percent(held),
        percent(ramps),
        percent(REPEATED),
        1e6 * late_s,
        1e6 * latest_s,
        TELEMETRY.as_secs_f64(),
    );
    let holds = late_s <= latest_s
        && overshoot <= OVERSHOOT
        && bend <= BEND
        && absolute <= ABSOLUTE
        && held.max(ramps) <= REPEATED
        && nothing_missed;
    conclude(&text, holds)
}
