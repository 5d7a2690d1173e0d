//! Data of the board's thread, and their display on the pages.

use std::time::{Duration, Instant};

use palpate_calibration::session::BenchSample;
use palpate_cli::failure::Failure;
use palpate_wire::Record;
use palpate_wire::command::TouchArray;
use palpate_wire::record::Fault;

use super::envelope::Envelope;
use super::feed::Feed;
use super::measurements::Measurements;
use super::state::{Answer, Progress, State};
use crate::board::link::{Arrival, Link};
use crate::commands::watch::known::Known;
use palpate_cli::touch_map::Array;
use palpate_cli::train_line::Train;

/// Interval of sample batches: 30 pictures a second look like continuous motion.
const PICTURE: Duration = Duration::from_millis(33);
/// Interval of states: numbers that change faster cannot be read.
const STATE: Duration = Duration::from_millis(100);

/// The view of a board.
pub(super) struct View {
    feed: Feed,
    pub(super) known: Known,
    /// Active faults.
    faults: Vec<Fault>,
    train: Train,
    measurements: Measurements,
    /// Chunks of the array of coils, and the array once all chunks are there.
    chunks: Vec<TouchArray>,
    array: Option<Array>,
    pub(super) calibration: Progress,
    pub(super) answer: Answer,
    envelope: Envelope,
    timeline: Timeline,
    next_picture: Instant,
    next_state: Instant,
}

/// Time axis of the plots: the device's time, continued after a restart.
#[derive(Clone, Copy, Debug, Default)]
struct Timeline {
    boot_id: Option<u32>,
    /// Axis time less device time, s.
    shift_s: f64,
    last_s: f64,
}

impl Timeline {
    /// Returns the axis time, s, of a record that arrived at `now_s` of the link's clock, and
    /// whether the device has restarted.
    fn at(&mut self, now_s: f64, boot_id: u32, device_s: f64) -> (f64, bool) {
        let is_new = self.boot_id != Some(boot_id);
        if is_new {
            self.boot_id = Some(boot_id);
            self.shift_s = now_s.max(self.last_s) - device_s;
        }
        self.last_s = self.last_s.max(device_s + self.shift_s);
        (self.last_s, is_new)
    }
}

impl View {
    /// Creates the view of a board without data.
    pub(super) fn new(feed: Feed, board: &str, calibration: Progress) -> Self {
        Self {
            feed,
            known: Known::of(board),
            faults: Vec::new(),
            train: Train::default(),
            measurements: Measurements::default(),
            chunks: Vec::new(),
            array: None,
            calibration,
            answer: Answer::default(),
            envelope: Envelope::default(),
            timeline: Timeline::default(),
            next_picture: Instant::now(),
            next_state: Instant::now(),
        }
    }

    /// Returns the feed, for requests of the pages.
    pub(super) const fn feed(&self) -> &Feed {
        &self.feed
    }

    /// Processes a frame. Returns whether a contact began.
    pub(super) fn take(&mut self, arrival: &Arrival) -> Result<bool, Failure> {
        let frame = &arrival.frame;
        let device_s = frame.header.time_us as f64 * 1e-6;
        let now_s = arrival.at.as_secs_f64();
        let (time_s, is_new) = self.timeline.at(now_s, frame.header.boot_id, device_s);
        if is_new {
            self.envelope.interrupt();
            self.faults.clear();
            self.train = Train::default();
            self.measurements.forget_tip();
            self.chunks.clear();
            self.array = None;
        }
        match &frame.message {
            Record::Sample(sample) => self.envelope.add(time_s, sample),
            Record::TouchArray(chunk) => self.take_array(chunk),
            Record::Fault(fault) => {
                self.faults.retain(|of| of.code != fault.code);
                self.faults.extend(fault.active.then(|| fault.clone()));
            }
            _ => {}
        }
        if let Some(line) = self.train.take(device_s, &frame.message) {
            self.feed.show_line(&line)?;
        }
        if self.measurements.take(&frame.message) {
            self.feed.show_measurements(&self.measurements)?;
        }
        Ok(self.known.take(frame))
    }

    /// Takes a chunk of the array of coils.
    fn take_array(&mut self, chunk: &TouchArray) {
        if chunk.first == 0 {
            self.chunks.clear();
        }
        self.chunks.push(chunk.clone());
        self.array = Array::of_chunks(&self.chunks);
    }

    /// Continues the time axis with an instrument on a bench, whose clock shows `device_s`.
    pub(super) fn begin_on_bench(&mut self, device_s: f64) {
        self.envelope.interrupt();
        self.timeline = Timeline {
            boot_id: None,
            shift_s: self.timeline.last_s - device_s,
            last_s: self.timeline.last_s,
        };
    }

    /// Adds samples recorded on a bench.
    pub(super) fn take_from_bench(&mut self, lines: &[BenchSample]) {
        let shift_s = self.timeline.shift_s;
        for line in lines {
            let time_s = (line.time_s + shift_s).max(self.timeline.last_s);
            self.timeline.last_s = time_s;
            self.envelope.add_from_bench(time_s, line);
        }
    }

    /// Updates the counts of the link.
    pub(super) fn take_link(&mut self, link: &Link) {
        self.known.take_link(link);
    }

    /// Shows that the board is gone.
    pub(super) fn lost(&mut self, reason: &str) -> Result<(), Failure> {
        self.envelope.interrupt();
        self.known.lost(reason);
        self.show()
    }

    /// Sends the updates that are due.
    pub(super) fn show_due(&mut self) -> Result<(), Failure> {
        let now = Instant::now();
        if now >= self.next_picture {
            self.next_picture = now + PICTURE;
            if let Some(batch) = self.envelope.take() {
                self.feed.add(&batch)?;
            }
        }
        if now >= self.next_state {
            self.show()?;
        }
        Ok(())
    }

    /// Sends the state.
    pub(super) fn show(&mut self) -> Result<(), Failure> {
        self.next_state = Instant::now() + STATE;
        let mut state = State::of(&self.known, &self.faults, &self.calibration, &self.answer);
        state.array = self.array.as_ref();
        self.feed.show(&state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_goes_on_where_a_board_starts_anew() {
        let mut timeline = Timeline::default();
        assert_eq!(timeline.at(5.0, 1, 100.0), (5.0, true));
        assert_eq!(timeline.at(6.1, 1, 101.0), (6.0, false));
        // A record of an earlier time leaves the axis where it is.
        assert_eq!(timeline.at(6.1, 1, 100.5), (6.0, false));
        assert_eq!(timeline.at(9.0, 2, 0.5), (9.0, true));
        assert_eq!(timeline.at(9.6, 2, 1.0), (9.5, false));
    }
}
