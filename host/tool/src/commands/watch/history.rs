//! The last values of a quantity.

use std::collections::VecDeque;

/// Means over equal times, the last ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct History {
    means: VecDeque<f64>,
    /// The sum and the number of what belongs to the mean that is not complete.
    sum: f64,
    count: f64,
    /// Which of all means that is, counted from the device's start.
    index: u64,
}

impl History {
    /// Time of a mean, s: a column of a chart is ten samples a second.
    pub(super) const MEAN_S: f64 = 0.1;
    /// As many as are kept: more than the widest terminal has columns.
    const KEPT: usize = 500;

    /// Adds a value at a time, s.
    pub(super) fn push(&mut self, time_s: f64, value: f64) {
        let index = (time_s / Self::MEAN_S) as u64;
        if index != self.index && self.count > 0.0 {
            self.means.push_back(self.sum / self.count);
            (self.sum, self.count) = (0.0, 0.0);
            while self.means.len() > Self::KEPT {
                self.means.pop_front();
            }
        }
        self.index = index;
        self.sum += value;
        self.count += 1.0;
    }

    /// The last means, as many as there are of so many.
    pub(super) fn last(&self, count: usize) -> impl Iterator<Item = f64> {
        let first = self.means.len().saturating_sub(count);
        self.means.iter().skip(first).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_are_means_and_not_more_of_them_than_a_screen_shows() {
        let mut history = History::default();
        (0..1_000_000).for_each(|ms| history.push(f64::from(ms) * 1e-3, f64::from(ms)));
        assert_eq!(history.means.len(), History::KEPT);
        let last: Vec<f64> = history.last(2).collect();
        assert!((last[1] - last[0] - 100.0).abs() < 1.1, "{last:?}");
        assert_eq!(history.last(9_999).count(), History::KEPT);
    }
}
