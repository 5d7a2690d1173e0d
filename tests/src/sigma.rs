//! The driver's stated standard uncertainty, against the scatter of the simulated chip's words
//! about the true mean frequency of each conversion.

use std::{cell::RefCell, f64::consts::PI};

use ldc161x::{
    Acquisition, Address, Channel, Code28, Configuration, Ldc161x, Model, Noise, Plan, Rate,
    Rcount, ReferenceClock, Request, Sensor, Sequence,
};
use ldc161x_sim::{
    Bus, Chip, Conversions, Counter, ExternalClock, Sensors, Settings, Switches, Time,
};
use rand::{RngExt, SeedableRng, seq::IndexedRandom};
use rand_pcg::Pcg64;

/// One setting of the converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConverterCase {
    /// RCOUNT of every channel.
    pub rcount: u16,
    /// Four channels in turn, or channel 0 alone.
    pub autoscan: bool,
    /// White noise of the sensors: relative standard deviation in 1 ms.
    pub noise_in_1_ms: f64,
    /// Whether the driver's configuration states the position of the simulated comparator's falling
    /// edge.
    pub duty_is_known: bool,
    /// Counting method of the simulated core.
    pub counter: Counter,
}

/// Scatter of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Rms of error over stated sigma: 1 for a correct statement.
    pub rms: f64,
    /// Mean of error over stated sigma.
    pub bias: f64,
}

/// Position of the simulated comparator's falling edge: consistent with posted words, and away from
/// the values at which phases coincide.
const DUTY: f64 = 0.29;
/// Half sensor periods of the channels, in reference periods of 25 ns. The phases between the edges
/// of sensor and reference run from in step (greatest quantisation) to half a step apart (least).
const HALF_PERIODS: [f64; 4] = [6.05, 6.27, 6.5, 5.73];
/// Relative frequency sweep of the sensors, so that no phase stays constant: at the shortest
/// conversion, RCOUNT 100, the count repeats after 0.06 %.
const SWEEP: f64 = 0.01;
/// Duration of a sweep from end to end, s; not a multiple of a conversion.
const SWEEP_S: f64 = 1.618_034;
/// Number of sweeps in a run of a random plan.
const SWEEPS: f64 = 5.39;
/// Time limit of a frame, longer than any frame takes.
const LONGEST_FRAME: Time = Time::from_ms(60_000);

/// Reads `readings` frames and returns the scatter of each channel.
///
/// # Errors
///
/// Errors of the driver or of the plan.
pub fn measure(case: &ConverterCase, readings: u32, seed: u64) -> Result<Vec<Scatter>, String> {
    let configuration = configuration(case)?;
    // With one channel the clock is halved, since its limit is 35 MHz.
    let reference_hz = if case.autoscan { 40e6 } else { 20e6 };
    let middles = HALF_PERIODS.map(|half| reference_hz / (2.0 * half));
    let sensors = move |channel: usize, time_s: f64| {
        let share = SWEEP * (sweep(channel, time_s / SWEEP_S) - 0.5);
        middles.get(channel).map_or(0.0, |hz| hz * (1.0 + share))
    };
    compare(&configuration, settings(case, seed), sensors, readings)
}

/// A triangle from 0 to 1 and back in two turns, with each channel a quarter of a turn behind.
fn sweep(channel: usize, turns: f64) -> f64 {
    ((turns + 0.25 * channel as f64).rem_euclid(2.0) - 1.0).abs()
}

/// Runs the driver on the simulated chip, and compares each reading with the true mean frequency of
/// its conversion.
fn compare(
    configuration: &Configuration,
    settings: Settings,
    sensors: impl Sensors + Clone,
    readings: u32,
) -> Result<Vec<Scatter>, String> {
    let chip = RefCell::new(Chip::new(settings, sensors));
    let mut driver = Ldc161x::new(Bus::new(&chip, 400_000), Model::Ldc1614, Address::AddrLow);
    let text = |error: ldc161x::Error<_>| error.to_string();
    driver.start(configuration).map_err(text)?;
    let mut sums = [(0.0, 0.0); 4];
    for _ in 0..readings {
        let limit = chip.borrow().now() + LONGEST_FRAME;
        let edge = chip.borrow_mut().advance_to_interrupt(limit);
        edge.ok_or("INTB did not fall")?;
        let frame = driver.read_frame().map_err(text)?;
        for (reading, (sum, squares)) in frame.readings().iter().zip(&mut sums) {
            let chip = chip.borrow();
            let Some(truth) = chip.last_read(reading.channel.number()) else {
                return Err(format!("no conversion is behind {reading:?}"));
            };
            let error = (reading.frequency_hz - truth.sensor_hz) / f64::from(reading.sigma_hz);
            *sum += error;
            *squares += error * error;
        }
    }
    let count = f64::from(readings);
    let channels = usize::from(configuration.acquisition.channel_count());
    let scatter = |&(sum, squares): &(f64, f64)| Scatter {
        rms: (squares / count).sqrt(),
        bias: sum / count,
    };
    Ok(sums.iter().take(channels).map(scatter).collect())
}

