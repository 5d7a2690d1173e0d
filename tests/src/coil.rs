//! Random sequences of orders, settings, faults and clocks for the coil's driver, on its simulated
//! circuit; the truth is compared with the limits after every period.

use coil_hbridge::{Averages, BLOCK, CurrentLine, DriveState, Fault, Limits, Supervisor};
use palpate_model::thermal::{Copper, Temperatures, TwoNode};
use palpate_model::units::{Celsius, JoulePerKelvin, KelvinPerWatt, Ohm, Second, Watt};
use palpate_sim::electrical::{
    Circuit, CircuitParameters, ControlLoop, Converter, ConverterParameters, Regulated, Slow,
    reference_hardware, reference_limits,
};
use palpate_sim::thermal::{COPPER_PER_KELVIN, ThermalParameters, ThermalState};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Number of steps of a sequence, and one in how many sequences is hot. Up to 600 periods pass
/// between two steps, or half a second in a hot sequence, to test heating.
const STEPS: u32 = 12;
const HOT: u64 = 8;
/// Periods of the PWM per step of the temperatures: 1 ms.
const THERMAL_PERIODS: u32 = 62;
/// Levels of the bridge's PWM: half of 16 us at 200 MHz.
const FULL_LEVEL: f32 = 1_600.0;
/// Ratio of the driver's trip level, 12.7 A, to the limit of the regulated current. An overshoot of
/// 2 %, a measurement that is 2 % off, and the widest code of its converter add up to less; in a
/// hundred thousand sequences two reached 12.62 A.
const CURRENT_MARGIN: f64 = 1.06;
/// Greatest current in a dead short that the hardware limit allows, A: on top of its 15 A, 1.5 us
/// of the greatest supply, 16 V, at 1 uH add 24 A. The factor 1.5 is for a shorter pulse, which the
/// limit does not detect at all, with another one after it before the next sample.
const PEAK_A: f64 = 15.0 + 1.5 * 24.0;
/// Periods in which the driver detects that a fault of the circuit has ended.
const LEARNS: u32 = 200;
/// Greatest difference of true and predicted copper temperature, K.
const TEMPERATURE_K: f64 = 5.0;

/// Results of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Number of sequences.
    pub sequences: u64,
    /// Number of accepted current lines.
    pub begun: u64,
    /// Number of refused orders.
    pub refused: u64,
    /// Count of each latched fault, by its index in [`Fault::ALL`].
    pub faults: [u64; Fault::ALL.len()],
    /// Largest current in a healthy circuit, A.
    pub greatest_a: f64,
    /// Largest current overall, in dead shorts, A.
    pub peak_a: f64,
    /// Largest share of the allowed energy that was used.
    pub energy: f64,
    /// Largest error of the predicted copper temperature, K.
    pub error_k: f64,
    /// Highest copper temperature above the initial one, K.
    pub rise_k: f64,
    /// Violated limits: seed and description.
    pub defects: Vec<(u64, String)>,
}

impl Summary {
    /// Adds another summary.
    pub fn merge(&mut self, other: Self) {
        self.sequences += other.sequences;
        self.begun += other.begun;
        self.refused += other.refused;
        for (sum, count) in self.faults.iter_mut().zip(other.faults) {
            *sum += count;
        }
        self.greatest_a = self.greatest_a.max(other.greatest_a);
        self.peak_a = self.peak_a.max(other.peak_a);
        self.energy = self.energy.max(other.energy);
        self.error_k = self.error_k.max(other.error_k);
        self.rise_k = self.rise_k.max(other.rise_k);
        self.defects.extend(other.defects);
    }
}

/// Runs sequences of consecutive seeds.
#[must_use]
pub fn campaign(first: u64, count: u64) -> Summary {
    let mut summary = Summary::default();
    for seed in first..first + count {
        summary.merge(run(seed));
    }
    summary
}

/// Pad of the reference stack, with the values of `model`'s own tests of it.
const HEAT: ThermalParameters = ThermalParameters {
    ambient_change_k: 0.0,
    growth_m_per_k: 0.0,
    copper_j_per_k: 0.8,
    pad_j_per_k: 60.0,
    copper_to_pad_k_per_w: 0.5,
    pad_to_ambient_k_per_w: 8.0,
    resistance_ohm: 0.0,
    resistance_per_kelvin: COPPER_PER_KELVIN,
    heating: 1.0,
};

/// Temperature prediction of the procedure: two nodes, reported currents, the identified
/// resistance.
struct Prediction {
    nodes: TwoNode,
    now: Temperatures,
    copper: Copper,
}

