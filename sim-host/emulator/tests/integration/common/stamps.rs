//! Compares samples with the true conversions of the simulated converter.

use std::collections::BTreeMap;

use ldc161x_sim::{InterruptRelease, Overwrite, Settings, Switches, TrueConversion};
use palpate_emulator::{EmulatedBoard, Options, Plant, Still, Time};
use palpate_wire::code::{Outcome, Stream};
use palpate_wire::command::Command;
use palpate_wire::record::Sample;

use super::{FREQUENCIES_HZ, RecordedBoard, image, origin_us, recording};

/// Allowed error of a time stamp, us.
pub(crate) const ALLOWED_US: f64 = 2.0;
/// Drift of every sensor's frequency, Hz/s: more from scan to scan than the resolution of a word,
/// so that each word identifies its conversion.
const DRIFT_HZ_PER_S: f64 = 1e6;

/// Sensors of the second converter, all different from the first one's.
const SECOND_HZ: [f64; 4] = [2.5e6, 2.6e6, 2.7e6, 2.8e6];

/// Unsettled properties of the converter that matter here.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Silicon {
    pub(crate) release: InterruptRelease,
    pub(crate) overwrite: Overwrite,
}

impl Silicon {
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        InterruptRelease::VARIANTS.iter().flat_map(|&release| {
            Overwrite::VARIANTS
                .iter()
                .map(move |&overwrite| Self { release, overwrite })
        })
    }

    /// A board with such a converter, just powered.
    pub(crate) fn bench(self) -> RecordedBoard {
        self.bench_with(recording())
    }

    /// A board with two such converters.
    pub(crate) fn bench_of_two(self) -> RecordedBoard {
        self.bench_with(Options {
            second_converter: Some(palpate_emulator::SecondSensors::new(SECOND_HZ)),
            ..recording()
        })
    }

    fn bench_with(self, options: Options) -> RecordedBoard {
        let chip = Settings {
            switches: Switches {
                interrupt_release: self.release,
                overwrite: self.overwrite,
                ..Switches::default()
            },
            ..Settings::default()
        };
        let mut plant = Still::new(FREQUENCIES_HZ);
        plant.drift_hz_per_s = DRIFT_HZ_PER_S;
        RecordedBoard::of(EmulatedBoard::new(image(), plant, chip, options))
    }

    /// Scan rate, Hz: 98 % of the highest that the bus can fetch with 10 us between two scans.
    pub(crate) fn fastest_hz(self, channels: u8) -> f32 {
        let status = u32::from(self.release == InterruptRelease::StatusOnly);
        let bit_times = 47 * (2 * channels.count_ones() + status) + 1;
        let period_s = f64::from(bit_times) * 2.5e-6 + 10e-6;
        (0.98 / period_s).ceil() as f32
    }
}

/// Check results of the samples.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Judged {
    /// Numbers of samples, and of marked ones.
    pub(crate) samples: u32,
    pub(crate) marked: u32,
    /// Unmarked samples with a time off by more than is allowed.
    pub(crate) off: u32,
    /// Unmarked samples with channels from different scans.
    pub(crate) mixed: u32,
    /// Unmarked samples after a missing scan.
    pub(crate) skipped: u32,
    /// Unmarked samples whose last byte is not the converter's, because its supply failed during
    /// that byte: the line then reads as ones, and no missing acknowledge shows the failure. The
    /// next sample must be marked, since the converter restarts.
    pub(crate) torn: u32,
    /// Smallest and largest error of an unmarked time, us.
    pub(crate) least_us: f64,
    pub(crate) most_us: f64,
    /// Greatest difference between the errors of two consecutive scans.
    pub(crate) jitter_us: f64,
}

impl Judged {
    /// Whether every unmarked sample is right.
    pub(crate) const fn holds(&self) -> bool {
        self.off == 0 && self.mixed == 0 && self.skipped == 0
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.marked += other.marked;
        self.off += other.off;
        self.mixed += other.mixed;
        self.skipped += other.skipped;
        self.torn += other.torn;
        self.least_us = self.least_us.min(other.least_us);
        self.most_us = self.most_us.max(other.most_us);
        self.jitter_us = self.jitter_us.max(other.jitter_us);
    }
}

fn middle_us(conversion: &TrueConversion) -> f64 {
    (conversion.start.as_secs_f64() + conversion.end.as_secs_f64()) / 2.0 * 1e6
}

/// Fetched conversions, by channel and word.
type Fetched<'a> = BTreeMap<(u8, u32), Vec<&'a TrueConversion>>;

/// True conversions of a sample, each with the time that the sample gives for it; `None` if one
/// never existed, as for a torn word.
fn truths<'a>(
    fetched: &Fetched<'a>,
    time_us: f64,
    sample: &Sample,
) -> Option<Vec<(&'a TrueConversion, f64)>> {
    let of = |it: &palpate_wire::record::Conversion| {
        let claimed_us = time_us + f64::from(it.offset_us);
        let off = |truth: &&&TrueConversion| (middle_us(truth) - claimed_us).abs();
        let all = fetched.get(&(it.channel, it.word & 0x0FFF_FFFF))?;
        let truth = all.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        Some((*truth, claimed_us))
    };
    sample.channels.iter().map(of).collect()
}

/// Whether the last byte of a sample's frame was read from an undriven line.
fn ends_in_ones(sample: &Sample) -> bool {
    let last = sample.channels.last();
    last.is_some_and(|it| it.word & 0xFF == 0xFF)
}

