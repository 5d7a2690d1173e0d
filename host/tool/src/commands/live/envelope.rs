//! Samples for a plot: minimum and maximum of every time slot, in order of time.
//!
//! A page that draws both values shows the same picture as with all samples, as long as a slot is
//! narrower than a pixel.

use std::collections::{BTreeMap, VecDeque};

use palpate_calibration::session::BenchSample;
use palpate_wire::record::Sample;
use serde::Serialize;

/// Duration of a slot, s. A page 1600 pixels wide shows 20 s on 700 pixels, so a pixel is 29 ms.
const PIECE_S: f64 = 0.01;
/// Maximum number of slots that wait for the next batch. At 30 batches a second 4 slots wait. More
/// wait when the stream catches up after a pause; the oldest beyond this number are lost.
const PIECES: usize = 512;

/// Plotted quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Quantity {
    FrequencyHz,
    DeformationM,
    ForceN,
    CurrentA,
}

/// Quantity of a converter and channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub(super) struct Series {
    quantity: Quantity,
    sensor: u8,
    channel: u8,
}

/// Slots for a page.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(super) struct Batch {
    /// Rising times, s.
    time_s: Vec<f64>,
    columns: Vec<Column>,
}

/// Values of a series at the times of a batch; `None` where the line is broken.
#[derive(Debug, PartialEq, Serialize)]
struct Column {
    #[serde(flatten)]
    series: Series,
    values: Vec<Option<f64>>,
}

/// Collects samples in slots.
#[derive(Debug, Default)]
pub(super) struct Envelope {
    complete: VecDeque<Piece>,
    piece: Option<Piece>,
}

/// A time slot. A slot without values breaks the lines.
#[derive(Clone, Debug, Default)]
struct Piece {
    /// Index from time zero.
    index: u64,
    extremes: BTreeMap<Series, Extremes>,
}

/// Minimum and maximum of a slot, each with the number of values that precede it in the slot.
#[derive(Clone, Copy, Debug)]
struct Extremes {
    count: u32,
    least: (u32, f64),
    greatest: (u32, f64),
}

impl Extremes {
    const fn of(value: f64) -> Self {
        Self {
            count: 1,
            least: (0, value),
            greatest: (0, value),
        }
    }

    fn add(&mut self, value: f64) {
        let this = (self.count, value);
        if value < self.least.1 {
            self.least = this;
        }
        if value > self.greatest.1 {
            self.greatest = this;
        }
        self.count += 1;
    }

    fn in_order(&self) -> [f64; 2] {
        if self.least.0 <= self.greatest.0 {
            [self.least.1, self.greatest.1]
        } else {
            [self.greatest.1, self.least.1]
        }
    }
}

impl Envelope {
    /// Adds a sample at a time, s. Times must not decrease.
    pub(super) fn add(&mut self, time_s: f64, sample: &Sample) {
        if sample.gap || sample.missed > 0 {
            self.interrupt();
        }
        let sensor = sample.sensor;
        let mut add = |quantity, channel, value: Option<f64>| {
            if let Some(value) = value {
                let series = Series {
                    quantity,
                    sensor,
                    channel,
                };
                self.enter(time_s, series, value);
            }
        };
        for of in &sample.channels {
            add(Quantity::FrequencyHz, of.channel, Some(of.frequency_hz));
            let deformation_m = of.deformation_m.map(f64::from);
            add(Quantity::DeformationM, of.channel, deformation_m);
        }
        add(Quantity::ForceN, 0, sample.force_n.map(f64::from));
        add(Quantity::CurrentA, 0, sample.current_a.map(f64::from));
    }

    /// Adds a sample recorded on a bench at a time, s, with the force of the load cell.
    pub(super) fn add_from_bench(&mut self, time_s: f64, of: &BenchSample) {
        for (quantity, value) in [
            (Quantity::FrequencyHz, Some(of.frequency_hz)),
            (Quantity::ForceN, of.force_n),
            (Quantity::CurrentA, Some(of.current_a)),
        ] {
            let series = Series {
                quantity,
                sensor: 0,
                channel: 0,
            };
            if let Some(value) = value {
                self.enter(time_s, series, value);
            }
        }
    }