struct GuardSequence {
    chance: Pcg64,
    seed: u64,
    sound: CircuitParameters,
    loop_: Regulated,
    limits: Limits,
    heat: ThermalParameters,
    state: ThermalState,
    prediction: Option<Prediction>,
    /// Whether the measurement has been reliable so far.
    measured: bool,
    /// Whether the circuit is healthy, and since when.
    is_sound: bool,
    sound_since: u32,
    square_a2_s: f64,
    since: u32,
    awake_periods: u32,
    above: Option<u32>,
    energy_j: f64,
    supply_j: f64,
    summary: Summary,
}

/// Runs one sequence.
#[must_use]
pub fn run(seed: u64) -> Summary {
    let mut chance = Pcg64::seed_from_u64(seed);
    let coil_ohm = chance.random_range(0.233..0.545);
    let sound = CircuitParameters::common(
        coil_ohm,
        20e-6 * 10_f64.powf(chance.random_range(0.0..1.0)),
        chance.random_range(5.0..12.5),
    );
    let hot = seed.is_multiple_of(HOT);
    let limits = Limits {
        on_time_s: chance.random_range(0.02..0.08),
        energy_j: chance.random_range(6.0..14.0),
        ..reference_limits()
    };
    let limits = if hot { reference_limits() } else { limits };
    let converter = ConverterParameters {
        reference_error: chance.random_range(-0.005..0.005),
        nonlinearity_phase: chance.random_range(0.0..6.3),
        ..ConverterParameters::RP2040
    };
    let made = Regulated::new(
        Circuit::new(sound),
        Converter::new(converter, seed),
        reference_hardware(),
        limits,
    );
    let mut loop_ = match made {
        Ok(loop_) => loop_,
        Err(refusal) => {
            return Summary {
                defects: vec![(seed, refusal.to_string())],
                ..Summary::default()
            };
        }
    };
    loop_.slow.gain_error = chance.random_range(-0.01..0.01);
    loop_.slow.offset_a = chance.random_range(-0.1..0.1);
    let heat = ThermalParameters {
        resistance_ohm: coil_ohm,
        ..HEAT
    };
    let mut sequence = GuardSequence {
        chance,
        seed,
        sound,
        loop_,
        limits,
        state: heat.at_rest(),
        heat,
        prediction: None,
        measured: true,
        is_sound: true,
        sound_since: 0,
        square_a2_s: 0.0,
        since: 0,
        awake_periods: 0,
        above: None,
        energy_j: 0.0,
        supply_j: 0.0,
        summary: Summary {
            sequences: 1,
            ..Summary::default()
        },
    };
    sequence.predict();
    for _ in 0..STEPS {
        if !hot || sequence.chance.random_range(0..4) == 0 {
            sequence.disturb();
        }
        if hot && sequence.chance.random_range(0..2) == 0 {
            sequence.heat_up();
        } else {
            sequence.command();
        }
        let most = if hot { 30_000 } else { 600 };
        let periods = sequence.chance.random_range(1..most);
        for _ in 0..periods {
            sequence.period();
        }
    }
    sequence.summary
}

impl GuardSequence {
    fn predict(&mut self) {
        let nodes = TwoNode::new(
            JoulePerKelvin(self.heat.copper_j_per_k as f32),
            JoulePerKelvin(self.heat.pad_j_per_k as f32),
            KelvinPerWatt(self.heat.copper_to_pad_k_per_w as f32),
            KelvinPerWatt(self.heat.pad_to_ambient_k_per_w as f32),
        );
        // The plant's temperatures are relative to 25 degrees Celsius; the calibration knows the
        // resistance within a percent.
        let error = self.chance.random_range(0.99..1.01);
        self.prediction = nodes.ok().map(|nodes| Prediction {
            nodes,
            now: Temperatures::uniform(Celsius(25.0)),
            copper: Copper(Ohm((self.sound.coil_ohm * error / 1.0197) as f32)),
        });
    }

    /// Starts or ends a fault of circuit, measurement, supply or supervision.
    fn disturb(&mut self) {
        let sound = self.sound;
        let control: &mut ControlLoop = &mut self.loop_;
        let parameters = &mut control.circuit.parameters;
        let kept = Slow {
            gain_error: control.slow.gain_error,
            offset_a: control.slow.offset_a,
            ..Slow::default()
        };
        let mut is_sound = false;
        match self.chance.random_range(0..20) {
            0 => {
                parameters.coil_ohm = self.chance.random_range(5e-3..0.1);
                parameters.inductance_h = self.chance.random_range(1e-6..10e-6);
            }
            1 => parameters.coil_ohm = 1e4,
            2 => {
                let volts = [0.0, 1.65, 3.3, self.chance.random_range(0.0..3.3)];
                let at = self.chance.random_range(0..volts.len());
                control.slow.stuck_v = Some(volts[at]);
                self.measured = false;
            }
            3 => control.slow.bridge_faults = true,
            4 => control.slow.attended = false,
            5 => parameters.supply_v = self.chance.random_range(0.5..16.0),
            6 => {
                control.slow.supply_error =
                    [f64::NAN, -1.0, 0.05, -0.05, f64::INFINITY][self.chance.random_range(0..5)];
            }
            7 => control.slow.limit_faults = false,
            _ => {
                let copper_ohm = parameters.coil_ohm;
                *parameters = sound;
                if copper_ohm < 1.0 && copper_ohm > 0.2 {
                    parameters.coil_ohm = copper_ohm;
                }
                control.slow = kept;
                is_sound = true;
            }
        }
        if is_sound && !self.is_sound {
            self.sound_since = self.loop_.periods();
        }
        self.is_sound = is_sound;
    }

