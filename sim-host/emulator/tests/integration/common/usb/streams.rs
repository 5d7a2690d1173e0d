//! Checks that data over USB are complete.

use palpate_emulator::{LevelTimes, Time};
use palpate_wire::code::{Outcome, State, Stream};
use palpate_wire::loss::Tally;
use palpate_wire::record::Sample;
use palpate_wire::{Command, Frame, Record};

use super::{UsbBench, missing};

/// Interval between two status records, s: short enough to lie within a train.
const STATUS_PERIOD_S: f32 = 0.1;
/// Time for which the stream continues after a disturbance, for its account.
const AFTERWARDS: Time = Time::from_ms(300);

/// Latest allowed time within a frame at which a bulk packet becomes available; the controller's
/// limit is 800 us (RP2040-E15).
pub(crate) const LATEST_PACKET: Time = Time::from_us(770);

/// Results of a stream.
#[derive(Clone, Debug, Default)]
pub(crate) struct StreamFindings {
    pub(crate) trains: u32,
    /// Total time in trains.
    pub(crate) driven: Time,
    /// Scans fetched by the firmware; `scans_lost` counts scans overwritten in the converter before
    /// they were fetched.
    pub(crate) scans: u32,
    pub(crate) scans_lost: u64,
    /// Samples received by USB; `samples_after_gap` counts those marked as following a gap.
    pub(crate) samples: u32,
    pub(crate) samples_after_gap: u32,
    /// Records missing by USB, and those that the device reports as dropped.
    pub(crate) missing: (u64, u64),
    /// Records missing by RTT.
    pub(crate) missing_by_rtt: u64,
    pub(crate) damaged: u32,
    pub(crate) levels: LevelTimes,
    pub(crate) edge_to_start: Time,
    /// Greatest load in a status record, over a tenth of a second, in trains and overall.
    pub(crate) load_in_train: f32,
    pub(crate) load: f32,
    pub(crate) restarts: u32,
}

/// Streams over both links for a time, while the coil runs its train as often as allowed.
pub(crate) fn stream_in_trains(
    bench: &mut UsbBench,
    channels: u8,
    rate_hz: f32,
    time: Time,
) -> StreamFindings {
    let settings = palpate_wire::command::Settings {
        channels,
        rate_hz,
        stream: Stream::Samples,
        status_period_s: STATUS_PERIOD_S,
        ..bench.probe.settings()
    };
    assert_eq!(
        bench.command(&Command::SetSettings(settings)),
        Outcome::Accepted
    );
    bench.run(Time::from_ms(300));
    bench.arm();
    bench.probe.frames.drain(..bench.probe.frames.len() - 1);
    bench.port.begin_account();
    let before = bench.status();
    let overwritten = bench.probe.board.chip().overwritten(0);
    let edges = bench
        .probe
        .board
        .wire_log()
        .map_or(0, |it| it.edge_to_start.len());
    let mut found = StreamFindings::default();
    let end = bench.probe.board.now() + time;
    while bench.probe.board.now() < end {
        match one_train(bench, end, &mut found) {
            Ok(()) => bench.run(Time::from_ms(10)),
            Err(wait) => {
                let left = end.max(bench.probe.board.now()) - bench.probe.board.now();
                pass(bench, wait.min(left), false, &mut found);
            }
        }
    }
    bench.run(Time::from_ms(20));
    take_frames(bench, false, &mut found);
    let after = bench.status();
    let tally = bench.port.tally();
    found.scans = after.conversions - before.conversions;
    found.scans_lost = u64::from(after.conversions_lost - before.conversions_lost)
        + (bench.probe.board.chip().overwritten(0) - overwritten);
    found.missing = missing(&tally);
    found.damaged = bench.port.damaged;
    let log = bench.probe.board.wire_log();
    let worst = log.and_then(|it| it.edge_to_start[edges..].iter().max().copied());
    found.edge_to_start = worst.unwrap_or_default();
    found.restarts = bench.probe.board.resets().watchdog;
    found
}