/// Checks the samples of a bench.
pub(crate) fn judge<P: Plant>(bench: &RecordedBoard<P>) -> Judged {
    let origin_us = origin_us(&bench.board);
    let log = bench.board.wire_log().unwrap();
    let mut fetched = Fetched::new();
    for conversion in &log.fetched {
        let key = (conversion.channel, conversion.word);
        fetched.entry(key).or_default().push(conversion);
    }
    let mut judged = Judged::default();
    let mut last = None;
    let mut last_error_us = None;
    let mut after_torn = false;
    let of_first = bench.samples().filter(|(_, sample)| sample.sensor == 0);
    for (time_us, sample) in of_first {
        judged.samples += 1;
        let truths = truths(&fetched, time_us as f64 + origin_us, sample);
        let numbers = |of: &[(&TrueConversion, f64)]| -> Vec<u64> {
            of.iter().map(|(truth, _)| truth.number).collect()
        };
        let before = last.take();
        let error_before_us = last_error_us.take();
        last = truths.as_deref().map(numbers);
        let is_marked = sample.gap || sample.missed > 0;
        judged.mixed += u32::from(core::mem::take(&mut after_torn) && !is_marked);
        if is_marked {
            judged.marked += 1;
            continue;
        }
        let Some(truths) = truths else {
            after_torn = ends_in_ones(sample);
            judged.torn += u32::from(after_torn);
            judged.mixed += u32::from(!after_torn);
            continue;
        };
        let errors = || truths.iter().map(|(truth, us)| us - middle_us(truth));
        judged.least_us = errors().fold(judged.least_us, f64::min);
        judged.most_us = errors().fold(judged.most_us, f64::max);
        last_error_us = errors().next();
        if let (Some(before_us), Some(us)) = (error_before_us, last_error_us) {
            judged.jitter_us = judged.jitter_us.max((us - before_us).abs());
        }
        judged.off += u32::from(errors().any(|us| us.abs() > ALLOWED_US));
        // The channels end one after the other, from the lowest, and a scan lasts as long as all of
        // them.
        let span = |at: &dyn Fn(&TrueConversion) -> f64| {
            let times = truths.iter().map(|(truth, _)| at(truth));
            times.clone().fold(f64::MIN, f64::max) - times.fold(f64::MAX, f64::min)
        };
        let longest_us = span(&middle_us);
        let claimed_us = sample.channels.last().map_or(0, |it| it.offset_us);
        judged.mixed += u32::from((longest_us - f64::from(claimed_us)).abs() > ALLOWED_US);
        if let (Some(before), Some((first, _))) = (before, truths.first()) {
            judged.skipped += u32::from(before.first() != Some(&(first.number.wrapping_sub(1))));
        }
    }
    judged
}

/// Check results of two converters on one bus, from the first sample of each on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shared {
    pub(crate) samples: u32,
    pub(crate) marked: u32,
    pub(crate) lost: u32,
    /// Unmarked samples whose frequency is not that of their sensor, or whose time is off the grid
    /// of the previous ones.
    pub(crate) wrong: u32,
}

impl Shared {
    pub(crate) fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.marked += other.marked;
        self.lost += other.lost;
        self.wrong += other.wrong;
    }
}

/// Checks the samples of both converters of a bench, both at this rate. The second one's sensors
/// are constant, so a word does not identify its conversion.
pub(crate) fn judge_both<P: Plant>(bench: &RecordedBoard<P>, rate_hz: f32) -> Shared {
    let mut found = Shared::default();
    for sensor in [0, 1] {
        let mut samples = bench.samples().filter(|(_, it)| it.sensor == sensor);
        // Losses before the first sample are unknown.
        let Some((mut last_us, _)) = samples.next() else {
            found.lost += 1;
            continue;
        };
        found.samples += 1;
        for (time_us, sample) in samples {
            found.samples += 1;
            found.lost += sample.missed;
            let step_us = (time_us - core::mem::replace(&mut last_us, time_us)) as f64;
            if sample.gap || sample.missed > 0 {
                found.marked += 1;
                continue;
            }
            let is_right = |it: &palpate_wire::record::Conversion| {
                let sensors_hz = if sensor == 0 {
                    FREQUENCIES_HZ
                } else {
                    SECOND_HZ
                };
                let drift_hz = if sensor == 0 { DRIFT_HZ_PER_S } else { 0.0 };
                let off_hz = it.frequency_hz - sensors_hz[usize::from(it.channel)];
                // The tolerance includes 1 s of drift, more than during a bench's run. At the second
                // converter, without drift, a wrong clock is off by more than 5 kHz.
                (-5e3..=5e3 + drift_hz).contains(&off_hz)
            };
            // The scan plan is exact to a thousandth of the period.
            let period_us = 1e6 / f64::from(rate_hz);
            let is_on_grid = (step_us - period_us).abs() < 5.0 + 2e-3 * period_us;
            let is_wrong = !is_on_grid || !sample.channels.iter().all(is_right);
            found.wrong += u32::from(is_wrong);
        }
    }
    found
}

/// Sets channels and rate, drops earlier samples, and runs.
pub(crate) fn change<P: Plant>(
    bench: &mut RecordedBoard<P>,
    channels: u8,
    rate_hz: f32,
    run: Time,
) {
    let settings = palpate_wire::command::Settings {
        channels,
        rate_hz,
        stream: Stream::Samples,
        ..bench.settings()
    };
    let answer = bench.command(&Command::SetSettings(settings));
    assert_eq!(answer.outcome, Outcome::Accepted);
    bench.run(run);
    // Samples from before the command have the old settings.
    let count = channels.count_ones() as usize;
    let of_old = |frame: &palpate_wire::Frame<palpate_wire::Record>| matches!(&frame.message, palpate_wire::Record::Sample(it) if it.channels.len() != count);
    if let Some(last) = bench.frames.iter().rposition(of_old) {
        bench.frames.drain(..=last);
    }
}
