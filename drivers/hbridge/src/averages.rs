//! Means of the measured current over past windows.

use core::sync::atomic::{AtomicI32, AtomicU32, Ordering};

/// Number of PWM periods whose currents are stored as one sum, a block.
pub const BLOCK: u32 = 16;
/// Length of a block in sixteenths of a PWM period.
const LENGTH: i64 = 16 * BLOCK as i64;

/// A point in time: number of whole PWM periods since the start, which wraps, and sixteenths of the
/// period that follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// Whole periods since the start.
    pub periods: u32,
    /// Sixteenths of the following period, below 16.
    pub sixteenths: u32,
}

impl Moment {
    /// The moment `sixteenths` of a period after the end of period `periods`.
    #[must_use]
    pub const fn after(periods: u32, sixteenths: i32) -> Self {
        Self {
            periods: periods.wrapping_add_signed(sixteenths >> 4),
            sixteenths: (sixteenths & 15) as u32,
        }
    }

    /// Time since an earlier moment, in sixteenths of a period.
    const fn since(self, earlier: Self) -> u32 {
        let periods = self.periods.wrapping_sub(earlier.periods);
        (periods.wrapping_mul(16) + self.sixteenths).wrapping_sub(earlier.sixteenths)
    }
}

impl From<u32> for Moment {
    fn from(periods: u32) -> Self {
        Self::after(periods, 0)
    }
}

/// Running sums of the measured current over the last `N` blocks: written by the control interrupt,
/// read by any task without a lock.
///
/// Times are numbers of PWM periods since the start, which wrap. Currents are in units of half a
/// count of the converter, as `Hardware::ampere_per_unit` says.
#[derive(Debug)]
#[repr(C)]
pub struct Averages<const N: usize> {
    /// Number of PWM periods so far; wraps.
    periods: AtomicU32,
    /// Sum of the currents of all periods so far; wraps. Only the interrupt writes it.
    total: AtomicI32,
    /// Sum of the currents of all periods up to the end of each block; wraps.
    sums: [AtomicI32; N],
}