/// Runs a train from its command to its end; the error is the time until another one is allowed.
fn one_train(bench: &mut UsbBench, end: Time, found: &mut StreamFindings) -> Result<(), Time> {
    let from = bench.port.frames.len();
    assert_eq!(bench.command(&Command::Sweep), Outcome::Accepted);
    bench.run(Time::from_ms(20));
    let wait_s = bench.port.frames[from..]
        .iter()
        .find_map(|it| match &it.message {
            Record::Refusal(refusal) => Some(refusal.wait_s.unwrap_or(1.0)),
            Record::Fault(fault) => panic!("{fault:?}"),
            _ => None,
        });
    if let Some(wait_s) = wait_s {
        return Err(Time::from_secs_f64(f64::from(wait_s) + 0.01));
    }
    assert!(bench.probe.board.bridge().awake, "the train begins");
    let begin = bench.probe.board.now();
    // Writes before the first period with current do not belong to the train.
    bench.probe.board.take_level_times();
    take_frames(bench, false, found);
    // The status that ends within the train may cover time before it.
    pass(bench, Time::from_ms(120), false, found);
    while bench.probe.board.bridge().awake && bench.probe.board.now() < end {
        pass(bench, Time::from_ms(10), true, found);
    }
    found.trains += 1;
    found.driven += bench.probe.board.now() - begin;
    let levels = bench.probe.board.take_level_times();
    found.levels.written += levels.written;
    found.levels.late += levels.late;
    found.levels.least_left = found.levels.least_left.min(levels.least_left);
    found.levels.longest_gap = found.levels.longest_gap.max(levels.longest_gap);
    Ok(())
}

fn pass(bench: &mut UsbBench, time: Time, in_train: bool, found: &mut StreamFindings) {
    let end = bench.probe.board.now() + time;
    while bench.probe.board.now() < end {
        let left = end - bench.probe.board.now();
        bench.run(left.min(Time::from_ms(500)));
        take_frames(bench, in_train, found);
    }
}

/// Counts the received frames, and drops them.
fn take_frames(bench: &mut UsbBench, in_train: bool, found: &mut StreamFindings) {
    for frame in bench.port.frames.drain(..bench.port.frames.len() - 1) {
        match frame.message {
            Record::Sample(sample) => {
                found.samples += 1;
                found.samples_after_gap += u32::from(sample.missed > 0 || sample.gap);
            }
            Record::Status(status) => {
                let load = status.processor_load.unwrap_or(1.0);
                found.load = found.load.max(load);
                if in_train {
                    found.load_in_train = found.load_in_train.max(load);
                }
            }
            Record::State(change) if change.state == State::Fault => panic!("{change:?}"),
            _ => {}
        }
    }
    let gap = |of: &[Frame<Record>]| match of {
        [before, after] => after.header.sequence.wrapping_sub(before.header.sequence) - 1,
        _ => 0,
    };
    let frames = &mut bench.probe.frames;
    found.missing_by_rtt += frames.windows(2).map(|of| u64::from(gap(of))).sum::<u64>();
    frames.drain(..frames.len().saturating_sub(1));
}

/// Loss account of a stream whose reader stops for a time.
pub(crate) fn stopped_reader(bench: &mut UsbBench, time: Time) -> Tally {
    begin(bench);
    bench.probe.board.usb_mut().set_reading(false);
    bench.run(time);
    bench.probe.board.usb_mut().set_reading(true);
    bench.run(AFTERWARDS);
    bench.port.tally()
}

/// Starts an account of both links.
pub(super) fn begin(bench: &mut UsbBench) {
    bench.run(Time::from_ms(5));
    bench.port.begin_account();
    bench.probe.frames.drain(..bench.probe.frames.len() - 1);
}

impl UsbBench {
    /// Loss account after DTR was off for a time.
    pub(crate) fn close_and_open(&mut self, time: Time) -> Tally {
        begin(self);
        self.set_open(false);
        self.run(time);
        self.set_open(true);
        self.run(AFTERWARDS);
        self.port.tally()
    }

    /// Opens or closes the port, as a program on the PC.
    pub(crate) fn set_open(&mut self, is_open: bool) {
        self.probe.board.usb_mut().set_dtr(is_open);
    }

    /// Loss account after the bus was suspended for a time.
    pub(crate) fn suspend_and_resume(&mut self, time: Time) -> Tally {
        begin(self);
        self.probe.board.usb_mut().suspend();
        self.run(time);
        self.probe.board.usb_mut().resume();
        self.run(AFTERWARDS);
        self.port.tally()
    }

    /// Number of samples by USB, and of those without an equal sample of the same time by RTT.
    pub(crate) fn strange_samples(&self) -> (usize, usize) {
        let of = |frames: &[Frame<Record>]| -> Vec<(u64, Sample)> {
            let sample = |frame: &Frame<Record>| match &frame.message {
                Record::Sample(sample) => Some((frame.header.time_us, sample.clone())),
                _ => None,
            };
            frames.iter().filter_map(sample).collect()
        };
        let known: std::collections::BTreeMap<u64, Sample> =
            of(&self.probe.frames).into_iter().collect();
        // The first samples may precede the start of the RTT account.
        let first_us = known.keys().next().copied().unwrap_or(u64::MAX);
        let came = of(&self.port.frames);
        let later = came.iter().filter(|(time_us, _)| *time_us >= first_us);
        let strange = later
            .clone()
            .filter(|(time_us, sample)| known.get(time_us) != Some(sample));
        (later.count(), strange.count())
    }
}