/// A plan for the sensors, with the RCOUNT of the case: the shortest conversions end sooner than
/// the bus can fetch them, which is not a usable plan but measures quantisation as well.
fn configuration(case: &ConverterCase) -> Result<Configuration, String> {
    let acquisition = if case.autoscan {
        Acquisition::Autoscan(Sequence::ZeroToThree)
    } else {
        Acquisition::Single(Channel::Zero)
    };
    let range = if case.autoscan {
        (2_900_000, 3_600_000)
    } else {
        (1_500_000, 1_800_000)
    };
    let sensor = Sensor {
        highest_quality_factor: 25,
        lowest_rp_ohm: 3_000,
        highest_rp_ohm: 3_000,
        ..Sensor::new(range.0, range.1)
    };
    let clock = ReferenceClock::External { hz: 40_000_000 };
    let plan = Request::new(Model::Ldc1614, clock, acquisition, sensor)
        .rate(Rate::PerSecond(100))
        .plan()
        .map_err(|refusal| refusal.to_string())?;
    let mut configuration = plan.configuration;
    configuration.noise = Noise {
        white_relative_in_1_ms: case.noise_in_1_ms as f32,
        comparator_duty: case.duty_is_known.then_some(DUTY as f32),
    };
    let rcount = Rcount::new(case.rcount).ok_or("RCOUNT below 9")?;
    for channel in acquisition.channels() {
        configuration.channel_mut(channel).rcount = rcount;
    }
    Ok(configuration)
}

/// Only quantisation and noise: no shift by the drive, an exact clock.
fn settings(case: &ConverterCase, seed: u64) -> Settings {
    Settings {
        seed,
        conversions: Conversions {
            quantised: true,
            noise_at_1ms: case.noise_in_1_ms,
            falling_edge: DUTY,
            ..Conversions::default()
        },
        switches: Switches {
            counter: case.counter,
            ..Switches::default()
        },
        ..Settings::ideal()
    }
}

/// Cases of the campaign: RCOUNT 100 to 65,535, one channel and four, without noise and with the
/// 1e-6 in 1 ms of this project's reference plants.
pub fn cases(counter: Counter, duty_is_known: bool) -> impl Iterator<Item = ConverterCase> {
    [100, 300, 1_000, 3_000, 10_000, 30_000, 65_535]
        .into_iter()
        .flat_map(move |rcount| {
            [false, true].into_iter().flat_map(move |autoscan| {
                [0.0, 1e-6]
                    .into_iter()
                    .map(move |noise_in_1_ms| ConverterCase {
                        rcount,
                        autoscan,
                        noise_in_1_ms,
                        duty_is_known,
                        counter,
                    })
            })
        })
}

/// Random requests that the planner accepts, for sensors of 1 kHz to 10 MHz.
pub fn accepted_plans(seed: u64) -> impl Iterator<Item = (Request, Plan)> {
    let mut random = Pcg64::seed_from_u64(seed);
    std::iter::repeat_with(move || draw(&mut random))
        .filter_map(|request| request.plan().ok().map(|plan| (request, plan)))
}

