//! Drives the coil by the image on any circuit, and evaluates its current.

use ldc161x_sim::{Sensors, Settings, Time};
use palpate_emulator::{EmulatedBoard, Image, LevelTimes, Options, Plant, PlantConditions, Still};
use palpate_sim::electrical::{Circuit, Pins};
use palpate_wire::code::{Outcome, Stream};
use palpate_wire::command::DriveCoil;
use palpate_wire::record::CoilTest;
use palpate_wire::{Command, Record};

use super::{FREQUENCIES_HZ, RecordedBoard, coil, image, recording};

/// Period of the bridge's PWM.
pub(crate) const PERIOD: Time = Time::from_us(16);
/// Length of a conversion, in whole periods of the PWM.
pub(crate) const WINDOW: usize = 62;

/// Plant of constant sensors and a given coil circuit.
#[derive(Clone)]
pub(crate) struct Wired {
    pub(crate) sensors: Still,
    pub(crate) conditions: PlantConditions,
    /// Parallel resistance of the sensors, ohm.
    pub(crate) parallel_ohm: f64,
}

/// Parallel resistance of healthy sensors, ohm.
const PARALLEL_OHM: f64 = 3_000.0;

impl Sensors for Wired {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        self.sensors.frequency_hz(channel, time_s)
    }

    fn parallel_resistance_ohm(&self, _: usize, _: f64) -> f64 {
        self.parallel_ohm
    }
}

impl Plant for Wired {
    fn advance_to(&mut self, _: Time) {}

    fn set_current(&mut self, _: f64, _: f64) {}

    fn conditions(&self) -> PlantConditions {
        self.conditions
    }
}

/// A streaming bench with this circuit and measurement.
pub(crate) fn wired(
    conditions: PlantConditions,
    drive: palpate_emulator::BridgeCircuit,
    seed: u64,
) -> RecordedBoard<Wired> {
    wired_with(image(), conditions, drive, seed)
}

/// A streaming bench with this image, circuit and measurement.
pub(crate) fn wired_with(
    image: &Image,
    conditions: PlantConditions,
    drive: palpate_emulator::BridgeCircuit,
    seed: u64,
) -> RecordedBoard<Wired> {
    let options = Options {
        drive,
        seed,
        ..recording()
    };
    let plant = Wired {
        sensors: Still::new(FREQUENCIES_HZ),
        conditions,
        parallel_ohm: PARALLEL_OHM,
    };
    let mut bench = RecordedBoard::of(EmulatedBoard::new(
        image,
        plant,
        Settings::default(),
        options,
    ));
    bench.stream();
    bench.run(Time::from_ms(20));
    bench
}

pub(crate) fn drive(to_a: f64, over_s: f32) -> Command {
    Command::DriveCoil(DriveCoil {
        to_a: to_a as f32,
        over_s,
        trace_interval_s: 0.0,
    })
}

/// Charge, A s, over time, s, known at least at the end of every period.
pub(crate) struct ChargeCurve(pub(crate) Vec<(f64, f64)>);

impl ChargeCurve {
    /// Mean current of every period, A.
    pub(crate) fn means(&self) -> Vec<f64> {
        let mean = |of: &[(f64, f64)]| match of {
            [before, after] => (after.1 - before.1) / (after.0 - before.0),
            _ => 0.0,
        };
        self.0.windows(2).map(mean).collect()
    }

    /// Charge at a time, interpolated linearly; `None` outside.
    pub(crate) fn charge_at(&self, time_s: f64) -> Option<f64> {
        let index = self.0.partition_point(|(at, _)| *at <= time_s);
        let (before, after) = (self.0.get(index.checked_sub(1)?)?, self.0.get(index)?);
        let part = (time_s - before.0) / (after.0 - before.0);
        Some(before.1 + part * (after.1 - before.1))
    }

    /// Mean currents of consecutive conversions; the first one starts `after_s` after the curve's
    /// start.
    pub(crate) fn windows(&self, after_s: f64) -> Vec<f64> {
        let length_s = WINDOW as f64 * PERIOD.as_secs_f64();
        let begin_s = self.0.first().map_or(0.0, |first| first.0) + after_s;
        let charge = |count: usize| self.charge_at(begin_s + count as f64 * length_s);
        (0..)
            .map_while(|count| Some((charge(count + 1)? - charge(count)?) / length_s))
            .collect()
    }
}

impl<P: Plant> RecordedBoard<P> {
    pub(crate) fn coil_test(&self, from: usize) -> Option<CoilTest> {
        self.frames[from..]
            .iter()
            .find_map(|frame| match &frame.message {
                Record::CoilTest(found) => Some(found.clone()),
                _ => None,
            })
    }