    fn number(&mut self, scale: f32) -> f32 {
        match self.chance.random_range(0..24) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => -1e30,
            3 => 1e30,
            _ => self.chance.random_range(-1.2..1.2_f32) * scale,
        }
    }

    fn command(&mut self) {
        let result = match self.chance.random_range(0..12) {
            0 => self.loop_.begin_test(),
            1 => {
                self.loop_.order(&Supervisor::stop());
                Ok(())
            }
            2 | 3 => {
                self.loop_.order(&Supervisor::clear());
                self.loop_.begin_test()
            }
            4 => {
                self.loop_.order(&Supervisor::clear());
                Ok(())
            }
            5 => self.finish_test(),
            6 => {
                let (to_a, over_s) = (self.number(12.0), self.number(0.02));
                self.loop_.go(to_a, over_s.abs())
            }
            7 => {
                let (to_a, over_s) = (self.number(12.0), self.number(0.02));
                self.loop_.go(to_a, over_s)
            }
            8 => {
                let peak_a = self.number(10.0);
                // Half waves of alternating polarity with decreasing peaks.
                let half_wave = |of: i32| (peak_a * (-0.8_f32).powi(of), 1e-3);
                self.loop_
                    .follow_all((0..12).map(half_wave).chain([(0.0, 1e-3)]))
            }
            _ => {
                let (peak_a, end_a) = (self.number(11.0), self.number(4.0));
                let [rise_s, rest_s, fall_s] =
                    [0.0, 1e-3, 2e-3].map(|least| least + self.number(1e-3).abs());
                let ramp = [(peak_a, rise_s), (peak_a, rest_s), (end_a, fall_s)];
                let train = [ramp.repeat(4), vec![(0.0, rise_s)]].concat();
                self.loop_.follow_all(train)
            }
        };
        match result {
            Ok(()) => self.summary.begun += 1,
            Err(_) => self.summary.refused += 1,
        }
    }

    /// Drives the highest current for the longest allowed time.
    fn heat_up(&mut self) {
        if matches!(
            self.loop_.state(),
            DriveState::Latched(_) | DriveState::Off { tested: false }
        ) && self.finish_test().is_err()
        {
            self.summary.refused += 1;
            return;
        }
        let current_a = self.chance.random_range(6.0..12.0_f32);
        let longest_s = self.chance.random_range(0.05..0.8);
        let stay = CurrentLine {
            start_us: self.loop_.now_us() + 1_000,
            from_a: current_a,
            to_a: current_a,
            over_s: longest_s,
        };
        match self.loop_.follow(&stay) {
            Ok(()) => self.summary.begun += 1,
            Err(_) => self.summary.refused += 1,
        }
    }

    /// Runs a self-test to its end, so that the coil can be driven.
    fn finish_test(&mut self) -> Result<(), coil_hbridge::Refusal> {
        self.loop_.order(&Supervisor::stop());
        self.loop_.order(&Supervisor::clear());
        self.loop_.begin_test()?;
        for _ in 0..12_000 {
            self.period();
            if self.loop_.state() != DriveState::Testing {
                break;
            }
        }
        Ok(())
    }

    fn defect(&mut self, what: String) {
        self.summary.defects.push((self.seed, what));
    }

    fn period(&mut self) {
        let before = self.loop_.state();
        let begin_a = self.loop_.circuit.current_a();
        self.loop_.circuit.forget_peak();
        let period = self.loop_.period();
        let state = self.loop_.state();
        if let (DriveState::Latched(fault), false) = (state, before == state)
            && let Some(index) = Fault::ALL.iter().position(|of| *of == fault)
        {
            self.summary.faults[index] += 1;
        }
        self.check_current(begin_a, state);
        let levels = period.output.levels;
        let duty = f32::from(levels.in1.abs_diff(levels.in2)) / FULL_LEVEL;
        if duty > self.limits.duty {
            self.defect(format!("duty {duty}"));
        }
        if !period.output.awake && (levels.in1 > 0 || levels.in2 > 0) {
            self.defect("asleep with an input high".to_owned());
        }
        let driven = before == DriveState::Driving && period.output.awake;
        // Counts from the first pulse on: until then the bridge wakes up.
        let begun = self.awake_periods > 0 || levels.in1 > 0 || levels.in2 > 0;
        self.awake_periods = if driven && begun {
            self.awake_periods + 1
        } else {
            0
        };
        let most = (f64::from(self.limits.on_time_s) / 16e-6) as u32 + BLOCK;
        if self.awake_periods > most {
            self.defect(format!("on for {} periods", self.awake_periods));
        }
        self.since += 1;
        if self.since >= THERMAL_PERIODS {
            self.since = 0;
            self.warm();
        }
    }

    fn check_current(&mut self, begin_a: f64, state: DriveState) {
        let (peak_a, _) = self.loop_.circuit.peak();
        self.summary.peak_a = self.summary.peak_a.max(peak_a);
        if peak_a > PEAK_A {
            self.defect(format!("{peak_a} A"));
        }
        let measures = self.loop_.slow.stuck_v.is_none();
        let learned = self.loop_.periods().wrapping_sub(self.sound_since) > LEARNS;
        if self.is_sound && learned && measures && state == DriveState::Driving {
            let current_a = self.loop_.circuit.current_a().abs();
            self.summary.greatest_a = self.summary.greatest_a.max(current_a);
            let limit_a = CURRENT_MARGIN * f64::from(self.limits.setpoint_a);
            if current_a > limit_a && begin_a.abs() > limit_a {
                self.defect(format!("{current_a} A in a sound circuit"));
            }
        }
        // The drive is off within two periods of the first sample above the limit.
        let over = measures && begin_a.abs() > 1.04 * f64::from(self.limits.trip_a);
        let drives = matches!(state, DriveState::Driving | DriveState::Testing);
        match (over && drives, self.above) {
            (true, Some(since)) if self.loop_.periods().wrapping_sub(since) > 1 => {
                self.defect(format!("{begin_a} A for more than two periods"));
            }
            (true, None) => self.above = Some(self.loop_.periods()),
            (true, _) => {}
            (false, _) => self.above = None,
        }
    }

    /// Advances heat and energy by a millisecond.
    fn warm(&mut self) {
        let totals = self.loop_.circuit.totals();
        let duration_s = f64::from(THERMAL_PERIODS) * 16e-6;
        let square_a2 = (totals.square_a2_s - self.square_a2_s) / duration_s;
        self.square_a2_s = totals.square_a2_s;
        let copper_ohm = self.loop_.circuit.parameters.coil_ohm;
        let sound = copper_ohm > 0.2 && copper_ohm < 1.0;
        if sound {
            self.state = self.heat.advance(&self.state, square_a2, duration_s);
            self.loop_.circuit.parameters.coil_ohm = self.heat.coil_resistance_ohm(&self.state);
        }
        let taken_j = totals.supply_j - self.supply_j;
        self.supply_j = totals.supply_j;
        let given_off_j = f64::from(self.limits.continuous_w) * duration_s;
        self.energy_j = (self.energy_j + taken_j - given_off_j).max(0.0);
        let part = self.energy_j / f64::from(self.limits.energy_j);
        self.summary.energy = self.summary.energy.max(part);
        if part > 1.0 {
            self.defect(format!("{} J", self.energy_j));
        }
        self.compare(sound, duration_s);
    }

    fn compare(&mut self, sound: bool, duration_s: f64) {
        let now = self.loop_.periods();
        let hardware = *self.loop_.supervisor().hardware();
        let averages: &Averages<_> = self.loop_.averages();
        let from = now.wrapping_sub(THERMAL_PERIODS);
        let mean_square =
            averages.mean_of_current(from, now, &hardware, |current_a| current_a * current_a);
        let (Some(square_a2), Some(prediction)) = (mean_square, &mut self.prediction) else {
            return;
        };
        if !sound || !self.measured {
            // A current through a short heats something else, and one beyond the measurement is
            // unknown: no prediction is possible. The guards above bound such currents.
            self.measured = false;
            return;
        }
        let ohm = prediction.copper.resistance(prediction.now.copper);
        prediction.now = prediction.nodes.after(
            prediction.now,
            Watt(square_a2 * ohm.0),
            Celsius(25.0),
            Second(duration_s as f32),
        );
        let error_k = f64::from(prediction.now.copper.0) - 25.0 - self.state.copper_k;
        self.summary.error_k = self.summary.error_k.max(error_k.abs());
        self.summary.rise_k = self.summary.rise_k.max(self.state.copper_k);
        if error_k.abs() > TEMPERATURE_K {
            self.defect(format!("the copper is {error_k} K off"));
        }
    }
}
