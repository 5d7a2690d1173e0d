//! The lines of an acceptance: readings of a board against the promises of its design.

use super::measured::{Drift, Held, Measured};
use crate::commands::acceptance::{Line, Promise};

/// Supply of the coil, V: `DRIVE` of the firmware (firmware/node/src/board.rs).
const SUPPLY_V: [f64; 2] = [4.5, 14.0];
/// Greatest standard deviation of the supply at rest, V: eight wide codes of the board's converter (RP2040,
/// erratum E11), 71 mV from end to end, and noise of two codes.
const SUPPLY_NOISE_V: f64 = 0.05;
/// Zero of the current's amplifier, V: 64 counts of 3.3 V/4096 about the middle, the firmware's tolerance.
const ZERO_V: [f64; 2] = [1.65 - 0.052, 1.65 + 0.052];
/// Greatest current without drive, A (docs/bring-up.md), and its standard deviation, A: means over 1 ms.
const REST_A: f64 = 0.05;
const REST_NOISE_A: f64 = 0.02;
/// Current at the reduced limit of the bridge, A: the self-test's own bounds.
const LIMITED_A: [f64; 2] = [1.0, 3.0];
/// Deviation of a held current from its setpoint, relative and A: what docs/firmware.md allows a step.
const HELD: f64 = 0.01;
/// Greatest standard deviation of a held current, A.
const HELD_NOISE_A: f64 = 0.03;
/// Greatest noise of the frequency, relative to the data sheet's.
const NOISE: f64 = 3.0;
/// Period of the bridge, s.
const PERIOD_S: f64 = 16e-6;
/// Temperatures of a room and a coil at rest, degrees Celsius.
const ROOM_C: [f64; 2] = [5.0, 45.0];

/// All lines: coil, current, supply, then the sensor.
pub(super) fn of(measured: &Measured, promise: &Promise) -> Vec<Line> {
    let mut lines = supply(measured);
    lines.extend(coil(measured, promise));
    lines.extend(held(measured, promise));
    lines.extend(sensor(measured, promise));
    lines
}

fn supply(measured: &Measured) -> Vec<Line> {
    let switch = "Switch the supply of the bridge on and check fuse, poles and the divider at GP28";
    vec![
        Line::new(
            "supply of the coil at rest",
            "V",
            mean(&measured.supply_v),
            (SUPPLY_V, "the firmware drives the coil within these"),
            switch,
        ),
        Line::new(
            "noise of the supply at rest",
            "V",
            deviation(&measured.supply_v),
            (
                [0.0, SUPPLY_NOISE_V],
                "wide codes and noise of the board's converter",
            ),
            "Use a supply with less ripple, shorter and thicker wires, and capacitors of 470 µF or more at the bridge; \
             check the ground between supply and board",
        ),
        Line::new(
            "current without drive",
            "A",
            mean(&measured.resting_a),
            ([-REST_A, REST_A], "measured from its own zero"),
            "Check the bridge's pull-downs (nothing may flow), and the reference of the current amplifier",
        ),
        Line::new(
            "noise of the current without drive",
            "A",
            deviation(&measured.resting_a),
            ([0.0, REST_NOISE_A], "means over a conversion of 1 ms"),
            "Check the amplifier's wires to the shunt, its supply, and the capacitor at GP26",
        ),
        Line::new(
            "temperature of the coil",
            "°C",
            measured.temperature_c,
            (ROOM_C, "a coil at rest in a room"),
            "Check the thermistor, 10 kΩ from GP27 to ground; without it the board estimates the coil's temperature alone",
        ),
    ]
}

fn coil(measured: &Measured, promise: &Promise) -> Vec<Line> {
    let test = measured.coil.as_ref().and_then(|coil| coil.as_ref().ok());
    let missing = match &measured.coil {
        Some(Err(reason)) => Some(reason.clone()),
        _ => None,
    };
    // A failed test is a defect of the coil's circuit, not a missing measurement.
    let action = |action: &str| missing.clone().unwrap_or_else(|| action.to_owned());
    let lost = test.map_or(0.0, |test| f64::from(test.lost));
    let mut lines = Vec::new();
    if let Some(reason) = &missing {
        lines.push(Line::new(
            "the coil's self-test passes",
            "",
            Some(0.0),
            ([1.0, 1.0], "1 if it does"),
            format!("{reason} Check the coil's plug, both coils in series, and the bridge"),
        ));
    }
    lines.extend([
        Line::new(
            "resistance of coil and circuit",
            "ohm",
            test.map(|test| test.resistance_ohm.into()),
            promise.resistance_ohm(lost),
            action(
                "Low: turns are shorted, or one of two coils is missing. High: a joint, a fuse or a plug; measure \
                 coil and wires with a meter of four wires",
            ),
        ),
        Line::new(
            "inductance of the coil",
            "H",
            test.map(|test| test.inductance_h.into()),
            promise.inductance_h(lost),
            action(
                "Low: turns are shorted, one coil's field is reversed (exchange its pads), or iron is missing. High: \
                 the gap is too small, or the design's turns are not those of the coil",
            ),
        ),
        Line::new(
            "dead time of the bridge, as a share of its period",
            "",
            test.map(|test| test.lost.into()),
            ([0.0, 0.10], "1.1 µs of 16 µs on the carrier"),
            action("Choose gate currents that switch faster, or a bridge with less dead time"),
        ),
        Line::new(
            "zero of the current's amplifier",
            "V",
            test.map(|test| test.zero_v.into()),
            (ZERO_V, "half of the converter's reference"),
            action("Check the amplifier's reference inputs: half of ADC_VREF"),
        ),
        Line::new(
            "current at the reduced limit of the bridge",
            "A",
            test.and_then(|test| test.limited_to_a).map(f64::from),
            (LIMITED_A, "VREF lowered by GP20"),
            action("Check GP20 and the divider at VREF; without this limit a short destroys the bridge"),
        ),
    ]);
    lines
}