    /// Arms; returns the result of the self-test.
    pub(crate) fn arm(&mut self) -> CoilTest {
        let before = self.frames.len();
        for command in [Command::SetCoil(coil()), Command::Arm] {
            assert_eq!(self.command(&command).outcome, Outcome::Accepted);
        }
        for _ in 0..300 {
            if let Some(found) = self.coil_test(before) {
                return found;
            }
            self.run(Time::from_ms(1));
        }
        panic!("the self-test does not end: {:?}", self.faults());
    }

    /// Drives to a current, and advances time.
    pub(crate) fn go(&mut self, to_a: f64, over_s: f32, time: Time) {
        let answer = self.command(&drive(to_a, over_s)).outcome;
        assert_eq!(answer, Outcome::Accepted, "{to_a} A: {:?}", self.faults());
        self.run(time);
    }

    /// Switches the drive off, ready for the next one.
    pub(crate) fn rest(&mut self) {
        self.command(&Command::Abort);
        self.run(Time::from_ms(5));
        assert_eq!(self.board.current_a(), 0.0);
    }

    /// Records the current for `periods` periods.
    pub(crate) fn charge_curve(&mut self, periods: usize) -> ChargeCurve {
        let mut points = Vec::with_capacity(periods + 1);
        for period in 0..=periods {
            let totals = self.board.totals();
            points.push((totals.time_s, totals.charge_a_s));
            if period < periods {
                self.board.run_for(PERIOD).expect("the image runs on");
            }
        }
        self.listen();
        ChargeCurve(points)
    }

