//! Means of the measured current over windows that have passed.

use core::sync::atomic::{AtomicI32, AtomicU32, Ordering};

/// Periods whose currents are kept as one sum.
pub const BLOCK: u32 = 16;

/// The measured current of the last `N` blocks, as running sums: written by the control interrupt,
/// read by anybody, without a lock.
///
/// A moment is a number of periods since the start, which wraps.
#[derive(Debug)]
#[repr(C)]
pub struct Averages<const N: usize> {
    /// Periods so far; wraps.
    periods: AtomicU32,
    /// Sum of all units so far; wraps. Written by the interrupt alone.
    total: AtomicI32,
    /// Sum of all units up to the end of each block; wraps.
    sums: [AtomicI32; N],
}

impl<const N: usize> Default for Averages<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Averages<N> {
    /// Without any current.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sums: [const { AtomicI32::new(0) }; N],
            periods: AtomicU32::new(0),
            total: AtomicI32::new(0),
        }
    }

    /// Adds a period.
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
        // Last, so that who sees this number sees the block as well.
        self.periods.store(periods, Ordering::Release);
    }

    /// The present.
    #[must_use]
    pub fn now(&self) -> u32 {
        self.periods.load(Ordering::Acquire)
    }

    /// Sum of a block, by the number of its end.
    fn block(&self, end: u32) -> f32 {
        let at = |end: u32| {
            let place = end as usize % N;
            self.sums
                .get(place)
                .map_or(0, |sum| sum.load(Ordering::Relaxed))
        };
        at(end).wrapping_sub(at(end.wrapping_sub(1))) as f32
    }

    /// Mean of a function of the current between two moments, in what the function gives. The
    /// function gets units and is asked once for every block; within one the current counts as
    /// constant. A window that ends after the last whole block counts that one for its rest.
    ///
    /// Nothing if the window is empty, or older than what is kept, or ends a block or more in the
    /// future.
    fn mean_of(&self, from: u32, to: u32, of: impl Fn(f32) -> f32) -> Option<f32> {
        let now = self.now();
        let last = now / BLOCK;
        let length = to.wrapping_sub(from);
        let ago = now.wrapping_sub(from);
        // One block in hand, for the one that may be written meanwhile.
        let kept = BLOCK * (N as u32).saturating_sub(2);
        if length == 0 || ago > kept || (to.wrapping_sub(now) as i32) >= BLOCK as i32 {
            return None;
        }
        let (mut at, mut sum) = (from, 0.0);
        while at != to {
            let begin = at / BLOCK;
            let rest = BLOCK - at % BLOCK;
            let part = rest.min(to.wrapping_sub(at));
            // The number of the block's end, the last whole one at most.
            let ahead = (begin.wrapping_add(1).wrapping_sub(last) as i32).max(0);
            let end = begin.wrapping_add(1).wrapping_sub(ahead as u32);
            let mean = self.block(end) / BLOCK as f32;
            sum += part as f32 * of(mean);
            at = at.wrapping_add(part);
        }
        Some(sum / length as f32)
    }

    /// Mean current between two moments, A.
    #[must_use]
    pub fn mean_a(&self, from: u32, to: u32, hardware: &crate::Hardware) -> Option<f32> {
        let unit_a = hardware.ampere_per_unit();
        Some(self.mean_of(from, to, |units| units)? * unit_a)
    }

    /// Mean of a function of the current, A, over the same window: where the function is not a
    /// straight line this is not the function of the mean. Of what happens within a block, as the
    /// ripple, it knows nothing: that is [`Ripple`](crate::Ripple).
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

    /// A ramp of one unit a period, from 100.
    fn ramp(periods: u32) -> Averages<64> {
        let averages = Averages::new();
        for period in 0..periods {
            averages.push(100 + period as i32);
        }
        averages
    }

    #[test]
    fn the_mean_of_a_ramp_is_its_middle() {
        let averages = ramp(1_000);
        for (from, to) in [(160, 320), (320, 336), (500, 900), (437, 911)] {
            let mean = averages.mean_of(from, to, |units| units).unwrap();
            let exact = 100.0 + 0.5 * (from + to - 1) as f32;
            // Half a block of slope at either end, where a block is cut.
            assert!((mean - exact).abs() < 0.2, "{from}..{to}: {mean} {exact}");
        }
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
        let mean = averages.mean_of(992, 1_004, |units| units).unwrap();
        assert_eq!(mean, 100.0 + 976.0 + 7.5);
        assert!(averages.mean_of(992, 1_016, |units| units).is_none());
        assert!(averages.mean_of(900, 900, |units| units).is_none());
        assert!(averages.mean_of(0, 100, |units| units).is_none(), "too old");
    }

    #[test]
    fn time_and_sums_wrap() {
        let averages = ramp(0);
        averages.periods.store(u32::MAX - 800, Ordering::Relaxed);
        averages.total.store(i32::MAX - 5_000, Ordering::Relaxed);
        for _ in 0..1_600 {
            averages.push(700);
        }
        let now = averages.now();
        let mean = averages.mean_of(now.wrapping_sub(900), now, |units| units);
        // 2^32 is a multiple of the ring only if it is a power of two, which it is here.
        assert_eq!(mean, Some(700.0));
    }
}