fn held(measured: &Measured, promise: &Promise) -> Vec<Line> {
    let held = measured.held.as_ref();
    let test = measured.coil.as_ref().and_then(|coil| coil.as_ref().ok());
    let to_a = held.map_or(0.0, |held| held.to_a);
    let off_a = HELD * to_a + REST_A;
    let currents_a = held.map_or(&[][..], |held: &Held| &held.currents_a);
    let first = "Repair what is off above first, then measure again";
    let mut lines = vec![
        Line::new(
            format!("current held at {to_a:.1} A"),
            "A",
            mean(currents_a),
            ([to_a - off_a, to_a + off_a], "1 % and the zero's tolerance"),
            first,
        ),
        Line::new(
            "noise of the held current",
            "A",
            deviation(currents_a),
            ([0.0, HELD_NOISE_A], "means over a conversion of 1 ms"),
            "Look at supply and current with an oscilloscope: a weak supply, a loose plug, or a noisy amplifier",
        ),
    ];
    if let (Some(held), Some(test)) = (held, test) {
        let [supply_v, ohm] = [test.supply_v, test.resistance_ohm].map(f64::from);
        let duty = (held.to_a * ohm / supply_v).min(1.0);
        // A triangle's rms is its height over the root of twelve.
        let rms_a =
            |henry: f64| supply_v * duty * (1.0 - duty) * PERIOD_S / henry / 12.0_f64.sqrt();
        let (henry, _) = promise.inductance_h(test.lost.into());
        lines.push(Line::new(
            "ripple of the held current, rms",
            "A",
            held.ripple_a,
            (
                [0.95 * rms_a(henry[1]), 1.05 * rms_a(henry[0])],
                "computed by the board from supply and inductance",
            ),
            "Repair what is off about the coil's inductance; it has the same cause",
        ));
    }
    lines
}

fn sensor(measured: &Measured, promise: &Promise) -> Vec<Line> {
    let frequencies: Vec<f64> = measured.frequencies_hz.iter().map(|(hz, _)| *hz).collect();
    let count = frequencies.len();
    let frequency_hz = mean(&frequencies);
    let sigma = mean(
        &measured
            .frequencies_hz
            .iter()
            .map(|(hz, sigma)| sigma / hz)
            .collect::<Vec<_>>(),
    );
    let share = |number: usize| (count > 0).then(|| number as f64 / count as f64);
    let stream = "Set the stream to samples: `palpate settings set stream=samples`";
    let capacitor = frequency_hz.map_or_else(|| stream.to_owned(), |hz| promise.capacitor(hz));
    let drift = measured
        .drift
        .map(|Drift { from_hz, to_hz, .. }| to_hz / from_hz - 1.0);
    let time_s = measured.drift.map_or(0.0, |drift| drift.time_s);
    vec![
        Line::new(
            "frequency of the untouched sensor",
            "Hz",
            frequency_hz,
            promise.frequency_hz(),
            capacitor,
        ),
        Line::new(
            "conversions with an error flag, share",
            "",
            share(measured.flagged),
            ([0.0, 0.0], "amplitude of 1.2 to 1.8 V"),
            "Check the tank's joints and metal near the coil; `palpate bring-up --expect` measures its quality factor",
        ),
        Line::new(
            "conversions lost",
            "",
            Some(measured.lost.into()),
            ([0.0, 0.0], "every conversion is read"),
            "Check INTB, and the bus: pull-ups of 2.2 kΩ, short wires",
        ),
        Line::new(
            "noise of the frequency, relative",
            "",
            successive_deviation(&frequencies),
            (
                [0.0, NOISE * sigma.unwrap_or(0.0)],
                "three times what counting and noise of the converter give",
            ),
            "Shorten and twist the leads of the sensing coil, keep them from the bridge, and check CLKIN's wire",
        ),
        Line::new(
            format!("drift of the frequency in {time_s:.0} s, relative"),
            "",
            drift,
            promise.drift(),
            "Let the board warm up for ten minutes, keep draughts and hands away, and measure again; check the \
             capacitor's material (C0G) and what presses on the sensor",
        ),
    ]
}

fn mean(of: &[f64]) -> Option<f64> {
    (!of.is_empty()).then(|| of.iter().sum::<f64>() / of.len() as f64)
}

fn deviation(of: &[f64]) -> Option<f64> {
    let mean = mean(of)?;
    let squares: f64 = of.iter().map(|value| (value - mean).powi(2)).sum();
    (of.len() > 1).then(|| (squares / (of.len() - 1) as f64).sqrt())
}

/// Relative standard deviation from successive differences, which a drift does not change.
fn successive_deviation(of: &[f64]) -> Option<f64> {
    let differences: Vec<f64> = of
        .windows(2)
        .map(|pair| (pair[1] / pair[0] - 1.0).powi(2))
        .collect();
    Some((0.5 * mean(&differences)?).sqrt())
}
