//! The standard uncertainty that the driver states, against the scatter of the simulated chip's
//! words about the true mean frequency of each conversion.

use std::cell::RefCell;

use ldc161x::{
    Acquisition, Address, Channel, Configuration, Ldc161x, Model, Noise, Rate, Rcount,
    ReferenceClock, Request, Sensor, Sequence,
};
use ldc161x_sim::{Bus, Chip, Conversions, Counter, Delay, IntbPin, Settings, Switches};

/// One setting of the converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConverterCase {
    /// RCOUNT of every channel.
    pub rcount: u16,
    /// Four channels in turn, or channel 0 alone.
    pub autoscan: bool,
    /// White noise of the sensors: relative standard deviation in 1 ms.
    pub noise_in_1_ms: f64,
    /// Whether the driver's configuration states where the simulated comparator's falling edge is.
    pub duty_is_known: bool,
    /// How the simulated core counts.
    pub counter: Counter,
}

/// What one channel showed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Middle of the sensor's frequency range, in hertz.
    pub sensor_hz: f64,
    /// Root mean square of error over stated sigma: 1 where the statement is right.
    pub rms: f64,
    /// Mean of error over stated sigma.
    pub bias: f64,
}

/// Where the simulated comparator's falling edge is: within what posted words allow, and at none
/// of the values at which phases fall together.
const DUTY: f64 = 0.29;
/// Half a sensor period in reference periods of 25 ns: four phases between the edges of sensor
/// and reference, from in step (which quantises most) to half a step apart (least).
const HALF_PERIODS: [f64; 4] = [6.05, 6.27, 6.5, 5.73];
/// The sensors sweep through this share of their frequency, so that no phase stands still: at
/// the shortest conversion, RCOUNT 100, the count repeats itself after 0.06 %.
const SWEEP: f64 = 0.01;
/// Seconds from one end of the sweep to the other; no multiple of a conversion.
const SWEEP_S: f64 = 1.618_034;

/// Reads `readings` frames and compares.
///
/// # Errors
///
/// What the driver or the plan complains of.
pub fn measure(case: &ConverterCase, readings: u32, seed: u64) -> Result<Vec<Scatter>, String> {
    let configuration = configuration(case)?;
    // With one channel the clock is halved, since its limit is 35 MHz.
    let reference_hz = if case.autoscan { 40e6 } else { 20e6 };
    let middles = HALF_PERIODS.map(|half| reference_hz / (2.0 * half));
    let sensors = move |channel: usize, time_s: f64| {
        let phase = (time_s / SWEEP_S + 0.25 * channel as f64).rem_euclid(2.0);
        let triangle = (phase - 1.0).abs() - 0.5;
        middles
            .get(channel)
            .map_or(0.0, |hz| hz * (1.0 + SWEEP * triangle))
    };
    let chip = RefCell::new(Chip::new(settings(case, seed), sensors));
    let (mut interrupt, mut delay) = (IntbPin::new(&chip), Delay::new(&chip));
    let mut driver = Ldc161x::new(Bus::new(&chip, 400_000), Model::Ldc1614, Address::AddrLow);
    let text = |error: ldc161x::Error<_>| error.to_string();
    driver.start(&configuration).map_err(text)?;
    let mut sums = [(0.0, 0.0); 4];
    for _ in 0..readings {
        driver
            .wait_for_interrupt(&mut interrupt, &mut delay)
            .map_err(text)?;
        let frame = driver.read_frame().map_err(text)?;
        for (reading, (sum, squares)) in frame.readings().iter().zip(&mut sums) {
            let chip = chip.borrow();
            let Some(truth) = chip.last_read(reading.channel.number()) else {
                continue;
            };
            let error = (reading.frequency_hz - truth.sensor_hz) / f64::from(reading.sigma_hz);
            *sum += error;
            *squares += error * error;
        }
    }
    let count = f64::from(readings);
    let channels = usize::from(configuration.acquisition.channel_count());
    Ok(sums
        .iter()
        .zip(middles)
        .take(channels)
        .map(|((sum, squares), sensor_hz)| Scatter {
            sensor_hz,
            rms: (squares / count).sqrt(),
            bias: sum / count,
        })
        .collect())
}

/// A plan for the sensors, with the RCOUNT of the case put in: the shortest conversions end
/// sooner than the bus can fetch them, which is no plan but measures quantisation as well.
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

/// Quantisation and noise and nothing else: no shift by the drive, an exact clock.
fn settings(case: &ConverterCase, seed: u64) -> Settings {
    let ideal = Settings::ideal();
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
        ..ideal
    }
}

/// The cases of the campaign: RCOUNT 100 to 65,535, one channel and four, without noise and with
/// the 1e-6 in 1 ms of this project's reference plants.
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