    /// Breaks the lines between the previous and the next samples.
    pub(super) fn interrupt(&mut self) {
        if let Some(piece) = self.piece.take() {
            let index = piece.index;
            self.complete(piece);
            self.complete(Piece {
                index,
                ..Piece::default()
            });
        }
    }

    fn enter(&mut self, time_s: f64, series: Series, value: f64) {
        let index = (time_s / PIECE_S) as u64;
        if self.piece.as_ref().is_some_and(|piece| piece.index < index)
            && let Some(piece) = self.piece.take()
        {
            self.complete(piece);
        }
        let piece = self.piece.get_or_insert_with(|| Piece {
            index,
            ..Piece::default()
        });
        let extremes = piece.extremes.entry(series);
        extremes
            .and_modify(|of| of.add(value))
            .or_insert_with(|| Extremes::of(value));
    }

    fn complete(&mut self, piece: Piece) {
        if self.complete.len() == PIECES {
            self.complete.pop_front();
        }
        self.complete.push_back(piece);
    }

    /// Returns the slots completed since the last call; `None` without any.
    pub(super) fn take(&mut self) -> Option<Batch> {
        let pieces = std::mem::take(&mut self.complete);
        if pieces.is_empty() {
            return None;
        }
        let all = pieces.iter().flat_map(|piece| piece.extremes.keys());
        let mut series: Vec<Series> = all.copied().collect();
        series.sort();
        series.dedup();
        let of_series = |series: Series| Column {
            series,
            values: pieces
                .iter()
                .flat_map(|piece| piece.values(series))
                .collect(),
        };
        Some(Batch {
            time_s: pieces.iter().flat_map(Piece::times_s).collect(),
            columns: series.into_iter().map(of_series).collect(),
        })
    }
}

impl Piece {
    /// Times at a quarter and three quarters of the slot, s; for a slot that breaks the lines, its
    /// end.
    fn times_s(&self) -> Vec<f64> {
        let at = |part: f64| (self.index as f64 + part) * PIECE_S;
        if self.extremes.is_empty() {
            vec![at(1.0)]
        } else {
            vec![at(0.25), at(0.75)]
        }
    }

    fn values(&self, series: Series) -> Vec<Option<f64>> {
        if self.extremes.is_empty() {
            return vec![None];
        }
        let found = self.extremes.get(&series).map(Extremes::in_order);
        found.map_or([None; 2], |values| values.map(Some)).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREQUENCY: Series = Series {
        quantity: Quantity::FrequencyHz,
        sensor: 0,
        channel: 0,
    };

    #[test]
    fn the_least_and_the_greatest_of_a_piece_stay_in_their_order() {
        let mut envelope = Envelope::default();
        for (time_s, value) in [
            (0.001, 5.0),
            (0.003, 9.0),
            (0.004, 2.0),
            (0.009, 3.0),
            (0.010, 1.0),
            (0.019, 4.0),
            (0.020, 0.0),
        ] {
            envelope.enter(time_s, FREQUENCY, value);
        }
        let batch = envelope.take().unwrap();
        assert_eq!(batch.columns[0].values, [9.0, 2.0, 1.0, 4.0].map(Some));
        assert_eq!(batch.time_s, [0.0025, 0.0075, 0.0125, 0.0175]);
        // The third slot is not complete.
        assert_eq!(envelope.take(), None);
    }

    #[test]
    fn lost_conversions_break_the_line() {
        let mut envelope = Envelope::default();
        envelope.enter(0.001, FREQUENCY, 1.0);
        envelope.interrupt();
        envelope.enter(0.002, FREQUENCY, 2.0);
        envelope.enter(0.5, FREQUENCY, 3.0);
        let values = &envelope.take().unwrap().columns[0].values;
        assert_eq!(*values, [Some(1.0), Some(1.0), None, Some(2.0), Some(2.0)]);
    }

    #[test]
    fn what_no_page_takes_is_bounded() {
        let mut envelope = Envelope::default();
        (0..1_000_000).for_each(|ms| envelope.enter(f64::from(ms) * 1e-3, FREQUENCY, 0.0));
        assert_eq!(envelope.take().unwrap().time_s.len(), 2 * PIECES);
    }
}
