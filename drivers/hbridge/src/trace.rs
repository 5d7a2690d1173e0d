//! A record of the measured current, period by period.

use core::sync::atomic::{AtomicI16, AtomicU32, Ordering};

use crate::hardware::Hardware;

/// A record of `N` currents, each of one period: written by the control interrupt, read by any task
/// without a lock.
#[derive(Debug)]
pub struct Trace<const N: usize> {
    units: [AtomicI16; N],
    taken: AtomicU32,
    /// Number of periods between two recorded currents.
    every: AtomicU32,
    /// Number of periods until the next recorded current.
    left: AtomicU32,
}

impl<const N: usize> Default for Trace<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Trace<N> {
    /// Creates an empty trace that does not record.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            units: [const { AtomicI16::new(0) }; N],
            taken: AtomicU32::new(0),
            every: AtomicU32::new(0),
            left: AtomicU32::new(0),
        }
    }

    /// Starts a new record that takes one current every `every` periods. [`push`](Self::push) must
    /// not interrupt this function.
    pub fn start(&self, every: u32) {
        let every = every.max(1);
        self.taken.store(0, Ordering::Relaxed);
        self.left.store(every, Ordering::Relaxed);
        self.every.store(every, Ordering::Release);
    }

    /// Records the current of a period, from [`Drive::measured`](crate::Drive::measured). Does
    /// nothing if the trace is full.
    #[inline]
    pub fn push(&self, units: i32) {
        let every = self.every.load(Ordering::Relaxed);
        if every == 0 {
            return;
        }
        let left = self.left.load(Ordering::Relaxed).wrapping_sub(1);
        if left != 0 {
            self.left.store(left, Ordering::Relaxed);
            return;
        }
        self.left.store(every, Ordering::Relaxed);
        let taken = self.taken.load(Ordering::Relaxed);
        if let Some(index) = self.units.get(taken as usize) {
            // The sum of two samples of 12 bits, relative to the reading without current, takes 14
            // bits.
            index.store(units as i16, Ordering::Relaxed);
            self.taken.store(taken + 1, Ordering::Release);
        }
        if taken as usize + 1 >= N {
            self.every.store(0, Ordering::Relaxed);
        }
    }

    /// Number of recorded currents.
    #[must_use]
    pub fn taken(&self) -> usize {
        self.taken.load(Ordering::Acquire) as usize
    }

    /// The recorded currents, A, in order.
    pub fn currents_a<'t>(&'t self, hardware: &Hardware) -> impl Iterator<Item = f32> + 't {
        let unit_a = hardware.ampere_per_unit();
        let taken = self.units.iter().take(self.taken());
        taken.map(move |units| f32::from(units.load(Ordering::Relaxed)) * unit_a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hardware::EXAMPLE as HARDWARE;

    #[test]
    fn every_so_many_periods_one_is_kept_until_it_is_full() {
        let trace = Trace::<4>::new();
        trace.push(7);
        assert_eq!(trace.taken(), 0, "not asked for");
        trace.start(3);
        for period in 1..=10 {
            trace.push(100 * period);
        }
        let units = |trace: &Trace<4>| -> heapless::Vec<i32, 4> {
            let of = trace.currents_a(&HARDWARE);
            of.map(|of_a| (of_a / 0.003).round() as i32).collect()
        };
        assert_eq!(units(&trace)[..], [300, 600, 900]);
        for period in 11..=40 {
            trace.push(100 * period);
        }
        assert_eq!(units(&trace)[..], [300, 600, 900, 1_200]);
        trace.start(1);
        trace.push(-8_190);
        assert_eq!(units(&trace)[..], [-8_190]);
        trace.start(0);
        trace.push(5);
        assert_eq!(units(&trace)[..], [5], "every period at least");
    }
}
