//! The last values of a quantity.

use std::collections::VecDeque;

/// The last means over equal times.
#[derive(Clone, Debug, Default)]
pub(crate) struct History {
    means: VecDeque<f64>,
    /// Sum and count of the incomplete mean.
    sum: f64,
    count: f64,
    /// Index of the incomplete mean since the device's start.
    index: u64,
}

impl History {
    /// Time over which a mean is taken, s: a column of a chart is a tenth of a second.
    pub(super) const MEAN_S: f64 = 0.1;
    /// Number of means that are kept: more than the columns of the widest terminal.
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

    /// Returns the last `count` means, or all if there are fewer.
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