impl<const N: usize> Default for Averages<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Averages<N> {
    /// Creates an instance without any current.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sums: [const { AtomicI32::new(0) }; N],
            periods: AtomicU32::new(0),
            total: AtomicI32::new(0),
        }
    }

    /// Adds the current of one period.
    #[inline]
    pub(crate) fn push(&self, units: i32) {
        let total = self.total.load(Ordering::Relaxed).wrapping_add(units);
        self.total.store(total, Ordering::Relaxed);
        let periods = self.periods.load(Ordering::Relaxed).wrapping_add(1);
        if periods.is_multiple_of(BLOCK)
            && let Some(sum) = self.sums.get((periods / BLOCK) as usize % N)
        {
            sum.store(total, Ordering::Relaxed);
        }
        // Stored last, so that a reader that sees this number of periods also sees the block's sum.
        self.periods.store(periods, Ordering::Release);
    }

    /// The current time: number of periods so far; wraps.
    #[must_use]
    pub fn now(&self) -> u32 {
        self.periods.load(Ordering::Acquire)
    }

    /// Sum of the currents of all periods up to the end of a block, in units; wraps.
    fn sum(&self, end: u32) -> i32 {
        let index = (end / BLOCK) as usize % N;
        self.sums
            .get(index)
            .map_or(0, |sum| sum.load(Ordering::Relaxed))
    }

    /// The end of the block that contains `moment` if that block is complete, otherwise the end of
    /// the last complete block before `now`.
    fn whole(moment: u32, now: u32) -> u32 {
        let end = (moment - moment % BLOCK).wrapping_add(BLOCK);
        let is_whole = now.wrapping_sub(end) as i32 >= 0;
        if is_whole { end } else { now - now % BLOCK }
    }

    /// Returns the current time if the window is not empty, lies within the stored blocks, and ends
    /// less than a block in the future; otherwise `None`.
    fn kept(&self, from: u32, to: u32) -> Option<u32> {
        let now = self.now();
        // Keeps two more blocks in reserve: the one that the interrupt may be writing, and the one
        // before the first block of the window.
        let kept = BLOCK * (N as u32).saturating_sub(3);
        let is_kept = now.wrapping_sub(from) <= kept;
        let is_past = (to.wrapping_sub(now) as i32) < BLOCK as i32;
        (from != to && is_kept && is_past).then_some(now)
    }

    /// Mean over a window of a function of the current, in the unit of the function. The function
    /// receives units and is evaluated once per block: within a block the current counts as
    /// constant. For the part of the window after the last complete block, the current of that
    /// block is used.
    ///
    /// `None` if the window is empty, older than the stored blocks, or ends a block or more in the
    /// future.
    fn mean_of(&self, from: u32, to: u32, of: impl Fn(f32) -> f32) -> Option<f32> {
        let now = self.kept(from, to)?;
        let (mut at, mut sum) = (from, 0.0);
        while at != to {
            let part = (BLOCK - at % BLOCK).min(to.wrapping_sub(at));
            let end = Self::whole(at, now);
            let units = self
                .sum(end)
                .wrapping_sub(self.sum(end.wrapping_sub(BLOCK)));
            sum += part as f32 * of(units as f32 / BLOCK as f32);
            at = at.wrapping_add(part);
        }
        Some(sum / to.wrapping_sub(from) as f32)
    }

    /// Mean current between two moments, in units: the difference of the running sums at both.
    /// Within a block the current is assumed to be a straight line whose slope is that between the
    /// neighbouring blocks. Assuming a constant instead would shift the running sum at either end
    /// by up to an eighth of the current's change within the block, times the block's length.
    fn mean(&self, from: Moment, to: Moment) -> Option<f32> {
        let length = to.since(from);
        let now = self.kept(
            from.periods,
            to.periods.wrapping_add(u32::from(length < 16)),
        )?;
        let until = |moment: Moment| {
            let end = Self::whole(moment.periods, now);
            let begin = end.wrapping_sub(BLOCK);
            let after = Self::whole(end, now);
            let block = |end: u32| {
                self.sum(end)
                    .wrapping_sub(self.sum(end.wrapping_sub(BLOCK)))
            };
            let change = i64::from(block(after).wrapping_sub(block(begin)));
            // The product is shifted by one bit more where `change` spans two blocks instead of
            // one.
            let halves = LENGTH.ilog2() + 1 + u32::from(after != end);
            // Position within the block, in sixteenths of a period.
            let at = i64::from(moment.since(begin.into()));
            let bend = (change * at * (LENGTH - at)) >> halves;
            (self.sum(begin), i64::from(block(end)) * at - bend)
        };
        let ((first, first_parts), (last, last_parts)) = (until(from), until(to));
        let between = i64::from(last.wrapping_sub(first)) * LENGTH;
        let sum = (between + last_parts - first_parts) as f32 / BLOCK as f32;
        (length > 0).then(|| sum / length as f32)
    }

    /// Mean current between two moments, A.
    #[must_use]
    pub fn mean_a(&self, from: Moment, to: Moment, hardware: &crate::Hardware) -> Option<f32> {
        let unit_a = hardware.ampere_per_unit();
        Some(self.mean(from, to)? * unit_a)
    }

    /// Mean of a function of the current, A, over the window from `from` to `to`. For a function
    /// that is not linear it differs from the function of the mean. It does not include changes
    /// within a block, such as the PWM ripple: see [`Ripple`](crate::Ripple).
    #[must_use]
    pub fn mean_of_current(
        &self,
        from: u32,
        to: u32,
        hardware: &crate::Hardware,
        of: impl Fn(f32) -> f32,
    ) -> Option<f32> {
        let unit_a = hardware.ampere_per_unit();
        self.mean_of(from, to, |units| of(units * unit_a))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp of one unit per period, starting at 100.
    fn ramp(periods: u32) -> Averages<64> {
        let averages = Averages::new();
        for period in 0..periods {
            averages.push(100 + period as i32);
        }
        averages
    }

    /// The mean of the current, once block by block and once from the running sums.
    fn both_means(averages: &Averages<64>, from: u32, to: u32) -> [f32; 2] {
        [
            averages.mean_of(from, to, |units| units).unwrap(),
            averages.mean(from.into(), to.into()).unwrap(),
        ]
    }

    #[test]
    fn the_mean_of_a_ramp_is_its_middle() {
        let averages = ramp(1_000);
        for (from, to) in [(160, 320), (320, 336), (500, 900), (437, 911)] {
            let exact = 100.0 + 0.5 * (from + to - 1) as f32;
            let [by_blocks, mean] = both_means(&averages, from, to);
            // A window that cuts a block errs by half a block of slope at each cut end.
            assert!(
                (by_blocks - exact).abs() < 0.2,
                "{from}..{to}: {by_blocks} {exact}"
            );
            assert!((mean - exact).abs() < 0.01, "{from}..{to}: {mean} {exact}");
        }
    }

    /// A current that starts to rise within a block. In units of (rise in a block) x (length of a
    /// block), the error of its sum over a window is below 0.036, below 0.076 if the window ends in the
    /// last whole block, and below 0.68 if it ends in an incomplete block. If the current counted as
    /// constant within a block, the errors would be 0.125, 0.125 and 0.91.
    #[test]
    fn a_corner_within_a_block_is_followed() {
        for corner in 480..512 {
            for pushed in 512..600 {
                let averages = Averages::<64>::new();
                let at = |period: u32| 160 * (period.saturating_sub(corner) as i32);
                (0..pushed).for_each(|period| averages.push(at(period)));
                let whole = pushed - pushed % BLOCK;
                let last = (whole + BLOCK - 1).min(pushed);
                for to in (500..=whole).chain([last]) {
                    let exact = (400..to).map(at).sum::<i32>() as f32;
                    let mean = averages.mean(400.into(), to.into()).unwrap();
                    let off = mean * (to - 400) as f32 - exact;
                    let part = off / (160 * BLOCK * BLOCK) as f32;
                    let allowed = match to {
                        to if to > whole => 0.68,
                        to if to > whole - BLOCK => 0.076,
                        _ => 0.036,
                    };
                    assert!(part.abs() < allowed, "{corner} {pushed} {to}: {part}");
                }
            }
        }
    }

    #[test]
    fn a_window_may_begin_and_end_within_a_period() {
        let averages = ramp(1_000);
        for (from, to) in [(5_121_i32, 8_007), (5_120, 5_121), (8_000, 8_015)] {
            let [begin, end] = [from, to].map(|at| Moment::after(0, at));
            let mean = averages.mean(begin, end).unwrap();
            let exact = 99.5 + (from + to) as f32 / 32.0;
            assert!((mean - exact).abs() < 0.07, "{from}..{to}: {mean} {exact}");
        }
        let [early, late] = [-7, 9].map(|by| {
            let at = |index: i32| Moment::after(0, index + by);
            averages.mean(at(5_120), at(10_240)).unwrap()
        });
        assert!(
            (late - early - 1.0).abs() < 1e-3,
            "a period apart: {early} {late}"
        );
        assert_eq!(
            Moment::after(3, -1),
            Moment {
                periods: 2,
                sixteenths: 15
            }
        );
    }

    #[test]
    fn the_mean_of_a_square_is_not_the_square_of_the_mean() {
        let averages = ramp(1_000);
        let mean = averages.mean_of(320, 640, |units| units * units).unwrap();
        let exact = (320..640)
            .map(|at| f64::from(100 + at).powi(2))
            .sum::<f64>()
            / 320.0;
        let of_mean = 579.5_f64.powi(2);
        assert!((f64::from(mean) - exact).abs() < 0.01 * (exact - of_mean));
    }

    #[test]
    fn the_last_block_stands_for_what_is_not_there_yet() {
        let averages = ramp(1_000); // 62 blocks and 8 periods
        // `mean_of` repeats the last block's mean; `mean` extends the slope.
        let expected = [100.0 + 976.0 + 7.5, 100.0 + 997.5];
        assert_eq!(both_means(&averages, 992, 1_004), expected);
        for (from, to) in [(992, 1_016), (900, 900), (0, 100)] {
            assert!(averages.mean_of(from, to, |units| units).is_none());
            assert!(
                averages.mean(from.into(), to.into()).is_none(),
                "{from} {to}"
            );
        }
    }

    #[test]
    fn time_and_sums_wrap() {
        let averages = ramp(0);
        averages.periods.store(u32::MAX - 799, Ordering::Relaxed);
        averages.total.store(i32::MAX - 5_000, Ordering::Relaxed);
        for period in 0..1_600 {
            averages.push(100 + period);
        }
        // Windows before, across and after the wrap of the period counter to 0, here at period 800.
        for (from, to) in [(700_u32, 790), (700, 1_500), (790, 810), (810, 1_500)] {
            let [begin, end] = [from, to].map(|at| at.wrapping_sub(800));
            let exact = 100.0 + 0.5 * (from + to - 1) as f32;
            for mean in both_means(&averages, begin, end) {
                assert!((mean - exact).abs() < 0.2, "{from}..{to}: {mean} {exact}");
            }
        }
    }
}