fn draw(random: &mut Pcg64) -> Request {
    let reference = if random.random_bool(0.2) {
        ReferenceClock::Internal
    } else {
        let hz = logarithmic(random, 2e6, 40e6) as u32;
        ReferenceClock::External { hz }
    };
    let acquisitions = [
        Acquisition::Single(Channel::Zero),
        Acquisition::Single(Channel::Two),
        Acquisition::Autoscan(Sequence::ZeroToOne),
        Acquisition::Autoscan(Sequence::ZeroToTwo),
        Acquisition::Autoscan(Sequence::ZeroToThree),
    ];
    let acquisition = acquisitions
        .choose(random)
        .copied()
        .unwrap_or(acquisitions[0]);
    let resistance_ohm = logarithmic(random, 1e3, 80e3) as u32;
    let lowest_hz = logarithmic(random, 1e3, 10e6);
    let sensor = Sensor {
        highest_quality_factor: logarithmic(random, 5.0, 200.0) as u16,
        lowest_rp_ohm: resistance_ohm,
        highest_rp_ohm: resistance_ohm,
        ..Sensor::new(
            lowest_hz as u32,
            (lowest_hz * random.random_range(1.01..1.1)) as u32,
        )
    };
    let rate = match random.random_range(0..3) {
        0 => Rate::AsTheBusAllows,
        1 => Rate::PerSecond(logarithmic(random, 1.0, 4e3) as u32),
        _ => {
            let rcount = logarithmic(random, 9.0, 65_535.0) as u16;
            Rate::Conversion(Rcount::new(rcount).unwrap_or(Rcount::MAX))
        }
    };
    let white_relative_in_1_ms = *[0.0, 1e-6].choose(random).unwrap_or(&0.0);
    Request {
        noise: Noise {
            white_relative_in_1_ms,
            comparator_duty: Some(DUTY as f32),
        },
        ..Request::new(Model::Ldc1614, reference, acquisition, sensor)
    }
    .rate(rate)
}

/// A log-uniform number between `low` and `high`.
fn logarithmic(random: &mut Pcg64, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.random())
}

/// Sensors of a plan, which sweep sinusoidally through their range: equal steps from reading to
/// reading would repeat the same rounding.
#[derive(Clone)]
struct Sweeping {
    sensor: Sensor,
    sweep_s: f64,
}

impl Sensors for Sweeping {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        let [low, high] = [self.sensor.lowest_hz, self.sensor.highest_hz].map(f64::from);
        let turns = time_s / self.sweep_s + 0.25 * channel as f64;
        low + (high - low) * (0.5 - 0.5 * (PI * turns).cos())
    }

    fn parallel_resistance_ohm(&self, _channel: usize, _time_s: f64) -> f64 {
        self.sensor.highest_rp_ohm.into()
    }

    fn quality_factor(&self, _channel: usize, _time_s: f64) -> f64 {
        self.sensor.highest_quality_factor.into()
    }
}

/// Reads `readings` frames by a plan and returns the scatter of each channel.
///
/// # Errors
///
/// Errors of the driver.
pub fn measure_plan(
    request: &Request,
    plan: &Plan,
    readings: u32,
    seed: u64,
) -> Result<Vec<Scatter>, String> {
    let [sensor, ..] = request.sensors;
    let sensors = Sweeping {
        sensor,
        sweep_s: sweep_s(&sensor, plan, readings),
    };
    let external_clock = match request.reference {
        ReferenceClock::External { hz } => Some(ExternalClock::exact(hz.into())),
        ReferenceClock::Internal => None,
    };
    let settings = Settings {
        seed,
        external_clock,
        conversions: Conversions {
            quantised: true,
            noise_at_1ms: request.noise.white_relative_in_1_ms.into(),
            falling_edge: DUTY,
            ..Conversions::default()
        },
        ..Settings::ideal()
    };
    compare(&plan.configuration, settings, sensors, readings)
}

/// Period of the sensors' sweep, s: not an integer fraction of the run, and so long that a
/// frequency moves by at most a fifth of the stated uncertainty in a third of a sensor period. The
/// mean between the counted edges is then that of the whole conversion.
fn sweep_s(sensor: &Sensor, plan: &Plan, readings: u32) -> f64 {
    let [low, high] = [sensor.lowest_hz, sensor.highest_hz].map(f64::from);
    let first = plan.configuration.acquisition.channels().next();
    let scale = plan.configuration.scale(first.unwrap_or_default());
    let code = Code28::new((high / scale.hz_per_lsb()) as u32).unwrap_or(Code28::OVER_RANGE);
    let share_per_s = 0.2 * f64::from(scale.relative_sigma(code)) * 3.0 * low;
    let run_s = f64::from(readings) * plan.frame_period_ns as f64 * 1e-9;
    (run_s / SWEEPS).max(PI / 2.0 * (high / low - 1.0) / share_per_s)
}