    /// Ripple within a period, peak to peak, A.
    pub(crate) fn ripple_a(&mut self) -> f64 {
        let (mut low, mut high) = (f64::MAX, f64::MIN);
        for _ in 0..160 {
            self.board
                .run_for(Time::from_ns(200))
                .expect("the image runs on");
            self.board.totals();
            let now_a = self.board.current_a();
            (low, high) = (low.min(now_a), high.max(now_a));
        }
        high - low
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepResult {
    /// Time from the first period with current to the one with 90 %.
    pub(crate) took: Time,
    /// Shortest time that supply and inductance allow.
    pub(crate) possible: Time,
    /// Greatest excess of a period's mean over the end value, relative to that value.
    pub(crate) overshoot: f64,
}

/// Shortest time that supply and inductance allow, with the bridge always on.
fn possible(circuit: &Circuit, to_a: f64) -> Time {
    let mut circuit = circuit.clone();
    circuit.parameters.wake_s = 0.0;
    let pins = Pins {
        awake: true,
        inputs: [true, false],
    };
    let mut took = Time::ZERO;
    while circuit.current_a() < 0.9 * to_a && took < Time::from_ms(10) {
        circuit.advance(pins, 1e-7);
        took += Time::from_ns(100);
    }
    took
}

/// Steps from rest at `phases` phases between the converter's bus and the PWM, whose interrupts
/// coincide differently at each phase; returns the slowest time and the highest overshoot.
pub(crate) fn steps<P: Plant>(bench: &mut RecordedBoard<P>, to_a: f64, phases: u32) -> StepResult {
    bench.go(0.0, 0.0, Time::from_ms(2));
    let possible = possible(bench.board.circuit(), to_a);
    let mut worst = StepResult {
        took: Time::ZERO,
        possible,
        overshoot: 0.0,
    };
    for _ in 0..phases {
        // The offsets of all phases add up to slightly more than a millisecond: they cover every
        // phase of a conversion of one millisecond.
        bench.run(Time::from_us(1_008 / u64::from(phases)));
        let mut bench = bench.clone();
        bench.send(&drive(to_a, 0.0));
        // The means over periods are compared, since the ripple is an ampere.
        let means = bench.charge_curve(500).means();
        let first = |level_a: f64| means.iter().position(|mean_a| *mean_a > level_a);
        let (Some(begin), Some(reached)) = (first(0.2), first(0.9 * to_a)) else {
            panic!("no step to {to_a} A: {:?}", bench.faults());
        };
        let took = Time::from_us(16 * (reached - begin) as u64);
        let highest = means.iter().copied().fold(0.0, f64::max);
        worst.took = worst.took.max(took);
        worst.overshoot = worst.overshoot.max(highest / to_a - 1.0);
    }
    worst
}

/// Greatest distance of a ramp's conversions from a straight line, relative to the ramp's peak.
pub(crate) fn bend<P: Plant>(bench: &mut RecordedBoard<P>, peak_a: f64, fall_s: f32) -> f64 {
    bench.go(peak_a, 2e-3, Time::from_ms(5));
    bench.send(&drive(0.2 * peak_a, fall_s));
    let periods = (f64::from(fall_s) / PERIOD.as_secs_f64()) as usize;
    // Skips the ramp's start, with the answer to the command, and its last tenth.
    bench.charge_curve(periods / 20 + 120);
    let means = bench.charge_curve(periods * 17 / 20 - 120).windows(0.0);
    assert!(means.len() > 5 && means[0] - means[5] > 0.0, "{means:?}");
    from_a_line(&means) / peak_a
}

/// Greatest distance from the least-squares line.
fn from_a_line(values: &[f64]) -> f64 {
    let middle = 0.5 * (values.len() as f64 - 1.0);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let (mut of_product, mut of_square) = (0.0, 0.0);
    for (index, value) in values.iter().enumerate() {
        let at = index as f64 - middle;
        of_product += at * value;
        of_square += at * at;
    }
    let slope = of_product / of_square;
    let off =
        |(index, value): (usize, &f64)| (value - mean - slope * (index as f64 - middle)).abs();
    values.iter().enumerate().map(off).fold(0.0, f64::max)
}

/// Cost of full telemetry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Telemetry {
    /// Write times of the levels, in periods with current.
    pub(crate) levels: LevelTimes,
    /// Samples fetched; `lost` counts samples lost on the way, by any of the counters.
    pub(crate) samples: u32,
    pub(crate) lost: u64,
    /// Worst delay from an edge of INTB to START.
    pub(crate) worst: Time,
}

/// Drives within the coil's continuous rating, with a command every 60 ms and a stream at 1 kHz
/// that the PC reads.
pub(crate) fn telemetry<P: Plant>(
    bench: &mut RecordedBoard<P>,
    time: Time,
    stream: Stream,
) -> Telemetry {
    let settings = palpate_wire::command::Settings {
        rate_hz: 1_000.0,
        stream,
        ..bench.settings()
    };
    let answer = bench.command(&Command::SetSettings(settings)).outcome;
    assert_eq!(answer, Outcome::Accepted);
    bench.run(Time::from_ms(200));
    let before = bench.status();
    let overwritten = bench.board.chip().overwritten(0);
    let edges = bench.edge_to_start().len();
    let mut levels = LevelTimes::default();
    let mut gaps = 0;
    let end = bench.board.now() + time;
    let mut profiles = [
        (2.5, 0.02),
        (0.4, 0.05),
        (3.0, 0.0),
        (-2.0, 0.0),
        (1.0, 0.05),
    ]
    .into_iter()
    .cycle();
    bench.arm();
    while bench.board.now() < end {
        bench.go(1.0, 0.0, Time::from_ms(2));
        bench.board.take_level_times();
        // Stays below the on-time limit of 20 s.
        let until = end.min(bench.board.now() + Time::from_ms(15_000));
        while bench.board.now() < until {
            let (to_a, over_s) = profiles.next().unwrap_or_default();
            bench.go(to_a, over_s, Time::from_ms(55));
            gaps += bench.forget_all_but_last();
        }
        let of_run = bench.board.take_level_times();
        levels.written += of_run.written;
        levels.late += of_run.late;
        levels.least_left = levels.least_left.min(of_run.least_left);
        levels.longest_gap = levels.longest_gap.max(of_run.longest_gap);
        bench.rest();
    }
    let after = bench.status();
    let worst = bench.edge_to_start()[edges..].iter().copied().max();
    Telemetry {
        levels,
        samples: after.conversions - before.conversions,
        lost: u64::from(after.conversions_lost - before.conversions_lost)
            + (bench.board.chip().overwritten(0) - overwritten)
            + gaps,
        worst: worst.unwrap_or_default(),
    }
}

impl<P: Plant> RecordedBoard<P> {
    fn edge_to_start(&self) -> &[Time] {
        self.board.wire_log().map_or(&[], |log| &log.edge_to_start)
    }

    /// Returns how many records are missing between the received ones; drops all but the last.
    fn forget_all_but_last(&mut self) -> u64 {
        let gap = |of: &[palpate_wire::Frame<Record>]| match of {
            [before, after] => {
                let step = after.header.sequence.wrapping_sub(before.header.sequence);
                u64::from(step).saturating_sub(1)
            }
            _ => 0,
        };
        let gaps = self.frames.windows(2).map(gap).sum();
        self.frames.drain(..self.frames.len().saturating_sub(1));
        gaps
    }
}
